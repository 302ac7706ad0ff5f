"""Fast Downward as a subprocess: its answers, its failures, and that nothing stays behind."""

import math
import os
import random
import signal
import stat
import subprocess
import sys
import time
from pathlib import Path

import pytest
from helpers.pace import at_most, start_of_python

from gentamp_lp.errors import LimitReached, SolverError
from gentamp_lp.streams import downward
from gentamp_lp.streams.downward import search
from gentamp_lp.streams.facts import FactBase
from gentamp_lp.streams.incremental import run_tests, sample, simulate, solve_incremental
from gentamp_lp.streams.pddl import parse_domain, parse_formula
from gentamp_lp.streams.problem_text import split_goal
from gentamp_lp.streams.semantics import Program, State, Step, View, applicable, apply
from gentamp_lp.tasks.task import Task

GRID = """(define (domain grid)
  (:predicates (Next ?x ?y) (Gate ?x) (At ?x) (Open ?x) (Dark) (Stuck) (Far ?x ?y))
  (:action go :parameters (?x ?y)
    :precondition (and (At ?x) (Next ?x ?y) (or (not (Gate ?y)) (Open ?y)))
    :effect (and (At ?y) (not (At ?x)) (when (Gate ?y) (Dark))))
  (:action open :parameters (?x)
    :precondition (and (not (Stuck)) (exists (?y) (and (At ?y) (Next ?y ?x))) (Gate ?x))
    :effect (and (Open ?x) (forall (?z) (when (and (Gate ?z) (not (= ?z ?x))) (not (Open ?z))))))
  (:derived (Far ?x ?y) (or (Next ?x ?y) (exists (?z) (and (Next ?x ?z) (Far ?z ?y)))))
  (:derived (Stuck) (and (Dark) (forall (?x) (imply (At ?x) (not (exists (?y) (and (Far ?x ?y) (Gate ?y)))))))))"""


def problem(seed: int) -> tuple[Program, FactBase, State]:
    rng = random.Random(seed)
    names = [f"c{i}" for i in range(6)]
    domain = parse_domain(GRID)
    base = FactBase(domain, (), {}, dict.fromkeys(names))
    for x in names:
        for y in rng.sample(names, 2):
            base.add(("next", x, y))
    for x in rng.sample(names[1:], 2):
        base.add(("gate", x))
    return Program.of(domain), base, frozenset([("at", "c0")])


def shortest(program: Program, base: FactBase, state: State, goal: object) -> int | None:
    """Breadth-first search with our own semantics."""
    layer, seen, depth = [state], {state}, 0
    while layer:
        if any(View(program, base, s).holds(goal) for s in layer):  # type: ignore[arg-type]
            return depth
        following = []
        for s in layer:
            view = View(program, base, s)
            for step in applicable(view):
                after = apply(view, step)
                if after not in seen:
                    seen.add(after)
                    following.append(after)
        layer, depth = following, depth + 1
    return None


@pytest.mark.parametrize("seed", range(6))
def test_a_plan_is_found_exactly_when_there_is_one(seed: int) -> None:
    """Conditional and quantified effects, recursive axioms under negation, disjunctions: both sides mean the same."""
    program, base, state = problem(seed)
    for text in ("(and (At c5) (not (Dark)))", "(and (Dark) (Open c3))", "(Stuck)"):
        constants = tuple(base.values)
        goal = parse_formula(text, program.domain, constants)
        plan = downward.search(program, base, state, goal, time_limit=20)
        length = shortest(program, base, state, goal)
        assert (plan is None) == (length is None), text
        if plan is not None and length is not None:
            assert len(plan) >= length
            current = state
            for step in plan:
                view = View(program, base, current)
                assert step in set(applicable(view))
                current = apply(view, step)
            assert View(program, base, current).holds(goal)


def easy() -> tuple[Program, FactBase, State, object]:
    program, base, state = problem(0)
    row = base.relation("next").matches(("c0", None))[0]
    return program, base, state, parse_formula(f"(or (At {row[1]}) (Open {row[1]}))", program.domain, [row[1]])


