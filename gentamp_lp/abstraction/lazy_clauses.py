"""The conditions that are added lazily: what a wrong choice of features and moves violates, as clauses.

Each clause holds for *every* choice, not only for the one that broke it, so it is added once and for all. The
rules are those of `asp/reference/validity.lp`, `policy.lp` and `termination.lp`; below, `chosen(T)` stands
for "the policy makes move T in the state it leaves", and a feature *breaks* (T, u) if its value in state u
cannot result from T.

goal          A goal and another state look different: some feature that differs on them is selected.
consistency   States s and t that look alike make the same change: if F is selected and T chosen in s, then
              some feature that differs on s and t is selected, or a move of t with T's change of F is chosen.
unseen        Where outcomes that no seen state shows are refused: if T is chosen, and the features are selected
              that tell one of its outcomes from every seen state, T is wrong.
frontier      An outcome shown by an unexpanded state u only has no rule: if T is chosen, and the features are
              selected that tell u from every expanded state, then some feature breaks (T, u).
termination   A loop that SIEVE cannot cut: of its moves one is not chosen, or a feature breaks one of its
              steps, or a count is selected that the loop lowers and never raises.
acyclic       The same for any loop, if strong fairness is demanded.
trap          States from which no goal is reached: one of their moves is not chosen, or the features that
              keep its outcomes inside are not all selected.

Outcomes are compared with the seen states; the 2^n outcomes of n selected falling counts are listed only to refuse
those that are unseen.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from functools import reduce
from operator import or_

from gentamp_lp.abstraction.theory import Expanded, Move, Theory
from gentamp_lp.base.bitsets import bits, hitting, minimal, subsets
from gentamp_lp.synthesis.sieve import Edge, components, short_loops, sieve

_AT_A_TIME = 60


@dataclass(frozen=True)
class LazyClause:
    """A clause: `unselected` or `selected` (masks), or a move of `unchosen` not chosen, or one of `chosen` is.

    It speaks only of policies that answer for all of `states`.
    """

    kind: str
    states: frozenset[int]
    selected: int = 0
    unselected: int = 0
    chosen: tuple[int, ...] = ()
    unchosen: tuple[int, ...] = ()


def refute(theory: Theory, selection: int, choice: dict[int, int]) -> list[LazyClause]:
    """Return clauses that the selection and the choice (state id -> move id) violate; none if it is right."""
    answered = [
        (state, next(move for move in state.moves if move.id == choice[state.id]))
        for state in theory.expanded
        if state.id in choice
    ]
    found = _goal(theory, selection) or _consistency(theory, selection, answered)
    return found or _Graph(theory, selection, answered).refute()


def _goal(theory: Theory, selection: int) -> list[LazyClause]:
    valuations: dict[int, list[int]] = {}
    for values in theory.goals:
        valuations.setdefault(values & selection, []).append(values)
    differences = {
        (goal ^ values) & theory.features
        for values in (*(state.values for state in theory.expanded), *theory.frontier)
        for goal in valuations.get(values & selection, ())
    }
    return [LazyClause("goal", frozenset(), selected=clause) for clause in minimal(differences, _AT_A_TIME)]


def _consistency(theory: Theory, selection: int, answered: list[tuple[Expanded, Move]]) -> list[LazyClause]:
    found: dict[LazyClause, None] = {}
    leaders: dict[int, tuple[Expanded, Move]] = {}
    for s, move in answered:
        t, other = leaders.setdefault(s.values & selection, (s, move))
        for bit in bits(((move.inc ^ other.inc) | (move.dec ^ other.dec)) & selection):
            found[_same(theory, s, move, t, 1 << bit)] = None
            found[_same(theory, t, other, s, 1 << bit)] = None
        if len(found) >= _AT_A_TIME:
            break
    return list(found)


def _same(theory: Theory, s: Expanded, move: Move, t: Expanded, bit: int) -> LazyClause:
    same = tuple(m.id for m in t.moves if m.inc & bit == move.inc & bit and m.dec & bit == move.dec & bit)
    return LazyClause(
        "consistency",
        frozenset((s.id, t.id)),
        selected=(s.values ^ t.values) & theory.features,
        unselected=bit,
        chosen=same,
        unchosen=(move.id,),
    )


class _Graph:
    """The policy graph of a consistent choice: one node a valuation, its rule that of the first state in it."""

    def __init__(self, theory: Theory, selection: int, answered: list[tuple[Expanded, Move]]) -> None:
        self.theory, self.selection = theory, selection
        self.rules: dict[int, tuple[Expanded, Move]] = {}
        for state, move in answered:
            self.rules.setdefault(state.values & selection, (state, move))
        self.answered = answered
        self.expanded = {state.values & selection for state in theory.expanded}
        self.goals = {values & selection for values in theory.goals}
        self.frontier: dict[int, list[int]] = {}
        for values in theory.frontier:
            self.frontier.setdefault(values & selection, []).append(values)
        valuations = sorted(self.expanded | self.goals | set(self.frontier))
        self.outcomes = {
            valuation: [seen for seen in valuations if not theory.broken(state, move, seen) & selection]
            for valuation, (state, move) in self.rules.items()
        }

    def refute(self) -> list[LazyClause]:
        return self._unseen() or self._frontier() or self._loops() or self._trap()

    def _unseen(self) -> list[LazyClause]:
        if self.theory.unseen == "drop":
            return []
        valuations = {*self.expanded, *self.goals, *self.frontier}
        found: dict[LazyClause, None] = {}
        for valuation, (_, move) in self.rules.items():
            falling = move.dec & self.theory.numeric & self.selection
            for zeros in subsets(falling):
                outcome = ((valuation | move.inc) & ~move.dec | falling & ~zeros) & self.selection
                if outcome in valuations:
                    continue
                needed = hitting({outcome ^ seen for seen in valuations})
                for state, same in self.answered:
                    if state.values & self.selection == valuation:
                        clause = LazyClause("unseen", frozenset({state.id}), unselected=needed, unchosen=(same.id,))
                        found[clause] = None
            if len(found) >= _AT_A_TIME:
                break
        return list(found)[:_AT_A_TIME]

    def _frontier(self) -> list[LazyClause]:
        found: dict[LazyClause, None] = {}
        for valuation, outcomes in self.outcomes.items():
            for seen in outcomes:
                if seen in self.expanded or seen in self.goals:
                    continue
                for values in self.frontier[seen]:
                    others = {(x.values ^ values) & self.selection for x in self.theory.expanded}
                    needed = hitting(others | {(g ^ values) & self.selection for g in self.theory.goals})
                    for state, move in self.answered:
                        if state.values & self.selection == valuation:
                            found[self._forbid("frontier", [(state, move, values)], unselected=needed)] = None
            if len(found) >= _AT_A_TIME:
                break
        return list(found)[:_AT_A_TIME]

    def _forbid(
        self, kind: str, steps: Iterable[tuple[Expanded, Move, int]], selected: int = 0, unselected: int = 0
    ) -> LazyClause:
        """Forbid to make all steps and break none."""
        steps = list(steps)
        breaks = reduce(or_, (self.theory.broken(*step) for step in steps), selected)
        states = sorted({(state.id, move.id) for state, move, _ in steps})
        return LazyClause(
            kind,
            frozenset(state for state, _ in states),
            selected=breaks,
            unselected=unselected,
            unchosen=tuple(move for _, move in states),
        )

    def _edges(self) -> list[Edge[int]]:
        numeric = self.selection & self.theory.numeric
        return [
            Edge(valuation, seen, frozenset(bits(move.dec & numeric)), frozenset(bits(move.inc & numeric)))
            for valuation, (_, move) in self.rules.items()
            for seen in self.outcomes[valuation]
            if seen in self.rules
        ]

    def _loops(self) -> list[LazyClause]:
        demanded = self.theory.fairness
        if demanded == "strong-cyclic":
            return []
        strong = demanded == "strong"
        edges = self._edges()
        stuck = components(edges) if strong else [list(part) for part in sieve(edges).stuck]
        found: dict[LazyClause, None] = {}
        for part in stuck:
            loops = [loop for loop in short_loops(part) if strong or not sieve(loop).terminates] or [part]
            for loop in loops[:5]:
                steps = [(*self.rules[edge.source], self.rules[edge.target][0].values) for edge in loop]
                raised = reduce(or_, (move.inc for _, move, _ in steps))
                lowered = reduce(or_, (move.dec for _, move, _ in steps))
                cut = 0 if strong else lowered & ~raised & self.theory.numeric & self.theory.features
                found[self._forbid("acyclic" if strong else "termination", steps, selected=cut)] = None
        return list(found)

    def _trap(self) -> list[LazyClause]:
        """Find the nodes from which no path leads to a goal, or to a state the policy need not answer for."""
        back: dict[int, list[int]] = {}
        for valuation, outcomes in self.outcomes.items():
            for seen in outcomes:
                back.setdefault(seen, []).append(valuation)
        asked = {state.id for state, _ in self.answered}
        excused = {x.values & self.selection for x in self.theory.expanded if x.id not in asked}
        safe = self.goals | excused
        waiting = list(safe)
        while waiting:
            for valuation in back.get(waiting.pop(), ()):
                if valuation not in safe:
                    safe.add(valuation)
                    waiting.append(valuation)
        trapped = self.rules.keys() - safe
        if not trapped:
            return []
        inside = [(state, move) for state, move in self.answered if state.values & self.selection in trapped]
        everything = {*(x.values for x in self.theory.expanded), *self.theory.goals, *self.theory.frontier}
        outside = sorted(values for values in everything if values & self.selection not in trapped)
        needed = hitting({self.theory.broken(*step, values) & self.selection for step in inside for values in outside})
        trapping = frozenset(state.id for state, _ in inside)
        moves = tuple(sorted({move.id for _, move in inside}))
        return [LazyClause("trap", trapping, unselected=needed, unchosen=moves)]
