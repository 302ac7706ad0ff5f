"""The independent check of a plan: nothing the planner believed is taken over.

The instance is drawn from its task, size and seed, and nothing sampled before is known in it. Sampled values come from
the plan as numbers; every test the preconditions need is run again on them, the steps are simulated, the goal is
evaluated, and the motions are replayed by the domain's own checker (PyBullet for `tabletop`, where planning used FCL).
"""

from __future__ import annotations

import re
import time

from gentamp_lp.errors import Diagnostic, InputError
from gentamp_lp.plans.plan import Plan
from gentamp_lp.streams.facts import Fact
from gentamp_lp.streams.formula import And
from gentamp_lp.streams.incremental import quota_for, sample
from gentamp_lp.streams.relations import bind
from gentamp_lp.streams.semantics import State, View, apply, precondition_holds, reads
from gentamp_lp.tasks.domain_folder import running
from gentamp_lp.tasks.task import Instance, Task

_NAME = re.compile(r"\w[\w-]*")


def validate(plan: Plan, task: Task, instance: Instance | None = None) -> list[str]:
    """What is wrong with a plan; empty when it is sound. Raises InputError when its values cannot be read.

    `instance` is that of the plan, with nothing sampled yet; without it, it is drawn.
    """
    instance = instance or task.instance(plan.size, plan.seed, robot=plan.robot)
    adopt(plan, instance)
    problems = _unfounded(plan, instance)
    if not problems:
        with running(task.folder, "check_facts"):
            problems = task.folder.code.check_facts(instance.world, plan.facts, instance.base.values)
    if problems:
        return problems
    state, problems = _simulate(plan, instance)
    if problems:
        return problems
    if not _goal_holds(instance, state):
        problems.append("the goal does not hold after the last step")
    steps = [(step.schema, step.args) for step in plan.steps]
    if plan.transits is not None and task.folder.code.plan_transits is None:
        return [*problems, f"the domain `{task.folder.path.name}` has no transits"]
    with running(task.folder, "check_plan"):
        problems += task.folder.code.check_plan(instance.world, steps, instance.base.values, *plan.transit_args)
    return problems


def adopt(plan: Plan, instance: Instance) -> None:
    """Take over the plan's entities and the stream facts it claims about them (the replay puts these to the test)."""
    base, code = instance.base, instance.task.folder.code
    for name, data in plan.entities.items():
        if not _NAME.fullmatch(name):
            raise InputError(Diagnostic(f"`{name}` is not a name for an entity"))
        if name in base.values:
            raise InputError(Diagnostic(f"entity `{name}` of the plan is already an object of the instance"))
        try:
            base.values[name] = code.decode(data, instance.world, base.values)
        except (KeyError, ValueError, TypeError, ArithmeticError) as error:
            raise InputError(Diagnostic(f"entity `{name}` of the plan cannot be read: {error!r}")) from None
    for fact in plan.facts:
        if not fact or fact[0] not in base.makers:
            raise InputError(Diagnostic(f"the plan may not state `{' '.join(fact[:1])}` facts: no stream makes them"))
        if len(fact) - 1 != instance.task.folder.domain.predicates[fact[0]].arity:
            raise InputError(Diagnostic(f"the fact {fact} has the wrong number of arguments"))
        unknown = [name for name in fact[1:] if name not in base.values]
        if unknown:
            raise InputError(Diagnostic(f"the fact {fact} is about an unknown entity {unknown[0]}"))
        if not set(fact[1:]) & set(plan.entities):
            raise InputError(Diagnostic(f"the fact {fact} is not about an entity of the plan"))
        base.add(fact)


def _unfounded(plan: Plan, instance: Instance) -> list[str]:
    """What the plan claims beyond what streams could have certified.

    Each entity must come from one call of a stream whose conditions hold, on inputs listed before it, and serve a step
    (or the making of an entity that does). So nobody can claim that one placement lies on two supports.
    """
    base, position = instance.base, {name: index for index, name in enumerate(plan.entities)}
    view = View(instance.task.program, base, instance.state)
    calls: dict[str, list[frozenset[Fact]]] = {name: [] for name in plan.entities}
    serving: dict[str, set[str]] = {name: set() for name in plan.entities}
    for stream in base.streams:
        if stream.is_test:
            continue
        for binding in view.solutions(And(stream.certified + stream.domain)):
            outputs = [binding[v] for v in stream.outputs if v in binding]
            needed = {binding[v] for v in stream.inputs} & position.keys()
            if not all(o in position and all(position[n] < position[o] for n in needed) for o in outputs):
                continue
            facts = frozenset((atom.predicate, *bind(atom, binding)) for atom in stream.certified)
            for output in outputs:
                calls[output].append(facts)
                serving[output] |= needed | set(outputs)
    problems = []
    for name, found in calls.items():
        if not found:
            problems.append(f"no call of a stream gives what the plan says about {name}")
        elif max(found, key=len) != frozenset().union(*found):
            problems.append(f"the plan takes {name} from two calls of streams")
    founded = {fact for found in calls.values() for facts in found for fact in facts}
    problems += [f"no stream certifies {f[0]}({', '.join(f[1:])})" for f in plan.facts if f not in founded]
    open_ = [name for step in plan.steps for name in step.args if name in position]
    used = set(open_)
    while open_:
        new = serving[open_.pop()] - used
        used |= new
        open_ += new
    return problems + [f"no step uses {name}" for name in plan.entities if name not in used]


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
            return state, [f"step {number}: {step} is not applicable"]
        state = apply(view, step)
    return state, []


def _goal_holds(instance: Instance, state: State) -> bool:
    """Evaluate the goal; where it speaks of sampled entities, the task's samples are drawn first."""
    task, base = instance.task, instance.base
    quota = quota_for(base, reads(task.goal, task.program), task.file.samples)
    sample(base, quota, time.monotonic() + 600)
    return View(task.program, base, state).holds(task.goal)
