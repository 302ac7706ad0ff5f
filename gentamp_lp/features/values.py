"""Values of features in states, and their qualitative changes."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from functools import cache

from gentamp_lp.demonstrations.dataset import Dataset
from gentamp_lp.features.axioms import Features
from gentamp_lp.features.feature import Feature
from gentamp_lp.streams.facts import FactBase
from gentamp_lp.streams.semantics import Program, State, View
from gentamp_lp.tasks.task import Task

MOST = 8  # entities or facts named at a time


def valuation(values: Mapping[str, int]) -> dict[str, bool]:
    """The qualitative state: which features are positive."""
    return {name: value > 0 for name, value in values.items()}


def matches_effects(
    effects: Mapping[str, str], kinds: Mapping[str, str], before: Mapping[str, int], after: Mapping[str, int]
) -> bool:
    """Whether a change of values is the qualitative change that an abstract action names (and no other)."""
    return all(
        effects.get(name) == effect_of(kinds[name], old > 0, after[name] > 0, after[name] - old)
        for name, old in before.items()
    )


def effect_of(kind: str, before: bool, after: bool, difference: int) -> str | None:
    """The qualitative change of a feature, from whether it was and is positive and the sign of the difference."""
    if kind == "boolean":
        return None if before == after else "true" if after else "false"
    return "increase" if difference > 0 else "decrease" if difference < 0 else None


def recorded(data: Dataset, task: Task, features: Features) -> Callable[[int], View]:
    """How to look at a recorded state, given its number: what was not sampled or tested then does not hold."""
    program = Program.of(task.folder.domain, features.axioms)

    @cache
    def base(number: int) -> FactBase:
        problem = data.problems[number]
        names = dict.fromkeys(name for entities in problem.entities.values() for name in entities)
        facts = FactBase(task.folder.domain, (), {}, names, data.sorts)
        for fact in problem.static:
            facts.add(fact)
        return facts

    def see(number: int) -> View:
        state = data.states[number]
        fluents = frozenset(fact for fact in state.facts if fact[0] not in task.program.axioms)
        return View(program, base(state.problem), fluents)

    return see


def situation(features: Iterable[Feature], base: FactBase, state: State) -> str:
    """What features say of a state, naming entities."""
    known = Features.of(features)
    view = View(Program.of(base.domain, known.axioms), base, state)
    return ", ".join(describe_value(f, view, f.name) for f in known.features)


def describe_value(feature: Feature, view: View, subject: str = "it") -> str:
    """What a feature says of a state, naming entities."""
    if feature.variable is None:
        return f"{subject} is {'true' if view.extension(feature.name) else 'false'}"
    holds = sorted(row[0] for row in view.extension(feature.name))
    shown = ", ".join(holds[:MOST]) + (f" and {len(holds) - MOST} more" if len(holds) > MOST else "")
    return f"{subject} {'counts' if feature.kind == 'numeric' else 'is true of'} {shown or 'nothing'}"
