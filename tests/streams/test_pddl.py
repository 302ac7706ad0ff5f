"""The PDDL and stream parsers: what they accept, and how they complain."""

import pytest

from gentamp_lp.base.shipped import resource
from gentamp_lp.errors import InputError
from gentamp_lp.streams.formula import And, Atom, Exists, Not, normalize, to_pddl
from gentamp_lp.streams.pddl import parse_domain, parse_formula
from gentamp_lp.streams.sorts import infer_sorts
from gentamp_lp.streams.stream_file import parse_streams

FOLDER = resource("domains", "tabletop")
DOMAIN = parse_domain((FOLDER / "domain.pddl").read_text(), FOLDER / "domain.pddl")
STREAM_TEXT = (FOLDER / "stream.pddl").read_text()


def test_tabletop_is_read_completely():
    streams = parse_streams(STREAM_TEXT, DOMAIN)
    assert [a.name for a in DOMAIN.actions] == ["place", "pick", "carry", "move"]
    assert DOMAIN.fluents == {"handempty", "atpose", "atgrasp", "atbase"}
    assert DOMAIN.derived == {"holding", "on", "standsat", "unsafe", "blocked"}
    assert {s.name for s in streams if s.is_test} == {"test-cfree", "test-reach-cfree"}
    assert DOMAIN.predicates["atpose"].spelling == "AtPose"


def test_sorts_join_positions_that_share_a_variable_or_an_entity():
    streams = parse_streams(STREAM_TEXT, DOMAIN)
    sorts = infer_sorts(DOMAIN, streams)
    assert sorts["on"] == (sorts["movable"][0],) * 2
    assert sorts["atpose"] == sorts["stand"] == sorts["cfree"][:2]
    assert len({sorts["movable"][0], sorts["atpose"][1], sorts["grasp"][1], sorts["traj"][0]}) == 4
    assert sorts["red"] != sorts["movable"]  # nothing in the domain says that red things are objects
    assert infer_sorts(DOMAIN, streams, [("movable", "b"), ("red", "b")])["red"] == sorts["movable"]


@pytest.mark.parametrize(
    ("old", "new", "line", "words"),
    [
        (
            "(On ?o ?s) (exists (?p)",
            "(On ?o ?s) (exists (?q)",
            "(:derived (On",
            "variable `?p` is not declared",
        ),
        (
            "(AtPose ?o ?p) (HandEmpty) (not",
            "(AtPlace ?o ?p) (HandEmpty) (not",
            ":effect (and (AtPlace",
            "unknown predicate",
        ),
        (
            "(AtBase ?q) (AtPose ?o ?p) (Pose",
            "(AtBase ?q) (AtPose ?o) (Pose",
            "(AtPose ?o) (Pose",
            "takes 2 argument(s), not 1",
        ),
        (
            ":parameters (?o ?p ?s ?w ?g ?q ?t)",
            ":parameter (?o ?p ?s ?w ?g ?q ?t)",
            ":parameter (",
            "unsupported keyword",
        ),
        ("(Stackable ?o ?s) ", "(Stackable ?o - block ?s) ", "(Stackable ?o -", "unknown type `block`"),
    ],
)
def test_domain_mistakes_are_located(old, new, line, words):
    text = DOMAIN.text.replace(old, new, 1)
    assert text != DOMAIN.text
    with pytest.raises(InputError) as caught:
        parse_domain(text, FOLDER / "domain.pddl")
    (diagnostic,) = caught.value.diagnostics
    assert words in diagnostic.message
    expected = next(n for n, row in enumerate(text.splitlines(), 1) if line in row)
    assert diagnostic.line == expected


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("(define (domain d) (:predicates (P ?x))", "never closed"),
        ("(define (domain d)))", "without a matching"),
        ("(define (domain d) (:action a :effect))", "no value"),
        ("(define (domain d) (:action a :parameters ()))", "has no `:effect`"),
        ("(define (domain d) (:durative-action a))", "temporal planning is not supported"),
        ("(define (domain d) (:predicates (P)) (:action a :effect (increase (P) 1)))", "only `total-cost`"),
        (
            "(define (domain d) (:predicates (P)) (:derived (P) (and)) (:action a :effect (P)))",
            "also an effect",
        ),
        ("", "expected one"),
    ],
)
def test_broken_domains(text, words):
    with pytest.raises(InputError, match=words.replace("(", r"\(")):
        parse_domain(text)


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        (":certified (Grasp ?o ?g)", ":certified (Gripped ?o ?g)", "unknown predicate `Gripped`"),
        (
            ":inputs (?o) :domain (Movable ?o)",
            ":inputs (?o ?x) :domain (Movable ?o)",
            "occur in no `:domain` fact",
        ),
        (":certified (CFree ?o ?p ?o2 ?p2)", ":certified (On ?o ?o2)", "which actions or axioms change"),
        (":outputs (?g)", ":outputs (?o)", "as input and output"),
    ],
)
def test_stream_mistakes(old, new, words):
    text = STREAM_TEXT.replace(old, new, 1)
    assert text != STREAM_TEXT
    with pytest.raises(InputError) as caught:
        parse_streams(text, DOMAIN, FOLDER / "stream.pddl")
    assert words in caught.value.diagnostics[0].message
    assert caught.value.diagnostics[0].line


def test_goal_line_offset():
    with pytest.raises(InputError) as caught:
        parse_formula("(and (HandEmpty)\n (Nope ?o))", DOMAIN, path="t.yaml", line_offset=10)
    assert caught.value.diagnostics[0].line == 12


def test_normal_form_has_no_forall_and_unique_variables():
    formula = parse_formula("(forall (?o) (imply (Movable ?o) (exists (?o) (Tray ?o))))", DOMAIN)
    normal = normalize(formula)
    assert isinstance(normal, Not) and isinstance(normal.body, Exists)
    inner = normal.body.body
    assert isinstance(inner, And) and isinstance(inner.parts[0], Atom)
    assert len(set(normal.body.variables) | set(inner.parts[1].body.variables)) == 2
    assert parse_formula(to_pddl(formula), DOMAIN) == formula
