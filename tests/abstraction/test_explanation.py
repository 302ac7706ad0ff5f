"""What the user is told when there is no answer, or none in time."""

import signal
import threading

import pytest
from helpers.pace import at_most, start_of_python
from helpers.worlds import UNSTACK_SIZES, Unstack, gather

from gentamp_lp.abstraction.choose import NoPolicy, synthesize_policy
from gentamp_lp.abstraction.conflict import Clash
from gentamp_lp.base.shipped import resource
from gentamp_lp.errors import InputError, LimitReached, SolverError
from gentamp_lp.solvers.asp import GroundProgram

TWO_GOALS = """
state(1,1). state(2,1). state(3,1). goal(3). goal(2).
transition(1,1,2). candidate(1). action(1,pick).
feature(1,1,boolean). feature(2,1,numeric). pos(2,1). pos(2,2). inc(1,1). pos(1,2). pos(1,3).
"""


def failure(facts, **options):
    with pytest.raises(NoPolicy) as caught:
        synthesize_policy(facts, **options)
    return caught.value


def test_goal_states_that_look_like_others_are_named():
    facts = TWO_GOALS + "state(4,1). pos(1,4). pos(2,4). state(5,1). pos(1,5)."
    error = failure(facts)
    assert error.pairs == ((2, 4), (3, 5))
    assert "2 and 4" in str(error) and "3 and 5" in str(error)


def test_a_sample_without_goal():
    assert "no goal" in str(failure("state(1,1). feature(1,1,boolean)."))


def test_like_states_with_different_moves_are_named():
    """States 1 and 4 look alike; pick lowers feature 1 in one, put raises feature 2 in the other; 6 is fine."""
    facts = """
    state(1,1). state(2,1). state(4,1). state(5,1). state(6,1). state(7,1). goal(2). goal(5). goal(7).
    transition(1,1,2). candidate(1). action(1,pick).  transition(2,4,5). candidate(2). action(2,put).
    transition(3,6,7). candidate(3). action(3,go).
    feature(1,1,numeric). feature(2,1,numeric). feature(3,1,boolean).
    pos(1,1). pos(1,4). pos(1,5). pos(2,5).  dec(1,1). inc(2,2).  pos(3,6). pos(1,6). pos(1,7). pos(2,7).
    dec(3,3). inc(2,3).
    """
    error = failure(facts)
    assert error.states == (1, 4)
    assert "state 1: pick" in str(error) and "state 4: put" in str(error)
    assert "states 1 and 4 look alike to every feature" in str(error)
    (attempt,) = error.attempts
    assert attempt.clashes == (Clash((1, 4), (1, 2), alike=True),)
    assert attempt.moves == {1: 1, 4: 2} and attempt.idle == (1, 4)


def test_a_move_that_changes_nothing_is_named():
    facts = """
    state(1,1). state(2,1). state(3,1). goal(3). transition(1,1,2). candidate(1). action(1,wait).
    transition(2,2,3). candidate(2). feature(1,1,boolean). pos(1,3). inc(1,2).
    """
    error = failure(facts)
    assert error.states == (1,)
    assert "state 1: wait" in str(error) and "no feature of the pool changes" in str(error)
    (attempt,) = error.attempts
    assert not attempt.clashes and attempt.idle == (1,)


def test_a_loop_is_named_and_weaker_fairness_accepts_it():
    """1 -> 2 lowers feature 1, 2 -> 1 raises it; the count may reach zero, then the goal is next."""
    facts = """
    state(1,1). state(2,1). state(3,1). state(4,1). goal(4).
    feature(1,1,numeric). feature(2,1,boolean).
    transition(1,1,2). candidate(1). dec(1,1). inc(2,1). pos(1,1). pos(1,2). pos(2,2).
    transition(2,2,1). candidate(2). inc(1,2). dec(2,2).
    transition(3,3,4). candidate(3). dec(2,3). pos(2,3).
    """
    error = failure(facts)
    assert error.states == (1, 2)
    assert [(attempt.kind, attempt.states) for attempt in error.attempts] == [("termination", (1, 2))]
    assert synthesize_policy(facts, fairness="strong-cyclic").features == (1, 2)


