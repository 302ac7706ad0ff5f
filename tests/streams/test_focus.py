"""Problems with too many possible stream calls: planned over those that matter to a coarse plan, or over all."""

import itertools
import re

import pytest
from helpers.tamp import line

from gentamp_lp.streams import And, Exists, Not, PDDLProblem, Result, downward, engine, from_fn, solve

WORKSHOP = """(define (domain workshop)
  (:predicates (Tool ?t) (Part ?p) (Jig ?p ?j) (Setup ?t ?p ?j ?s) (Stance ?s) (Way ?a ?w ?b) (At ?s) (Done ?t ?p)
    (Used ?s))
  (:action walk :parameters (?a ?w ?b) :precondition (and (Way ?a ?w ?b) (At ?a)) :effect (and (At ?b) (not (At ?a))))
  (:action work :parameters (?t ?p ?j ?s) :precondition (and (Setup ?t ?p ?j ?s) (At ?s) (not (Used ?s)))
    :effect (and (Done ?t ?p) (Used ?s))))"""
STREAMS = """(define (stream workshop)
  (:stream jig :inputs (?p) :domain (Part ?p) :outputs (?j) :certified (Jig ?p ?j))
  (:stream setup :inputs (?t ?p ?j) :domain (and (Tool ?t) (Jig ?p ?j)) :outputs (?s)
    :certified (and (Setup ?t ?p ?j ?s) (Stance ?s)))
  (:stream way :inputs (?a ?b) :domain (and (Stance ?a) (Stance ?b)) :outputs (?w) :certified (Way ?a ?w ?b)))"""


def workshop(goal: object, size: int, domain: str = WORKSHOP) -> tuple[Result, list[int]]:
    """Work with tools on parts from stances that ways connect, and how many calls were assumed in each search."""
    functions = {
        "jig": from_fn(lambda p: ((p, "jig"),)),
        "setup": from_fn(lambda t, p, j: ((t, *j),)),
        "way": from_fn(lambda a, b: ((a, "to", b),)),
    }
    init = [("Tool", f"t{i}") for i in range(size)] + [("Part", f"p{i}") for i in range(size)]
    problem = PDDLProblem(domain, {}, STREAMS, functions, [*init, ("Stance", "door"), ("At", "door")], goal)
    said: list[str] = []
    result = solve(problem, max_time=60, progress=said.append)
    return result, [int(n) for text in said for n in re.findall(r"(\d+) stream calls assumed", text)]


def follow(result: Result) -> set[tuple[str, str]]:
    """What was done; every step is checked."""
    assert result.plan is not None, str(result.report)
    at, done = "door", set()
    for name, args in result.plan:
        if name == "walk":
            assert args[0] == at and args[1] == (at, "to", args[2])
            at = args[2]
        else:
            tool, part, jig, stance = args
            assert at == stance == (tool, *jig) and jig == (part, "jig")
            done.add((tool, part))
    return done


def test_few_of_many_calls_are_assumed() -> None:
    """Of 20 000 ways between stances, a few hundred."""
    goal = And(("Done", "t3", "p5"), ("Done", "t5", "p5"), ("Done", "t3", "p1"))
    result, calls = workshop(goal, 12, WORKSHOP.replace(" (not (Used ?s))", ""))
    assert {("t3", "p5"), ("t5", "p5"), ("t3", "p1")} <= follow(result)
    assert max(calls) < 1000


def test_a_coarse_view_that_shows_no_plan_is_not_believed(monkeypatch: pytest.MonkeyPatch) -> None:
    """All stances look like one, which can be used once only."""
    monkeypatch.setattr(engine, "MANY_CALLS", 20)
    goal = And(("Done", "t1", "p1"), ("Done", "t0", "p1"), Exists(["?s"], And(("Used", "?s"), Not(("At", "?s")))))
    result, calls = workshop(goal, 3)
    assert {("t1", "p1"), ("t0", "p1")} <= follow(result) and len(calls) > 1
    assert len({action.args[3] for action in result.plan if action.name == "work"}) == 2


@pytest.mark.parametrize(("slack", "shadows"), [(2.5, 0), (5.0, 2)])
def test_continuous_scenes_in_focus(monkeypatch: pytest.MonkeyPatch, slack: float, shadows: int) -> None:
    monkeypatch.setattr(engine, "MANY_CALLS", 20)
    scene = line(4, slack=slack, shadows=shadows)
    result = solve(scene.problem(), max_time=60)
    assert result.plan is not None, str(result.report)
    scene.check([(action.name, action.args) for action in result.plan])


def test_a_problem_is_translated_once_however_often_it_is_searched(monkeypatch: pytest.MonkeyPatch) -> None:
    run, commands = downward._run, []
    monkeypatch.setattr(downward, "_run", lambda command, *more: (commands.append(command), run(command, *more))[1])
    monkeypatch.setattr(engine, "FIRST_SLICE", 1e-3)
    result = solve(line(2, slack=5).problem(), max_time=60)
    translations = sum("fast_downward.translate" in command for command in commands)
    assert result.plan and translations == result.report.iterations
    assert len(list(itertools.filterfalse(lambda c: "fast_downward.translate" in c, commands))) > 2 * translations
