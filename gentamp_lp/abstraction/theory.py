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
from dataclasses import dataclass, field
from functools import reduce
from operator import or_

from gentamp_lp.abstraction.observations import Evidence
from gentamp_lp.base.bitsets import bits, hitting, minimal, subsets, transpose
from gentamp_lp.synthesis.sieve import Edge, components, short_loops, sieve

_AT_A_TIME = 60


@dataclass(frozen=True)
class Move:
    """A class of transitions: all that raise and lower the same features."""

    id: int
    inc: int
    dec: int


@dataclass(frozen=True)
class Expanded:
    """A class of expanded states: equal on the whole pool, with the same classes of candidate moves."""

    id: int
    values: int
    moves: tuple[Move, ...]


@dataclass(frozen=True)
class Lemma:
    """A clause: `unselected` or `selected` (masks), or a move of `unchosen` not chosen, or one of `chosen` is.

    It speaks only of policies that answer for all of `states`.
    """

    kind: str
    states: frozenset[int]
    selected: int = 0
    unselected: int = 0
    chosen: tuple[int, ...] = ()
    unchosen: tuple[int, ...] = ()


@dataclass(frozen=True)
class Theory:
    """The sample in classes; `features` is the mask of one cheapest feature of each class of features."""

    evidence: Evidence
    features: int
    numeric: int
    expanded: tuple[Expanded, ...]
    frontier: tuple[int, ...]
    goals: tuple[int, ...]
    fairness: str
    unseen: str
    home: dict[int, int] = field(repr=False)  # expanded state id -> id of its class

    def broken(self, state: Expanded, move: Move, values: int) -> int:
        """Return the features whose value in `values` cannot result from the move."""
        same = (state.values ^ values) & ~(move.inc | move.dec)
        return ((move.inc & ~values) | (move.dec & ~self.numeric & values) | same) & self.features

    def refute(self, selection: int, choice: dict[int, int]) -> list[Lemma]:
        """Return lemmas that the selection and the choice (state id -> move id) violate; none if it is right."""
        answered = [
            (state, next(move for move in state.moves if move.id == choice[state.id]))
            for state in self.expanded
            if state.id in choice
        ]
        lemmas = self._goal(selection) or self._consistency(selection, answered)
        return lemmas or _Graph(self, selection, answered).refute()

    def _goal(self, selection: int) -> list[Lemma]:
        looks: dict[int, list[int]] = {}
        for values in self.goals:
            looks.setdefault(values & selection, []).append(values)
        clauses = {
            (goal ^ values) & self.features
            for values in (*(state.values for state in self.expanded), *self.frontier)
            for goal in looks.get(values & selection, ())
        }
        return [Lemma("goal", frozenset(), selected=clause) for clause in minimal(clauses, _AT_A_TIME)]

    def _consistency(self, selection: int, answered: list[tuple[Expanded, Move]]) -> list[Lemma]:
        lemmas: dict[Lemma, None] = {}
        leaders: dict[int, tuple[Expanded, Move]] = {}
        for s, move in answered:
            t, other = leaders.setdefault(s.values & selection, (s, move))
            for bit in bits(((move.inc ^ other.inc) | (move.dec ^ other.dec)) & selection):
                lemmas[self._same(s, move, t, 1 << bit)] = None
                lemmas[self._same(t, other, s, 1 << bit)] = None
            if len(lemmas) >= _AT_A_TIME:
                break
        return list(lemmas)

    def _same(self, s: Expanded, move: Move, t: Expanded, bit: int) -> Lemma:
        same = tuple(m.id for m in t.moves if m.inc & bit == move.inc & bit and m.dec & bit == move.dec & bit)
        return Lemma(
            "consistency",
            frozenset((s.id, t.id)),
            selected=(s.values ^ t.values) & self.features,
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
        looks = sorted(self.expanded | self.goals | set(self.frontier))
        self.outcomes = {
            look: [seen for seen in looks if not theory.broken(state, move, seen) & selection]
            for look, (state, move) in self.rules.items()
        }

    def refute(self) -> list[Lemma]:
        return self._unseen() or self._frontier() or self._loops() or self._trap()

    def _unseen(self) -> list[Lemma]:
        if self.theory.unseen == "drop":
            return []
        looks = {*self.expanded, *self.goals, *self.frontier}
        lemmas: dict[Lemma, None] = {}
        for look, (_, move) in self.rules.items():
            falling = move.dec & self.theory.numeric & self.selection
            for zeros in subsets(falling):
                outcome = ((look | move.inc) & ~move.dec | falling & ~zeros) & self.selection
                if outcome in looks:
                    continue
                needed = hitting({outcome ^ seen for seen in looks})
                for state, same in self.answered:
                    if state.values & self.selection == look:
                        lemma = Lemma("unseen", frozenset({state.id}), unselected=needed, unchosen=(same.id,))
                        lemmas[lemma] = None
            if len(lemmas) >= _AT_A_TIME:
                break
        return list(lemmas)[:_AT_A_TIME]

    def _frontier(self) -> list[Lemma]:
        lemmas: dict[Lemma, None] = {}
        for look, outcomes in self.outcomes.items():
            for seen in outcomes:
                if seen in self.expanded or seen in self.goals:
                    continue
                for values in self.frontier[seen]:
                    others = {(x.values ^ values) & self.selection for x in self.theory.expanded}
                    needed = hitting(others | {(g ^ values) & self.selection for g in self.theory.goals})
                    for state, move in self.answered:
                        if state.values & self.selection == look:
                            lemmas[self._forbid("frontier", [(state, move, values)], unselected=needed)] = None
            if len(lemmas) >= _AT_A_TIME:
                break
        return list(lemmas)[:_AT_A_TIME]

    def _forbid(
        self, kind: str, steps: Iterable[tuple[Expanded, Move, int]], selected: int = 0, unselected: int = 0
    ) -> Lemma:
        """Forbid to make all steps and break none."""
        steps = list(steps)
        breaks = reduce(or_, (self.theory.broken(*step) for step in steps), selected)
        states = sorted({(state.id, move.id) for state, move, _ in steps})
        return Lemma(
            kind,
            frozenset(state for state, _ in states),
            selected=breaks,
            unselected=unselected,
            unchosen=tuple(move for _, move in states),
        )

    def _edges(self) -> list[Edge[int]]:
        numeric = self.selection & self.theory.numeric
        return [
            Edge(look, seen, frozenset(bits(move.dec & numeric)), frozenset(bits(move.inc & numeric)))
            for look, (_, move) in self.rules.items()
            for seen in self.outcomes[look]
            if seen in self.rules
        ]

    def _loops(self) -> list[Lemma]:
        demanded = self.theory.fairness
        if demanded == "strong-cyclic":
            return []
        strong = demanded == "strong"
        edges = self._edges()
        stuck = components(edges) if strong else [list(part) for part in sieve(edges).stuck]
        lemmas: dict[Lemma, None] = {}
        for part in stuck:
            loops = [loop for loop in short_loops(part) if strong or not sieve(loop).terminates] or [part]
            for loop in loops[:5]:
                steps = [(*self.rules[edge.source], self.rules[edge.target][0].values) for edge in loop]
                raised = reduce(or_, (move.inc for _, move, _ in steps))
                lowered = reduce(or_, (move.dec for _, move, _ in steps))
                cut = 0 if strong else lowered & ~raised & self.theory.numeric & self.theory.features
                lemmas[self._forbid("acyclic" if strong else "termination", steps, selected=cut)] = None
        return list(lemmas)

    def _trap(self) -> list[Lemma]:
        """Find the nodes from which no path leads to a goal, or to a state the policy need not answer for."""
        back: dict[int, list[int]] = {}
        for look, outcomes in self.outcomes.items():
            for seen in outcomes:
                back.setdefault(seen, []).append(look)
        asked = {state.id for state, _ in self.answered}
        excused = {x.values & self.selection for x in self.theory.expanded if x.id not in asked}
        safe = self.goals | excused
        waiting = list(safe)
        while waiting:
            for look in back.get(waiting.pop(), ()):
                if look not in safe:
                    safe.add(look)
                    waiting.append(look)
        trapped = self.rules.keys() - safe
        if not trapped:
            return []
        inside = [(state, move) for state, move in self.answered if state.values & self.selection in trapped]
        everything = {*(x.values for x in self.theory.expanded), *self.theory.goals, *self.theory.frontier}
        outside = sorted(values for values in everything if values & self.selection not in trapped)
        needed = hitting({self.theory.broken(*step, values) & self.selection for step in inside for values in outside})
        trapping = frozenset(state.id for state, _ in inside)
        moves = tuple(sorted({move.id for _, move in inside}))
        return [Lemma("trap", trapping, unselected=needed, unchosen=moves)]


def compress(evidence: Evidence, fairness: str, unseen: str = "drop") -> Theory:
    """Merge what no data tells apart; the answer is the same, the problem smaller."""
    moves = [evidence.transitions[t] for numbers in evidence.candidates.values() for t in numbers]
    width = len(evidence.features)
    columns = zip(
        transpose(list(evidence.states.values()), width),
        transpose([move.inc for move in moves], width),
        transpose([move.dec for move in moves], width),
        strict=True,
    )
    everywhere = (1 << len(evidence.states)) - 1
    best: dict[tuple[int, ...], tuple[int, int, int]] = {}
    for i, column in enumerate(columns):
        if column[0] in (0, everywhere) and not column[1] and not column[2]:
            continue  # it never tells anything
        key = (evidence.numeric >> i & 1, *column)
        rank = (evidence.features[i].cost, evidence.features[i].size, i)
        best[key] = min(best.get(key, rank), rank)
    features = sum(1 << i for *_, i in best.values())
    return _states(evidence, features, fairness, unseen)


def _states(evidence: Evidence, features: int, fairness: str, unseen: str) -> Theory:
    known: dict[tuple[int, frozenset[tuple[int, int]]], Expanded] = {}
    home: dict[int, int] = {}
    for number, candidates in evidence.candidates.items():
        values = evidence.states[number] & features
        classes: dict[tuple[int, int], Move] = {}
        for t in (evidence.transitions[candidate] for candidate in candidates):
            change = (t.inc & features, t.dec & features)
            classes.setdefault(change, Move(t.id, *change))
        key = (values, frozenset(classes))
        home[number] = known.setdefault(key, Expanded(number, values, tuple(classes.values()))).id
    looks = {state.values for state in known.values()}
    return Theory(
        evidence,
        features,
        evidence.numeric & features,
        tuple(known.values()),
        tuple(sorted({evidence.states[s] & features for s in evidence.frontier} - looks)),
        tuple(sorted({evidence.states[s] & features for s in evidence.goals})),
        fairness,
        unseen,
        home,
    )
