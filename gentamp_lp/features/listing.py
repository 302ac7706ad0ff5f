"""The feature pool of a task, for people: what is in it, what it says of a state, and where a formula stands in it."""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from gentamp_lp.base.documents import Document
from gentamp_lp.base.reading import read_text
from gentamp_lp.demonstrations.demonstrate import demonstrate
from gentamp_lp.errors import Diagnostic, InputError
from gentamp_lp.features.open_world import Openness
from gentamp_lp.features.pool import (
    Pool,
    PoolSession,
    Pruned,
    PruningEntry,
    Reading,
    check_grammars,
    split_formula,
)
from gentamp_lp.tasks.task import Task

Progress = Callable[[str], None]


@dataclass(frozen=True)
class ListedFeature:
    """A feature of the pool. `open` ones depend on what was sampled; `why` says what makes a Boolean one Boolean.

    `values` has the value in every state, `satisfying` the entities counted in the state that was asked for.
    """

    id: int
    cost: int
    kind: str
    why: str
    open: bool
    formula: str
    term: str
    values: list[int]
    satisfying: list[str] | None = None


@dataclass(frozen=True)
class ListedFormula:
    """A formula that was asked for: how it reads, what it is worth, and its match in the pool (`how` it matches)."""

    name: str
    given: str
    formula: str
    term: str
    cost: int
    open: bool
    values: list[int]
    match: int | None
    how: str
    satisfying: list[str] | None = None


@dataclass(frozen=True)
class Listing:
    """The answer of `gentamp-lp features`."""

    task: str
    complexity: int
    states: int
    transitions: int
    state: str | None
    features: list[ListedFeature]
    formulas: list[ListedFormula]
    pruning: tuple[Pruned, ...]
    statistics: dict[str, float | int] = field(default_factory=dict)

    def report(self) -> dict[str, Any]:
        """The JSON document of the command."""
        document = FeaturesReport.model_validate(
            {
                "task": self.task,
                "complexity": self.complexity,
                "states": self.states,
                "transitions": self.transitions,
                "state": self.state,
                "pool_size": self.statistics["features"],
                "seconds": round(self.statistics["seconds"], 3),
                "features": self.features,
                "formulas": self.formulas,
                "pruning": [{"level": row.level, "rule": row.rule, **row.counts} for row in self.pruning],
            }
        )
        return document.dump()


class FeaturesReport(Document):
    """What `features --json` prints."""

    task: str
    complexity: int
    states: int
    transitions: int
    state: str | None
    """the facts of the state that was asked for"""
    pool_size: int
    seconds: float
    features: list[ListedFeature]
    formulas: list[ListedFormula]
    pruning: list[PruningEntry]


def list_features(
    task: Task,
    *,
    complexity: int = 3,
    match: str | None = None,
    formulas: Sequence[str] = (),
    state: int | None = None,
    sizes: Sequence[str] = (),
    grammars: Sequence[Path] = (),
    around: bool = True,
    seed: int = 0,
    robot: str | None = None,
    time_limit: float = 600.0,
    cache: bool = True,
    progress: Progress = lambda _: None,
) -> Listing:
    """Build the pool of a task's demonstrations (of `sizes` instead of its training sizes, if given) and list it.

    `match` keeps the features whose text contains it (spaces and letter case aside); `formulas` are looked up, each
    written as in `logic/notation.pl`, optionally after `name =`; `state` is a state's number in the training data.
    Raises InputError for a formula, state or grammar that is wrong, LimitReached for time and memory.
    """
    grammars = task.grammars(grammars)
    check_grammars(grammars)
    data = demonstrate(
        task, sizes=sizes, seed=seed, robot=robot, around=around, time_limit=time_limit, cache=cache, progress=progress
    )
    if state is not None and not 0 <= state < len(data.states):
        raise InputError(Diagnostic(f"there is no state {state}", hint=f"states are 0 to {len(data.states) - 1}"))
    openness = Openness(task.folder.domain, task.folder.streams, data.sorts)
    with PoolSession(data.pool_facts(), grammars=grammars, time_limit=time_limit) as session:
        readings = [_read(session, text) for text in formulas]  # mistakes first, before the long work
        pool = session.deepen(complexity)
        readings = [(name, given, session.read(given)) for name, given, _ in readings]
        values = session.values()
        satisfying = session.satisfying(state) if state is not None else {}
    listed = [
        _feature(number, pool, openness, values[number], satisfying.get(number)) for number in sorted(pool.formulas)
    ]
    if match is not None:
        wanted = _squeeze(match)
        listed = [feature for feature in listed if wanted in _squeeze(feature.formula)]
    return Listing(
        task=task.name,
        complexity=complexity,
        states=len(data.states),
        transitions=len(data.transitions),
        state=None if state is None else data.describe(state, task.folder.domain.fluents),
        features=listed,
        formulas=[_formula(name, given, reading, openness, state) for name, given, reading in readings],
        pruning=pool.pruned,
        statistics=pool.statistics,
    )


def formula_file(path: Path) -> list[str]:
    """The formulas of a file, one a line as `name = formula`; `%` starts a comment."""
    return [text for line in read_text(path).splitlines() if (text := line.partition("%")[0].strip())]


def _read(session: PoolSession, text: str) -> tuple[str, str, Reading]:
    named = re.match(r"\s*([\w .-]+?)\s*=(?!>)\s*(.*)", text)
    name, given = (named[1], named[2]) if named else ("", text)
    try:
        return name, given, session.read(given)
    except InputError as error:
        first = error.diagnostics[0]
        column = f" (character {first.column})" if first.column else ""
        shown = given if len(given) <= 200 else f"{given[:200]}…"
        raise InputError(
            Diagnostic(f"formula `{shown}`: {first.message}{column}", hint="logic/notation.pl explains the notation")
        ) from None


def _feature(
    number: int, pool: Pool, openness: Openness, values: list[int], satisfying: list[str] | None
) -> ListedFeature:
    variable, sort, body = split_formula(pool.formulas[number])
    cost, kind = pool.kinds[number]
    why = "" if kind == "numeric" else "closed formula" if variable is None else "at most one, by the actions"
    is_open = openness.is_open(body, variable, sort)
    return ListedFeature(number, cost, kind, why, is_open, pool.texts[number], body, values, satisfying)


def _formula(name: str, given: str, reading: Reading, openness: Openness, state: int | None) -> ListedFormula:
    variable, sort, body = split_formula(reading.formula)
    return ListedFormula(
        name=name,
        given=given,
        formula=reading.text,
        term=body,
        cost=reading.cost,
        open=openness.is_open(body, variable, sort),
        values=reading.values,
        match=reading.match,
        how=reading.how,
        satisfying=reading.satisfying.get(state) if state is not None else None,
    )


def _squeeze(text: str) -> str:
    return re.sub(r"\s+", "", text).casefold()
