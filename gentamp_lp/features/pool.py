"""The feature pool: drives the Prolog program in `logic/`."""

from __future__ import annotations

import re
import tempfile
import time
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

from pydantic import BaseModel, ConfigDict

from gentamp_lp.base.reading import read_text
from gentamp_lp.base.shipped import resource
from gentamp_lp.base.terms import Fact, quote_atom, read_facts, unquote
from gentamp_lp.errors import Diagnostic, InputError, SolverError
from gentamp_lp.solvers.prolog import PrologProcess, parse_diagnostics


@dataclass(frozen=True)
class Pruned:
    """What became of the candidates of one grammar rule on one level; `logic/generate.pl` explains the names.

    The rule `features` stands for the last step, from formulas to features.
    """

    level: str
    rule: str
    counts: dict[str, int]


class PruningEntry(BaseModel):
    """What became of the formulas that a rule made at a level: counts by reason, `new` for those that were kept."""

    model_config = ConfigDict(extra="allow", use_attribute_docstrings=True)
    __pydantic_extra__: dict[str, int]

    level: str
    rule: str


@dataclass(frozen=True)
class Pool:
    """Features up to some cost, one for each qualitative behaviour on the training data.

    `facts` are `feature/3`, `size/2`, `pos/2`, `inc/2` and `dec/2`, legal in Prolog and in ASP; `formulas` gives the
    term `formula/4` of each feature, `texts` how people read it, and `kinds` its cost and kind (boolean or numeric).
    """

    facts: str
    formulas: dict[int, str]
    texts: dict[int, str]
    kinds: dict[int, tuple[int, str]]
    size: int
    statistics: dict[str, float | int]
    pruned: tuple[Pruned, ...] = ()


@dataclass(frozen=True)
class Reading:
    """A feature that somebody wrote down, evaluated exactly and looked up in the pool.

    `formula` is the term `formula/4`, and `text` how people read it; `satisfying` has the entities counted in each
    state (nothing for a closed formula); `match` is the number of a feature of the pool, and `how` says in what sense
    (`pool_formula/1` in `logic/pool.pl`).
    """

    formula: str
    text: str
    cost: int
    values: list[int]
    satisfying: dict[int, list[str]]
    match: int | None
    how: str


class PoolSession:
    """The Prolog process that builds a pool: use it in a `with` block.

    `facts` are the training data (`Dataset.pool_facts`), `grammars` are added to the shipped grammar, and `time_limit`
    bounds the seconds spent in Prolog in total. Raises InputError for a grammar that is not usable, LimitReached when
    time or memory is up.
    """

    def __init__(self, facts: str, *, grammars: Sequence[Path] = (), time_limit: float | None = None) -> None:
        self._limit = time_limit
        self._spent = 0.0
        self._level = -1
        self._facts: list[str] = []
        self._formulas: dict[int, str] = {}
        self._texts: dict[int, str] = {}
        self._kinds: dict[int, tuple[int, str]] = {}
        self._prolog = PrologProcess()
        try:
            _load(self._prolog, grammars)
            with tempfile.TemporaryDirectory() as folder:
                data = Path(folder) / "facts.pl"
                data.write_text(facts, encoding="utf-8")
                self._ask(f"pool_open({quote_atom(data)})")
        except BaseException:
            self._prolog.__exit__()
            raise

    def __enter__(self) -> PoolSession:
        return self

    def __exit__(self, *_: object) -> None:
        self._prolog.__exit__()

    def _ask(self, goal: str) -> str:
        started = time.monotonic()
        try:
            return self._prolog.text(goal, None if self._limit is None else self._limit - self._spent)
        finally:
            self._spent += time.monotonic() - started

    def _ask_much(self, goal: str) -> str:
        """The same for goals that print hundreds of megabytes."""
        with tempfile.TemporaryDirectory() as folder:
            file = Path(folder) / "printed"
            self._ask(f"bridge:to_file({quote_atom(file)}, {goal})")
            return file.read_text(encoding="utf-8")

    def deepen(self, cost: int) -> Pool:
        """Return the pool of all features up to `cost`, building the levels that are missing.

        A feature has the same number in all pools of a session, and a deeper pool starts with the shallower one.
        """
        for level in range(self._level + 1, cost + 1):
            self._ask(f"pool_level({level})")
            self._facts.append(self._ask_much(f"pool_features({level})"))
            for number, kind, term, text in _fields(self._ask(f"pool_formulas({level})")):
                feature = int(number)
                self._formulas[feature], self._texts[feature] = term.rstrip("."), text
                self._kinds[feature] = level, kind
            self._level = level
        facts = list(read_facts(self._ask("pool_statistics")))
        statistics: dict[str, float | int] = {f.args[0]: int(f.args[1]) for f in facts if f.name == "stat"}
        statistics["seconds"] = self._spent
        return Pool(
            "".join(self._facts),
            dict(self._formulas),
            dict(self._texts),
            dict(self._kinds),
            len(self._formulas),
            statistics,
            _pruned(facts),
        )

    def values(self) -> dict[int, list[int]]:
        """Return the value of each feature in every state."""
        rows = "".join(self._ask(f"pool_values({level})") for level in range(self._level + 1))
        return {int(i): [int(v) for v in values.split()] for i, values in _fields(rows)}

    def satisfying(self, state: int) -> dict[int, list[str]]:
        """Return the entities that satisfy each feature that counts in a state."""
        return {int(i): entities.split() for i, entities in _fields(self._ask(f"pool_satisfying({state})"))}

    def read(self, text: str) -> Reading:
        """Read a formula as people write it, e.g. `exists y: On(x,y) & Tray(y)`; see `logic/notation.pl`.

        Raises InputError, with the column, for what is no formula over the predicates of the data.
        """
        rows = _fields(self._ask(f"pool_formula({quote_atom(text)})"))
        single = {row[0]: row[1] for row in rows if row[0] != "satisfying"}
        match, how = single["match"].split()
        return Reading(
            formula=single["formula"].rstrip("."),
            text=next(row[2] for row in rows if row[0] == "formula"),
            cost=int(single["cost"]),
            values=[int(v) for v in single["values"].split()],
            satisfying={int(row[1]): row[2].split() for row in rows if row[0] == "satisfying"},
            match=None if match == "none" else int(match),
            how=how,
        )


