"""Reading s-expressions (PDDL, stream files) with the line each list and symbol stands on."""

from __future__ import annotations

import re
from dataclasses import dataclass
from pathlib import Path

from gentamp_lp.errors import Diagnostic, InputError

MAX_DEPTH = 100
_TOKEN = re.compile(r"\s+|;[^\n]*|([()])|([^\s();]+)")


@dataclass(frozen=True)
class Symbol:
    """A word of the file, lower-cased (PDDL ignores case), with its original spelling and line."""

    name: str
    spelling: str
    line: int


@dataclass(frozen=True)
class Group:
    """A parenthesised list."""

    items: tuple[Symbol | Group, ...]
    line: int

    @property
    def head(self) -> str:
        """The first symbol's name, or "" when there is none."""
        first = self.items[0] if self.items else None
        return first.name if isinstance(first, Symbol) else ""


@dataclass
class Reader:
    """Takes the items of one file apart; every error names the file and the line."""

    path: Path | str | None

    def error(self, message: str, line: int | None, hint: str | None = None) -> InputError:
        """An error in this file, to be raised."""
        return InputError(Diagnostic(message, self.path, line, hint=hint))

    def group(self, item: Symbol | Group, what: str) -> Group:
        """The item, which must be a list; `what` is what it should be. Raises InputError."""
        if not isinstance(item, Group):
            raise self.error(f"expected {what}, found `{item.spelling}`", item.line)
        return item

    def symbol(self, item: Symbol | Group, what: str) -> Symbol:
        """The item, which must be a word; `what` is what it should be. Raises InputError."""
        if not isinstance(item, Symbol):
            raise self.error(f"expected {what}, found a list", item.line)
        return item


def read_groups(text: str, path: Path | str | None = None) -> list[Group]:
    """Parse `text` into its top-level lists.

    Raises InputError (with the line) for unbalanced parentheses or words outside any list.
    """
    stack: list[tuple[int, list[Symbol | Group]]] = []
    groups: list[Group] = []
    line = 1
    for match in _TOKEN.finditer(text):
        bracket, word = match.groups()
        if bracket == "(":
            if len(stack) == MAX_DEPTH:
                raise InputError(Diagnostic(f"lists are nested more than {MAX_DEPTH} deep", path, line))
            stack.append((line, []))
        elif bracket == ")":
            if not stack:
                raise InputError(Diagnostic("`)` without a matching `(`", path, line))
            start, items = stack.pop()
            group = Group(tuple(items), start)
            (stack[-1][1] if stack else groups).append(group)
        elif word:
            if not stack:
                raise InputError(Diagnostic(f"`{word}` stands outside any list", path, line))
            stack[-1][1].append(Symbol(word.lower(), word, line))
        line += match.group().count("\n")
    if stack:
        raise InputError(Diagnostic("this `(` is never closed", path, stack[-1][0]))
    return groups
