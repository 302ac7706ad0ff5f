"""Terms and facts: what is written is read back, and mistakes have their line."""

from __future__ import annotations

import random

import pytest

from gentamp_lp.base.terms import (
    Term,
    parse_term,
    quote_atom,
    quote_string,
    read_facts,
    read_pooled,
    unquote,
    write_term,
)
from gentamp_lp.errors import InputError

NAMES = ["a", "on", "_x1", "17", "-3", "'is-o'", "'it\\'s (so), \\\\ \\n.'", '"x, (y). % \\"z\\""']


def draw(rng: random.Random, depth: int) -> Term:
    if depth and rng.random() < 0.6:
        name = rng.choice([*(n for n in NAMES if n[0] in "ao_'"), ""])
        return name, tuple(draw(rng, depth - 1) for _ in range(rng.randint(1, 3)))
    return rng.choice(NAMES), ()


def spread(rng: random.Random, text: str) -> str:
    """The same with blanks and comments in places where they mean nothing."""
    parts, quoted = [], ""
    for before, character in zip(" " + text, text, strict=False):
        if character in "'\"" and before != "\\" and quoted in ("", character):
            quoted = "" if quoted else character
        blank = rng.choice([" ", "\n", '% a(b). "\n', "%* two\n' lines *%"])
        parts.append(character + blank * (not quoted and character in "(,)"))
    return "".join(parts)


@pytest.mark.parametrize("seed", range(100))
def test_what_is_written_is_read_back(seed: int) -> None:
    rng = random.Random(seed)
    terms = [("f", tuple(draw(rng, 3) for _ in range(rng.randint(1, 3)))) for _ in range(10)]
    facts = list(read_facts("".join(spread(rng, write_term(term) + ".\n") for term in terms)))
    assert [(fact.name, fact.args) for fact in facts] == [(n, tuple(map(write_term, args))) for n, args in terms]


def test_lines_are_those_of_the_names() -> None:
    text = "a.\n% b.\nc(\n 1).  d(f(\n2\n)). %* *% e.\n\ng('x', \"%\")."
    assert [(str(fact), fact.line) for fact in read_facts(text)] == [
        ("a", 1), ("c(1)", 3), ("d(f(2))", 4), ("e", 6), ("g('x',\"%\")", 8),
    ]  # fmt: skip


@pytest.mark.parametrize(
    ("text", "line", "message"),
    [
        ("a.\n\nb(1,\n  ).", 4, "expected a term, found `)`"),
        ("a.\n%\nb(\n\n", 3, "expected a term, found `the end`"),
        ("a(f(1)\n 2).", 2, "expected `)`, found `2`"),
        ("a.\n'b'(1).", 2, "not a fact: `'b'`"),
        ("a(1;2).", 1, "not a fact: `;`"),
        ("a(\n[1]).", 2, "not a fact: `[`"),
        ('a("x\ny").', 1, 'not a fact: `"`'),
        ("a(B).", 1, "not a fact: `B`"),
    ],
)
def test_mistakes(text: str, line: int, message: str) -> None:
    with pytest.raises(InputError) as caught:
        list(read_facts(text, "t.lp"))
    [found] = caught.value.diagnostics
    assert (found.path, found.line, found.message) == ("t.lp", line, message)


@pytest.mark.parametrize("text", ["", "a(b", "a(b))", "a b", "a.", "a-b", "1(a)", "A"])
def test_no_terms(text: str) -> None:
    with pytest.raises(ValueError):
        parse_term(text)


def test_names_lose_their_quotes() -> None:
    assert parse_term("conj('is-o'(v1), on(v0,\n v1))") == (
        "conj", (("is-o", (("v1", ()),)), ("on", (("v0", ()), ("v1", ())))),
    )  # fmt: skip


@pytest.mark.parametrize("text", ["", "a", "it's", '"', "\\", "a\nb", "\\n", "''", '""'])
def test_quotes(text: str) -> None:
    for quoted in (quote_atom(text), quote_string(text)):
        assert unquote(quoted) == text
        assert parse_term(f"f({quoted})") == ("f", ((text, ()),))


def test_pooled_rows_are_taken_out_and_lines_stay() -> None:
    text = 'p(1,(2;\n4)). q(7, 8).  % p(9,9).\nr("% p(3,3)"). %* p(\n1,1). *% p(5,6). s.\np(a,1).'
    rows, rest = read_pooled(text, ("p", "q"))
    assert rows == {"p": [("1", "2;\n4"), ("5", "6")], "q": [("7", "8")]}
    assert [(str(fact), fact.line) for fact in read_facts(rest)] == [('r("% p(3,3)")', 3), ("s", 4), ("p(a,1)", 5)]
