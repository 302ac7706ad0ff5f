"""Streams that feed themselves make ever more objects, among them those that a goal names."""

import time

import pytest

from gentamp_lp.streams import PDDLProblem, from_fn, solve

DOMAIN = """(define (domain numbers) (:requirements :strips)
  (:predicates (Num ?n) (Next ?n ?m) (Sum ?n ?m ?k) (At ?n))
  (:action go :parameters (?n ?m) :precondition (and (Next ?n ?m) (At ?n)) :effect (and (At ?m) (not (At ?n))))
  (:action add :parameters (?n ?m ?k) :precondition (and (Sum ?n ?m ?k) (At ?n))
    :effect (and (At ?k) (not (At ?n)))))"""
STREAMS = {
    "next": """(define (stream s) (:stream next :inputs (?n) :domain (Num ?n)
      :outputs (?m) :certified (and (Num ?m) (Next ?n ?m))))""",
    "plus": """(define (stream s) (:stream plus :inputs (?n ?m) :domain (and (Num ?n) (Num ?m))
      :outputs (?k) :certified (and (Num ?k) (Sum ?n ?m ?k))))""",
}
FUNCTIONS = {"next": lambda n: (n + 1,), "plus": lambda n, m: (n + m,)}


def problem(stream: str, goal: int) -> PDDLProblem:
    streams = {stream: from_fn(FUNCTIONS[stream])}
    return PDDLProblem(DOMAIN, {}, STREAMS[stream], streams, [("Num", 1), ("At", 1)], ("At", goal))


@pytest.mark.parametrize("algorithm", ["adaptive", "incremental"])
def test_a_goal_that_only_many_calls_in_a_row_can_name(algorithm: str) -> None:
    result = solve(problem("next", 9), algorithm, max_time=60)
    assert [action.args for action in result.plan] == [(n, n + 1) for n in range(1, 9)]


def test_more_calls_than_can_be_assumed_do_not_end_the_search() -> None:
    result = solve(problem("plus", 7), "adaptive", max_time=120)
    assert result.status == "solved", str(result.report)
    assert result.plan[-1].args[2] == 7


@pytest.mark.parametrize("algorithm", ["adaptive", "incremental"])
def test_the_time_limit_holds_while_inputs_are_listed(algorithm: str) -> None:
    """Pairs of sums of pairs of sums: soon there are millions of inputs."""
    start = time.monotonic()
    result = solve(problem("plus", 1001), algorithm, max_time=4)
    assert result.status == "time limit"
    assert time.monotonic() - start < 4 * 1.05 + 1
