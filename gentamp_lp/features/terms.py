"""Formulas of the pool as terms."""

from __future__ import annotations

import re

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
