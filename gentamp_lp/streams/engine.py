"""The algorithms: plan over what may be, find out what is, until a plan holds.

`adaptive` plans over placeholders for what streams have not given yet (`optimistic_facts`), asks only the streams and
tests that the plan needs (`support`, `binding`, `execution`), and gives up the hopes that were disappointed until there
is no plan without them; then it hopes again and tries harder. `incremental` samples every stream level by level and
plans over that.
Either way a plan is returned only after a simulation with the real facts, in which every test that is read is run.
"""

from __future__ import annotations

import random
import time
from collections import Counter
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any

from gentamp_lp.errors import Diagnostic, InputError, LimitReached, MemoryLimitReached, NoAnswer, SolverError
from gentamp_lp.streams.binding import SAMPLES, Assignment, Binder, Refuted
from gentamp_lp.streams.downward import MEMORY_LIMIT, SEARCHES, Planner, translated
from gentamp_lp.streams.execution import Execution, Found, Stuck
from gentamp_lp.streams.facts import Fact
from gentamp_lp.streams.focus import focus
from gentamp_lp.streams.hopeful_domain import Split, hopeful_problem, split
from gentamp_lp.streams.hopes import Hopes
from gentamp_lp.streams.incremental import run_tests, sample
from gentamp_lp.streams.language import INF, Generator
from gentamp_lp.streams.optimistic_facts import OptimisticFacts, TooManyCalls
from gentamp_lp.streams.problem import PlanningProblem
from gentamp_lp.streams.relations import Args
from gentamp_lp.streams.semantics import Step
from gentamp_lp.streams.stream_graph import in_order, relevant_streams
from gentamp_lp.streams.support import Needs, plan_needs

COPIES = (1, 2, 4)  # placeholders of one call; more when there is no plan
UNROLLED = 3  # times that streams feed themselves at first
MAX_LEVELS = 10
TRIES = 10  # with other samples for a plan that is too costly or that the real facts refute
FEW_TESTS = 50  # of one stream, run before planning: cheaper than to plan with wrong hopes; more after disappointments
LAST_RESORT = 2  # a power of ten: samples of every stream call before `adaptive` gives up
MAX_OBJECTS = 1000  # or this many of these
MANY_CALLS = 5000  # of streams; if more are possible, those are assumed that matter to a coarse plan
FIRST_SLICE = 2.0  # seconds for a first search of an optimistic problem; doubled when it does not suffice


@dataclass(frozen=True)
class Options:
    """How to search."""

    adaptive: bool = True
    time_limit: float = INF
    memory_limit: int = MEMORY_LIMIT
    max_cost: float = INF
    max_iterations: float = INF
    unit_costs: bool = False
    searches: tuple[str, ...] = SEARCHES
    planner_time: float = INF
    seed: int = 0
    quota: Mapping[str, int] = field(default_factory=dict)
    eager: frozenset[str] = frozenset()
    contextual: frozenset[str] = frozenset()
    opt_costs: Mapping[str, Callable[..., float]] = field(default_factory=dict)
    opt_outputs: Mapping[str, Generator] = field(default_factory=dict)
    progress: Callable[[str], None] = lambda _: None


