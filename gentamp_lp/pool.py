"""The feature pool: drives the Prolog program in `logic/` and writes its formulas for people."""

from __future__ import annotations

import re
import tempfile
import time
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from gentamp_lp.errors import InputError
from gentamp_lp.prolog import PrologProcess, parse_diagnostics, quote
from gentamp_lp.resources import resource


@dataclass(frozen=True)
class Pool:
    """Features up to some cost, one for each qualitative behaviour on the training data.

    `facts` are `feature/3`, `pos/2`, `inc/2` and `dec/2`, legal in Prolog and in ASP; `formulas` gives the
    text of `formula/4` for each feature.
    """

    facts: str
    formulas: dict[int, str]
    size: int
    statistics: dict[str, float | int]


def generate_pool(facts: str, *, max_cost: int, grammars: Sequence[Path] = (), time_limit: float | None = None) -> Pool:
    """Generate all features up to `max_cost`; `grammars` are added to the shipped grammar."""
    *_, pool = deepen(facts, costs=range(max_cost, max_cost + 1), grammars=grammars, time_limit=time_limit)
    return pool


def deepen(
    facts: str, *, costs: Sequence[int], grammars: Sequence[Path] = (), time_limit: float | None = None
) -> Iterator[Pool]:
    """Yield the pool for each of the ascending `costs`, working on one only when it is asked for.

    A feature has the same number in all of these pools, and a deeper pool starts with the shallower one.
    `time_limit` bounds the seconds spent generating in total.
    """
    spent = 0.0
    with PrologProcess() as prolog, tempfile.TemporaryDirectory() as folder:

        def ask(goal: str) -> str:
            nonlocal spent
            started = time.monotonic()
            try:
                return prolog.text(goal, None if time_limit is None else time_limit - spent)
            finally:
                spent += time.monotonic() - started

        _load(prolog, grammars)
        data = Path(folder) / "facts.pl"
        data.write_text(facts, encoding="utf-8")
        ask(f"pool_open({quote(data)})")
        done = -1
        text: list[str] = []
        formulas: dict[int, str] = {}
        for cost in costs:
            for level in range(done + 1, cost + 1):
                ask(f"pool_level({level})")
                text.append(ask(f"pool_features({level})"))
                formulas |= _numbered(ask(f"pool_formulas({level})"))
            done = cost
            statistics: dict[str, float | int] = {
                name: int(number) for name, number in re.findall(r"stat\((\w+),(\d+)\)", ask("pool_statistics"))
            }
            statistics["seconds"] = spent
            yield Pool("".join(text), dict(formulas), len(formulas), statistics)


def check_grammars(grammars: Sequence[Path]) -> None:
    """Raise `InputError` if the grammar files, added to the shipped grammar, are not usable."""
    with PrologProcess() as prolog:
        _load(prolog, grammars)


def _load(prolog: PrologProcess, grammars: Sequence[Path]) -> None:
    diagnostics = prolog.load(resource("logic", "pool.pl"))
    if not diagnostics:
        files = [resource("logic", "grammar.lp"), *(path.absolute() for path in grammars)]
        diagnostics = parse_diagnostics(prolog.text(f"pool_grammar([{', '.join(map(quote, files))}])"))
    if diagnostics:
        raise InputError(*diagnostics)


def _numbered(lines: str) -> dict[int, str]:
    formulas = [line.rstrip(".") for line in lines.splitlines()]
    return {int(formula[len("formula(") : formula.index(",")]): formula for formula in formulas}


Term = tuple[str, tuple["Term", ...]]

_TOKEN = re.compile(r"'(?:[^'\\]|\\.|'')*'|\w+|[(),]")


def parse_term(text: str) -> Term:
    """Parse a ground Prolog term without operators, e.g. the text of a formula, into (name, arguments)."""
    tokens = _TOKEN.findall(text)
    position = 0

    def term() -> Term:
        nonlocal position
        name = tokens[position].strip("'")
        position += 1
        arguments: list[Term] = []
        while position < len(tokens) and tokens[position] in (("(", ",") if arguments else ("(",)):
            position += 1
            arguments.append(term())
        if arguments:
            position += 1
        return name, tuple(arguments)

    return term()


_CONNECTIVES = {"conj": (" ∧ ", 3), "disj": (" ∨ ", 2), "implies": (" ⇒ ", 1)}
_NEGATION = 4
_QUANTIFIERS = {"some": "∃", "every": "∀"}


def describe(formula: str, display: Mapping[str, str]) -> str:
    """Write a formula (the text of `formula/4` or of its last argument) for people: `∃y On(x,y) ∧ Movable(y)`.

    `display` gives the spelling of predicates. The free variable is x; a quantifier reaches as far as it can.
    """
    term = parse_term(formula)
    if term[0] == "formula":
        term = term[1][3]

    def variable(name: str) -> str:
        letters = "xyzwuvrstpqabcdefghijklmno"
        number = int(name[1:])
        return letters[number] if number < len(letters) else name

    def write(term: Term, strength: int = 0) -> str:
        name, arguments = term
        if name in _CONNECTIVES:
            symbol, own = _CONNECTIVES[name]
            left, right = arguments
            before = f"({write(left)})" if _open_ended(left) else write(left, own + (name == "implies"))
            text = before + symbol + write(right, own)
            return f"({text})" if own < strength else text
        if name in _QUANTIFIERS:
            bound = []
            while term[0] == name:
                bound.append(variable(term[1][0][0]))
                term = term[1][2]
            return f"{_QUANTIFIERS[name]}{','.join(bound)} {write(term)}"
        if name == "neg":
            return "¬" + write(arguments[0], _NEGATION)
        if name == "closure":
            u, w, _, body, y, x = arguments
            pair = f"{variable(u[0])},{variable(w[0])}"
            return f"{{{pair} | {write(body)}}}⁺({variable(y[0])},{variable(x[0])})"
        if name == "true":
            return "⊤"
        spelling = display.get(name, name)
        return f"{spelling}({','.join(variable(a[0]) for a in arguments)})" if arguments else spelling

    return write(term)


def _open_ended(term: Term) -> bool:
    """Whether the text of a formula ends with the reach of a quantifier, so that nothing may follow it."""
    name, arguments = term
    return name in _QUANTIFIERS or (name in (*_CONNECTIVES, "neg") and _open_ended(arguments[-1]))
