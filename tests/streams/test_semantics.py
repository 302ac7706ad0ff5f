"""The fast evaluator against first-order semantics written out, on random small structures."""

from itertools import product

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from gentamp_lp.errors import InputError
from gentamp_lp.streams.facts import FactBase
from gentamp_lp.streams.formula import And, Atom, Exists, Forall, Not, Or
from gentamp_lp.streams.language import from_gen_fn, from_test
from gentamp_lp.streams.pddl import Axiom, parse_domain
from gentamp_lp.streams.semantics import Program, Step, View, applicable, apply
from gentamp_lp.streams.stream_file import parse_streams

DOMAIN = parse_domain(
    """(define (domain d)
      (:predicates (p ?x) (q ?x) (r ?x ?y) (s ?x ?y) (t ?x ?y) (path ?x ?y) (lonely ?x) (e ?x))
      (:action move :parameters (?x ?y) :precondition (and (p ?x) (r ?x ?y) (not (p ?y)))
        :effect (and (p ?y) (not (p ?x)) (forall (?z) (when (s ?y ?z) (q ?z)))))
      (:derived (path ?x ?y) (or (r ?x ?y) (exists (?z) (and (r ?x ?z) (path ?z ?y)))))
      (:derived (lonely ?x) (and (e ?x) (not (exists (?y) (path ?x ?y))))))"""
)
STREAMS = parse_streams(
    "(define (stream d) (:stream t :inputs (?x ?y) :domain (and (e ?x) (e ?y)) :certified (t ?x ?y)))", DOMAIN
)
NAMES = ("a", "b", "c")
VARIABLES = ("?u", "?v", "?w")
PROGRAM = Program.of(DOMAIN)


def formulas():
    argument = st.sampled_from(VARIABLES + NAMES)
    unary = st.builds(lambda n, x: Atom(n, (x,)), st.sampled_from(["p", "q", "lonely"]), argument)
    binary = st.builds(
        lambda n, x, y: Atom(n, (x, y)), st.sampled_from(["r", "s", "t", "path", "="]), argument, argument
    )
    return st.recursive(
        unary | binary,
        lambda inner: st.one_of(
            st.builds(Not, inner),
            st.builds(lambda *parts: And(parts), inner, inner),
            st.builds(lambda *parts: Or(parts), inner, inner),
            st.builds(lambda v, f: Exists((v,), f), st.sampled_from(VARIABLES), inner),
            st.builds(lambda v, f: Forall((v,), f), st.sampled_from(VARIABLES), inner),
        ),
        max_leaves=5,
    )


def structures():
    pairs = st.frozensets(st.tuples(st.sampled_from(NAMES), st.sampled_from(NAMES)), max_size=5)
    ones = st.frozensets(st.sampled_from(NAMES))
    return st.tuples(ones, ones, pairs, pairs, pairs)


def build(structure):
    p, q, r, s, t = structure
    base = FactBase(DOMAIN, STREAMS, {"t": from_test(lambda x, y: (x, y) in t)}, {n: n for n in NAMES})
    for name in NAMES:
        base.add(("e", name))
    for row in sorted(r):
        base.add(("r", *row))
    for row in sorted(s):
        base.add(("s", *row))
    return base, frozenset({("p", x) for x in p} | {("q", x) for x in q})


def closure(r):
    reach = set(r)
    while True:
        more = {(x, w) for (x, y), (z, w) in product(reach, reach) if y == z} - reach
        if not more:
            return reach
        reach |= more


def brute(formula, structure, binding):
    p, q, r, s, t = structure
    path = closure(r)
    match formula:
        case Atom(name, args):
            values = tuple(binding.get(a, a) for a in args)
            if name == "=":
                return values[0] == values[1]
            if name == "lonely":
                return not any(x == values[0] for x, _ in path)
            table = {"p": {(x,) for x in p}, "q": {(x,) for x in q}, "r": r, "s": s, "t": t, "path": path}
            return values in table[name]
        case Not(body):
            return not brute(body, structure, binding)
        case And(parts):
            return all(brute(part, structure, binding) for part in parts)
        case Or(parts):
            return any(brute(part, structure, binding) for part in parts)
        case Exists((v,), body):
            return any(brute(body, structure, {**binding, v: n}) for n in NAMES)
        case Forall((v,), body):
            return all(brute(body, structure, {**binding, v: n}) for n in NAMES)


@settings(max_examples=1500, deadline=None)
@given(formulas(), structures())
def test_solutions_are_exactly_the_satisfying_bindings(formula, structure):
    base, state = build(structure)
    view = View(PROGRAM, base, state)
    free = sorted(formula.free)
    expected = {
        values
        for values in product(NAMES, repeat=len(free))
        if brute(formula, structure, dict(zip(free, values, strict=True)))
    }
    found = set()
    for solution in view.solutions(formula):
        choices = [[solution[v]] if v in solution else list(NAMES) for v in free]
        found |= set(product(*choices))
    assert found == expected
    for values in product(NAMES, repeat=len(free)):
        assert view.holds(formula, dict(zip(free, values, strict=True))) == (values in expected)


@settings(max_examples=200, deadline=None)
@given(structures())
def test_actions(structure):
    p, q, r, s, _ = structure
    base, state = build(structure)
    view = View(PROGRAM, base, state)
    steps = set(applicable(view))
    assert steps == {Step("move", (x, y)) for x, y in r if x in p and y not in p}
    for step in steps:
        x, y = step.args
        painted = q | {z for w, z in s if w == y}
        assert apply(view, step) == {("p", n) for n in (p - {x}) | {y}} | {("q", n) for n in painted}


def test_unstratified_axioms_are_refused():
    odd = Axiom(Atom("lonely", ("?x",)), Not(Atom("path", ("?x", "?x"))))
    loop = Axiom(Atom("path", ("?x", "?y")), Not(Atom("lonely", ("?x",))))
    with pytest.raises(InputError, match="its own negation"):
        Program.of(DOMAIN, [odd, loop])


def test_failed_draws_are_counted_but_make_nothing():
    domain = parse_domain("(define (domain d) (:predicates (a ?x) (b ?x ?y)))")
    streams = parse_streams(
        "(define (stream d) (:stream g :inputs (?x) :domain (a ?x) :outputs (?y) :certified (b ?x ?y)))",
        domain,
    )
    base = FactBase(domain, streams, {"g": from_gen_fn(lambda x: iter([None, (x + "!",)]))}, {"k": "k"})
    base.add(("a", "k"))
    (stream,) = streams
    assert base.draw(stream, ("k",)) is None
    assert base.draw(stream, ("k",)) == ("y1",)
    assert base.values["y1"] == "k!" and ("k", "y1") in base.relation("b")
    assert base.draw(stream, ("k",)) is None and base.exhausted(stream, ("k",))
    assert (base.statistics["g"].calls, base.statistics["g"].successes) == (3, 1)
