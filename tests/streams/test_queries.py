"""Compiled queries and watched extensions against the plain evaluator, on random formulas, changes and samples."""

from dataclasses import dataclass
from itertools import product

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from gentamp_lp.planning.feature_changes import Prospect, Watches
from gentamp_lp.streams.facts import FactBase
from gentamp_lp.streams.formula import And, Atom, Exists, Forall, Not, Or
from gentamp_lp.streams.language import from_gen_fn, from_test
from gentamp_lp.streams.pddl import Axiom, parse_domain
from gentamp_lp.streams.queries import Situation, unfold
from gentamp_lp.streams.semantics import Program, Step, View, applicable, apply
from gentamp_lp.streams.stream_file import parse_streams

DOMAIN = parse_domain(
    """(define (domain d)
      (:predicates (e ?x) (p ?x) (q ?x ?y) (r ?x ?y) (made ?x ?y) (t ?x ?y) (free ?x) (path ?x ?y) (two ?x))
      (:action go :parameters (?x ?y)
        :precondition (and (p ?x) (r ?x ?y) (not (p ?y)) (not (t ?y ?y)))
        :effect (and (p ?y) (not (p ?x)) (forall (?z) (when (and (r ?y ?z) (p ?z)) (q ?y ?z)))))
      (:action back :parameters (?x ?y) :precondition (q ?x ?y) :effect (and (p ?x) (not (q ?x ?y))))
      (:derived (free ?x) (and (e ?x) (not (exists (?y) (and (p ?y) (t ?x ?y))))))
      (:derived (path ?x ?y) (or (q ?x ?y) (exists (?z) (and (q ?x ?z) (path ?z ?y)))))
      (:derived (two ?x) (exists (?y) (and (made ?x ?y) (free ?y))))
      (:derived (two ?x) (p ?x)))"""
)
STREAMS = parse_streams(
    """(define (stream d)
      (:stream make :inputs (?x) :domain (r ?x ?x) :outputs (?y) :certified (and (made ?x ?y) (e ?y)))
      (:stream test :inputs (?x ?y) :domain (and (e ?x) (e ?y)) :certified (t ?x ?y)))""",
    DOMAIN,
)
NAMES = ("a", "b", "c")
VARIABLES = ("?u", "?v", "?w")
PROGRAM = Program.of(DOMAIN)


def formulas():
    argument = st.sampled_from((*VARIABLES, *VARIABLES, *NAMES))
    unary = st.builds(lambda n, x: Atom(n, (x,)), st.sampled_from(["e", "p", "free", "two"]), argument)
    binary = st.builds(
        lambda n, x, y: Atom(n, (x, y)), st.sampled_from(["q", "r", "made", "t", "path", "="]), argument, argument
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
        max_leaves=7,
    )


@dataclass
class Structure:
    base: FactBase
    state: frozenset


@st.composite
def structures(draw):
    pairs = st.frozensets(st.tuples(st.sampled_from(NAMES), st.sampled_from(NAMES)), max_size=6)
    bits = draw(st.integers(0, 2**12))

    def overlap(x, y):
        return bool(bits >> (sum(map(ord, x)) * 3 + sum(map(ord, y))) % 12 & 1)

    generators = {
        "make": from_gen_fn(lambda x: iter([(f"{x}{i}",) for i in range(2)])),
        "test": from_test(overlap),
    }
    base = FactBase(DOMAIN, STREAMS, generators, {n: n for n in NAMES})
    for name in NAMES:
        base.add(("e", name))
    for row in sorted(draw(pairs) | {("a", "a")}):
        base.add(("r", *row))
    fluents = {("p", x) for x in draw(st.frozensets(st.sampled_from(NAMES)))} | {("q", *row) for row in draw(pairs)}
    return Structure(base, frozenset(fluents))


def extension(structure, formula, variables, state):
    """By trying all entities."""
    view = View(PROGRAM, structure.base, state)
    rows = product(structure.base.values, repeat=len(variables))
    return {row for row in rows if view.holds(formula, dict(zip(variables, row, strict=True)))}


@settings(max_examples=150, deadline=None)
@given(formulas(), structures(), st.integers(0, 3))
def test_queries_find_what_views_find(formula, structure, bound):
    variables = tuple(sorted(formula.free))
    given_, wanted = variables[:bound], variables
    query = Situation(PROGRAM, structure.base, structure.state).query(formula, given_, wanted)
    expected = extension(structure, formula, variables, structure.state)
    for args in product(NAMES, repeat=len(given_)):
        right = {row for row in expected if row[: len(given_)] == args}
        assert set(query.solutions(args)) == right
        assert query.holds(args) == bool(right)