def run(**options: float) -> list[Step] | None:
    return downward.search(*easy(), **{"time_limit": 20.0, **options})  # type: ignore[arg-type]


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Temporary files go here, where they are seen."""
    place = tmp_path / "tmp"
    place.mkdir()
    monkeypatch.setattr("tempfile.tempdir", str(place))
    return place


def fake(path: Path, body: str, monkeypatch: pytest.MonkeyPatch) -> None:
    path.write_text(f"#!/bin/sh\n{body}\n")
    path.chmod(path.stat().st_mode | stat.S_IXUSR)
    monkeypatch.setattr(downward, "binary", lambda: path)


def test_success_leaves_nothing(folder: Path) -> None:
    assert run()
    assert list(folder.iterdir()) == []


@pytest.mark.parametrize("code", [1 + 31, 33, 34, 35, 36, 37, 99])
def test_failures_are_failures(folder: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, code: int) -> None:
    fake(tmp_path / "downward", f"echo something went wrong; exit {code}", monkeypatch)
    with pytest.raises(SolverError, match=rf"code {code}:\n(.*\n)*something went wrong"):
        run()
    assert list(folder.iterdir()) == []


def test_a_crash_is_a_failure(folder: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    fake(tmp_path / "downward", "kill -SEGV $$", monkeypatch)
    with pytest.raises(SolverError, match="code -11"):
        run()
    assert list(folder.iterdir()) == []


@pytest.mark.parametrize("code", [11, 12])
def test_unsolvable_is_none(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, code: int) -> None:
    fake(tmp_path / "downward", f"exit {code}", monkeypatch)
    assert run() is None


@pytest.mark.parametrize(("code", "turns"), [(22, 1), (23, 4), (24, 4)])
def test_limits_of_every_search(
    folder: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, code: int, turns: int
) -> None:
    """Each search is tried three times for a while, then with its share of the time unless it ran out of memory."""
    fake(tmp_path / "downward", f"echo $2 >> {tmp_path}/tried; exit {code}", monkeypatch)
    with pytest.raises(LimitReached, match="no plan within"):
        run()
    assert (tmp_path / "tried").read_text().splitlines() == [*downward.SEARCHES] * turns
    assert list(folder.iterdir()) == []


@pytest.mark.parametrize("seconds", [0.0, -1.0])
def test_translating_may_use_up_the_time(seconds: float) -> None:
    with (
        downward.translated(*easy(), time_limit=60.0) as planner,
        pytest.raises(LimitReached, match="no plan within"),
    ):
        planner(downward.SEARCHES, seconds, math.inf)


def test_a_search_does_not_wait_for_the_others_to_use_up_their_shares(tmp_path: Path, monkeypatch) -> None:
    last = downward.SEARCHES[-1]
    fake(tmp_path / "downward", f'[ "$2" = "{last}" ] && exit 11; exec sleep 600', monkeypatch)
    monkeypatch.setattr(downward, "_FIRST", (0.2,))
    with at_most(len(downward.SEARCHES) * 0.2, starts=500):
        assert run(time_limit=600.0) is None


def test_the_time_limit_ends_a_search_that_hangs(folder: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    fake(tmp_path / "downward", f"echo $$ >> {tmp_path}/pids; exec sleep 600", monkeypatch)
    limit = max(2.0, 50 * start_of_python())  # enough to come to the search
    with at_most(limit, starts=200), pytest.raises(LimitReached):
        run(time_limit=limit)
    pids = (tmp_path / "pids").read_text().split()
    assert pids and not any(Path("/proc", pid).exists() for pid in pids)
    assert list(folder.iterdir()) == []


@pytest.mark.parametrize("limit", [0.0, -1.0, 0.01])
def test_no_time_at_all(folder: Path, limit: float) -> None:
    with at_most(max(limit, 0.0), starts=100), pytest.raises(LimitReached):
        run(time_limit=limit)
    assert list(folder.iterdir()) == []


def test_the_translator_may_fail_too(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(downward, "write_problem", lambda *_, **__: ("(define (domain d)", "nonsense"))
    with pytest.raises(SolverError, match="translator failed"):
        run()
    assert list(folder.iterdir()) == []


INTERRUPTED = """
import sys, tempfile
from pathlib import Path
sys.path[:0] = sys.argv[1], sys.argv[1] + "/.."
tempfile.tempdir = sys.argv[2]
import test_downward
from gentamp_lp.streams import downward
downward.binary = lambda: Path(sys.argv[3])
test_downward.run(time_limit=60.0)
"""


@pytest.mark.parametrize("how", [signal.SIGINT, signal.SIGKILL])
def test_interrupting_leaves_no_child(folder: Path, tmp_path: Path, monkeypatch, how: int) -> None:
    script = tmp_path / "downward"
    fake(script, f"echo $$ > {tmp_path}/half; mv {tmp_path}/half {tmp_path}/pid; exec sleep 600", monkeypatch)
    here = str(Path(__file__).parent)
    child = subprocess.Popen(
        [sys.executable, "-c", INTERRUPTED, here, str(folder), str(script)], stderr=subprocess.PIPE, text=True
    )
    deadline = time.monotonic() + 60
    while not (tmp_path / "pid").exists():
        assert time.monotonic() < deadline and child.poll() is None
        time.sleep(0.02)
    child.send_signal(how)
    _, messages = child.communicate(timeout=60)
    pid = int((tmp_path / "pid").read_text())
    deadline = time.monotonic() + 60
    while _running(pid) and time.monotonic() < deadline:
        time.sleep(0.02)
    assert not _running(pid)
    if how == signal.SIGINT:
        assert "KeyboardInterrupt" in messages
        assert list(folder.iterdir()) == []


INTERRUPTED_FORK = """
import os, signal, sys
sys.path[:0] = sys.argv[1], sys.argv[1] + "/.."
import test_downward
os.register_at_fork(after_in_parent=lambda: os.kill(os.getpid(), signal.SIGINT))
print(test_downward.run())
"""


def test_an_interruption_while_a_child_starts_is_not_lost() -> None:
    here = str(Path(__file__).parent)
    done = subprocess.run([sys.executable, "-c", INTERRUPTED_FORK, here], capture_output=True, text=True, timeout=300)
    assert done.returncode != 0 and "KeyboardInterrupt" in done.stderr and done.stdout == ""


def _running(pid: int) -> bool:
    try:
        os.kill(pid, 0)
    except ProcessLookupError:
        return False
    status = Path(f"/proc/{pid}/stat").read_text().rsplit(")", 1)[1].split()
    return status[0] != "Z"


def test_a_quantified_goal_is_split_into_parts_that_say_the_same():
    task = Task.load("load")
    instance = task.instance("2-3", 0)
    base, program = instance.base, task.program
    deadline = time.monotonic() + 60
    sample(base, task.file.samples, deadline)
    run_tests(base, deadline)
    parts = split_goal(program, base, task.goal)
    assert len(parts) == 1 + 3  # the tray is held; each of the three things is on it or does not fit
    open_, seen, truths = [instance.state], {instance.state}, set()
    while open_ and len(seen) < 150:
        view = View(program, base, open_.pop(0))
        whole = view.holds(task.goal)
        truths.add(whole)
        assert whole == all(view.holds(part) for part in parts)
        for successor in sorted((apply(view, step) for step in applicable(view)), key=sorted):
            if successor not in seen:
                seen.add(successor)
                open_.append(successor)
    plan = search(program, base, instance.state, task.goal, time_limit=60)
    for state in simulate(program, base, instance.state, plan):
        view = View(program, base, state)
        truths.add(view.holds(task.goal))
        assert view.holds(task.goal) == all(view.holds(part) for part in parts)
    assert truths == {True, False}


def test_splitting_makes_a_goal_over_many_things_reachable():
    task = Task.load("load")
    instance = task.instance("6-8", 0)
    plan = solve_incremental(
        task.program, instance.base, instance.state, task.goal, quota=task.file.samples, time_limit=60
    )
    assert len(plan) == 13
