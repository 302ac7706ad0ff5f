"""The shipped examples: what has a policy, how fast, and why the others have none."""

from pathlib import Path

import pytest
from helpers.pace import at_most
from helpers.problem_examples import detours, nested

from gentamp_lp.synthesis import read_problem, synthesize
from gentamp_lp.synthesis.certificate import certificate, check
from gentamp_lp.synthesis.explaining import explain
from gentamp_lp.synthesis.reading import parse_problem, read_sources

FOLDER = Path(__file__).parents[2] / "docs" / "examples" / "08-qnp"


@pytest.mark.parametrize(
    ("name", "level", "states", "choices"),
    [
        ("clear", "qnp", 2, 100),
        ("on", "qnp", 7, 100),
        ("gripper", "qnp", 10, 100),
        ("delivery", "qnp", 5, 100),
        ("nested-10", "qnp", 41, 10_000),
        ("swing", "strong-cyclic", 2, 100),
        ("unstack", "qnp", 3, 100),
        ("sort", "qnp", 8, 100),
        ("clutter", "strong-cyclic", 2, 100),
    ],
)
def test_a_minimal_policy_of_the_strongest_level(name, level, states, choices):
    file = FOLDER / f"{name}.lp"
    found = synthesize(read_problem([file]), minimize=True)
    assert (found.solvable, found.fairness, len(found.policy), found.optimal) == (True, level, states, True)
    assert found.statistics["choices"] < choices
    assert check(certificate(found, read_sources([file]))) == []


@pytest.mark.parametrize("depth", range(1, 11))
@pytest.mark.parametrize("everywhere", [False, True])
def test_nested_loops(depth, everywhere):
    sources = [("nested.lp", nested(depth, everywhere))]
    problem = parse_problem(sources)
    found = synthesize(problem, minimize=True, fairness="qnp")
    assert found.optimal and found.statistics["choices"] < 10_000
    if everywhere:
        assert len(problem.states) == 2 ** (depth + 1) and len(found.policy) == 2**depth
    assert check(certificate(found, sources)) == []


def test_the_shipped_files_are_what_the_generators_make():
    assert (FOLDER / "nested-10.lp").read_text() == nested(10)
    assert (FOLDER / "detours-6.lp").read_text() == detours(6)


REASONS = {
    ("unsolvable.lp", None): """\
no strong-cyclic policy for the initial state `bank`: no closed policy
  whatever it does, a run may come to a state from which no goal can be reached
  such states: swamp""",
    ("unreachable.lp", None): """\
no strong-cyclic policy for the initial state `n>0, -open`: the goal is unreachable
  1 state(s) can be reached from it, none of them a goal""",
    ("transport.lp", None): """\
no strong-cyclic policy for the initial state `f1>0, -f2, f3>0, f4=0, -f5, f6`: no closed policy
  whatever it does, a run may come to a state from which no goal can be reached
  such states: f1>0, f2, f3=0, f4>0, f5, f6; f1>0, f2, f3=0, f4=0, f5, f6""",
    ("clutter.lp", "qnp"): """\
no qnp policy for the initial state `-f1, f2>0`: only non-terminating ones
  strong-cyclic policies exist, but a run may stay for ever in a loop, for instance:
    -f1, f2>0  do a0
    f1, f2>0  do a1
  in it: f2 is lowered and raised""",
    ("swing.lp", "qnp"): """\
no qnp policy for the initial state `n>0, -ready`: only non-terminating ones
  strong-cyclic policies exist, but a run may stay for ever in a loop, for instance:
    n>0, -ready  do prepare
    n>0, ready  do use
  in it: n is lowered and raised""",
    ("clear.lp", "strong"): """\
no strong policy for the initial state `n>0, -holding`: only non-terminating ones
  strong-cyclic policies exist, but a run may stay for ever in a loop, for instance:
    n>0, -holding  do pick
    n>0, holding  do put_back
  in it: whatever is fair, strong policies have no loop""",
}


@pytest.mark.parametrize(("name", "level"), REASONS)
def test_a_reason_names_the_culprit(name, level):
    problem = read_problem([FOLDER / name])
    found = synthesize(problem, fairness=level)
    assert found.solvable is False
    assert explain(problem, found.fairness) == REASONS[name, level]


def test_the_initial_state_at_fault_is_named():
    text = (FOLDER / "clutter.lp").read_text().replace("init(f2, positive).", "")
    problem = parse_problem([("both.lp", text)])
    assert "`-f1, f2=0`: the goal is unreachable" in explain(problem, "strong-cyclic")
    graph = """
        state(1). state(2). state(3). initialState(1). initialState(2). goal(3). action(a). action(b).
        transition(1, a, 3). transition(2, b, 2). transition(2, b, 3)."""
    assert "`2`: only non-terminating ones" in explain(parse_problem([("g.lp", graph)]), "qnp")


@pytest.mark.parametrize("length", [2, 4, 6])
def test_a_family_with_a_reason_for_each_way_around(length):
    """2^length loops and no other reason; the search must not give up, and must not find a policy."""
    problem = parse_problem([("detours.lp", detours(length))])
    found = synthesize(problem, fairness="qnp")
    assert found.solvable is False
    assert found.statistics["clauses_termination"] >= 2**length
    assert synthesize(problem).fairness == "strong-cyclic"
    reason = explain(problem, "qnp")
    assert "actions of con_A(luck) and con_B(luck)" in reason and "home  do start" in reason


def test_a_time_limit_is_kept():
    problem = parse_problem([("detours.lp", detours(16))])
    with at_most(0.3, starts=100):
        found = synthesize(problem, fairness="qnp", time_limit=0.3)
    assert found.solvable is None and found.limited


def test_a_level_that_ends_in_time_is_kept_at_the_limit():
    found = synthesize(parse_problem([("nested.lp", nested(12))]), fairness="qnp", minimize=True, time_limit=0.7)
    assert found.limited and (found.solvable is None or not found.optimal)
