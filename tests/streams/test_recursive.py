"""Streams that feed themselves make ever more objects, among them those that a goal names."""

import pytest
from helpers.pace import at_most

from gentamp_lp.streams import And, Exists, PDDLProblem, from_fn, solve
from gentamp_lp.streams.pddl import parse_domain
from gentamp_lp.streams.stream_file import parse_streams
from gentamp_lp.streams.stream_graph import in_order

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
    with at_most(4 * 1.05, starts=100):
        result = solve(problem("plus", 1001), algorithm, max_time=4)
    assert result.status == "time limit"


def test_more_stream_calls_than_can_be_listed_are_no_time_limit() -> None:
    """320 numbers have 102 400 sums."""
    task = problem("plus", 10**6)
    result = solve(task._replace(init=[*task.init, *(("Num", n) for n in range(2, 322))]), max_time=60)
    assert result.status == "call limit" and result.plan is None
    assert "calls of `plus`" in result.reason and "`:domain`" in result.reason and "`incremental`" in result.reason


CYCLE = """(define (domain cycle) (:predicates (A ?x) (B ?x) (C ?x) (D ?x) (E ?x) (From ?x ?y) (At ?x) (Seen ?x))
  (:action go :parameters (?x ?y) :precondition (and (From ?x ?y) (At ?x)) :effect (and (At ?y) (not (At ?x)))))"""
LINKS = """(define (stream cycle)
  (:stream back :inputs (?x) :domain (E ?x) :outputs (?y) :certified (A ?y))
  (:stream de :inputs (?x) :domain (D ?x) :outputs (?y) :certified (and (E ?y) (From ?x ?y)))
  (:stream cd :inputs (?x) :domain (C ?x) :outputs (?y) :certified (and (D ?y) (From ?x ?y)))
  (:stream bc :inputs (?x) :domain (B ?x) :outputs (?y) :certified (and (C ?y) (From ?x ?y)))
  (:stream ab :inputs (?x) :domain (A ?x) :outputs (?y) :certified (and (B ?y) (From ?x ?y))))"""


@pytest.mark.parametrize("loop", [True, False])
def test_streams_are_assumed_after_those_that_feed_them(loop: bool) -> None:
    text = LINKS if loop else LINKS.replace("(A ?y)", "(Seen ?y)")
    streams = parse_streams(text, parse_domain(CYCLE))
    ordered, recursive = in_order(streams, parse_domain(CYCLE))
    assert recursive == loop
    assert [s.name for s in ordered] == (["back", "de", "cd", "bc", "ab"] if loop else ["ab", "bc", "cd", "de", "back"])


def test_streams_that_feed_themselves_are_unrolled_a_little_and_more_if_there_is_no_plan() -> None:
    goal = Exists(["?x"], And(("E", "?x"), ("At", "?x")))
    streams = {name: from_fn(lambda x: ((*x, "+"),)) for name in ("back", "de", "cd", "bc", "ab")}
    said: list[str] = []
    task = PDDLProblem(CYCLE, {}, LINKS, streams, [("A", ("a",)), ("At", ("a",))], goal)
    assert len(solve(task, max_time=20, progress=said.append).plan) == 4
    assert "no plan over 4 objects, 3 stream calls assumed" in said[0]
    assert "a plan of 4 steps" in said[2]


def test_types_feed_streams_that_take_their_supertypes() -> None:
    domain = parse_domain("(define (domain d) (:types cup - thing) (:predicates (Seen ?x)))")
    text = """(define (stream s)
      (:stream look :inputs (?x - thing) :outputs (?y) :certified (Seen ?y))
      (:stream make :inputs (?x) :domain (Seen ?x) :outputs (?y - cup) :certified (Seen ?y)))"""
    assert in_order(parse_streams(text, domain), domain)[1]
