"""Reading `.lp` files that hold facts only, with the line of each fact."""

from __future__ import annotations

import re
from dataclasses import dataclass
from pathlib import Path

from gentamp_lp.errors import Diagnostic, InputError

_TOKEN = re.compile(r'(%\*.*?\*%|%[^\n]*|\s+)|("(?:[^"\\\n]|\\.)*"|-?\d+|_*[a-z]\w*)|([(),.])', re.DOTALL)


@dataclass(frozen=True)
class Fact:
    """A ground atom; arguments are terms as text, without blanks."""

    name: str
    args: tuple[str, ...]
    path: Path | str | None
    line: int

    def __str__(self) -> str:
        return f"{self.name}({','.join(self.args)})" if self.args else self.name

    def error(self, message: str, hint: str | None = None) -> InputError:
        """Return an error about this fact."""
        return InputError(Diagnostic(message, self.path, self.line, hint=hint))


def read_facts(text: str, path: Path | str | None = None) -> list[Fact]:
    """Return the facts of a text in order; an InputError names the line of what is not a fact."""
    return _Reader(text, path).read()


class _Reader:
    def __init__(self, text: str, path: Path | str | None) -> None:
        self.path = path
        self.tokens: list[tuple[str, int, bool]] = []  # text, line, whether it is punctuation
        self.position = 0
        line, at = 1, 0
        while at < len(text):
            match = _TOKEN.match(text, at)
            if match is None:
                raise self.error(f"not a fact: `{text[at]}`", line)
            blank, word, mark = match.groups()
            if blank is None:
                self.tokens.append((word or mark, line, word is None))
            line += match.group().count("\n")
            at = match.end()

    def error(self, message: str, line: int) -> InputError:
        hint = "a problem file holds facts like name(term, term). and comments, no rules or variables"
        return InputError(Diagnostic(message, self.path, line, hint=hint))

    def read(self) -> list[Fact]:
        facts = []
        while self.position < len(self.tokens):
            name, line, mark = self.tokens[self.position]
            if mark or not re.match("_*[a-z]", name):
                raise self.error(f"not a fact: `{name}`", line)
            self.position += 1
            args = self.arguments() if self.at("(") else ()
            self.expect(".", line)
            facts.append(Fact(name, args, self.path, line))
        return facts

    def at(self, mark: str) -> bool:
        return self.position < len(self.tokens) and self.tokens[self.position][::2] == (mark, True)

    def expect(self, mark: str, line: int) -> None:
        if not self.at(mark):
            found = self.tokens[self.position] if self.position < len(self.tokens) else ("the end", line, True)
            raise self.error(f"expected `{mark}`, found `{found[0]}`", found[1])
        self.position += 1

    def arguments(self) -> tuple[str, ...]:
        line = self.tokens[self.position][1]
        self.expect("(", line)
        args = [self.term(line)]
        while self.at(","):
            self.position += 1
            args.append(self.term(line))
        self.expect(")", line)
        return tuple(args)

    def term(self, line: int) -> str:
        if self.at("("):
            return f"({','.join(self.arguments())})"
        word, line, mark = self.tokens[self.position] if self.position < len(self.tokens) else ("the end", line, True)
        if mark:
            raise self.error(f"expected a term, found `{word}`", line)
        self.position += 1
        if self.at("(") and re.match("_*[a-z]", word):
            return f"{word}({','.join(self.arguments())})"
        return word
