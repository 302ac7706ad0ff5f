"""PDDL with oneof: what is read, and what is refused where."""

from pathlib import Path

import pytest

from gentamp_lp.errors import InputError
from gentamp_lp.synthesis import read_problem, synthesize
from gentamp_lp.synthesis.certificate import certificate, check
from gentamp_lp.synthesis.reading import parse_problem, read_sources

FILE = Path(__file__).parents[2] / "docs" / "examples" / "08-qnp" / "slippery.pddl"

DOMAIN = """(define (domain d) (:requirements :typing)
(:types car bike - vehicle) (:constants mine - car)
(:predicates (parked ?v - vehicle) (clean ?v - vehicle) (rain))
(:action wash :parameters (?v - vehicle) :precondition (parked ?v)
  :effect (when (not (rain)) (clean ?v)))
(:action drive :parameters (?v - car) :effect (oneof (parked ?v) (not (parked ?v)))))
"""
PROBLEM = "(define (problem p) (:domain d)\n(:objects yours - bike)\n(:init (parked yours))\n(:goal (clean mine)))"


def test_the_example_needs_fair_outcomes():
    problem = read_problem([FILE])
    found = synthesize(problem, minimize=True)
    assert found.fairness == "strong-cyclic" and found.optimal
    assert check(certificate(found, read_sources([FILE]))) == []
    assert synthesize(problem, fairness="strong").solvable is False
    assert not any("next" in name for name in problem.states)


def test_types_constants_and_conditions():
    problem = parse_problem([("problem.pddl", PROBLEM), ("domain.pddl", DOMAIN)])
    found = synthesize(problem, minimize=True)
    assert [(problem.states[state], choice.action) for state, choice in found.policy.items()] == [
        ("parked(yours)", "drive(mine)"),
        ("parked(mine), parked(yours)", "wash(mine)"),
    ]
    assert {choice.action for choice in problem.choices} == {"drive(mine)", "wash(mine)", "wash(yours)"}


def test_one_file_or_two():
    assert parse_problem([("both.pddl", DOMAIN + PROBLEM)]) == parse_problem([("d.pddl", DOMAIN), ("p.pddl", PROBLEM)])


@pytest.mark.parametrize(
    ("old", "new", "file", "line", "message"),
    [
        (":typing", ":typing :fluents", "d.pddl", 1, "the requirement `:fluents` is not supported"),
        ("(rain))\n", "(rain))\n(:derived (rain) (rain))\n", "d.pddl", 4, "`:derived` is not supported"),
        ("(parked ?v)\n", "(or (parked ?v))\n", "d.pddl", 4, "`or` is not supported here"),
        ("(oneof (parked ?v)", "(probabilistic 0.5 (parked ?v)", "d.pddl", 6, "unknown predicate `probabilistic`"),
        ("(oneof (parked ?v)", "(oneof (forall (?x) (parked ?x))", "d.pddl", 6, "`forall` is not supported here"),
        ("(clean ?v))", "(clean ?w))", "d.pddl", 5, "`?w` is not declared"),
        ("?v - car", "?v - boat", "d.pddl", 6, "unknown type `boat` of `?v`"),
        ("(oneof (parked ?v)", "(oneof (parked ?v ?v)", "d.pddl", 6, "`parked` takes 1 argument(s), not 2"),
        ("(parked yours)", "(parked his)", "p.pddl", 3, "`his` is not declared"),
        ("(parked yours)", "(not (parked yours))", "p.pddl", 3, "the initial state is a list of atoms"),
        ("(:goal (clean mine))", "(:metric minimize)", "p.pddl", 4, "`:metric` is not supported"),
        ("(:init (parked yours))", "", "p.pddl", 1, "the problem has no `:init`"),
        (PROBLEM, "", "d.pddl", None, "there is no problem"),
        (PROBLEM, DOMAIN, "p.pddl", 1, "a second domain"),
        ("(problem p)", "(plan p)", "p.pddl", 1, "expected `(define (domain"),
        ("(:goal (clean mine)))", "(:goal (clean mine))", "p.pddl", 1, "never closed"),
    ],
)
def test_what_is_refused(old, new, file, line, message):
    sources = [("d.pddl", DOMAIN.replace(old, new)), ("p.pddl", PROBLEM.replace(old, new))]
    with pytest.raises(InputError) as caught:
        parse_problem(sources)
    diagnostic = caught.value.diagnostics[0]
    assert message in diagnostic.message
    assert (diagnostic.path, diagnostic.line) == (file, line)


def test_formats_are_not_mixed():
    with pytest.raises(InputError, match="cannot tell the format"):
        parse_problem([("d.pddl", DOMAIN), ("p.lp", "state(a).")])
