"""What a policy means: its features and why they were chosen, and what it does along a plan."""

from __future__ import annotations

import time
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

from gentamp_lp.demonstrations.dataset import Dataset
from gentamp_lp.errors import Diagnostic, InputError
from gentamp_lp.features.axioms import Features
from gentamp_lp.features.feature import Feature
from gentamp_lp.features.values import recorded, valuation
from gentamp_lp.plans.plan import Plan
from gentamp_lp.plans.validate import adopt
from gentamp_lp.policy.learn_report import read_report
from gentamp_lp.policy.model import Rule
from gentamp_lp.policy.policy import Policy
from gentamp_lp.streams.incremental import quota_for, sample, simulate
from gentamp_lp.streams.semantics import Program, View, reads
from gentamp_lp.tasks.task import Task

_SAMPLING = 600.0  # seconds
_DOES = {"true": "makes it true", "false": "makes it false", "increase": "raises it", "decrease": "lowers it"}
_HAPPENS = {"true": "becomes true", "false": "becomes false", "increase": "rises", "decrease": "falls"}


@dataclass(frozen=True)
class ExplainedFeature:
    """A feature of a policy: `why` it was selected (empty in a bundle written by hand), and where it is `used`."""

    name: str
    formula: str
    kind: str
    cost: int
    open: bool | None
    why: str
    used: list[str]


@dataclass(frozen=True)
class ExplainedState:
    """A state along a plan: the features' `values`, the abstract state, and what the policy does there.

    `holds` names the entities that satisfy each feature; `step` is the plan's next step, empty in the last state.
    """

    values: dict[str, int]
    holds: dict[str, list[str]]
    abstract: str
    does: str
    step: str


def explain(policy: Policy, folder: Path, name: str | None = None) -> list[ExplainedFeature]:
    """Explain the features of a bundle, or the one of this name. Raises InputError when there is none."""
    chosen = [f for f in policy.features if name in (None, f.name)]
    if not chosen:
        names = ", ".join(f.name for f in policy.features)
        raise InputError(Diagnostic(f"the policy has no feature `{name}`", folder, hint=f"it has {names}"))
    known = {row["name"]: row for row in read_report(folder).get("features", ())}
    return [
        ExplainedFeature(
            name=f.name,
            formula=f.text or f.formula,
            kind=f.kind,
            cost=f.cost,
            open=known.get(f.name, {}).get("open"),
            why=known.get(f.name, {}).get("why", ""),
            used=_uses(policy, f),
        )
        for f in chosen
    ]


def _uses(policy: Policy, feature: Feature) -> list[str]:
    found = []
    for action in policy.actions:
        schemas = f"{action.name} ({', '.join(action.schemas)})"
        if feature.name in action.preconditions:
            found.append(f"{schemas} requires {feature.show(action.preconditions[feature.name])}")
        if feature.name in action.effects:
            found.append(f"{schemas} {_DOES[action.effects[feature.name]]}")
    ends = [number for number, step in enumerate(policy.certificate, 1) if step.feature == feature.name]
    if ends:
        found.append(f"the policy ends because of it (step {', '.join(map(str, ends))} of the certificate)")
    return found


def trace(policy: Policy, plan: Plan, task: Task) -> list[ExplainedState]:
    """What the policy says in each state along a plan of its task. Raises InputError for a plan that does not execute.

    Features that speak of sampled entities see the task's number of samples, and the plan's own.
    """
    if task.name != policy.task:
        raise InputError(Diagnostic(f"the plan is for task `{task.name}`, the policy for `{policy.task}`"))
    instance = task.instance(plan.size, plan.seed, robot=plan.robot)
    adopt(plan, instance)
    features = Features.of(policy.features)
    program = Program.of(task.folder.domain, features.axioms)
    read = {predicate for axiom in features.axioms for predicate in reads(axiom.body, program)}
    sample(instance.base, quota_for(instance.base, read, task.file.samples), time.monotonic() + _SAMPLING)
    states = simulate(task.program, instance.base, instance.state, list(plan.steps))
    if states is None:
        raise InputError(Diagnostic("the plan does not execute", hint="gentamp-lp validate says why"))
    steps = [str(step) for step in plan.steps] + [""]
    return [
        _explained(policy, features, View(program, instance.base, state), step, goal)
        for state, step, goal in zip(
            states, steps, (View(program, instance.base, s).holds(task.goal) for s in states), strict=True
        )
    ]


def retrace(policy: Policy, data: Dataset, task: Task) -> list[list[ExplainedState]]:
    """What the policy says in each state of each demonstration, one list a training problem.

    Features are evaluated on the recorded facts: what was not sampled or tested then does not hold.
    """
    features = Features.of(policy.features)
    see = recorded(data, task, features)
    next_step = {t.source: t for t in data.transitions if t.demonstrated}
    found: list[list[ExplainedState]] = [[] for _ in data.problems]
    for first in (number for number, state in enumerate(data.states) if state.initial):
        number: int | None = first
        while number is not None:
            state, step = data.states[number], next_step.get(number)
            shown = str(step or "")
            found[state.problem].append(_explained(policy, features, see(number), shown, state.goal))
            number = step.target if step else None
    return found


def _explained(policy: Policy, features: Features, view: View, step: str, goal: bool) -> ExplainedState:
    values = features.values(view)
    abstract = tuple(valuation(values).values())
    rule = policy.rule_for(abstract)
    if goal:
        does = "nothing: this is a goal"
    elif rule is None:
        does = "nothing: the policy has no rule for this abstract state"
    else:
        does = purpose(policy, rule)
    holds = {
        f.name: sorted(row[0] for row in view.extension(f.name)) for f in policy.features if f.variable is not None
    }
    return ExplainedState(values, holds, policy.show(abstract), does, step)


def purpose(policy: Policy, rule: Rule) -> str:
    """What a rule does, and to which features."""
    action = policy.action(rule.action)
    return f"{action.name} ({', '.join(action.schemas)}): {_changes(policy.features, action.effects)}"


def _changes(features: Iterable[Feature], effects: dict[str, str]) -> str:
    return ", ".join(f"{f.name} {_HAPPENS[effects[f.name]]}" for f in features if f.name in effects)
