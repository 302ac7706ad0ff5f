"""Why there is no policy: which states of the training data stand in the way."""

from __future__ import annotations

import time
from collections.abc import Mapping
from dataclasses import dataclass
from itertools import islice, product

from gentamp_lp.abstraction.facts import relaxed_program
from gentamp_lp.abstraction.lazy_clauses import refute
from gentamp_lp.abstraction.observations import Observations
from gentamp_lp.abstraction.theory import Theory
from gentamp_lp.base.bitsets import bits
from gentamp_lp.errors import NoAnswer
from gentamp_lp.solvers.asp import Atom, GroundProgram

_ATTEMPTS = 64  # choices of moves that are explained


class NoPolicy(NoAnswer):
    """No abstraction of the pool has a policy; `states` or `pairs` (goal, other) are what stands in the way.

    `attempts` say why each choice of moves in `states` fails; `minimal` whether there is proof that all are needed.
    """

    def __init__(
        self,
        message: str,
        *,
        states: tuple[int, ...] = (),
        pairs: tuple[tuple[int, int], ...] = (),
        attempts: tuple[Attempt, ...] = (),
        minimal: bool = True,
    ) -> None:
        super().__init__(message)
        self.states = states
        self.pairs = pairs
        self.attempts = attempts
        self.minimal = minimal


@dataclass(frozen=True)
class Clash:
    """Two states that look alike to the features not `barred` before, and what their moves change differently."""

    states: tuple[int, int]
    barred: tuple[int, ...]  # features, cheapest first
    alike: bool  # to every feature of the pool


@dataclass(frozen=True)
class Attempt:
    """Why a choice of moves (state -> transition) fails: clashes bar features, and with all others `kind` is violated.

    A move must change a selected feature; those of `idle` states change none that is left. `kind` (empty: that is all)
    is that of a lazy clause (`lazy_clauses.py`), `states` those it speaks of (goal: a goal and its like).
    """

    moves: Mapping[int, int]
    clashes: tuple[Clash, ...]
    kind: str
    states: tuple[int, ...]
    idle: tuple[int, ...]


def require_separable_goals(observations: Observations) -> None:
    """Raise NoPolicy if a goal state looks like another one to every feature of the pool."""
    if not observations.goals:
        raise NoPolicy("the training data have no goal state")
    looks: dict[int, list[int]] = {}
    for goal in sorted(observations.goals):
        looks.setdefault(observations.states[goal], []).append(goal)
    pairs = tuple(
        (looks[values][0], state)
        for state, values in observations.states.items()
        if state not in observations.goals and values in looks
    )
    if pairs:
        shown = ", ".join(f"{goal} and {other}" for goal, other in pairs[:5])
        raise NoPolicy(
            f"no feature of the pool separates these goal states from states that are none: {shown}"
            + (f" and {len(pairs) - 5} more pairs" if len(pairs) > 5 else "")
            + "; try a higher complexity (--max-complexity) or a word that tells them apart (--grammar)",
            pairs=pairs,
            states=tuple(sorted({state for pair in pairs for state in pair})),
        )


def find_conflict(theory: Theory, limit: float) -> NoPolicy:
    """Return the error that names a smallest set of expanded states for which no policy exists together."""
    program = relaxed_program(theory)
    deadline = time.monotonic() + limit
    everything: list[Atom] = [("relevant", state.id) for state in theory.expanded]
    first = _core(program, everything, limit)
    core = everything if first is None else first
    minimal = first is not None
    for atom in list(core):
        if atom in core:
            rest = [other for other in core if other != atom]
            core = _core(program, rest, deadline - time.monotonic()) or core
            minimal = minimal and time.monotonic() < deadline
    return _conflict(theory, tuple(sorted(state for _, state in core)), minimal)


def _core(program: GroundProgram, atoms: list[Atom], limit: float) -> list[Atom] | None:
    """Return a core among the atoms; None if they can be demanded together, or nobody knows in time."""
    if limit <= 0:
        return None
    outcome = program.solve(limit=limit, assume=atoms, on_answer=lambda answer: False)
    if outcome.answers or outcome.interrupted:
        return None
    return [atom for atom in atoms if atom in outcome.core]


def _conflict(theory: Theory, states: tuple[int, ...], minimal: bool) -> NoPolicy:
    observations = theory.observations
    lines = [
        f"no abstraction of the pool has a {theory.fairness} policy for these expanded states together: "
        f"{', '.join(map(str, states))}" + ("" if minimal else " (not proved to be a smallest such set)")
    ]
    shown = [state for state in theory.expanded if state.id in states]
    for state in shown[:8]:
        moves = sorted({observations.schemas.get(t, f"transition {t}") for t in observations.candidates[state.id]})
        lines.append(f"  state {state.id}: {' or '.join(moves)}")
        if all(not move.inc | move.dec for move in state.moves):
            lines.append("    no feature of the pool changes along it")
    for i, s in enumerate(shown):
        for t in shown[:i]:
            if s.values == t.values:
                lines.append(
                    f"  states {t.id} and {s.id} look alike to every feature of the pool, "
                    "but their moves differ in features"
                )
    lines.append(
        "  demonstrations that treat like states differently are inconsistent: change them, or try a higher "
        "complexity (--max-complexity), a word of your own (--grammar)"
        + ("" if theory.fairness == "strong-cyclic" else ", a weaker fairness (--fairness)")
    )
    attempts = tuple(
        _attempt(theory, dict(zip((s.id for s in shown), (m.id for m in moves), strict=True)))
        for moves in islice(product(*(state.moves for state in shown)), _ATTEMPTS)
    )
    return NoPolicy("\n".join(lines), states=states, attempts=attempts, minimal=minimal)


def _attempt(theory: Theory, choice: dict[int, int]) -> Attempt:
    """Bar what moves of states that look alike change differently, until something else goes wrong."""
    observations, left = theory.observations, theory.features
    moves = {state.id: move for state in theory.expanded for move in state.moves if move.id == choice.get(state.id)}
    clashes: list[Clash] = []
    while (violated := refute(theory, left, choice)) and violated[0].kind == "consistency":
        barred: dict[tuple[int, ...], int] = {}
        for clause in violated:
            pair = tuple(sorted(clause.states))
            barred[pair] = barred.get(pair, 0) | clause.unselected
        for (first, second), mask in barred.items():
            by_cost = sorted(bits(mask), key=lambda i: observations.features[i].cost)
            alike = not (observations.states[first] ^ observations.states[second]) & theory.features
            clashes.append(Clash((first, second), tuple(observations.features[i].id for i in by_cost), alike))
            left &= ~mask
    idle = tuple(state for state, move in moves.items() if not (move.inc | move.dec) & left)
    kind = violated[0].kind if violated else ""
    wrong = observations.confused(left) if kind == "goal" else tuple(sorted(violated[0].states)) if violated else ()
    return Attempt(choice, tuple(clashes), kind, wrong, idle)