class Engine:
    """One search. Not to be used by two threads; two searches do not share anything."""

    def __init__(self, problem: PlanningProblem, options: Options) -> None:
        self.problem = problem
        self.program, self.base, self.state, self.goal = problem.program, problem.base, problem.state, problem.goal
        self.options = options
        self.deadline = time.monotonic() + options.time_limit
        self.rng = random.Random(options.seed)
        relevant = relevant_streams(self.program, self.goal, self.base)
        ordered, recursive = in_order((s for s in self.base.streams if s.name in relevant), self.program.domain)
        self.streams = [s for s in ordered if not s.decides]
        self.lazy = [s for s in self.streams if options.adaptive or s.fluents]
        of_state = {a.predicate for s in self.streams if s.fluents for a in s.certified}
        for stream in self.streams:
            if not of_state.isdisjoint(a.predicate for a in stream.domain):
                raise InputError(
                    Diagnostic(f"stream `{stream.name}` takes what a stream with `:fluents` gives", None, stream.line,
                               hint="let actions read it instead")
                )  # fmt: skip
        self.longest = len(self.streams) + 1 if recursive else 1
        self.rungs = [(copies, self.longest + number) for number, copies in enumerate(COPIES)]
        if self.longest > UNROLLED:
            self.rungs.insert(0, (1, UNROLLED))
        self.hopes = Hopes()
        self._climb(0)
        self.searches = options.searches
        self.few_tests = FEW_TESTS
        self.focusing = True
        self.exact = False
        self.effort = 1
        self.level = 0
        self.iterations = 0
        self.slice = min(FIRST_SLICE, options.planner_time)
        self.planner_seconds = 0.0
        self._splits: dict[bool, Split] = {}
        self._expected: list[dict[Fact, float]] = []
        self._tried: dict[tuple[str, tuple[str, ...]], None] = {}

    def solve(self) -> Found:
        """Find a plan of at most the maximal cost.

        Raises NoAnswer when there is none with what the streams can give, LimitReached at a limit of time or memory,
        SolverError when the planner fails.
        """
        self._prepare()
        while True:
            self.iterations += 1
            if self.iterations > self.options.max_iterations:
                raise LimitReached(f"no plan within {self.options.max_iterations} iterations")
            self._apply_rules()
            self._show_exhausted()
            hoped, focused = self._hope()
            steps = self._plan(hoped)
            if steps is None:
                if focused:
                    self.focusing = False
                else:
                    self._hope_again(hoped)
                continue
            needs = plan_needs(self.program, hoped, self.state, steps, self.goal)
            if needs is None:
                self._mistrust("the planner's plan cannot be explained")
                continue
            found = self._complete(hoped, steps, needs)
            if found is not None:
                return found

    def _hope(self) -> tuple[OptimisticFacts, bool]:
        """What may be, and whether that is only what matters to a plan over a coarse view of it."""
        if not self.focusing:
            return self._hope_for_all(), False
        try:
            return self._assume(self.hopes, most=MANY_CALLS), False
        except TooManyCalls:
            coarse = self._assume(Hopes(depth=self.longest, hidden=self.hopes.hidden, coarse=True))
            steps = self._plan(coarse)
            if steps is None:
                self.focusing = False
                return self._hope_for_all(), False
            return self._assume(self.hopes, wanted=focus(coarse, steps, self.lazy)), True

    def _hope_for_all(self) -> OptimisticFacts:
        """What may be, with as many outputs and as long chains of calls as can be assumed."""
        while True:
            try:
                return self._assume(self.hopes)
            except TooManyCalls:
                if self.rung == 0:
                    raise
                del self.rungs[self.rung :]
                self._climb(self.rung - 1)

    def _assume(self, hopes: Hopes, **limits: Any) -> OptimisticFacts:
        costs, outputs = self.options.opt_costs, self.options.opt_outputs
        return OptimisticFacts.of(self.base, hopes, self.lazy, costs, self._left, opt_outputs=outputs, **limits)

    def _climb(self, rung: int) -> None:
        """Assume so many outputs of each stream call and so long chains of calls."""
        self.rung = rung
        self.hopes.copies, self.hopes.depth = self.rungs[rung]

    def _left(self) -> float:
        left = self.deadline - time.monotonic()
        if left <= 0:
            raise LimitReached("the time limit was reached")
        return left

    def _prepare(self) -> None:
        if not self.options.adaptive:
            self._sample()
        self._run_tests()

    def _run_tests(self) -> None:
        """Run the eager tests, and those on few enough objects that the planner knows."""
        hidden = self.hopes.hidden
        for stream in {id(s): s for s in self.base.tests.values()}.values():
            inputs = [args for args in self.base.inputs(stream, self._left) if hidden.isdisjoint(args)]
            if stream.name in self.options.eager or len(inputs) <= self.few_tests:
                for args in inputs:
                    self._left()
                    self.base.run_test(stream, args)

    def _sample(self) -> bool:
        """One level more of samples, and every test on them."""
        self.level += 1
        quota = dict.fromkeys((s.name for s in self.base.streams), 0)
        quota |= {s.name: self.level * self.options.quota.get(s.name, 1) for s in self.streams}
        grew = sample(self.base, quota, self.deadline)
        run_tests(self.base, self.deadline)
        self.options.progress(f"level {self.level}: {len(self.base.values)} objects")
        return grew

    def _apply_rules(self) -> None:
        """Draw all consequences of rules."""
        rules = [s for s in self.streams if s.kind == "rule"]
        grew = True
        while grew:
            grew = any(
                self.base.draw(rule, inputs) is not None
                for rule in rules
                for inputs in self.base.inputs(rule, self._left)
                if not self.base.exhausted(rule, inputs)
            )
            self._left()

    def _plan(self, hoped: OptimisticFacts) -> list[Step] | None:
        if self.exact not in self._splits:
            self._splits[self.exact] = split(self.program, self.goal, self.base, self.exact)
        task = self._splits[self.exact]
        program, base = hopeful_problem(task, hoped)
        options, start = self.options, time.monotonic()
        limit = min(self._left(), options.planner_time)
        try:
            with translated(
                program, base, self.state, task.goal,
                time_limit=limit, memory_limit=options.memory_limit, unit_costs=options.unit_costs,
            ) as planner:  # fmt: skip
                steps = self._search(planner)
        finally:
            self.planner_seconds += time.monotonic() - start
        length = "no plan" if steps is None else f"a plan of {len(steps)} steps"
        options.progress(
            f"iteration {self.iterations}: {length} over {len(hoped.values)} objects, {len(hoped.made)} stream "
            f"calls assumed ({time.monotonic() - start:.2f} s)"
        )
        return steps

    def _search(self, planner: Planner) -> list[Step] | None:
        """Search in slices of time that become longer and begin with another search when the first was in vain."""
        while True:
            start = time.monotonic()
            limit = min(self._left(), self.slice)
            try:
                steps = planner(self.searches, limit, self.options.max_cost)
            except MemoryLimitReached:
                raise
            except LimitReached:
                if self.slice >= self.options.planner_time:
                    raise
                self.slice = min(2 * self.slice, self.options.planner_time)
                continue
            if time.monotonic() - start > limit / 2:  # the first search used its share up in vain
                self.searches = (*self.searches[1:], self.searches[0])
            return steps

    def _hope_again(self, hoped: OptimisticFacts) -> None:
        """There is no plan: try harder, or raise NoAnswer when nothing is left to be tried."""
        if self.hopes.clear():
            self.effort *= 2
            self._reveal()
            self.options.progress(f"no plan without what was given up: trying again with effort {self.effort}")
        elif not self.exact and any(negated for _, _, negated in self._splits[False].uses):
            self.exact = True
        elif not self.options.adaptive and self._more_samples():
            pass
        elif self.options.adaptive and hoped.made and self.rung + 1 < len(self.rungs):
            self._climb(self.rung + 1)
            copies, depth = self.rungs[self.rung]
            self.options.progress(f"no plan: assuming {copies} output(s) of each stream call, {depth} rounds of calls")
        elif self.options.adaptive and hoped.made and self._sample_all():
            pass
        elif hoped.made:
            raise NoAnswer(
                f"no plan over {len(self.base.values)} objects, "
                "even if all tests and streams not tried yet gave what is wished for"
            )
        else:
            raise NoAnswer("no plan: all streams are exhausted")

    def _more_samples(self) -> bool:
        if self.level >= MAX_LEVELS and self.options.time_limit == INF:
            raise NoAnswer(f"no plan within {self.level} levels of samples")
        return self._sample()

    def _sample_all(self) -> bool:
        """Samples of every stream, shown to the planner: one of them may be an object that the problem names."""
        if len(self.base.values) > MAX_OBJECTS:
            return False
        draws = 10 ** min(self.level, LAST_RESORT)
        self.level += 1
        self.hopes.hidden.clear()
        self.options.progress(f"no plan over what may be: drawing {draws} sample(s) of each stream call")
        quota = {s.name: draws if s in self.streams else 0 for s in self.base.streams}
        return sample(self.base, quota, self.deadline)

    def _reveal(self) -> None:
        """Show the planner what the streams of unsuccessful plans have given."""
        if self.effort < 4:
            return
        for name, inputs in self._tried:
            stream = next(s for s in self.streams if s.name == name)
            if not stream.fluents:
                for outputs in self.base.drawn_outputs(stream, inputs)[: self.effort]:
                    self.hopes.hidden.difference_update(outputs)

    def _mistrust(self, what: str) -> None:
        """Read tests exactly from now on. Raises SolverError when that was done already."""
        if self.exact:
            raise SolverError(f"{what}: this is a mistake in the engine, please report it")
        self.exact = True

    def _complete(self, hoped: OptimisticFacts, steps: list[Step], needs: Needs) -> Found | None:
        """Call the streams and tests that a plan needs; on failure, remember why."""
        base = self.base
        known = [(f, value) for f, value in sorted(needs.literals) if all(a in base.values for a in f[1:])]
        wrong = [1 for fact, value in known if (self._left(), base.truth(fact[0], fact[1:]))[1] != value]
        if wrong:
            self.options.progress(f"  {len(wrong)} of {len(known)} tests came out otherwise")
            self.few_tests *= 4
            self._run_tests()
            return None
        before = set(base.values)
        result = self._bind(hoped, steps, needs)
        if isinstance(result, Stuck):
            self._give_up(hoped, needs, result)
            self._refute_more(hoped, needs, result)
        if self.options.adaptive:
            self.hopes.hidden |= self.base.values.keys() - before
            self._tried |= {
                (call.stream.name, call.inputs): None
                for call in needs.calls.values()
                if all(name in base.values for name in call.inputs)
            }
        return None if isinstance(result, Stuck) else result

    def _refute_more(self, hoped: OptimisticFacts, needs: Needs, stuck: Stuck) -> None:
        """Find out what else a plan hopes for in vain when a test outcome is left out, with a limited effort."""
        most = self._calls() + SAMPLES * len(needs.calls)
        while self.effort == 1 and stuck.refuted and stuck.refuted.literal and self._calls() < most:
            needs.literals.discard(stuck.refuted.literal)
            bound = self._binder(needs, Counter()).solve()
            if not isinstance(bound, Refuted):
                return
            stuck = Stuck(bound)
            self._give_up(hoped, needs, stuck)

    def _bind(self, hoped: OptimisticFacts, steps: list[Step], needs: Needs) -> Found | Stuck:
        """Values for a plan's placeholders that make it a plan, and one that does not cost too much."""
        cursor: Counter[tuple[str, Args]] = Counter()
        before: Assignment = {}
        execution = Execution(self.problem, hoped, steps, self.options.unit_costs, self.effort > 1, self._left)
        for attempt in range(TRIES * self.effort):
            bound = self._binder(needs, cursor).solve()
            if isinstance(bound, Refuted):
                return Stuck(bound)
            result = execution.run(bound)
            if isinstance(result, Stuck):
                about = {name for failure in result.failures for name in failure.fact[1:]}
                hopeless = about.isdisjoint(bound) if about else not self.exact
                if hopeless or bound == before or attempt == TRIES * self.effort - 1:
                    return result
                before = dict(bound)
                continue
            if result.cost <= self.options.max_cost + 1e-9:
                return result
            expected = execution.placeholder_costs(bound)
            if not expected:
                return Stuck(too_costly=True)
            self._expected.append(expected)
        for fact in {fact for costs in self._expected for fact in costs}:
            self.hopes.costs[fact] = min(costs[fact] for costs in self._expected if fact in costs)
        self._expected.clear()
        return Stuck(too_costly=True)

    def _calls(self) -> int:
        return sum(statistics.calls for statistics in self.base.statistics.values())

    def _binder(self, needs: Needs, cursor: Counter[tuple[str, Args]]) -> Binder:
        contextual = set(self.options.contextual)
        return Binder(self.base, needs, self.deadline, self.effort, self.rng, contextual, cursor)

    def _show_exhausted(self) -> None:
        """Samples stay unknown to the planner unless they are all that there is."""
        hidden = self.hopes.hidden
        growing = bool(hidden)
        while growing:
            size = len(hidden)
            for stream in self.streams:
                for inputs in () if stream.fluents else self.base.inputs(stream, self._left):
                    if hidden.isdisjoint(inputs) and self.base.exhausted(stream, inputs):
                        hidden.difference_update(*self.base.drawn_outputs(stream, inputs))
            growing = len(hidden) < size

    def _give_up(self, hoped: OptimisticFacts, needs: Needs, stuck: Stuck) -> None:
        hopes, refuted = self.hopes, stuck.refuted
        match refuted:
            case None if stuck.too_costly:
                text = f"the plan costs more than {self.options.max_cost:.3f}"
                if not needs.calls:
                    raise SolverError("the planner's costs are not those of the plan: please report it")
            case None if any(failure not in hopes.in_state for failure in stuck.failures):
                hopes.in_state += stuck.failures
                text = (
                    f"{' '.join(stuck.failures[0].fact)} is {'true' if stuck.failures[0].true else 'false'} in a state"
                )
            case Refuted(call=call) if call is not None:
                hopes.calls.add(call.key)
                text = f"{call.stream.name}({', '.join(call.inputs)}) gives nothing that fits"
            case Refuted(literal=literal) if literal is not None:
                hopes.literals |= {literal} if self.effort > 1 else hoped.alike(literal)
                text = f"{' '.join(literal[0])} stays {'false' if literal[1] else 'true'}"
            case _:
                text = "the real facts refute the plan"
                if not self.exact or not needs.calls:
                    self._mistrust(text)
                else:
                    hopes.calls |= needs.calls.keys()
        self.options.progress(f"  {text}")
