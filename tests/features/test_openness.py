"""Which features a state decides."""

from __future__ import annotations

import pytest

from gentamp_lp.features.open_world import Openness
from gentamp_lp.learning.learn import Learned
from gentamp_lp.streams.pddl import parse_domain
from gentamp_lp.streams.stream_file import parse_streams


@pytest.fixture(scope="module")
def openness(load: Learned) -> Openness:
    sorts = {name: tuple(row) for name, row in load.dataset.predicates.items()}
    return Openness(load.task.folder.domain, load.task.folder.streams, sorts)


@pytest.mark.parametrize(
    ("formula", "sort"),
    [
        ("holding(v0)", "o"),
        ("handempty", None),
        ("neg(some(v1,o,on(v1,v0)))", "o"),
        ("some(v1,w,atpose(v0,v1))", "o"),
        ("some(v1,o,atpose(v1,v0))", "w"),
        ("some(v1,w,standsat(v0,v1))", "o"),
        ("every(v1,w,implies(atpose(v0,v1),unsafe(v0,v1)))", "o"),
        ("some(v1,w,conj(some(v2,o,atpose(v2,v1)),cfree(v0,v1,v0,v1)))", "o"),
        ("some(v1,o,closure(v2,v3,o,on(v2,v3),v0,v1))", "o"),
        ("some(v1,w,disj(atpose(v0,v1),fixed(v0,v1)))", "o"),
    ],
)
def test_closed(openness: Openness, formula: str, sort: str | None) -> None:
    assert not openness.is_open(formula, "v0" if sort else None, sort)


@pytest.mark.parametrize(
    ("formula", "sort"),
    [
        ("some(v1,o,unsafe(v1,v0))", "w"),
        ("some(v1,w,unsafe(v0,v1))", "o"),
        ("every(v1,w,unsafe(v0,v1))", "o"),
        ("neg(some(v1,o,atpose(v1,v0)))", "w"),
        ("some(v1,o,some(v2,o,pose(v1,v0,v2)))", "w"),
        ("blocked(v0)", "t"),
        ("some(v1,w,disj(atpose(v0,v1),unsafe(v0,v1)))", "o"),
        ("some(v1,o,closure(v2,v3,o,some(v4,w,pose(v2,v4,v3)),v0,v1))", "o"),
    ],
)
def test_open(openness: Openness, formula: str, sort: str) -> None:
    assert openness.is_open(formula, "v0", sort)


def test_derived_predicates_are_as_open_as_their_conditions() -> None:
    domain = parse_domain("""(define (domain d)
      (:predicates (thing ?x) (place ?x ?p) (at ?x ?p) (roomy ?x) (reach ?p ?q) (joined ?x ?y))
      (:action move :parameters (?x ?p ?q) :precondition (and (at ?x ?p) (place ?x ?q))
        :effect (and (at ?x ?q) (not (at ?x ?p))))
      (:derived (roomy ?x) (exists (?p) (place ?x ?p)))
      (:derived (joined ?x ?y) (or (exists (?p) (and (at ?x ?p) (at ?y ?p)))
                                   (exists (?z) (and (joined ?x ?z) (joined ?z ?y))))))""")
    streams = parse_streams(
        "(define (stream s) (:stream sample :inputs (?x) :domain (thing ?x) :outputs (?p) :certified (place ?x ?p)))",
        domain,
    )
    sorts = {"thing": ("x",), "place": ("x", "p"), "at": ("x", "p"), "roomy": ("x",), "joined": ("x", "x")}
    openness = Openness(domain, streams, sorts)
    assert openness.is_open("roomy(v0)", "v0", "x")
    assert not openness.is_open("some(v1,x,joined(v0,v1))", "v0", "x")
    assert openness.is_open("some(v1,x,conj(joined(v0,v1),roomy(v1)))", "v0", "x")