@settings(max_examples=150, deadline=None)
@given(st.lists(formulas(), min_size=1, max_size=3), structures(), st.lists(st.integers(0, 99), max_size=12))
def test_watched_extensions_follow_a_random_walk(bodies, structure, walk):
    """Actions, samples and steps back in any order; peeking foretells, and changes nothing."""
    axioms = [Axiom(Atom(f"w{i}", tuple(sorted(body.free))), body) for i, body in enumerate(bodies)]
    situation = Situation(PROGRAM, structure.base, structure.state)
    watches = Watches(situation, axioms)

    def expected(state):
        return {a.head.predicate: len(extension(structure, a.body, a.head.args, state)) for a in axioms}

    states, done = [structure.state], []
    for number in walk:
        steps = list(applicable(View(PROGRAM, structure.base, states[-1])))
        if number % 5 == 0:
            inputs = structure.base.inputs(STREAMS[0])
            structure.base.draw(STREAMS[0], inputs[number % len(inputs)])
        elif number % 5 == 1 and done:
            added, deleted = done.pop()
            states.pop()
            situation.change(deleted, added)
            watches.change(deleted, added)
        elif steps:
            step = steps[number % len(steps)]
            successor = apply(View(PROGRAM, structure.base, states[-1]), step)
            added, deleted = situation.effects(DOMAIN.action(step.schema), step.args)
            assert (states[-1] - set(deleted)) | set(added) == successor
            assert not set(added) & states[-1] and set(deleted) <= states[-1]
            prospects = [Prospect(), Prospect(), None]
            here, there = expected(states[-1]), expected(successor)
            for name, change in dict(watches.peek(added, deleted, prospects[0])).items():
                assert change.before == (here[name] > 0)
                assert change.sign == (there[name] > here[name]) - (there[name] < here[name])
                if number % 2:
                    assert change.after() == (there[name] > 0)
            assert watches.any_after(added, deleted, prospects[1]) == any(there.values())
            assert situation.state() == states[-1] and watches.counts() == here
            if number % 7 == 0:  # as the streams of a step do
                inputs = structure.base.inputs(STREAMS[0])
                structure.base.draw(STREAMS[0], inputs[number % len(inputs)])
            situation.change(added, deleted)
            watches.change(added, deleted, prospects[number % 3])
            states.append(successor)
            done.append((added, deleted))
        assert situation.state() == states[-1]
        counts = expected(states[-1])
        assert watches.any() == any(counts.values())
        assert watches.positive() == {name: count > 0 for name, count in counts.items()}
        assert watches.counts() == counts


def test_lazy_queries_draw_up_to_the_limit_and_remember():
    base = FactBase(
        DOMAIN,
        STREAMS,
        {"make": from_gen_fn(lambda x: iter([(1,), None, (2,), (3,)])), "test": from_test(lambda x, y: True)},
        {n: n for n in NAMES},
    )
    for fact in (("e", "a"), ("e", "b"), ("r", "a", "a"), ("r", "b", "b")):
        base.add(fact)
    limits = {"make": 3}

    def spent(stream, inputs):
        return base.exhausted(stream, inputs) or base.drawn(stream, inputs) >= limits[stream.name]

    situation = Situation(PROGRAM, base, frozenset({("p", "a")}), spent)
    formula = And((Atom("p", ("?x",)), Atom("made", ("?x", "?y"))))
    query = situation.query(formula, (), ("?x", "?y"), lazy=True)
    assert not list(situation.query(formula, (), ("?x",)).solutions())
    assert [base.values[y] for _, y in query.solutions()] == [1, 2]
    assert base.statistics["make"].calls == 3  # none for b, which the formula does not speak of
    assert [base.values[y] for _, y in query.solutions()] == [1, 2]
    limits["make"] = 9
    assert [base.values[y] for _, y in query.solutions()] == [1, 2, 3]


def test_newest_facts_come_first():
    base = FactBase(DOMAIN, STREAMS, {}, {n: n for n in NAMES})
    situation = Situation(PROGRAM, base, frozenset({("p", "a"), ("p", "c")}))
    query = situation.query(Atom("p", ("?x",)), (), ("?x",))
    situation.change([("p", "b")], [])
    assert list(query.solutions()) == [("b",), ("c",), ("a",)]


def test_what_is_undone_leaves_no_trace_in_the_order():
    base = FactBase(DOMAIN, STREAMS, {}, {n: n for n in NAMES})
    facts = [("p", "a"), ("p", "b"), ("p", "c")]
    situation = Situation(PROGRAM, base, frozenset(facts))
    query = situation.query(Atom("p", ("?x",)), (), ("?x",))
    first, stamp = list(query.solutions()), situation.stamp()
    changes = [([], facts[:2]), ([], [facts[2], facts[0]]), ([], facts)]
    for added, deleted in changes:
        for _ in range(2):
            situation.change(added, deleted)
            assert situation.stamp() != stamp
            situation.change(deleted, added)
            assert list(query.solutions()) == first and situation.stamp() == stamp
    situation.change([], facts[1:2])
    other = situation.stamp()
    situation.change([], facts[2:])
    situation.change(facts[1:2], [])  # not the last change: it comes as new
    assert list(query.solutions()) == [("b",), ("a",)]
    assert len({stamp, other, situation.stamp()}) == 3


