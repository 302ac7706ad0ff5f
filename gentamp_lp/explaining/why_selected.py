"""Why each feature was selected: what goes wrong without it, in a state of the training data."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import partial, reduce
from operator import or_

from gentamp_lp.abstraction.choose import Solution
from gentamp_lp.abstraction.lazy_clauses import LazyClause, refute
from gentamp_lp.abstraction.theory import Theory

WORDS = {
    "unseen": "the policy could lead to what no seen state shows",
    "frontier": "the policy could lead where it knows no rule",
    "termination": "nothing shows that a loop of the policy ends",
    "acyclic": "the policy could run in a loop",
    "trap": "no goal could be reached",
}


def reasons(
    solution: Solution,
    describe: Callable[[int, int], str],
    step: Callable[[int], str],
) -> dict[int, str]:
    """For each selected feature a sentence: what the other selected features alone cannot do.

    `describe` says what a feature is in a state, given their numbers; `step` says which step the policy takes.
    """
    theory = solution.theory
    bit = {feature: 1 << theory.observations.bit(feature) for feature in solution.features}
    everything = reduce(or_, bit.values(), 0)
    choice = _choice(theory, solution)
    return {
        feature: _reason(theory, everything & ~own, own, choice, partial(describe, feature), step)
        for feature, own in bit.items()
    }


def _choice(theory: Theory, solution: Solution) -> dict[int, int]:
    """The chosen move of each class of expanded states."""
    moves = {state.id: state.moves for state in theory.expanded}
    choice: dict[int, int] = {}
    for step in (theory.observations.transitions[t] for t in solution.chosen):
        state, change = theory.home[step.source], (step.inc & theory.features, step.dec & theory.features)
        choice.setdefault(state, next(move.id for move in moves[state] if (move.inc, move.dec) == change))
    return choice


def _reason(
    theory: Theory,
    others: int,
    feature: int,
    choice: Mapping[int, int],
    describe: Callable[[int], str],
    step: Callable[[int], str],
) -> str:
    violated = refute(theory, others, dict(choice))
    if not violated:
        return "it is not needed on the training data"
    kind = violated[0].kind
    if kind == "goal":
        goal, state = theory.observations.confused(others)
        rivals = _rivals(theory, violated, feature)
        return f"without it, {describe(goal)}, looks like {describe(state)}{rivals}"
    states = sorted(violated[0].states)
    if kind == "consistency":
        first, second = (states * 2)[:2]
        return (
            f"without it, {describe(first)}, looks like {describe(second)}, but the policy does "
            f"{step(first)} in one and {step(second)} in the other"
        )
    return f"without it, {WORDS[kind]}: {'; '.join(describe(state) for state in states[:3])}"


def _rivals(theory: Theory, violated: list[LazyClause], feature: int) -> str:
    """How many other features of the pool would do what this one does for the goal, and how cheap they are."""
    able = reduce(lambda mask, clause: mask & clause.selected, violated, theory.features) & ~feature
    costs = sorted(theory.observations.features[i].cost for i in range(able.bit_length()) if able >> i & 1)
    if not costs:
        return "; no other feature of the pool tells them apart"
    return f"; {len(costs)} other feature(s) of the pool would tell them apart, at a cost of {costs[0]} or more"
