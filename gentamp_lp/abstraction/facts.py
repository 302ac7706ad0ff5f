"""Compressed training data in the vocabulary of `asp/abstraction.lp`: its facts, and its lazy conditions as clauses."""

from __future__ import annotations

from collections.abc import Iterable

from gentamp_lp.abstraction.hitting_sets import covers, kernels
from gentamp_lp.abstraction.lazy_clauses import refute
from gentamp_lp.abstraction.theory import Theory
from gentamp_lp.base.bitsets import bits, minimal
from gentamp_lp.base.shipped import resource
from gentamp_lp.solvers.asp import Atom, Clause, GroundProgram

_GOAL_PAIRS = 300  # pairs of goal and other states given from the start
_KERNELS = 20_000  # kernels listed at most
_COVERS = 200  # covers given from the start: the shortest, more do not help the bound


class LazyPolicy:
    """The conditions of `lazy_clauses.py` in the vocabulary of the program."""

    predicates: tuple[str, ...] = ("selected", "chosen", "relevant")

    def __init__(self, theory: Theory) -> None:
        self.theory = theory
        self._bit = {feature.id: 1 << i for i, feature in enumerate(theory.observations.features)}
        self._state = {move.id: state.id for state in theory.expanded for move in state.moves}

    def refute(self, true: dict[str, list[int]]) -> Iterable[tuple[str, Clause]]:
        """Return the violated clauses, each with its kind."""
        relevant = set(true["relevant"])
        choice = {self._state[move]: move for move in true["chosen"] if self._state[move] in relevant}
        for violated in refute(self.theory, self.mask(true["selected"]), choice):
            clause: list[tuple[Atom, bool]] = [(("relevant", state), False) for state in sorted(violated.states)]
            clause += [(("selected", feature), True) for feature in self.theory.observations.ids(violated.selected)]
            clause += [(("selected", feature), False) for feature in self.theory.observations.ids(violated.unselected)]
            clause += [(("chosen", move), True) for move in violated.chosen]
            clause += [(("chosen", move), False) for move in violated.unchosen]
            yield violated.kind, clause

    def mask(self, features: Iterable[int]) -> int:
        """Return the mask of a selection."""
        return sum(self._bit[feature] for feature in features)


def theory_facts(theory: Theory) -> str:
    """Return the input facts of `asp/abstraction.lp` (documented in `asp/abstraction/defined.lp`)."""
    observations = theory.observations
    name = [feature.id for feature in observations.features]
    lines = [f"feature({name[i]},{observations.features[i].cost})." for i in bits(theory.features)]
    lines += [f"size({name[i]},{observations.features[i].size})." for i in bits(theory.features)]
    for state in theory.expanded:
        lines.append(f"expanded({state.id}).")
        for move in state.moves:
            lines.append(f"move({state.id},{move.id}).")
            lines.extend(f"changes({move.id},{name[i]})." for i in bits((move.inc | move.dec) & theory.features))
    for predicate, number, pairs in (
        ("differ", _GOAL_PAIRS, _goal_pairs(theory)),
        ("tells", _COVERS, covers(theory)),
    ):
        for mask in minimal(pairs, number):
            lines.extend(f"{predicate}({pairs[mask][0]},{pairs[mask][1]},{name[i]})." for i in bits(mask))
    return "\n".join(lines)


def improvement_facts(theory: Theory, improve: tuple[int, int] | None) -> str:
    """Return the input facts of `asp/abstraction/improve.lp` and `kernels.lp`."""
    if improve is None:
        return ""
    lines = [f"\ncheaper_than({improve[0]}). deeper_than({improve[1]})."]
    listed = kernels(theory, *improve, _KERNELS)
    if listed is not None:
        lines.append("kernels_listed.")
        name = [feature.id for feature in theory.observations.features]
        lines += [f"kernel({k},{name[i]})." for k, mask in enumerate(listed) for i in bits(mask)]
    return "\n".join(lines)


def _goal_pairs(theory: Theory) -> dict[int, tuple[int, int]]:
    """Map each set of features that differ on a goal and another state to one such pair."""
    observations = theory.observations
    states = {values & theory.features: s for s, values in reversed(observations.states.items())}
    goals = {observations.states[s] & theory.features: s for s in sorted(observations.goals, reverse=True)}
    return {
        goal ^ other & theory.features: (goals[goal], states[other & theory.features])
        for goal in goals
        for other in (*(state.values for state in theory.expanded), *theory.frontier)
    }


def relaxed_program(theory: Theory) -> GroundProgram:
    """Return `asp/explanation.lp` for training data: which states the policy answers for is left to assumptions."""
    return GroundProgram([resource("asp", "explanation.lp")], theory_facts(theory), theory=LazyPolicy(theory))