def _fields(rows: str) -> list[list[str]]:
    return [row.split("\t") for row in rows.splitlines()]


def split_formula(formula: str) -> tuple[str | None, str | None, str]:
    """Variable, sort and body of `formula(Id,Variable,Sort,Body)`; a closed formula has no variable."""
    _, variable, sort, body = formula.removeprefix("formula(").removesuffix(")").split(",", 3)
    return (None, None, body) if variable == "none" else (variable, unquote(sort), body)


def _pruned(facts: Iterable[Fact]) -> tuple[Pruned, ...]:
    rows: dict[tuple[str, str], dict[str, int]] = {}
    for fact in facts:
        if fact.name == "pruned":
            level, rule, what, number = fact.args
            rows.setdefault((level, rule), {})[what] = int(number)
    return tuple(Pruned(level, rule, counts) for (level, rule), counts in rows.items())


def generate_pool(facts: str, *, max_cost: int, grammars: Sequence[Path] = (), time_limit: float | None = None) -> Pool:
    """Generate all features up to `max_cost`; `grammars` are added to the shipped grammar."""
    with PoolSession(facts, grammars=grammars, time_limit=time_limit) as session:
        return session.deepen(max_cost)


def deepen(
    facts: str, *, costs: Sequence[int], grammars: Sequence[Path] = (), time_limit: float | None = None
) -> Iterator[Pool]:
    """Yield the pool for each of the ascending `costs`, working on one only when it is asked for."""
    with PoolSession(facts, grammars=grammars, time_limit=time_limit) as session:
        for cost in costs:
            yield session.deepen(cost)


def check_grammars(grammars: Sequence[Path]) -> None:
    """Raise `InputError` if the grammar files, added to the shipped grammar, are not usable."""
    with PrologProcess() as prolog:
        _load(prolog, grammars)


def _load(prolog: PrologProcess, grammars: Sequence[Path]) -> None:
    diagnostics = prolog.load(resource("logic", "pool.pl"))
    if not diagnostics:
        for path in grammars:
            read_text(path)
            if re.search(r"[\t\n]", str(path.absolute())):
                hint = "rename the file or the folder"
                raise InputError(
                    Diagnostic("Prolog reports no files with tabs or line ends in their names", path, hint=hint)
                )
        files = [resource("logic", "grammar.lp"), *(path.absolute() for path in grammars)]
        try:
            diagnostics = parse_diagnostics(prolog.text(f"pool_grammar([{', '.join(map(quote_atom, files))}])"))
        except SolverError as error:
            if not grammars:
                raise
            hint = "Prolog reads no terms that are nested many thousand deep"
            raise InputError(*(Diagnostic(f"not a grammar: {error}", path, hint=hint) for path in grammars)) from error
    if diagnostics:
        raise InputError(*diagnostics)
