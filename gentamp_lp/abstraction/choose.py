"""Choose features and moves that make a policy: one optimising ASP program with lazy clauses.

The rules are in `asp/abstraction.lp` and `gentamp_lp/abstraction/lazy_clauses.py`. This module turns training data into
the program's facts, runs it, breaks ties, and says why when there is no answer. The lazy formulation follows D2L
(Frances, Bonet and Geffner, AAAI 2021) in solving with few pairs and adding those that an answer violates.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import get_args

from gentamp_lp.abstraction.conflict import NoPolicy, find_conflict, require_separable_goals
from gentamp_lp.abstraction.facts import LazyPolicy, improvement_facts, relaxed_program, theory_facts
from gentamp_lp.abstraction.observations import Observations, parse_observations
from gentamp_lp.abstraction.reference import reference_program
from gentamp_lp.abstraction.theory import Theory, compress
from gentamp_lp.base.fairness import LEVELS, ProgramName, Unseen
from gentamp_lp.base.shipped import resource
from gentamp_lp.errors import InputError, LimitReached
from gentamp_lp.solvers.asp import Answer, Atom, GroundProgram, Outcome

__all__ = ["NoPolicy", "Solution", "synthesize_policy"]

_TIES = 200  # optimal selections that are compared to break ties
_IMPROVE = 200_000  # conflicts spent on improving a proved optimum: a count, not a time, so that results repeat
_EXPLAIN = 10.0  # seconds spent on making an explanation small


@dataclass(frozen=True)
class Solution:
    """Selected features, one chosen transition for every expanded state, and what is proved about the cost."""

    features: tuple[int, ...]
    cost: int
    bound: int
    optimal: bool
    chosen: tuple[int, ...]
    by_user: bool = field(compare=False)  # Ctrl-C ended the search
    seconds: dict[str, float] = field(compare=False)
    statistics: dict[str, int] = field(compare=False)
    theory: Theory = field(compare=False, repr=False)  # what it was chosen for


def synthesize_policy(
    facts: str | Observations,
    *,
    fairness: str = "qnp",
    unseen: str = "drop",
    time_limit: float | None = None,
    seed: int = 0,
    improve: tuple[int, int] | None = None,
    explain: bool = True,
    program: str = "lazy",
    progress: Callable[[str], None] | None = None,
) -> Solution:
    """Return the cheapest abstraction with a policy for every expanded state of the training data.

    `fairness` is the least that must be guaranteed: `strong` (no loop), `qnp` (every loop lowers a count it
    never raises) or `strong-cyclic` (a goal stays in reach). A falling count may reach zero or not: outcomes that
    no seen state shows are dropped, or (`unseen` = "refuse") make the policy wrong. Among optimal answers the one
    with the shortest formulas, then the fewest features, then the fewest policy rules, then the smallest numbers is
    returned, whatever the seed (if more than 200 tie, of the first 200). `improve` = (cost, level) asks only for
    answers that cost less and use a feature whose cost exceeds the level: what a deeper pool can add to an optimum
    over a shallower one. The effort for that is limited by a number of conflicts. `program` = "reference" asks the
    complete program, which gives the same answer where the data are few enough.

    Raises NoPolicy, which names the states at fault unless `explain` is off, or LimitReached if the limit ends
    before any answer, or if the data are too many for the reference program. An answer not proved optimal in time
    (or before Ctrl-C) comes back with `optimal` False and a lower `bound`.
    """
    _require_known(fairness, unseen, program)
    say = progress or (lambda message: None)
    clock = _Clock(time_limit)
    observations = parse_observations(facts) if isinstance(facts, str) else facts
    require_separable_goals(observations)
    theory = compress(observations, fairness, unseen)
    grounded = _ground(theory, program, improve, seed)
    prepared = clock.now()
    say(f"{theory.features.bit_count()} features, {len(theory.expanded)} state classes")
    watch = _Watch(say)
    outcome = grounded.solve(limit=clock.left(), on_answer=watch.report, on_bound=watch.bound)
    if not outcome.answers:
        raise _failure(outcome, theory, improve, explain, clock)
    best = _best(outcome.answers, theory)
    bound = max(outcome.bound[0], 0) if outcome.bound else 0
    optimal = best.optimal or outcome.complete or bound >= best.cost[0]
    return Solution(
        features=best.atoms["selected"],
        cost=best.cost[0],
        bound=best.cost[0] if optimal else bound,
        optimal=optimal,
        chosen=_first_choice(theory, best.atoms["selected"]),
        by_user=outcome.by_user,
        seconds={"theory": prepared, "solving": clock.now() - prepared},
        statistics={
            "pool_classes": theory.features.bit_count(),
            "state_classes": len(theory.expanded),
            "frontier_states": len(theory.frontier),
            "ties": len({answer.atoms["selected"] for answer in outcome.answers if answer.optimal}),
            **grounded.statistics(),
        },
        theory=theory,
    )


def _require_known(fairness: str, unseen: str, program: str) -> None:
    """Raise InputError for a word that means nothing."""
    if fairness not in LEVELS:
        raise InputError(f"unknown fairness {fairness!r}: one of {', '.join(LEVELS)}")
    if unseen not in get_args(Unseen):
        raise InputError(f"unknown treatment of unseen outcomes {unseen!r}: one of {', '.join(get_args(Unseen))}")
    if program not in get_args(ProgramName):
        raise InputError(f"unknown program {program!r}: one of {', '.join(get_args(ProgramName))}")


def _failure(
    outcome: Outcome, theory: Theory, improve: tuple[int, int] | None, explain: bool, clock: _Clock
) -> NoPolicy | LimitReached:
    """Why a search has no answer."""
    if not outcome.complete:
        return LimitReached(f"no policy found within the limit; {_reached(outcome)}")
    if improve is not None:
        return NoPolicy(f"no abstraction with a deeper feature costs less than {improve[0]}")
    if not explain:
        return NoPolicy("no abstraction of the pool has a policy")
    left = clock.left()
    return find_conflict(theory, _EXPLAIN if left is None else min(_EXPLAIN, left))


def _ground(theory: Theory, program: str, improve: tuple[int, int] | None, seed: int) -> GroundProgram:
    """Return the program over the training data, ready to be solved."""
    options = [
        "--configuration=trendy",  # the one of clasp's that is never slow
        "--opt-strategy=usc,oll,disjoint,stratify",  # disjoint cores first: Transport 2-15 s, without 12-42
        "--opt-mode=optN",
        "--project=project",
        "0",
        *_random(seed),
    ]
    if program == "reference":
        return reference_program(theory, improve, options)
    facts = theory_facts(theory) + improvement_facts(theory, improve)
    options += _effort(improve)
    return GroundProgram([resource("asp", "abstraction.lp")], facts, options=options, theory=LazyPolicy(theory))


class _Clock:
    def __init__(self, limit: float | None) -> None:
        self._start, self._limit = time.monotonic(), limit

    def now(self) -> float:
        return time.monotonic() - self._start

    def left(self) -> float | None:
        return None if self._limit is None else max(self._limit - self.now(), 0.0)


def _random(seed: int) -> list[str]:
    return [f"--seed={seed}", "--rand-freq=0.01"] if seed else []


def _effort(improve: tuple[int, int] | None) -> list[str]:
    return [] if improve is None else [f"--solve-limit={_IMPROVE}"]


class _Watch:
    """Report progress, and stop the listing of optimal selections at some point."""

    def __init__(self, say: Callable[[str], None]) -> None:
        self._say, self._count, self._bound = say, 0, 0

    def bound(self, bound: tuple[int, ...]) -> None:
        if bound[0] > self._bound:
            self._bound = bound[0]
            self._say(f"cost at least {bound[0]}")

    def report(self, answer: Answer) -> bool:
        if answer.optimal:
            self._count += 1
        else:
            self._say(f"a policy of cost {answer.cost[0]} with {answer.cost[-1]} features")
        return self._count < _TIES


def _reached(outcome: Outcome) -> str:
    return f"its cost is at least {outcome.bound[0]}" if outcome.bound else "nothing is known about its cost"


def _best(answers: list[Answer], theory: Theory) -> Answer:
    """Break ties that the program leaves: fewest policy rules, smallest feature numbers."""
    lazy = LazyPolicy(theory)

    def key(answer: Answer) -> tuple[int, tuple[int, ...], int, tuple[int, ...]]:
        mask = lazy.mask(answer.atoms["selected"])
        rules = len({state.values & mask for state in theory.expanded})
        return (-answer.optimal, answer.cost, rules, answer.atoms["selected"])

    return min(answers, key=key)


def _first_choice(theory: Theory, selected: tuple[int, ...]) -> tuple[int, ...]:
    """Return the smallest transitions that make the selected features work, state by state."""
    observations = theory.observations
    moves = {state.id: [move.id for move in state.moves] for state in theory.expanded}
    mask = LazyPolicy(theory).mask(selected)
    if any(len(options) > 1 for options in moves.values()):
        picked = _settle(replace(theory, features=mask, numeric=theory.numeric & mask), selected, moves)
    else:
        picked = {state: options[0] for state, options in moves.items()}
    chosen = []
    for state, candidates in observations.candidates.items():
        model = observations.transitions[picked[theory.home[state]]]
        chosen.append(
            next(
                t
                for t in candidates
                if not ((observations.transitions[t].inc ^ model.inc) | (observations.transitions[t].dec ^ model.dec))
                & mask
            )
        )
    return tuple(sorted(chosen))


def _settle(theory: Theory, selected: tuple[int, ...], moves: dict[int, list[int]]) -> dict[int, int]:
    """Fix the moves one state after the other, each time the smallest that leaves an answer."""
    program = relaxed_program(theory)
    fixed: list[Atom] = [("selected", feature) for feature in selected]
    fixed += [("relevant", state) for state in moves]
    picked: dict[int, int] = {}
    for state, options in moves.items():
        for move in options:
            trial = [*fixed, ("chosen", move)]
            if move == options[-1] or program.solve(assume=trial, on_answer=lambda answer: False).answers:
                fixed, picked[state] = trial, move
                break
    return picked
