"""What follows a policy, by definition and in a constrained domain, on small instances with a fixed set of samples."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass

from gentamp_lp.constrained.encodings import constrained_domain, original_step
from gentamp_lp.features.axioms import Features
from gentamp_lp.features.feature import Feature
from gentamp_lp.features.values import valuation
from gentamp_lp.policy.policy import Policy
from gentamp_lp.streams.formula import And, Atom
from gentamp_lp.streams.incremental import run_tests, sample
from gentamp_lp.streams.semantics import Program, State, Step, View, applicable, apply
from gentamp_lp.tasks.task import Instance, Task

QUOTA = {"sample-grasp": 1, "sample-placement": 1, "sample-cell": 2, "sample-reach": 1}


def sorts_of(policy: Policy) -> dict[str, tuple[str, ...]]:
    return {name: tuple(row) for name, row in policy.extra["sorts"].items()}


@dataclass
class Case:
    """An instance with a fixed set of samples, under the original domain and under the constrained one."""

    policy: Policy
    task: Task
    instance: Instance
    original: Program  # with the features as axioms
    constrained: Program


def case_of(policy: Policy, instance: Instance, encoding: str) -> Case:
    sample(instance.base, QUOTA, float("inf"))
    run_tests(instance.base, float("inf"))
    folder = instance.task.folder
    original = Program.of(folder.domain, Features.of(policy.features).axioms)
    constrained = constrained_domain(policy, folder, sorts_of(policy), encoding, [instance.state])
    return Case(policy, instance.task, instance, original, Program.of(constrained))


def extensions(case: Case, state: State) -> dict[str, set[tuple[str, ...]]]:
    view = View(case.original, case.instance.base, state)
    return {f.name: set(view.extension(f.name)) for f in case.policy.features}


def change(feature: Feature, before: set[tuple[str, ...]], after: set[tuple[str, ...]]) -> str:
    """The effect on one feature by set inclusion; `mixed` is no effect of any action."""
    if feature.kind == "boolean":
        return "" if bool(before) == bool(after) else "true" if after else "false"
    if before == after:
        return ""
    return "increase" if before < after else "decrease" if after < before else "mixed"


def policy_steps(case: Case, state: State) -> Iterator[tuple[Step, State]]:
    """The steps that follow the policy, by definition."""
    policy = case.policy
    before = extensions(case, state)
    rule = policy.rule_for(valuation({name: len(rows) for name, rows in before.items()}))
    if rule is None:
        return
    action = policy.action(rule.action)
    view = View(case.original, case.instance.base, state)
    for step in applicable(view):
        successor = apply(view, step)
        after = extensions(case, successor)
        effects = {f.name: change(f, before[f.name], after[f.name]) for f in policy.features}
        if step.schema in action.schemas and {k: v for k, v in effects.items() if v} == action.effects:
            yield step, successor


def fluents(case: Case, state: State) -> State:
    names = case.task.folder.domain.fluents
    return frozenset(fact for fact in state if fact[0] in names)


def plans_by(
    case: Case, follow: Callable[..., Iterator[tuple[Step, State]]], state: State, depth: int
) -> Iterator[tuple[Step, ...]]:
    """All plans of up to so many steps, by the definition of what follows the policy."""
    if View(case.original, case.instance.base, state).holds(case.task.goal):
        yield ()
    for step, successor in follow(case, state) if depth else ():
        yield from ((step, *rest) for rest in plans_by(case, follow, successor, depth - 1))


def plans_in(case: Case, program: Program, state: State, depth: int) -> Iterator[tuple[Step, ...]]:
    """The same in a constrained domain; bookkeeping does not count."""
    view = View(program, case.instance.base, state)
    if view.holds(And((case.task.goal, Atom("ready", ())))):
        yield ()
    for step in applicable(view):
        own = original_step(step)
        if own is None or depth:
            for rest in plans_in(case, program, apply(view, step), depth - (own is not None)):
                yield rest if own is None else (own, *rest)
