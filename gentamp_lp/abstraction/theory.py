"""The training data in classes: what no feature tells apart is one, and of features that agree one is kept."""

from __future__ import annotations

from dataclasses import dataclass, field

from gentamp_lp.abstraction.observations import Observations
from gentamp_lp.base.bitsets import transpose


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
class Theory:
    """The training data in classes; `features` is the mask of one cheapest feature of each class of features."""

    observations: Observations
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


def compress(observations: Observations, fairness: str, unseen: str = "drop") -> Theory:
    """Merge what no data tells apart; the answer is the same, the problem smaller."""
    moves = [observations.transitions[t] for numbers in observations.candidates.values() for t in numbers]
    width = len(observations.features)
    columns = zip(
        transpose(list(observations.states.values()), width),
        transpose([move.inc for move in moves], width),
        transpose([move.dec for move in moves], width),
        strict=True,
    )
    everywhere = (1 << len(observations.states)) - 1
    best: dict[tuple[int, ...], tuple[int, int, int]] = {}
    for i, column in enumerate(columns):
        if column[0] in (0, everywhere) and not column[1] and not column[2]:
            continue  # it never tells anything
        key = (observations.numeric >> i & 1, *column)
        rank = (observations.features[i].cost, observations.features[i].size, i)
        best[key] = min(best.get(key, rank), rank)
    features = sum(1 << i for *_, i in best.values())
    return _states(observations, features, fairness, unseen)


def _states(observations: Observations, features: int, fairness: str, unseen: str) -> Theory:
    known: dict[tuple[int, frozenset[tuple[int, int]]], Expanded] = {}
    home: dict[int, int] = {}
    for number, candidates in observations.candidates.items():
        values = observations.states[number] & features
        classes: dict[tuple[int, int], Move] = {}
        for t in (observations.transitions[candidate] for candidate in candidates):
            change = (t.inc & features, t.dec & features)
            classes.setdefault(change, Move(t.id, *change))
        key = (values, frozenset(classes))
        home[number] = known.setdefault(key, Expanded(number, values, tuple(classes.values()))).id
    valuations = {state.values for state in known.values()}
    return Theory(
        observations,
        features,
        observations.numeric & features,
        tuple(known.values()),
        tuple(sorted({observations.states[s] & features for s in observations.frontier} - valuations)),
        tuple(sorted({observations.states[s] & features for s in observations.goals})),
        fairness,
        unseen,
        home,
    )
