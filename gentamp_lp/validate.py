"""The independent check of a plan: nothing the planner believed is taken over.

The instance is drawn again from its task, size and seed. Sampled values come from the plan as numbers; every test the
preconditions need is run anew on them, the steps are simulated, the goal is evaluated, and the motions are replayed
by the domain's own checker (PyBullet for `tabletop`, where planning used FCL).
"""

from __future__ import annotations

import time

from gentamp_lp.errors import Diagnostic, InputError
from gentamp_lp.plan import Plan
from gentamp_lp.streams.incremental import quota_for, sample
from gentamp_lp.streams.semantics import State, View, apply, precondition_holds, reads
from gentamp_lp.task import Instance, Task


def validate(plan: Plan, task: Task) -> list[str]:
    """What is wrong with a plan; empty when it is sound. Raises InputError when its values cannot be read."""
    instance = task.instance(plan.size, plan.seed, robot=plan.robot)
    _adopt(plan, instance)
    state, problems = _simulate(plan, instance)
    if problems:
        return problems
    if not _goal_holds(instance, state):
        problems.append("the goal does not hold after the last step")
    steps = [(step.schema, step.args) for step in plan.steps]
    problems += task.folder.code.check_plan(instance.world, steps, instance.base.values)
    return problems


def _adopt(plan: Plan, instance: Instance) -> None:
    """Take over the plan's entities and the stream facts it claims about them (the replay puts these to the test)."""
    base, code = instance.base, instance.task.folder.code
    for name, data in plan.entities.items():
        if name in base.values:
            raise InputError(Diagnostic(f"entity `{name}` of the plan is already an object of the instance"))
        try:
            base.values[name] = code.decode(data, instance.world, base.values)
        except (KeyError, ValueError, TypeError) as error:
            raise InputError(Diagnostic(f"entity `{name}` of the plan cannot be read: {error!r}")) from None
    for fact in plan.facts:
        if fact[0] not in base.makers:
            raise InputError(Diagnostic(f"the plan may not state `{fact[0]}` facts: no stream makes them"))
        if not set(fact[1:]) & set(plan.entities):
            raise InputError(Diagnostic(f"the fact {fact} is not about an entity of the plan"))
        base.add(fact)


def _simulate(plan: Plan, instance: Instance) -> tuple[State, list[str]]:
    program, state = instance.task.program, instance.state
    arities = {schema.name: len(schema.parameters) for schema in program.domain.actions}
    for number, step in enumerate(plan.steps, 1):
        if arities.get(step.schema) != len(step.args):
            return state, [f"step {number}: there is no action {step.schema} with {len(step.args)} arguments"]
        unknown = [a for a in step.args if a not in instance.base.values]
        if unknown:
            return state, [f"step {number}: unknown entity {unknown[0]}"]
        view = View(program, instance.base, state)
        if not precondition_holds(view, step):
            return state, [f"step {number}: {step.schema}({', '.join(step.args)}) is not applicable"]
        state = apply(view, step)
    return state, []


def _goal_holds(instance: Instance, state: State) -> bool:
    """Evaluate the goal; where it speaks of sampled entities, the task's samples are drawn first."""
    task, base = instance.task, instance.base
    quota = quota_for(base, reads(task.goal, task.program), task.file.samples)
    sample(base, quota, time.monotonic() + 600)
    return View(task.program, base, state).holds(task.goal)
