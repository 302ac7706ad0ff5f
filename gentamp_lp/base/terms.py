"""Ground terms and facts as text, in the syntax that Prolog and clingo share: the one reader of `name(arguments).`

A term is a number, a name, a quoted name or string, a compound `name(term, ...)`, or a tuple `(term, term)`. What is
read as text is written without blanks, so that equal terms are equal texts.
"""

from __future__ import annotations

import re
from collections import defaultdict
from collections.abc import Collection, Iterator
from pathlib import Path
from typing import NamedTuple

from gentamp_lp.errors import Diagnostic, InputError

Term = tuple[str, tuple["Term", ...]]
"""Name and arguments; a tuple has the name ``""``, and a string that stands alone is named by what it says."""

_STRING = r'"(?:[^"\\\n]|\\.)*"'
_NAME = r"_*[a-z]\w*|'(?:[^'\\\n]|\\.|'')*'"
_BLANK = re.compile(r"(?:%\*.*?\*%|%[^\n]*|\s+)*", re.DOTALL)
_TOKEN = re.compile(rf"({_NAME})|(-?\d+|{_STRING})|[(),.]")
_FLAT_TERM = rf"-?\d+|{_NAME}|{_STRING}"
_FLAT_TERMS = re.compile(_FLAT_TERM)
_FLAT_FACT = re.compile(rf"(_*[a-z]\w*)(?:\(\s*((?:{_FLAT_TERM})(?:\s*,\s*(?:{_FLAT_TERM}))*)\s*\))?\s*\.")
_HINT = "want facts like name(term, term). and comments, no rules or variables"


class Fact(NamedTuple):
    """A ground atom and where it stands; `args` are terms as text."""

    name: str
    args: tuple[str, ...]
    path: Path | str | None
    line: int

    def __str__(self) -> str:
        return f"{self.name}({','.join(self.args)})" if self.args else self.name

    def error(self, message: str, hint: str | None = None) -> InputError:
        """Return an error about this fact."""
        return InputError(Diagnostic(message, self.path, self.line, hint=hint))


def read_facts(text: str, path: Path | str | None = None) -> Iterator[Fact]:
    """Yield the facts of a text in order; an InputError names file and line of what is not a fact."""
    reader = _Reader(text)
    line = counted = 0
    reader.skip()
    while reader.at < len(text):
        line, counted = line + text.count("\n", counted, reader.at), reader.at
        flat = _FLAT_FACT.match(text, reader.at)
        if flat:
            name, args = flat[1], tuple(_FLAT_TERMS.findall(flat[2] or ""))
            reader.at = flat.end()
        else:
            try:
                name, parts = reader.fact()
            except ValueError as error:
                wrong = line + 1 + text.count("\n", counted, reader.blamed)
                raise InputError(Diagnostic(str(error), path, wrong, hint=_HINT)) from None
            args = tuple(map(write_term, parts))
        yield Fact(name, args, path, line + 1)
        reader.skip()


def read_pooled(text: str, names: Collection[str]) -> tuple[dict[str, list[tuple[str, str]]], str]:
    """Take the facts `name(N,M).` and `name(N,(M1;M2)).` of some names out of a text of many megabytes, by one scan.

    As in clingo, the second stands for `name(N,M1).` and `name(N,M2).`; its row is `("N", "M1;M2")`. Returns the rows
    by name, and the rest of the text, its lines as before and without comments, for `read_facts`.
    """
    rows: dict[str, list[tuple[str, str]]] = defaultdict(list)

    def take(match: re.Match[str]) -> str:
        rows[match[1]].append((match[2], match[3] or match[4]))
        return "\n" * match[0].count("\n")

    if "%" in text:
        text = re.sub(rf"({_STRING})|%\*.*?\*%|%[^\n]*", _without_comment, text, flags=re.DOTALL)
    fact = rf"\b({'|'.join(names)})\(\s*(\d+)\s*,\s*(?:\(([\d;\s]+)\)|(\d+))\s*\)\s*\."
    return rows, re.sub(fact, take, text)


