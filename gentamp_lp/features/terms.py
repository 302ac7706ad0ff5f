"""Formulas of the pool as terms, and how people read them."""

from __future__ import annotations

import re
from collections.abc import Mapping

Term = tuple[str, tuple["Term", ...]]

_TOKEN = re.compile(r"'(?:[^'\\]|\\.|'')*'|\w+|[(),]")


def split_formula(text: str) -> tuple[str | None, str | None, str]:
    """Variable, sort and body of `formula(Id, Variable, Sort, Body)`; a closed formula has no variable."""
    found = re.fullmatch(r"formula\(\d+, *(\w+), *(\w+), *(.*)\)\.?", text)
    if found is None:
        raise AssertionError(f"not a formula of the pool: {text}")
    variable, sort, body = found.groups()
    return (None, None, body) if variable == "none" else (variable, sort, body)


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
