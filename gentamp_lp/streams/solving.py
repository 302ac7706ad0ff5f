"""`solve`: PDDLStream's entry point, with its arguments and their meaning."""

from __future__ import annotations

import sys
import time
from collections.abc import Callable, Collection, Iterable, Mapping
from dataclasses import dataclass, field, replace
from typing import Any

from gentamp_lp.errors import InputError, LimitReached, MemoryLimitReached, NoAnswer
from gentamp_lp.streams.constraints import Constrained, PlanConstraints, constrain
from gentamp_lp.streams.diagnosis import diagnose
from gentamp_lp.streams.downward import MEMORY_LIMIT, PLANNERS, SEARCHES
from gentamp_lp.streams.engine import Engine, Options
from gentamp_lp.streams.execution import Found
from gentamp_lp.streams.facts import Fact, FactBase
from gentamp_lp.streams.interruption import interrupting
from gentamp_lp.streams.language import (
    INF,
    Action,
    Certificate,
    ExternalInfo,
    FunctionInfo,
    PartialInputs,
    PDDLProblem,
    Solution,
    StreamInfo,
)
from gentamp_lp.streams.optimistic_facts import TooManyCalls
from gentamp_lp.streams.problem import PlanningProblem, build
from gentamp_lp.streams.semantics import State
from gentamp_lp.streams.stream_code import StreamStatistics

ALGORITHMS = ("adaptive", "incremental")
#: Other optimistic algorithms of PDDLStream, in whose place `adaptive` is run.
OPTIMISTIC = ("focused", "binding")
#: What PDDLStream's `solve` also takes and this engine has no use for: they steer how the original searches.
IGNORED = frozenset({
    "replan_actions", "initial_complexity", "complexity_step", "max_complexity", "max_skeletons",
    "search_sample_ratio", "max_failures", "unit_efforts", "max_effort", "effort_weight", "reorder", "visualize",
    "debug", "clean", "temp_dir", "hierarchy",
})  # fmt: skip


@dataclass(frozen=True)
class Report:
    """How a search went. `status`: solved, no plan, time limit, memory limit, or call limit."""

    status: str
    reason: str
    seconds: float
    iterations: int
    planner_seconds: float
    streams: Mapping[str, StreamStatistics]
    advice: tuple[str, ...] = ()

    def __str__(self) -> str:
        lines = [self.reason or self.status]
        lines.append(
            f"{self.iterations} iterations, {self.planner_seconds:.2f} s of {self.seconds:.2f} s in the planner"
        )
        lines += [
            f"  {name}: {s.calls} calls, {s.successes} successes, {s.seconds:.3f} s" for name, s in self.streams.items()
        ]
        return "\n".join([*lines, *self.advice])


class Result(Solution):
    """A solution that also says how it was found, or why there is none."""

    report: Report

    @property
    def status(self) -> str:
        """`solved`, `no plan`, `time limit`, `memory limit` or `call limit` (of stream calls that are possible)."""
        return self.report.status

    @property
    def reason(self) -> str:
        """Why there is no plan and what to try; empty when there is one."""
        return "" if self.plan is not None else "\n".join((self.report.reason, *self.report.advice))


@dataclass
class _Search:
    """The best plan so far, over all searches with falling cost bounds."""

    problem: PlanningProblem
    options: Options
    success_cost: float
    best: Found | None = None
    status: str = "no plan"
    reason: str = ""
    iterations: int = 0
    planner_seconds: float = 0.0
    unbounded: list[Engine] = field(default_factory=list)

    def run(self) -> None:
        """Search until a plan is cheap enough, or there is no better one, or a limit is reached."""
        deadline = time.monotonic() + self.options.time_limit
        bound = self.options.max_cost
        while True:
            engine = Engine(self.problem, replace(self.options, max_cost=bound, time_limit=deadline - time.monotonic()))
            if self.unbounded and not self.options.adaptive:
                engine.level = self.unbounded[-1].level  # go on where the last search had come to
            self.unbounded.append(engine)
            try:
                with interrupting(self.problem.base, engine.options.time_limit):
                    self.best = engine.solve()
            except NoAnswer as error:
                self.reason = str(error)
                return
            except MemoryLimitReached as error:
                self.status, self.reason = "memory limit", str(error)
                return
            except TooManyCalls as error:
                self.status, self.reason = "call limit", str(error)
                return
            except LimitReached as error:
                self.status, self.reason = "time limit", str(error)
                return
            finally:
                self.iterations += engine.iterations
                self.planner_seconds += engine.planner_seconds
            if self.best.cost < self.success_cost or self.best.cost <= 0:
                return
            bound = self.best.cost - 1e-3

    def report(self, seconds: float) -> Report:
        """How the search went, which took so many seconds."""
        return Report(
            "solved" if self.best else self.status,
            "" if self.best else self.reason,
            seconds,
            self.iterations,
            self.planner_seconds,
            self.problem.base.statistics,
            () if self.best else tuple(diagnose(self.unbounded[-1])),
        )


