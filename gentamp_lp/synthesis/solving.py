"""Solving a problem with `asp/synthesis.lp`: one search for each level of fairness, strongest first.

The program is exact for strong and strong-cyclic policies. For conditional fairness a policy is refuted by states
that a fair run may visit for ever, as SIEVE finds them: a clause forbids to keep the choices of these states
together, in this policy and in all others.
"""

from __future__ import annotations

import time
from collections.abc import Iterable
from dataclasses import dataclass, field

from gentamp_lp.base.fairness import LEVELS
from gentamp_lp.base.shipped import resource
from gentamp_lp.errors import InputError
from gentamp_lp.solvers.asp import Answer, Clause, GroundProgram, Outcome
from gentamp_lp.synthesis.problem import Choice, Problem
from gentamp_lp.synthesis.sieve import Cut, Edge, Verdict, short_loops, sieve

_LOOPS = 60  # edges of a component through which short loops are looked for
_AT_A_TIME = 20  # clauses from one component


@dataclass(frozen=True)
class Synthesis:
    """What was found: `policy` maps states to choices, None if there is none (`solvable`) or nobody knows (None).

    `fairness` is the level of the policy, or the weakest that was asked for in vain.
    """

    problem: Problem
    solvable: bool | None
    fairness: str
    policy: dict[int, Choice] = field(default_factory=dict)
    optimal: bool = False
    bound: int = 0
    cuts: tuple[Cut[int], ...] = ()
    limited: bool = False
    by_user: bool = False
    seconds: float = 0.0
    statistics: dict[str, int] = field(default_factory=dict)


def synthesize(
    problem: Problem, *, fairness: str | None = None, minimize: bool = False, time_limit: float | None = None
) -> Synthesis:
    """Return a policy of the level `fairness`, or of the strongest level that has one; `minimize` its states."""
    if fairness is not None and fairness not in LEVELS:
        raise InputError(f"unknown fairness `{fairness}`: one of {', '.join(LEVELS)}")
    start = time.monotonic()
    conditional = any(choice.lowered for choice in problem.choices)
    levels = [level for level in LEVELS if conditional or level != "qnp"] if fairness is None else [fairness]
    statistics: dict[str, int] = {}
    for level in levels:
        left = None if time_limit is None else max(time_limit - (time.monotonic() - start), 0.01)
        found = _solve(problem, level, minimize, left)
        for name, count in found.statistics.items():
            statistics[name] = statistics.get(name, 0) + count
        if found.solvable is not False:
            break
    return Synthesis(**{**vars(found), "seconds": time.monotonic() - start, "statistics": statistics})


def sieve_policy(policy: dict[int, Choice]) -> Verdict[int]:
    """Run SIEVE on a policy, under the problem's conditional fairness."""
    edges = [
        Edge(state, after, choice.lowered, choice.raised)
        for state, choice in policy.items()
        for after in choice.outcomes
        if after in policy
    ]
    return sieve(edges, {state: choice.outcomes for state, choice in policy.items()})


class _Termination:
    """The lazy clauses; the solver's atoms are `chosen(T)` with T the position of a choice."""

    predicates: tuple[str, ...] = ("chosen",)

    def __init__(self, problem: Problem) -> None:
        self.choices = problem.choices

    def refute(self, true: dict[str, list[int]]) -> Iterable[tuple[str, Clause]]:
        """Return clauses against the endless runs of the policy, a few short ones if there are some."""
        number = {self.choices[t].state: t for t in true["chosen"]}
        policy = {state: self.choices[t] for state, t in number.items()}
        for part in sieve_policy(policy).stuck:
            for nodes in _witnesses(list(part), policy):
                yield "termination", [(("chosen", number[node]), False) for node in nodes]


def _witnesses(part: list[Edge[int]], policy: dict[int, Choice]) -> list[list[int]]:
    """Return sets of states that the policy may visit for ever, all of them inside a stuck component."""
    outcomes = {state: choice.outcomes for state, choice in policy.items()}
    loops = [loop for loop in short_loops(part, _LOOPS) if not sieve(loop, outcomes).terminates]
    sets = {frozenset(edge.source for edge in loop): None for loop in [*loops[:_AT_A_TIME], part]}
    return [sorted(nodes) for nodes in sets if not any(other < nodes for other in sets)]


def encode(problem: Problem) -> str:
    """Return the input facts of `asp/synthesis.lp` (documented in `asp/synthesis/defined.lp`)."""
    lines = [f"initial({state})." for state in problem.initial]
    lines += [f"goal({state})." for state in sorted(problem.goals)]
    for number, choice in enumerate(problem.choices):
        lines.append(f"choice({choice.state},{number}).")
        lines += [f"outcome({number},{after})." for after in choice.outcomes]
        lines += [f"con_A({number},{constraint})." for constraint in sorted(choice.lowered)]
    return "\n".join(lines)


def _solve(problem: Problem, level: str, minimize: bool, limit: float | None) -> Synthesis:
    """Look for any policy first; core-guided minimisation proves fast, but meets no policy before the best."""
    start = time.monotonic()
    program = GroundProgram(
        [resource("asp", "synthesis.lp")],
        encode(problem),
        options=["-c", f"fairness={level.replace('-', '_')}", "--opt-strategy=usc"],
        theory=_Termination(problem) if level == "qnp" else None,
    )
    statistics: dict[str, int] = {}

    def search(optimize: bool) -> Outcome:
        left = None if limit is None else max(limit - (time.monotonic() - start), 0.01)
        outcome = program.solve(limit=left, optimize=optimize, on_answer=None if optimize else _first)
        for name, count in program.statistics().items():  # clauses are counted over all searches
            statistics[name] = count + (0 if name.startswith("clauses") else statistics.get(name, 0))
        return outcome

    outcome = search(False)
    if not outcome.answers:
        solvable = False if outcome.complete else None
        return Synthesis(
            problem, solvable, level, limited=outcome.interrupted, by_user=outcome.by_user, statistics=statistics
        )
    chosen, optimal, bound = outcome.answers[-1].atoms.get("chosen", ()), False, 0
    if minimize:
        try:
            outcome = search(True)
        except KeyboardInterrupt:  # keep the first policy
            outcome = Outcome(interrupted=True, by_user=True)
        if outcome.answers:
            chosen = outcome.answers[-1].atoms.get("chosen", ())
        optimal, bound = not outcome.interrupted, max(outcome.bound, default=0)
    policy = _in_order(problem, {problem.choices[t].state: problem.choices[t] for t in chosen})
    return Synthesis(
        problem,
        True,
        level,
        policy,
        optimal,
        len(policy) if optimal else bound,
        sieve_policy(policy).cuts if level == "qnp" else (),
        limited=outcome.interrupted,
        by_user=outcome.by_user,
        statistics=statistics,
    )


def _first(answer: Answer) -> bool:
    return False


def _in_order(problem: Problem, policy: dict[int, Choice]) -> dict[int, Choice]:
    """Order the states as runs meet them."""
    order = dict.fromkeys(state for state in problem.initial if state in policy)
    queue = list(order)
    for state in queue:
        for after in policy[state].outcomes:
            if after in policy and after not in order:
                order[after] = None
                queue.append(after)
    return {state: policy[state] for state in order}