def _without_comment(match: re.Match[str]) -> str:
    return match[1] or "\n" * match[0].count("\n")


def parse_term(text: str) -> Term:
    """Parse one term, e.g. the text of a formula, into (name, arguments), names without quotes.

    Raises ValueError for anything else.
    """
    reader = _Reader(text)
    reader.skip()
    term = reader.term()
    reader.expect("")
    return _unquoted(term)


def _unquoted(term: Term) -> Term:
    name, arguments = term
    return unquote(name), tuple(map(_unquoted, arguments))


def write_term(term: Term) -> str:
    """A term as text; its names must have the quotes that they need."""
    name, arguments = term
    return f"{name}({','.join(map(write_term, arguments))})" if arguments else name


def quote_atom(text: str | Path) -> str:
    """Write text as a Prolog atom."""
    return _quoted(str(text), "'")


def quote_string(text: str) -> str:
    """Write text as a string."""
    return _quoted(text, '"')


def _quoted(text: str, mark: str) -> str:
    escaped = text.replace("\\", "\\\\").replace(mark, f"\\{mark}").replace("\n", "\\n")
    return f"{mark}{escaped}{mark}"


def unquote(text: str) -> str:
    """What a quoted name or string says; other text as it is."""
    mark = text[:1]
    if mark not in ("'", '"'):
        return text
    return re.sub(rf"\\(.)|{mark}{mark}", lambda m: {"n": "\n"}.get(m[1], m[1]) if m[1] else mark, text[1:-1])


class _Reader:
    """Recursive descent. `at` is the place of the next token, and `blamed` that of the last mistake."""

    def __init__(self, text: str) -> None:
        self.text = text
        self.at = self.blamed = 0

    def skip(self) -> None:
        """Go on to what is neither blank nor comment."""
        blank = _BLANK.match(self.text, self.at)
        self.at = blank.end() if blank else self.at

    def token(self) -> re.Match[str] | None:
        """The next token, which must be one, or None at the end."""
        found = _TOKEN.match(self.text, self.at)
        if found is None and self.at < len(self.text):
            self.blamed = self.at
            raise ValueError(f"not a fact: `{self.text[self.at]}`")
        return found

    def move(self, token: re.Match[str]) -> str:
        """Go on to the token after this one, which is returned."""
        self.at = token.end()
        self.skip()
        return token[0]

    def wrong(self, wanted: str) -> ValueError:
        """An error about the next token; the end is blamed on what is before it."""
        token = self.token()
        self.blamed = self.at if token else len(self.text[: self.at].rstrip())
        return ValueError(f"expected {wanted}, found `{token[0] if token else 'the end'}`")

    def expect(self, mark: str) -> None:
        """Go on after a mark; an empty one is the end."""
        token = self.token()
        if (token[0] if token else "") != mark:
            raise self.wrong(f"`{mark or 'the end'}`")
        if token:
            self.move(token)

    def fact(self) -> Term:
        token = self.token()
        if token is None or token[1] is None or token[1].startswith("'"):
            self.blamed = self.at
            raise ValueError(f"not a fact: `{token[0] if token else 'the end'}`")
        term = self.term()
        self.expect(".")
        return term

    def term(self) -> Term:
        token = self.token()
        if token is None or token[0] in "),.":
            raise self.wrong("a term")
        if token[0] == "(":
            return "", self.arguments()
        name = self.move(token)
        following = self.token() if token[1] else None
        return name, self.arguments() if following and following[0] == "(" else ()

    def arguments(self) -> tuple[Term, ...]:
        self.expect("(")
        terms = [self.term()]
        while (token := self.token()) and token[0] == ",":
            self.move(token)
            terms.append(self.term())
        self.expect(")")
        return tuple(terms)