@pytest.mark.parametrize("tested", [False, True])
def test_new_facts_of_known_entities_are_noticed(tested):
    """Also when they come between what was foreseen and the change."""
    base = FactBase(DOMAIN, STREAMS, {"test": from_test(lambda x, y: True)}, {n: n for n in NAMES})
    for name in NAMES:
        base.add(("e", name))
    body = And((Atom("made", ("?x", "?y")), Atom("t", ("?x", "?y")) if tested else Atom("e", ("?y",))))
    situation = Situation(PROGRAM, base, frozenset({("p", "a")}))
    watches = Watches(situation, [Axiom(Atom("w", ("?x", "?y")), body)])
    assert watches.counts() == {"w": 0} and not watches.any()
    base.add(("made", "a", "b"))
    assert watches.any() and watches.counts() == {"w": 1}
    added, deleted, prospect = [("p", "b")], [("p", "a")], Prospect()
    assert watches.any_after(added, deleted, prospect)
    base.add(("made", "b", "c"))
    situation.change(added, deleted)
    watches.change(added, deleted, prospect)
    assert watches.counts() == {"w": 2}


def test_unfolding_leaves_recursive_predicates_only():
    formula = Exists(("?y",), And((Atom("two", ("?y",)), Not(Atom("path", ("?x", "?y"))))))
    named = {a.predicate for a in _atoms(unfold(formula, PROGRAM))}
    assert named == {"made", "e", "p", "t", "path"}


def _atoms(formula):
    from gentamp_lp.streams.formula import atoms

    return list(atoms(formula))


@pytest.mark.parametrize("step", [Step("go", ("a", "b"))])
def test_effects_are_those_of_the_semantics(step):
    base = FactBase(DOMAIN, STREAMS, {"test": from_test(lambda x, y: False)}, {n: n for n in NAMES})
    for fact in (("e", "a"), ("e", "b"), ("e", "c"), ("r", "a", "b"), ("r", "b", "c")):
        base.add(fact)
    state = frozenset({("p", "a"), ("p", "c")})
    added, deleted = Situation(PROGRAM, base, state).effects(DOMAIN.action("go"), step.args)
    assert (sorted(added), deleted) == ([("p", "b"), ("q", "b", "c")], [("p", "a")])


@settings(max_examples=100, deadline=None)
@given(st.lists(formulas(), min_size=1, max_size=3), structures())
def test_what_moves_by_an_action_is_told_from_its_parameters(bodies, structure):
    """Every tuple that a step lets into an extension, or puts out, is one that its arguments name."""
    axioms = [Axiom(Atom(f"w{i}", tuple(sorted(body.free))), body) for i, body in enumerate(bodies)]
    watches = Watches(Situation(PROGRAM, structure.base, structure.state), axioms)
    view = View(PROGRAM, structure.base, structure.state)
    for axiom, body in zip(axioms, bodies, strict=True):
        before = extension(structure, body, axiom.head.args, structure.state)
        for step in applicable(view):
            after = extension(structure, body, axiom.head.args, apply(view, step))
            schema = DOMAIN.action(step.schema)
            binding = dict(zip(schema.parameters, step.args, strict=True))
            if before - after:
                assert view.holds(watches.puts_out(axiom.head.predicate, schema), binding)
            for entering, moved in ((True, after - before), (False, before - after)):
                rows = watches.moved_by(axiom.head.predicate, schema, entering)
                assert rows is None or moved <= {tuple(binding.get(a, a) for a in row) for row in rows}


def test_a_condition_calls_no_streams_in_a_lazy_query():
    base = FactBase(
        DOMAIN,
        STREAMS,
        {"make": from_gen_fn(lambda x: iter([(1,), (2,)])), "test": from_test(lambda x, y: True)},
        {n: n for n in NAMES},
    )
    for fact in (("e", "a"), ("e", "b"), ("r", "a", "a"), ("r", "b", "b")):
        base.add(fact)
    base.draw(STREAMS[0], ("b",))
    situation = Situation(PROGRAM, base, frozenset({("p", "a"), ("p", "b")}), base.exhausted)
    condition = situation.condition(Exists(("?y",), Atom("made", ("?x", "?y"))), ("?x",))
    query = situation.query(And((condition, Atom("p", ("?x",)))), (), ("?x",), lazy=True)
    assert list(query.solutions()) == [("b",)] and base.statistics["make"].calls == 1
