"""Axioms over tests on sampled values, negated and nested: the cases that optimistic planning gets wrong elsewhere.

Blocks of width 1 stand at 0, 2, 4, ... on a line; positions beyond 10 are red. The letters are those of the cases that
PDDLStream's algorithms were measured on. Each plan is followed by a checker that knows only numbers.
"""

import random
from collections.abc import Callable

import pytest

from gentamp_lp.streams import ALGORITHMS, Not, PDDLProblem, from_gen_fn, from_list_fn, from_test, solve

DOMAIN = """(define (domain line)
  (:predicates (Block ?b) (Pose ?b ?p) (Red ?b ?p) (CFree ?b ?p ?b2 ?p2) (Collide ?b ?p ?b2 ?p2)
               (AtPose ?b ?p) (Holding ?b) (HandEmpty) (Done)
               (Unsafe ?b ?p) (AllRed) (NotAll) (Bad ?b) (Any) (SomePale) (Mixed))
  (:action pick :parameters (?b ?p)
    :precondition (and (Pose ?b ?p) (AtPose ?b ?p) (HandEmpty))
    :effect (and (Holding ?b) (not (AtPose ?b ?p)) (not (HandEmpty))))
  (:action place :parameters (?b ?p)
    :precondition (and (Pose ?b ?p) (Holding ?b) (not (Unsafe ?b ?p)))
    :effect (and (AtPose ?b ?p) (HandEmpty) (not (Holding ?b))))
  (:action finish :parameters () :precondition (and (HandEmpty) CONDITION) :effect (Done))
  (:derived (Unsafe ?b ?p) (exists (?b2 ?p2) (and (Pose ?b ?p) (Pose ?b2 ?p2) (AtPose ?b2 ?p2) COLLISION)))
  (:derived (AllRed) (forall (?b ?p) (imply (AtPose ?b ?p) (Red ?b ?p))))
  (:derived (NotAll) (exists (?b ?p) (and (AtPose ?b ?p) (not (Red ?b ?p)))))
  (:derived (Bad ?b) (exists (?p) (and (AtPose ?b ?p) (not (Red ?b ?p)))))
  (:derived (Any) (exists (?b) (Bad ?b)))
  (:derived (Mixed) (and (Any) (exists (?b ?p) (and (AtPose ?b ?p) (not (Bad ?b))))))
  (:derived (SomePale) (exists (?b ?p) (and (AtPose ?b ?p) (not (Red ?b ?p))))))"""

STREAMS = """(define (stream line)
  (:stream sample-pose :inputs (?b) :domain (Block ?b) :outputs (?p) :certified (Pose ?b ?p))
  (:stream t-red :inputs (?b ?p) :domain (Pose ?b ?p) :certified (Red ?b ?p))
  (:stream t-cfree :inputs (?b ?p ?b2 ?p2) :domain (and (Pose ?b ?p) (Pose ?b2 ?p2)) :certified (CFree ?b ?p ?b2 ?p2))
  (:stream t-collide :inputs (?b ?p ?b2 ?p2) :domain (and (Pose ?b ?p) (Pose ?b2 ?p2))
    :certified (Collide ?b ?p ?b2 ?p2)))"""

FREE, COLLIDE = "(not (CFree ?b ?p ?b2 ?p2))", "(Collide ?b ?p ?b2 ?p2)"
Positions = list[float]


def all_red(positions: Positions) -> bool:
    return all(p > 10 for p in positions)


def some_pale(positions: Positions) -> bool:
    return not all_red(positions)


def mixed(positions: Positions) -> bool:
    return any(p > 10 for p in positions) and any(p <= 10 for p in positions)


CASES: dict[str, tuple[str, str, Callable[[Positions], bool]]] = {
    "A": ("(AllRed)", FREE, all_red),
    "B": ("(not (NotAll))", FREE, all_red),
    "C": ("(not (Any))", FREE, all_red),
    "D": ("(AllRed) (not (Any))", FREE, all_red),
    "E": ("(not (NotAll))", COLLIDE, all_red),
    "F": ("(SomePale)", FREE, some_pale),
    "G": ("(forall (?b ?p) (imply (AtPose ?b ?p) (Red ?b ?p)))", FREE, all_red),
    "H": ("(AllRed)", COLLIDE, all_red),
    "both ways": ("(Mixed)", FREE, mixed),
    "denied twice": ("(not (Mixed)) (not (SomePale))", FREE, all_red),
    "a disjunction": ("(or (and (Any) (not (SomePale))) (not (exists (?b) (Bad ?b))))", COLLIDE, all_red),
}


