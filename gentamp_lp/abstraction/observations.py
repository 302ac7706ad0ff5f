"""What was seen: states, transitions and feature values, read from facts into bit masks over the pool.

A feature is a bit; the qualitative valuation of a state (Boolean true, count above zero) is one integer, and
so are the features that a transition raises and those it lowers. Comparing two states over the whole pool is
then one exclusive or, whatever the size of the pool.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable, Mapping
from dataclasses import dataclass

import numpy as np

from gentamp_lp.base.bitsets import bits, pack
from gentamp_lp.base.terms import quote_string, read_facts, read_pooled, unquote
from gentamp_lp.errors import Diagnostic, InputError

_POOLED = ("pos", "inc", "dec")
_ARITY = {
    "state": 2, "initial": 1, "goal": 1, "transition": 3, "candidate": 1,
    "action": 2, "feature": 3, "size": 2,
}  # fmt: skip


@dataclass(frozen=True)
class PoolFeature:
    """A feature of the pool: its number, its cost, whether it counts (numeric) or holds (boolean), its length."""

    id: int
    cost: int
    kind: str
    size: int = 0


@dataclass(frozen=True)
class Transition:
    """A seen step, with the features it raises and lowers."""

    id: int
    source: int
    target: int
    inc: int
    dec: int


@dataclass(frozen=True)
class Observations:
    """The training data: bit i of every mask is `features[i]`."""

    features: tuple[PoolFeature, ...]
    numeric: int
    states: dict[int, int]
    initial: frozenset[int]
    goals: frozenset[int]
    transitions: dict[int, Transition]
    candidates: dict[int, tuple[int, ...]]
    schemas: dict[int, str]
    problems: dict[int, int]  # the problem in which each state was seen

    @property
    def frontier(self) -> list[int]:
        """States that were seen but neither expanded nor goals."""
        return [s for s in self.states if s not in self.goals and s not in self.candidates]

    def bit(self, feature: int) -> int:
        """Return the bit of a feature, given its number."""
        return next(i for i, known in enumerate(self.features) if known.id == feature)

    def ids(self, mask: int) -> list[int]:
        """Return the numbers of the features in a mask."""
        return [self.features[i].id for i in bits(mask)]

    def confused(self, features: int) -> tuple[int, int]:
        """Return a goal state and another that the features of a mask do not tell apart."""
        goals = {self.states[goal] & features: goal for goal in sorted(self.goals, reverse=True)}
        return next(
            (goals[values & features], state)
            for state, values in self.states.items()
            if state not in self.goals and values & features in goals
        )


def parse_observations(facts: str) -> Observations:
    """Read the facts (predicates in `asp/reference/defined.lp`); an InputError names the line at fault."""
    rows = _rows(facts)
    sizes = {int(f): int(size) for f, size in rows["size"]}
    features = sorted((_feature(row, sizes) for row in rows["feature"]), key=lambda f: f.id)
    place = {feature.id: i for i, feature in enumerate(features)}
    if len(place) < len(features):
        raise InputError(Diagnostic("two feature/3 facts have the same number"))
    states = {int(s): 0 for s, _ in rows["state"]}
    transitions = {int(t): (int(s), int(s2)) for t, s, s2 in rows["transition"]}
    positive = _masks(rows["pos"], place, states, "pos", "state")
    inc = _masks(rows["inc"], place, transitions, "inc", "transition")
    dec = _masks(rows["dec"], place, transitions, "dec", "transition")
    observations = Observations(
        features=tuple(features),
        numeric=sum(1 << i for i, f in enumerate(features) if f.kind == "numeric"),
        states={s: positive[s] for s in sorted(states)},
        initial=_marked(rows["initial"], states, "initial", "state"),
        goals=_marked(rows["goal"], states, "goal", "state"),
        transitions={t: Transition(t, *ends, inc=inc[t], dec=dec[t]) for t, ends in sorted(transitions.items())},
        candidates=_candidates(_marked(rows["candidate"], transitions, "candidate", "transition"), transitions),
        schemas={int(t): unquote(name) for t, name in rows["action"]},
        problems={int(s): int(problem) for s, problem in rows["state"]},
    )
    _check(observations)
    return observations


def observation_facts(observations: Observations, features: int) -> str:
    """Return the facts of which `parse_observations` makes this observations, of the features in a mask only."""
    known = {i: observations.features[i] for i in bits(features)}
    lines = [f"feature({f.id},{f.cost},{f.kind}). size({f.id},{f.size})." for f in known.values()]
    for state, values in observations.states.items():
        lines.append(f"state({state},{observations.problems[state]}).")
        lines += [f"pos({known[i].id},{state})." for i in bits(values & features)]
    lines += [f"initial({state})." for state in sorted(observations.initial)]
    lines += [f"goal({state})." for state in sorted(observations.goals)]
    for t in observations.transitions.values():
        lines.append(f"transition({t.id},{t.source},{t.target}).")
        lines += [f"inc({known[i].id},{t.id})." for i in bits(t.inc & features)]
        lines += [f"dec({known[i].id},{t.id})." for i in bits(t.dec & features)]
    lines += [f"candidate({t})." for numbers in observations.candidates.values() for t in numbers]
    lines += [f"action({t},{quote_string(schema)})." for t, schema in observations.schemas.items()]
    return "\n".join(lines) + "\n"


def _rows(facts: str) -> dict[str, list[tuple[str, ...]]]:
    """Split the text into argument rows; those of pos, inc and dec, which are many, are as `read_pooled` says."""
    pooled, rest = read_pooled(facts, _POOLED)
    rows: dict[str, list[tuple[str, ...]]] = defaultdict(list)
    for name in _POOLED:
        rows[name] += pooled[name]
    for fact in read_facts(rest):
        name, arguments = fact.name, fact.args
        numbers = arguments[: 1 if name in ("feature", "action") else None]
        if _ARITY.get(name) != len(arguments) or not all(map(str.isdigit, numbers)):
            known = ", ".join(f"{name}/{arity}" for name, arity in sorted(_ARITY.items()))
            raise fact.error(f"not a fact of the training data: {fact}", f"known: {known}")
        rows[name].append(arguments)
    return rows


def _feature(row: tuple[str, ...], sizes: Mapping[int, int]) -> PoolFeature:
    number, cost, kind = row
    if kind not in ("boolean", "numeric") or not cost.isdigit():
        raise InputError(Diagnostic(f"feature({number}, {cost}, {kind}): want a cost and boolean or numeric"))
    return PoolFeature(int(number), int(cost), kind, sizes.get(int(number), 0))


def _masks(
    rows: Iterable[tuple[str, ...]], place: dict[int, int], known: Iterable[int], name: str, kind: str
) -> dict[int, int]:
    """For each known state or transition, the mask of the features that have a row with its number."""
    line = {number: index for index, number in enumerate(known)}
    table = np.zeros((len(line), len(place)), dtype=np.bool_)
    for feature, keys in rows:
        for key in map(int, keys.split(";")):
            if int(feature) not in place or key not in line:
                raise InputError(Diagnostic(f"{name}({feature}, {key}): no such feature or {kind}"))
            table[line[key], place[int(feature)]] = True
    return dict(zip(line, pack(table), strict=True))


def _marked(rows: Iterable[tuple[str, ...]], known: Iterable[int], name: str, kind: str) -> frozenset[int]:
    marked = frozenset(int(row[0]) for row in rows)
    for unknown in sorted(marked - set(known)):
        raise InputError(Diagnostic(f"{name}({unknown}): no such {kind}"))
    return marked


def _candidates(candidates: frozenset[int], transitions: dict[int, tuple[int, int]]) -> dict[int, tuple[int, ...]]:
    by_source: dict[int, list[int]] = defaultdict(list)
    for number in sorted(candidates):
        by_source[transitions[number][0]].append(number)
    return {source: tuple(numbers) for source, numbers in sorted(by_source.items())}


def _check(observations: Observations) -> None:
    """Refuse data that contradict themselves: everything learned from them would be worthless."""
    for t in observations.transitions.values():
        if t.source not in observations.states or t.target not in observations.states:
            raise InputError(Diagnostic(f"transition({t.id}, {t.source}, {t.target}): no such state"))
    for source, numbers in observations.candidates.items():
        if source in observations.goals:
            raise InputError(Diagnostic(f"candidate({numbers[0]}) leaves the goal state {source}"))
        for number in numbers:
            t = observations.transitions[number]
            before, after = observations.states[t.source], observations.states[t.target]
            boolean = ~observations.numeric
            wrong = (t.inc & t.dec) | (t.inc & ~after) | (t.dec & ~before)
            wrong |= boolean & ((t.inc & before) | (t.dec & after))
            wrong |= (before ^ after) & ~(t.inc | t.dec)
            if wrong:
                feature = observations.ids(wrong)[0]
                raise InputError(
                    Diagnostic(
                        f"transition {number} contradicts the values of feature {feature}",
                        hint="inc/dec of a candidate must agree with pos of its two states",
                    )
                )
