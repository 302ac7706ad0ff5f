"""The incremental algorithm: sample every stream, level by level, and search what has been sampled."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable, Mapping
from functools import partial

from gentamp_lp.errors import LimitReached, NoAnswer, SolverError
from gentamp_lp.streams.downward import SEARCHES, search
from gentamp_lp.streams.facts import FactBase
from gentamp_lp.streams.formula import Formula
from gentamp_lp.streams.semantics import Program, State, Step, View, apply, precondition_holds


def sample(base: FactBase, quota: Mapping[str, int], deadline: float) -> bool:
    """Ask every generator stream (but fluent ones) up to `quota[name]` times (default 1) on all inputs known so far.

    Repeats until nothing is left to ask; returns whether any call was made. Raises LimitReached at the deadline.
    """
    called = False
    check_time = partial(_check, deadline, "the time limit ended stream sampling")
    for _ in base.streams:  # a chain of streams is at most as long as their number within one level
        again = False
        for stream in base.streams:
            if stream.decides or stream.fluents:
                continue
            for inputs in base.inputs(stream, check_time):
                while base.drawn(stream, inputs) < quota.get(stream.name, 1):
                    if base.exhausted(stream, inputs):
                        break
                    check_time()
                    base.draw(stream, inputs)
                    again = called = True
        if not again:
            break
    return called


def quota_for(base: FactBase, predicates: Iterable[str], samples: Mapping[str, int]) -> dict[str, int]:
    """How often to call each stream so that formulas over `predicates` see the given number of samples.

    Streams that neither certify one of the predicates nor supply inputs to one that does get 0.
    """
    quota = {stream.name: 0 for stream in base.streams}
    open_ = list(predicates)
    while open_:
        for stream in base.makers.get(open_.pop(), ()):
            if quota[stream.name] == 0:
                quota[stream.name] = samples.get(stream.name, 1)
                open_ += [atom.predicate for atom in stream.domain]
    return quota


def run_tests(base: FactBase, deadline: float) -> None:
    """Evaluate every test stream on all its inputs. Raises LimitReached at the deadline."""
    check_time = partial(_check, deadline, "the time limit ended the tests")
    for stream in base.streams:
        if not stream.decides:
            continue
        for inputs in base.inputs(stream, check_time):
            check_time()
            base.run_test(stream, inputs)


def _check(deadline: float, message: str) -> None:
    if time.monotonic() > deadline:
        raise LimitReached(message)


def simulate(program: Program, base: FactBase, state: State, steps: list[Step]) -> list[State] | None:
    """States along a plan, or None when a step is not applicable."""
    states = [state]
    for step in steps:
        view = View(program, base, states[-1])
        if not precondition_holds(view, step):
            return None
        states.append(apply(view, step))
    return states


def solve_incremental(
    program: Program,
    base: FactBase,
    state: State,
    goal: Formula,
    *,
    quota: Mapping[str, int],
    time_limit: float,
    max_levels: int = 10,
    searches: tuple[str, ...] = SEARCHES,
    seed: int | None = None,
    progress: Callable[[str], None] = lambda _: None,
) -> list[Step]:
    """Find a plan, sampling more at every level; see `search` for `searches` and the `seed`.

    Raises NoAnswer when the streams are exhausted or `max_levels` is passed without a plan, LimitReached at the
    time limit, SolverError when Fast Downward fails. The plan is simulated before it is returned.
    """
    deadline = time.monotonic() + time_limit
    for level in range(1, max_levels + 1):
        grew = sample(base, {s.name: level * quota.get(s.name, 1) for s in base.streams}, deadline)
        if not grew and level > 1:
            raise NoAnswer(f"no plan: all streams are exhausted after {level - 1} level(s)")
        run_tests(base, deadline)
        progress(f"level {level}: {len(base.values)} entities")
        left = deadline - time.monotonic()
        plan = search(program, base, state, goal, time_limit=left, searches=searches, seed=seed)
        if plan is None:
            continue
        states = simulate(program, base, state, plan)
        if states is None or not View(program, base, states[-1]).holds(goal):
            raise SolverError(
                "Fast Downward's plan does not execute: does the domain negate a test outside its stream's `:domain`?"
            )
        return plan
    raise NoAnswer(f"no plan within {max_levels} levels of samples")