def test_strong_is_refused_where_a_count_must_run_out():
    facts = gather([Unstack(*size) for size in UNSTACK_SIZES], Unstack.features[:2]).facts
    assert "weaker fairness" in str(failure(facts, fairness="strong"))


@pytest.mark.parametrize(
    "line, message",
    [
        ("pos(9,1).", "no such feature"),
        ("goal(9).", "no such state"),
        ("candidate(9).", "no such transition"),
        ("postition(1,1).", "not a fact of the training data: postition"),
        ("inc(1,1,1).", "not a fact of the training data: inc"),
        ("feature(9,1,real).", "boolean or numeric"),
        ("transition(5,1,9).", "no such state"),
        ("inc(2,1). dec(2,1).", "contradicts the values of feature 2"),
        ("candidate(7). transition(7,2,1).", "leaves the goal state"),
        ("what is this", "expected `.`, found `is`"),
    ],
)
def test_bad_facts(line, message):
    with pytest.raises(InputError, match=message):
        synthesize_policy(TWO_GOALS + line)


def test_unknown_fairness():
    with pytest.raises(InputError, match="qnp"):
        synthesize_policy(TWO_GOALS, fairness="weak")


def hard(features=90, states=60):
    """Random values: everything tells everything apart, and no bound can be proved."""
    import random

    rng = random.Random(3)
    lines = [f"state({s},1)." for s in range(1, states + 1)] + [f"goal({states})."]
    values = [[rng.randint(0, 3) for _ in range(states + 1)] for _ in range(features)]
    lines += [f"transition({s},{s},{s + 1}). candidate({s})." for s in range(1, states)]
    for f, row in enumerate(values, 1):
        lines.append(f"feature({f},{rng.randint(3, 9)},numeric).")
        lines += [f"pos({f},{s})." for s in range(1, states + 1) if row[s]]
        for s in range(1, states):
            if row[s] != row[s + 1]:
                lines.append(f"{'inc' if row[s + 1] > row[s] else 'dec'}({f},{s}).")
    return "\n".join(lines)


def test_no_model_in_time():
    with pytest.raises(LimitReached):
        synthesize_policy(hard(), time_limit=0.0)


def test_a_model_without_proof_is_returned_as_such():
    said = []
    limit = max(2.0, 100 * start_of_python())  # some models take a tenth of it, the proof much longer than all
    with at_most(limit, starts=200):
        solution = synthesize_policy(hard(), time_limit=limit, progress=said.append)
    assert not solution.optimal
    assert 0 < solution.bound < solution.cost
    assert any("a policy of cost" in message for message in said)


def test_control_c_keeps_the_best_model():
    def press(message):
        if "a policy of cost" in message:
            signal.pthread_kill(threading.main_thread().ident, signal.SIGINT)

    solution = synthesize_policy(hard(), time_limit=600.0, progress=press)
    assert not solution.optimal


class Broken:
    predicates = ("selected",)

    def refute(self, true):
        raise ZeroDivisionError("inside")


class Lying(Broken):
    def refute(self, true):
        return [("false", [((("selected", f)), True) for f in true["selected"][:1]])] if true["selected"] else []


def test_errors_inside_the_propagator_come_out():
    facts = "feature(1,1). expanded(1). move(1,1). changes(1,1)."
    files = [resource("asp", "abstraction.lp")]
    with pytest.raises(ZeroDivisionError, match="inside"):
        GroundProgram(files, facts, theory=Broken()).solve()
    with pytest.raises(AssertionError, match="does not violate"):
        GroundProgram(files, facts, theory=Lying()).solve()


def test_errors_of_the_caller_come_out():
    def fail(message):
        raise ZeroDivisionError(message)

    with pytest.raises(ZeroDivisionError):
        synthesize_policy(hard(features=20, states=6), progress=fail, time_limit=5)
    said = []

    def fail_later(message):
        said.append(message)
        return len(said) < 2 or fail(message)

    with pytest.raises(ZeroDivisionError):
        synthesize_policy(hard(features=20, states=6), progress=fail_later, time_limit=5)


def test_errors_of_the_grounder_have_a_place():
    with pytest.raises(SolverError, match=r"<block>:1:.*error"):
        GroundProgram([resource("asp", "abstraction.lp")], "feature(1,.")
