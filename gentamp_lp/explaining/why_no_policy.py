"""Why `learn` found no policy, in sentences that name states, steps and objects of the demonstrations."""

from __future__ import annotations

from collections.abc import Collection, Iterable
from itertools import pairwise

from gentamp_lp.abstraction.conflict import Attempt, NoPolicy
from gentamp_lp.base.fairness import LEVELS, Fairness
from gentamp_lp.demonstrations.dataset import Dataset
from gentamp_lp.explaining.why_selected import WORDS
from gentamp_lp.features.pool import Pool

_PAIRS = 3  # of states
_STATES = 6
_CHOICES = 3
_FEATURES = 3


def absence(
    failure: NoPolicy, data: Dataset, pool: Pool, complexity: int, fairness: Fairness, fluents: Collection[str]
) -> str:
    """The failure in terms of the states of `data` and the features of `pool`; `fluents` say where states differ."""
    if failure.pairs:
        lines, differ = _goals(failure, data, fluents)
    elif failure.states:
        lines, differ = _conflict(failure, data, pool, fluents)
    else:
        return str(failure)
    words = f"a word about {', '.join(sorted(differ))}" if differ else "a word that tells the states apart"
    remedies = [f"deeper features (--max-complexity {complexity + 1})", f"{words} (--grammar FILE)"]
    if any(attempt.kind in ("termination", "acyclic") and not attempt.idle for attempt in failure.attempts):
        remedies.append(f"a weaker fairness (--fairness {LEVELS[LEVELS.index(fairness) + 1]})")
    what = f"no {fairness} policy over the {pool.size} features up to complexity {complexity}: {lines[0]}"
    return "\n  ".join([what, *lines[1:], f"try: {'; '.join(remedies)}"])


def _goals(failure: NoPolicy, data: Dataset, fluents: Collection[str]) -> tuple[list[str], set[str]]:
    """The goal states that look like others, those first that differ least in facts of one problem."""

    def distance(pair: tuple[int, int]) -> tuple[bool, int]:
        first, second = (data.states[n] for n in pair)
        differ = set(first.facts) ^ set(second.facts)
        return first.problem != second.problem, sum(fact[0] in fluents for fact in differ)

    nearest = sorted(failure.pairs, key=distance)[:_PAIRS]
    contrasts = [data.contrast(*pair, fluents) for pair in nearest]
    lines = [f"{len(failure.pairs)} pair(s) of a goal state and another state look alike to each"]
    for (goal, other), (text, _) in zip(nearest, contrasts, strict=True):
        lines.append(f"{data.name(goal)}, {data.where(goal)}, looks like {data.name(other)}, {data.where(other)}")
        lines.append(f"  {text or 'they have the same number of facts of each predicate'}")
    if len(failure.pairs) > _PAIRS:
        lines.append(f"and {len(failure.pairs) - _PAIRS} more")
    return lines, set.union(*(names for _, names in contrasts))


def _conflict(failure: NoPolicy, data: Dataset, pool: Pool, fluents: Collection[str]) -> tuple[list[str], set[str]]:
    """The states that no policy answers for together, where they differ, and why each choice of steps fails."""
    states = failure.states[:_STATES]
    together = "this state" if len(failure.states) == 1 else f"these {len(failure.states)} states together"
    lines = [
        f"none answers for {together}"
        + ("" if failure.minimal else " (perhaps fewer would do: the time for that ended)")
    ]
    steps = {n: [t for t in data.transitions if t.demonstrated and t.source == n] for n in states}
    lines += [f"{data.name(n)}, {data.where(n)}: {' or '.join(map(str, steps[n]))} is done there" for n in states]
    if len(failure.states) > _STATES:
        lines.append(f"and {len(failure.states) - _STATES} more")
    alike = {clash.states for attempt in failure.attempts for clash in attempt.clashes if clash.alike}
    shown = sorted(alike)[:_PAIRS] or list(pairwise(states))[:_PAIRS]
    contrasts = [data.contrast(*pair, fluents) for pair in shown]
    for (first, second), (text, _) in zip(shown, contrasts, strict=True):
        same = "look alike to every feature" if (first, second) in alike else "differ"
        lines.append(f"states {first} and {second} {same}; {text or 'each predicate has as many facts in both'}")
    choices = failure.attempts[:_CHOICES]
    for attempt in choices:
        lines += _fails(attempt, data, pool, len(failure.attempts) > 1)
    if len(failure.attempts) > _CHOICES:
        lines.append("the other choices of steps fail as well")
    return lines, set().union(*(names for _, names in contrasts))


def _fails(attempt: Attempt, data: Dataset, pool: Pool, named: bool) -> Iterable[str]:
    """Why a choice of steps fails."""
    if named:
        yield f"with {', '.join(str(data.transitions[t]) for t in attempt.moves.values())}:"
    for clash in attempt.clashes[:_PAIRS]:
        features = [f"`{pool.texts[f]}`" for f in clash.barred[:_FEATURES]]
        more = f" and {len(clash.barred) - _FEATURES} more" if len(clash.barred) > _FEATURES else ""
        yield (
            f"the steps of states {clash.states[0]} and {clash.states[1]}, which look alike"
            f"{'' if clash.alike else ' to the rest'}, change some features differently, so none of these can be used: "
            f"{', '.join(features)}{more}"
        )
    if len(attempt.clashes) > _PAIRS:
        yield f"{len(attempt.clashes) - _PAIRS} more pairs of states rule out features"
    without = "with all other features" if attempt.clashes else "with all features"
    if attempt.idle:
        yield f"{without}, nothing is seen to change by the step of {_states(attempt.idle)}"
    elif attempt.kind == "goal":
        goal, other = attempt.states
        yield f"{without}, {data.name(goal)}, {data.where(goal)}, looks like {data.name(other)}, {data.where(other)}"
    elif attempt.kind:
        yield f"{without}, {WORDS[attempt.kind]}: {_states(attempt.states)}"


def _states(numbers: Collection[int]) -> str:
    return f"state{'s' * (len(numbers) > 1)} {', '.join(map(str, numbers))}"