def solve(
    problem: PDDLProblem,
    algorithm: str = "adaptive",
    constraints: PlanConstraints | None = None,
    stream_info: Mapping[str, ExternalInfo] | None = None,
    *,
    unit_costs: bool = False,
    success_cost: float = INF,
    max_time: float = INF,
    max_iterations: float = INF,
    max_memory: float = INF,
    max_cost: float = INF,
    planner: str | None = None,
    max_planner_time: float = INF,
    seed: int = 0,
    verbose: bool = False,
    progress: Callable[[str], None] | None = None,
    **ignored: Any,
) -> Result:
    """Solve a PDDLStream problem.

    `algorithm` is `adaptive` or `incremental` (`focused` and `binding` run `adaptive`). `max_time` is in seconds,
    `max_memory` in kilobytes (of the planner). `planner` is one of PDDLStream's planner names (`PLANNERS`) or a search
    string of Fast Downward; by default several searches are tried in turn. `success_cost`: go on for cheaper plans
    until one costs less. With `verbose`, progress and the report are printed. Further arguments of PDDLStream's `solve`
    are accepted and not needed.

    Returns (plan, cost, certificate); the plan is None when there is none. `result.report` says how it went, and why.
    Raises InputError for a mistake in the problem (with file and line), SolverError when the planner fails.
    """
    unknown = ignored.keys() - IGNORED
    if unknown:
        raise TypeError(f"solve() got an unexpected keyword argument {min(unknown)!r}")
    if algorithm not in ALGORITHMS + OPTIMISTIC:
        raise InputError(f"unknown algorithm {algorithm!r}: known are {', '.join(ALGORITHMS)}")
    start = time.monotonic()
    constraints = constraints or PlanConstraints()
    say = progress or (_print if verbose else _silent)
    constrained = constrain(build(problem), constraints)
    options = Options(
        adaptive=algorithm != "incremental",
        time_limit=max_time - (time.monotonic() - start),
        memory_limit=MEMORY_LIMIT if max_memory == INF else int(max_memory * 1024),
        max_cost=min(max_cost, constraints.max_cost),
        max_iterations=max_iterations,
        unit_costs=unit_costs,
        searches=SEARCHES if planner is None else (PLANNERS.get(planner, planner),),
        planner_time=max_planner_time,
        seed=seed,
        progress=say,
        **_stream_options(stream_info or {}),
    )
    search = _Search(constrained.problem, options, success_cost)
    search.run()
    report = search.report(time.monotonic() - start)
    if verbose or progress:
        say(str(report))
    result = _result(constrained, search.best)
    result.report = report
    return result


def _stream_options(stream_info: Mapping[str, ExternalInfo]) -> dict[str, Any]:
    """What `Options` hold of what a user says of single streams."""
    infos = {name.lower(): info for name, info in stream_info.items()}
    streams = {name: info for name, info in infos.items() if isinstance(info, StreamInfo)}
    return {
        "eager": frozenset(name for name, info in infos.items() if info.eager),
        "contextual": frozenset(name for name, info in streams.items() if info.contextual),
        "opt_costs": {n: i.opt_fn for n, i in infos.items() if isinstance(i, FunctionInfo) and i.opt_fn},
        "opt_outputs": {
            name: info.opt_gen_fn
            for name, info in streams.items()
            if callable(info.opt_gen_fn) and not isinstance(info.opt_gen_fn, PartialInputs)
        },
    }


def _result(constrained: Constrained, found: Found | None) -> Result:
    """The plan in terms of the user's values; the certificate of what is known without one."""
    base, state = constrained.problem.base, constrained.problem.state
    if found is None:
        return Result(None, INF, Certificate(_facts(base, state), None))
    steps = [constrained.original(step) for step in found.steps]
    plan = [Action(step.schema, tuple(base.values[name] for name in step.args)) for step in steps]
    used = {name for step in steps for name in step.args}
    preimage = _facts(base, state, found.facts, used)
    return Result(plan, found.cost, Certificate(_facts(base, state, found.facts), preimage))


def solve_incremental(problem: PDDLProblem, constraints: PlanConstraints | None = None, **options: Any) -> Result:
    """`solve` with the algorithm `incremental`."""
    return solve(problem, "incremental", constraints, **options)


def solve_adaptive(
    problem: PDDLProblem,
    constraints: PlanConstraints | None = None,
    stream_info: Mapping[str, ExternalInfo] | None = None,
    **options: Any,
) -> Result:
    """`solve` with the algorithm `adaptive`."""
    return solve(problem, "adaptive", constraints, stream_info, **options)


solve_focused = solve_binding = solve_adaptive


def _facts(
    base: FactBase, state: State, more: Iterable[Fact] = (), used: Collection[str] | None = None
) -> list[tuple[Any, ...]]:
    """Static, initial and certified facts with values, only those about `used` entities and what these come from."""
    if used is not None:
        waiting, kept = list(used), set()
        while waiting:
            name = waiting.pop()
            if name not in kept:
                kept.add(name)
                waiting += base.made_by[name][1] if name in base.made_by else ()
        used = kept
    known = [(p, *row) for p, relation in base.static.items() if p in base.domain.predicates for row in relation.rows]
    facts = [*known, *sorted(state), *sorted(more)]
    return [(f[0], *(base.values[a] for a in f[1:])) for f in facts if used is None or used >= set(f[1:])]


def _print(text: str) -> None:
    sys.stdout.write(text + "\n")


def _silent(_: str) -> None:
    return None
