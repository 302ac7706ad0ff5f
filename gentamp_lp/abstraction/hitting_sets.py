"""The small selections that every cheap enough abstraction contains.

Asked whether a deeper pool has a cheaper abstraction, clingo branches on one feature after the other, and learns from
each failure something about these few features only. Most of the question is a weighted hitting set: each pair of a
goal and another state, each cover and each move gives a set of features of which one must be selected. Listing the
hitting sets within the budget takes a moment, because the features that complete a partial selection are an
intersection of the sets it misses. What is listed goes to the program as facts (`asp/abstraction/kernels.lp`).
"""

from __future__ import annotations

from collections.abc import Iterator
from functools import reduce
from operator import and_

from gentamp_lp.abstraction.theory import Expanded, Move, Theory
from gentamp_lp.base.bitsets import bits, minimal

_DEMANDS = 2000  # at most; larger sets refute little


class _TooMany(Exception):
    """The effort is spent."""


def demands(theory: Theory) -> list[int]:
    """Return sets of features, the smallest: every abstraction selects one of each, whatever else it selects.

    They are the differences of goal states and others, the changes of moves without alternative, and the covers of
    pairs of states with one move each (see `asp/abstraction/goal.lp`, `moves.lp` and `covers.lp`).
    """
    sets = {(move.inc | move.dec) & theory.features for _, move in _single(theory)}
    sets.update(
        (goal ^ values) & theory.features
        for goal in theory.goals
        for values in (*(state.values for state in theory.expanded), *theory.frontier)
    )
    return minimal(sets.union(covers(theory)), _DEMANDS)


def covers(theory: Theory) -> dict[int, tuple[int, int]]:
    """Map each cover (see `asp/abstraction/covers.lp`) to a pair of states, for states with one candidate."""
    single = _single(theory)
    return {
        ((s.values ^ t.values) | (a.inc & b.inc) | (a.dec & b.dec)) & theory.features: (s.id, t.id)
        for i, (s, a) in enumerate(single)
        for t, b in single[:i]
    }


def _single(theory: Theory) -> list[tuple[Expanded, Move]]:
    return [(state, state.moves[0]) for state in theory.expanded if len(state.moves) == 1]


def kernels(theory: Theory, cheaper_than: int, deeper_than: int, most: int) -> list[int] | None:
    """Return selections (masks) such that every abstraction within the bounds contains one of them.

    The bounds: it costs less than `cheaper_than`, and one of its features costs more than `deeper_than`. Returns None
    when there are more than `most`, or more than a hundred times as many partial selections would have to be looked at.
    """
    search = _Search(theory, cheaper_than, deeper_than, 100 * most)
    found: list[int] = []
    try:
        for kernel in search.complete(demands(theory), theory.features, 0, cheaper_than - 1, deep=False):
            found.append(kernel)
            if len(found) > most:
                return None
    except _TooMany:
        return None
    return found


class _Search:
    def __init__(self, theory: Theory, cheaper_than: int, deeper_than: int, most: int) -> None:
        self.cost = [feature.cost for feature in theory.observations.features]
        self.deeper_than, self.left = deeper_than, most
        self.within = [0] * cheaper_than  # features that cost no more than the index
        for feature in bits(theory.features):
            for budget in range(self.cost[feature], cheaper_than):
                self.within[budget] |= 1 << feature
        self.deep = sum(1 << f for f in bits(theory.features) if self.cost[f] > deeper_than)
        self.cheapest = min((self.cost[f] for f in bits(theory.features)), default=1)

    def complete(self, missed: list[int], allowed: int, chosen: int, budget: int, *, deep: bool) -> Iterator[int]:
        """Yield the ways to complete `chosen` by features of `allowed` that hit all that is `missed`."""
        self.left -= 1
        if self.left < 0:
            raise _TooMany
        reserve = 0 if deep else self.deeper_than + 1  # what a deep feature will cost
        affordable = allowed & self.within[budget]
        if not missed and deep:
            yield chosen
        elif budget < reserve:
            return
        elif not missed or budget < reserve + self.cheapest or (deep and budget < 2 * self.cheapest):
            last = reduce(and_, missed, affordable if deep else affordable & self.deep)
            yield from (chosen | 1 << feature for feature in bits(last))
        else:
            narrowest = min((mask & affordable for mask in missed), key=int.bit_count)
            for feature in sorted(bits(narrowest), key=self.cost.__getitem__):
                bit = 1 << feature
                allowed &= ~bit  # the next ones need not consider it
                rest = [mask for mask in missed if not mask & bit]
                yield from self.complete(
                    rest, allowed, chosen | bit, budget - self.cost[feature], deep=deep or bool(bit & self.deep)
                )
