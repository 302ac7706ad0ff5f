"""Limits and interruptions of `solve`: in time, told apart, and nothing is left behind."""

import os
import signal
import subprocess
import sys
import time
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import pytest
from helpers.pace import at_most, start_of_python
from helpers.processes import left_alive

from gentamp_lp.errors import LimitReached, MemoryLimitReached
from gentamp_lp.streams import ALGORITHMS, PDDLProblem, from_gen_fn, from_test, solve
from gentamp_lp.streams.downward import search
from gentamp_lp.tasks.task import Task

HARD = """(define (domain hard) (:predicates (Item ?i) (Spot ?i ?x) (Big ?x) (On ?i ?x))
  (:action put :parameters (?i ?x) :precondition (and (Spot ?i ?x) (Big ?x)) :effect (On ?i ?x)))"""
HARD_STREAMS = """(define (stream hard)
  (:stream spot :inputs (?i) :domain (Item ?i) :outputs (?x) :certified (Spot ?i ?x))
  (:stream big :inputs (?i ?x) :domain (Spot ?i ?x) :certified (Big ?x)))"""


def hopeless(pause: float) -> PDDLProblem:
    """Endless samples, none of which is big."""

    def spots(_: str) -> object:
        number = 0
        while True:
            time.sleep(pause)
            number += 1
            yield (number,)

    functions = {"spot": from_gen_fn(spots), "big": from_test(lambda i, x: False)}
    return PDDLProblem(HARD, {}, HARD_STREAMS, functions, [("Item", "a")], ("exists", ["?x"], ("On", "a", "?x")))


@pytest.mark.parametrize("algorithm", ALGORITHMS)
@pytest.mark.parametrize(("limit", "pause"), [(0.0, 0.0), (0.8, 0.0), (0.8, 0.05)])
def test_time_limits_are_kept(algorithm: str, limit: float, pause: float) -> None:
    with at_most(1.05 * limit, starts=100):
        result = solve(hopeless(pause), algorithm, max_time=limit)
    assert result.status == "time limit" and result.plan is None


def stuck(stream: str, begun: list[float]) -> PDDLProblem:
    """One of the streams never returns; what it raises on the way is of no avail. When it is called goes to `begun`."""

    def sleep(*inputs: object) -> object:
        begun.append(time.monotonic())
        while True:
            try:
                time.sleep(600)
            except Exception:
                continue

    functions = {
        "spot": from_gen_fn(lambda i: iter([(1,)])),
        "big": from_test(lambda i, x: True),
        "effort": lambda i: 1,
    }
    functions[stream] = {"spot": from_gen_fn(sleep), "big": from_test(sleep), "effort": sleep}[stream]
    domain = HARD.replace("(:action", "(:functions (Effort ?i)) (:action").replace(
        ":effect (On ?i ?x)", ":effect (and (On ?i ?x) (increase (total-cost) (Effort ?i)))"
    )
    streams = HARD_STREAMS[:-1] + "(:function (Effort ?i) (Item ?i)))"
    domain, streams = (text.replace("Big ?x", "Big ?i ?x") for text in (domain, streams))
    return PDDLProblem(domain, {}, streams, functions, [("Item", "a")], ("exists", ["?x"], ("On", "a", "?x")))


@pytest.mark.parametrize("algorithm", ALGORITHMS)
@pytest.mark.parametrize("stream", ["spot", "big", "effort"])
def test_a_stream_that_never_returns_is_ended_and_named(algorithm: str, stream: str) -> None:
    limit = max(1.2, 50 * start_of_python())  # enough to come to the call
    begun: list[float] = []
    problem = stuck(stream, begun)
    end = time.monotonic() + limit
    with at_most(1.05 * limit, starts=100):
        result = solve(problem, algorithm, max_time=limit)
    assert result.status == "time limit" and result.plan is None
    assert f"stream `{stream}` was still running on (a" in result.report.reason
    assert result.report.streams[stream].calls >= 1
    assert result.report.streams[stream].seconds >= 0.99 * (end - begun[0]) > 0
    assert not any(f"`{stream}` was never called" in line for line in result.report.advice)
    assert signal.getitimer(signal.ITIMER_REAL) == (0.0, 0.0) and signal.getsignal(signal.SIGALRM) is signal.SIG_DFL


def test_someone_elses_alarm_is_left_alone() -> None:
    rung = []
    before = signal.signal(signal.SIGALRM, lambda *_: rung.append(1))
    try:
        signal.setitimer(signal.ITIMER_REAL, 0.3)
        assert solve(hopeless(0.05), max_time=0.8).status == "time limit"
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0)
        signal.signal(signal.SIGALRM, before)
    assert rung == [1]


def test_limits_are_kept_between_calls_in_other_threads() -> None:
    with at_most(1.05 * 0.8, starts=100), ThreadPoolExecutor(2) as pool:
        found = [pool.submit(solve, hopeless(0.05), "adaptive", max_time=0.8) for _ in range(2)]
        assert [f.result().status for f in found] == ["time limit"] * 2


def test_a_memory_limit_is_not_a_time_limit() -> None:
    result = solve(hopeless(0.0), max_memory=16_000, max_time=300)
    assert result.status == "memory limit"
    task = Task.load("load")
    instance = task.instance("2-3", 0)
    with pytest.raises(MemoryLimitReached):
        search(task.program, instance.base, instance.state, task.goal, time_limit=300, memory_limit=24 * 2**20)
    assert issubclass(MemoryLimitReached, LimitReached) and MemoryLimitReached.exit_code == 3


INTERRUPTED = """
import sys, tempfile
sys.path[:0] = sys.argv[1], sys.argv[1] + "/.."
tempfile.tempdir = sys.argv[2]
from test_limits import hopeless
from gentamp_lp.streams import solve
print("ready", flush=True)
solve(hopeless(0.0), sys.argv[3], max_time=60)
"""


@pytest.mark.parametrize("algorithm", ["adaptive", pytest.param("incremental", marks=pytest.mark.slow)])
def test_an_interruption_leaves_nothing(tmp_path: Path, algorithm: str) -> None:
    here = str(Path(__file__).parent)
    child = subprocess.Popen(
        [sys.executable, "-c", INTERRUPTED, here, str(tmp_path), algorithm],
        stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, start_new_session=True,
    )  # fmt: skip
    assert child.stdout is not None and child.stdout.readline() == "ready\n"
    time.sleep(1)
    child.send_signal(signal.SIGINT)
    _, messages = child.communicate(timeout=60)
    assert "KeyboardInterrupt" in messages
    assert list(tmp_path.iterdir()) == []
    assert left_alive(child.pid) == []


def test_nothing_is_written_to_the_current_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    solve(hopeless(0.0), max_time=0.5)
    assert os.listdir(tmp_path) == []
