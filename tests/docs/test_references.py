"""The references that docs/hooks.py makes say something of every predicate that there is."""

import importlib.util
import re
from pathlib import Path

import pytest
from clingo import ast

from gentamp_lp.solvers.prolog import Prolog

ROOT = Path(__file__).parents[2]
FILES = sorted((ROOT / "asp").glob("*/*.lp"))


@pytest.fixture(scope="module")
def hooks():
    spec = importlib.util.spec_from_file_location("hooks", ROOT / "docs" / "hooks.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


class Atoms(ast.Transformer):
    """The predicates that occur in a term of the syntax."""

    def __init__(self, node):
        self.found = set()
        self.visit(node)

    def visit_SymbolicAtom(self, atom):
        while atom.symbol.ast_type is ast.ASTType.UnaryOperation:
            atom.symbol = atom.symbol.argument
        self.found.add((atom.symbol.name, len(atom.symbol.arguments)))
        return atom


def predicates(text):
    """The predicates that a program defines: rules' heads and declared inputs; and all that it reads."""
    defined, inputs, occurring = set(), set(), set()

    def collect(statement):
        if statement.ast_type is ast.ASTType.Rule:
            head = statement.head
            for element in getattr(head, "elements", None) or [head]:
                defined.update(Atoms(getattr(element, "literal", element)).found)
        if statement.ast_type is ast.ASTType.Defined:
            inputs.add((statement.name, statement.arity))
        elif statement.ast_type in (ast.ASTType.Rule, ast.ASTType.Minimize):
            occurring.update(Atoms(statement).found)

    ast.parse_string(text, collect)
    return defined, inputs, occurring - defined - inputs


def explained(hooks, path, *roles):
    """The signatures that the comment of a file explains."""
    names = [name for name, what, role in hooks.asp_predicates(path) if role in roles and what]
    found = set()
    ast.parse_string("".join(f"{name}.\n" for name in names), lambda s: found.update(Atoms(s).found))
    return found


@pytest.mark.parametrize("path", FILES, ids=lambda p: str(p.relative_to(ROOT)))
def test_asp_files_explain_their_predicates(hooks, path):
    """What a file defines and declares is explained there, nothing else is, and what it reads is named."""
    defined, inputs, read = predicates(path.read_text(encoding="utf-8"))
    assert explained(hooks, path, "Output", "Local") == defined
    assert explained(hooks, path, "Input") == inputs
    told = hooks.asp_comment(path)
    named = explained(hooks, path.parent / "defined.lp", "Input", "Output") if "defined.lp" in told else set()
    for name, arity in read - named:
        assert re.search(rf"\b{name}(/{arity}|\()" if arity else rf"\b{name}\b", told), f"{name}/{arity} is not named"


def test_a_predicate_that_nobody_explains_is_noticed(hooks, tmp_path):
    path = tmp_path / "new.lp"
    path.write_text(
        "%*\nPurpose: none.\nOutput:\n    a(X)   X is a\n*%\na(X) :- b(X), not c.\n{ d(X, Y) : e(Y) } :- a(X).\n"
    )
    assert explained(hooks, path, "Output") == {("a", 1)}
    defined, inputs, read = predicates(path.read_text())
    assert (defined, inputs, read) == ({("a", 1), ("d", 2)}, set(), {("b", 1), ("c", 0), ("e", 1)})


def test_the_page_lists_all_of_them(hooks):
    page = hooks.asp()
    for path in FILES:
        for name, what, role in hooks.asp_predicates(path):
            assert f"| `{name}` | {what} | {role.lower()}, `{path.name}` |" in page


def test_the_grammar_reference_has_every_clause_and_primitive(hooks):
    """All that logic/rules.pl accepts from a user's file, and all that the bodies of its clauses may call."""
    prolog = Prolog()
    assert not prolog.load(ROOT / "logic" / "pool.pl")
    clauses = prolog.text(
        "forall((clause(rules:accept(T,_,_,_), _), (T = (H :- _) -> true ; H = T), functor(H, N, A)),"
        " format('~w/~w~n', [N, A]))"
    )
    primitives = prolog.text("forall((engine:primitive(H), functor(H, N, A)), format('~w/~w~n', [N, A]))")
    page = hooks.grammar()
    head = page[: page.index("## `logic/")]
    assert len(set(clauses.split())) == 11 and len(primitives.split()) == 11
    for signature in {*clauses.split(), *primitives.split()}:
        name, arity = signature.split("/")
        arguments = r"(?:\"[^\"]+\"|[^(),]+(?:\([^()]*\))?)"
        assert re.search(rf"\b{name}\({arguments}(?:, *{arguments}){{{int(arity) - 1}}}\)", head), signature
    for name in (signature.split("/")[0] for signature in primitives.split()):
        assert f"**`{name}(" in page, f"{name} has no PlDoc comment"
