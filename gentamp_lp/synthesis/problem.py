"""A planning problem as a finite graph, with conditional fairness.

A constraint i has two sets of actions (Rodriguez, Bonet, Sardina and Geffner, "Flexible FOND Planning with Explicit
Fairness Assumptions", ICAPS 2021). If a run takes an action of con_A(i) in one state for ever, and actions of
con_B(i) only finitely often, then each outcome of that action in that state happens for ever. An action in no con_A
is adversarial; one in a con_A(i) whose con_B(i) is empty is fair. In a QNP the constraints are the numeric
variables: con_A(x) holds the actions that lower x, con_B(x) those that raise it.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace


@dataclass(frozen=True)
class Choice:
    """An action that can be taken in a state: `lowered` and `raised` are the constraints i with it in A(i), B(i)."""

    state: int
    action: str
    outcomes: tuple[int, ...]
    lowered: frozenset[int] = frozenset()
    raised: frozenset[int] = frozenset()


@dataclass(frozen=True)
class Problem:
    """States are positions in `states` (their names), choices positions in `choices`; goal states have no choice."""

    states: tuple[str, ...]
    initial: tuple[int, ...]
    goals: frozenset[int]
    choices: tuple[Choice, ...]
    constraints: tuple[str, ...] = ()
    numeric: bool = False  # the constraints are the variables of a QNP

    def names(self, states: Iterable[int], most: int = 5) -> str:
        """Return the names of some states for a message."""
        listed = list(states)
        shown = "; ".join(self.states[state] for state in listed[:most])
        return shown + (f"; and {len(listed) - most} more" if len(listed) > most else "")


def reachable(problem: Problem) -> Problem:
    """Return the problem without the states that no run visits, and without choices in goals.

    States keep their order, so that names and answers do not depend on how the graph was found.
    """
    own: dict[int, list[Choice]] = {}
    for choice in problem.choices:
        if choice.state not in problem.goals:
            own.setdefault(choice.state, []).append(choice)
    seen, waiting = set(problem.initial), list(problem.initial)
    while waiting:
        for choice in own.get(waiting.pop(), ()):
            waiting += set(choice.outcomes) - seen
            seen |= set(choice.outcomes)
    return _renumber(problem, sorted(seen), [c for state in sorted(seen) for c in own.get(state, ())])


def _renumber(problem: Problem, kept: Sequence[int], choices: Iterable[Choice]) -> Problem:
    number = {state: i for i, state in enumerate(kept)}
    return replace(
        problem,
        states=tuple(problem.states[state] for state in kept),
        initial=tuple(number[state] for state in problem.initial),
        goals=frozenset(number[state] for state in problem.goals if state in number),
        choices=tuple(
            replace(c, state=number[c.state], outcomes=tuple(sorted({number[s] for s in c.outcomes}))) for c in choices
        ),
    )
