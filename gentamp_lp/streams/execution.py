"""Carrying out an optimistic plan: with real values for its placeholders, each step is checked in the real state."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

from gentamp_lp.streams.binding import Assignment, Refuted
from gentamp_lp.streams.facts import Fact
from gentamp_lp.streams.hopes import StateFailure
from gentamp_lp.streams.optimistic_facts import OptimisticFacts
from gentamp_lp.streams.problem import PlanningProblem
from gentamp_lp.streams.problem_text import COST_SCALE
from gentamp_lp.streams.relations import bind
from gentamp_lp.streams.semantics import State, Step, View, apply, precondition_holds
from gentamp_lp.streams.stream_file import Stream


@dataclass(frozen=True)
class Found:
    """A plan, its cost, the states along it, and what fluent streams certified in them."""

    steps: list[Step]
    cost: float
    states: list[State]
    facts: set[Fact]


@dataclass(frozen=True)
class Stuck:
    """Where a plan fails: at a call in a state, or (None) at a condition."""

    refuted: Refuted | None = None
    failures: tuple[StateFailure, ...] = ()  # what streams with `:fluents` said in this state, about placeholders
    too_costly: bool = False  # the plan holds but costs too much


@dataclass(frozen=True)
class Execution:
    """A plan over placeholders, to be carried out with one choice of real values or another.

    `exact`: what a stream with `:fluents` refuses in a state is refused in states with just the same facts, else also
    in those with more. `check_time` raises LimitReached at the deadline.
    """

    problem: PlanningProblem
    hoped: OptimisticFacts
    steps: list[Step]
    unit_costs: bool
    exact: bool
    check_time: Callable[[], object]

    def run(self, bound: Assignment) -> Found | Stuck:
        """Simulate the plan with real values; streams that depend on the state are called in it."""
        program, base, state = self.problem.program, self.problem.base, self.problem.state
        states, found, certified, cost = [state], [], set[Fact](), 0.0
        *optimistic, last = self._optimistic_states()
        for step, before in zip(self.steps, optimistic, strict=True):
            self.check_time()
            called = self._call_in_state(step, state, before, bound)
            if isinstance(called, Stuck):
                return called
            binding, facts = called
            real = Step(step.schema, tuple(binding.get(name, name) for name in step.args))
            view = View(program, base, state | facts)
            if not precondition_holds(view, real):
                return self._failed_condition(view, before, binding)
            amount = self._cost(real)
            if amount is None:
                return Stuck()
            cost += amount
            certified |= facts | {fact for fact, true in view.in_state.items() if true}
            state = apply(view, real) - facts
            states.append(state)
            found.append(real)
        view = View(program, base, state)
        if not view.holds(self.problem.goal):
            return self._failed_condition(view, last, bound)
        certified |= {fact for fact, true in view.in_state.items() if true}
        return Found(found, cost, states, certified)

    def _call_in_state(
        self, step: Step, state: State, before: State, bound: Assignment
    ) -> tuple[dict[str, str], set[Fact]] | Stuck:
        """The values of a step's placeholders, and what the streams that depend on the state certified in it.

        `before` is the state with placeholders.
        """
        binding: dict[str, str] = dict(bound)
        facts: set[Fact] = set()
        call_of = self.hoped.call_of
        for call in (call_of[name] for name in step.args if name in call_of):
            if not call.stream.fluents or call.outputs[0] in binding:
                continue
            inputs = tuple(binding.get(name, name) for name in call.inputs)
            given = sorted(fact for fact in state if fact[0] in call.stream.fluents)
            answer = self.problem.base.call_in_state(call.stream, inputs, given)
            if answer is None:
                names = dict(zip(call.stream.inputs + call.stream.outputs, call.inputs + call.outputs, strict=True))
                missing = {(a.predicate, *bind(a, names)): False for a in call.stream.certified}
                return Stuck(failures=self._failures(missing, call.stream, before))
            binding |= zip(call.outputs, answer[0], strict=True)
            facts |= answer[1]
        return binding, facts

    def _failed_condition(self, view: View, before: State, binding: Mapping[str, str]) -> Stuck:
        """What tests with `:fluents` said, when a condition does not hold; `before` is the state with placeholders."""
        placeholders = {value: name for name, value in binding.items()}
        failures: list[StateFailure] = []
        for fact, true in view.in_state.items():
            hoped = {(fact[0], *(placeholders.get(a, a) for a in fact[1:])): true}
            failures += self._failures(hoped, self.problem.base.state_tests[fact[0]], before)
        return Stuck(failures=tuple(failures))

    def _failures(self, said: Mapping[Fact, bool], stream: Stream, before: State) -> tuple[StateFailure, ...]:
        situation = frozenset(fact for fact in before if fact[0] in stream.fluents)
        return tuple(StateFailure(fact, situation, stream.fluents, self.exact, true) for fact, true in said.items())

    def _optimistic_states(self) -> list[State]:
        """States along the plan, with placeholders."""
        states = [self.problem.state]
        for step in self.steps:
            states.append(apply(View(self.problem.program, self.hoped, states[-1]), step))
        return states

    def _cost(self, step: Step) -> float | None:
        domain = self.problem.program.domain
        schema = domain.action(step.schema)
        if self.unit_costs or not any(a.cost or a.cost_terms for a in domain.actions):
            return 1.0
        binding = dict(zip(schema.parameters, step.args, strict=True))
        values = [self.problem.base.cost(term.predicate, bind(term, binding)) for term in schema.cost_terms]
        return None if None in values else schema.cost + sum(value for value in values if value is not None)

    def placeholder_costs(self, bound: Assignment) -> dict[Fact, float]:
        """What functions of placeholders come to with these values, and the least that the planner can tell more."""
        found: dict[Fact, float] = {}
        for step in self.steps:
            schema = self.problem.program.domain.action(step.schema)
            binding = dict(zip(schema.parameters, step.args, strict=True))
            for term in schema.cost_terms:
                args = bind(term, binding)
                value = self.problem.base.cost(term.predicate, tuple(bound.get(a, a) for a in args))
                if value is not None and any(a in self.hoped.call_of for a in args):
                    found[(term.predicate, *args)] = value + 1 / COST_SCALE
        return found