def problem(case: str, seed: int, blocks: int = 2, first: float = 0.0) -> PDDLProblem:
    condition, collision, _ = CASES[case]
    rng = random.Random(seed)
    init: list[tuple[object, ...]] = [("HandEmpty",)]
    for i in range(blocks):
        b, p = f"b{i}", first + 2.0 * i
        init += [("Block", b), ("Pose", b, p), ("AtPose", b, p)]
    streams = {
        "sample-pose": from_gen_fn(lambda _: iter(lambda: (rng.uniform(0, 20),), None)),
        "t-red": from_test(lambda _, p: p > 10),
        "t-cfree": from_test(lambda a, p, b, q: a == b or abs(p - q) >= 1),
        "t-collide": from_test(lambda a, p, b, q: a != b and abs(p - q) < 1),
    }
    text = DOMAIN.replace("CONDITION", condition).replace("COLLISION", collision)
    return PDDLProblem(text, {}, STREAMS, streams, init, ("Done",))


def follow(case: str, plan: list, blocks: int, first: float) -> None:
    at = {f"b{i}": first + 2.0 * i for i in range(blocks)}
    held = None
    for name, args in plan:
        if name == "pick":
            assert held is None and at.pop(args[0]) == args[1]
            held = args[0]
        elif name == "place":
            assert held == args[0] and all(abs(args[1] - other) >= 1 for other in at.values())
            at[args[0]], held = args[1], None
        else:
            assert held is None and CASES[case][2](list(at.values()))
    assert plan[-1].name == "finish"


def solved(case: str, seed: int, algorithm: str, blocks: int = 2, first: float = 0.0) -> None:
    result = solve(problem(case, seed, blocks, first), algorithm, max_time=60, seed=seed)
    assert result.status == "solved", str(result.report)
    follow(case, result.plan, blocks, first)


@pytest.mark.parametrize("case", CASES)
def test_valid_plans(case: str) -> None:
    solved(case, 0, "adaptive")


@pytest.mark.parametrize("case", ["A", "C", "F", "H"])
def test_valid_plans_of_the_incremental_algorithm(case: str) -> None:
    solved(case, 0, "incremental")


@pytest.mark.slow
@pytest.mark.parametrize("algorithm", ALGORITHMS)
@pytest.mark.parametrize("case", CASES)
@pytest.mark.parametrize("first", [0.0, 12.0])
def test_valid_plans_on_every_seed(case: str, algorithm: str, first: float) -> None:
    for seed in range(8):
        solved(case, seed, algorithm, 3, first)


def test_a_condition_that_only_a_move_makes_true() -> None:
    """F where everything is red at first, so that one block has to go back; and the mixed case likewise."""
    solved("F", 0, "adaptive", first=12.0)
    solved("both ways", 0, "adaptive", first=12.0)


@pytest.mark.parametrize("algorithm", ALGORITHMS)
def test_no_plan_is_told_when_streams_are_exhausted(algorithm: str) -> None:
    for case in ("A", "C", "H"):
        task = problem(case, 0)
        task.stream_map["sample-pose"] = from_list_fn(lambda _: [(1.0,), (3.0,)])  # type: ignore[index]
        result = solve(task, algorithm, max_time=60)
        assert result == (None, float("inf"), result.certificate) and result.status == "no plan"


@pytest.mark.parametrize("algorithm", ALGORITHMS)
def test_a_negated_goal(algorithm: str) -> None:
    task = problem("A", 0)._replace(goal=("and", ("HandEmpty",), Not(("Any",))))
    result = solve(task, algorithm, max_time=60)
    assert result.status == "solved" and len(result.plan) == 4
    follow("A", [*result.plan, type(result.plan[0])("finish", ())], 2, 0.0)


@pytest.mark.parametrize("algorithm", ALGORITHMS)
def test_a_test_outside_its_conditions_fails(algorithm: str) -> None:
    """`Red` of what is no pose is false, so that the axioms that negate it are true there."""
    domain = """(define (domain d) (:predicates (Thing ?x) (Pose ?x) (Red ?x) (Pale ?x) (Done) (Any))
      (:action end :parameters (?x) :precondition (and (Thing ?x) CONDITION) :effect (Done))
      (:derived (Pale ?x) (and (Thing ?x) (not (Red ?x))))
      (:derived (Any) (exists (?x) (Pale ?x))))"""
    streams = "(define (stream s) (:stream t-red :inputs (?x) :domain (Pose ?x) :certified (Red ?x)))"

    def run(condition: str, init: list) -> str:
        text = domain.replace("CONDITION", condition)
        task = PDDLProblem(text, {}, streams, {"t-red": from_test(lambda _: True)}, init, ("Done",))
        return solve(task, algorithm, max_time=20).status

    assert run("(not (Any))", [("Thing", "a"), ("Pose", "a")]) == "solved"
    assert run("(not (Any))", [("Thing", "a")]) == "no plan"
    assert run("(Pale ?x)", [("Thing", "a")]) == "solved"
    assert run("(Pale ?x)", [("Thing", "a"), ("Pose", "a")]) == "no plan"
