"""Tests with `:fluents`: their outcome depends on the state, positively, negated, in axioms and in goals."""

import pytest

from gentamp_lp.errors import InputError
from gentamp_lp.streams import (
    ALGORITHMS,
    And,
    Exists,
    Forall,
    Imply,
    Not,
    PDDLProblem,
    Result,
    from_gen_fn,
    from_test,
    solve,
)

DOMAIN = """(define (domain boxes)
  (:predicates (Box ?b) (Lit ?b) (Spot ?b ?x) (Reach ?b ?x) (Open ?b) (Seen ?b) (Hidden ?b) (On ?b ?x)
    (AnyLit) (AllLit))
  (:action open :parameters (?b) :precondition (Box ?b) :effect (Open ?b))
  (:action shut :parameters (?b) :precondition (Box ?b) :effect (not (Open ?b)))
  (:action look :parameters (?b) :precondition (Lit ?b) :effect (Seen ?b))
  (:action hide :parameters (?b) :precondition (and (Box ?b) (not (Lit ?b))) :effect (Hidden ?b))
  (:action put :parameters (?b ?x) :precondition (and (Spot ?b ?x) (Reach ?b ?x)) :effect (On ?b ?x))
  (:derived (AnyLit) (exists (?b) (and (Box ?b) (Lit ?b))))
  (:derived (AllLit) (forall (?b) (imply (Box ?b) (Lit ?b)))))"""
STREAMS = """(define (stream boxes)
  (:stream lit :inputs (?b) :domain (Box ?b) :fluents (Open) :certified (Lit ?b))
  (:stream spot :inputs (?b) :domain (Box ?b) :outputs (?x) :certified (Spot ?b ?x))
  (:stream reach :inputs (?b ?x) :domain (Spot ?b ?x) :fluents (Open) :certified (Reach ?b ?x)))"""


def lit(box: str, fluents: list) -> bool:
    """A box is lit if it alone is open, or all are."""
    return ("open", box) in fluents and len(fluents) in (1, 3)


def reach(box: str, x: int, fluents: list) -> bool:
    """The more is open, the farther things have to be put, and their own box has to be open."""
    return ("open", box) in fluents and x > 2 * len(fluents)


def run(goal: object, algorithm: str, opened: str = "b") -> Result:
    def spots(box: str) -> object:
        return ((x,) for x in range(6))

    functions = {"lit": from_test(lit), "spot": from_gen_fn(spots), "reach": from_test(reach)}
    init = [*(("Box", b) for b in "abc"), *(("Open", b) for b in opened)]
    return solve(PDDLProblem(DOMAIN, {}, STREAMS, functions, init, goal), algorithm, max_time=20)


def follow(result: Result, opened: str = "b") -> tuple[list, set]:
    """What is open in the end, and what was achieved; every condition is checked."""
    assert result.plan is not None, str(result.report)
    fluents = [("open", b) for b in opened]
    done: set = set()
    for name, args in result.plan:
        is_lit = lit(args[0], fluents)
        match name:
            case "open":
                fluents = list(dict.fromkeys([*fluents, ("open", args[0])]))
            case "shut":
                fluents = [f for f in fluents if f != ("open", args[0])]
            case "look":
                assert is_lit
            case "hide":
                assert not is_lit
            case "put":
                assert reach(*args, fluents)
        done.add((name, *args))
    return [box for _, box in fluents], done


@pytest.mark.parametrize("algorithm", ALGORITHMS)
def test_a_test_of_the_state_in_preconditions(algorithm: str) -> None:
    assert ("look", "a") in follow(run(("Seen", "a"), algorithm))[1]
    assert {("look", "a"), ("hide", "a")} <= follow(run(And(("Seen", "a"), ("Hidden", "a")), algorithm, "a"), "a")[1]
    assert ("hide", "b") in follow(run(("Hidden", "b"), algorithm))[1]


@pytest.mark.parametrize("algorithm", ALGORITHMS)
def test_a_test_of_the_state_in_goals_and_axioms(algorithm: str) -> None:
    for goal, opened in [(("Lit", "c"), "b"), (("AnyLit",), "ab"), (Exists(["?b"], ("Lit", "?b")), "")]:
        now, _ = follow(run(goal, algorithm, opened), opened)
        assert any(lit(b, [("open", o) for o in now]) for b in "abc")
    for goal in (Not(("AnyLit",)), Forall(["?b"], Imply(("Box", "?b"), Not(("Lit", "?b"))))):
        now, _ = follow(run(goal, algorithm))
        assert len(now) in (0, 2)
    assert len(follow(run(("AllLit",), algorithm))[0]) == 3


@pytest.mark.parametrize("algorithm", ALGORITHMS)
def test_a_test_of_the_state_on_samples(algorithm: str) -> None:
    """Most samples are out of reach, in most states."""
    goal = And(Exists(["?x"], ("On", "a", "?x")), ("Open", "a"), ("Open", "b"))
    assert any(step[:2] == ("put", "a") and step[2] > 2 for step in follow(run(goal, algorithm))[1])


@pytest.mark.parametrize("algorithm", ALGORITHMS)
def test_what_no_state_makes_true_is_no_plan(algorithm: str) -> None:
    assert run(And(("Lit", "a"), Not(("Open", "a"))), algorithm).status == "no plan"
    assert run(And(("AllLit",), Not(("Lit", "b"))), algorithm).status == "no plan"


def test_its_facts_name_all_its_inputs() -> None:
    text = STREAMS.replace(":certified (Lit ?b)", ":certified (Box ?b)").replace("(?b) :domain (Box ?b) :fl", "(?b ?c) "
        ":domain (and (Box ?b) (Box ?c)) :fl")  # fmt: skip
    with pytest.raises(InputError, match=r"stream.pddl:2: .*leaves out an input"):
        solve(PDDLProblem(DOMAIN, {}, text, {}, [], ("Seen", "a")))
