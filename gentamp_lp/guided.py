"""Guided planning: follow the policy, sample only what it asks for, backtrack where geometry refuses.

In every state the policy names one abstract action. The planner binds the arguments of the concrete actions that
were seen with it, cheapest conditions first, and checks the abstract effect before the expensive streams (inverse
kinematics, arm collisions) are called. Streams are drawn from lazily and their results kept; a dead end is undone
chronologically, and when a round's budget is spent the search restarts with larger sampling limits.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, field

from gentamp_lp.errors import LimitReached, NoAnswer
from gentamp_lp.features import Features, matches_effects, valuation
from gentamp_lp.policy import AbstractAction, Policy
from gentamp_lp.streams.facts import Args, FactBase
from gentamp_lp.streams.formula import And, Formula, atoms, conjuncts, free_variables
from gentamp_lp.streams.incremental import quota_for, sample
from gentamp_lp.streams.pddl import ActionSchema, Stream
from gentamp_lp.streams.semantics import Program, State, Step, View, apply, reads
from gentamp_lp.task import Instance

_BACKTRACKS = 30  # per round, doubled every round


class LazyView(View):
    """A view that calls streams when a condition needs entities not sampled yet."""

    def __init__(self, program: Program, base: FactBase, state: State, limit: Callable[[str], int]) -> None:
        super().__init__(program, base, state)
        self._limit = limit

    def generates(self, predicate: str) -> bool:
        """Whether unbound arguments of this predicate may be filled by calling streams."""
        return predicate in self.base.makers

    def rows(self, predicate: str, pattern: tuple[str | None, ...]) -> Iterable[Args]:
        """Known tuples first, then new ones from the streams, one draw each in turn up to the limit."""
        if predicate not in self.base.makers:
            yield from super().rows(predicate, pattern)
            return
        yield from self._relation(predicate).matches(pattern)
        for stream in self.base.makers[predicate]:
            yield from self._draw(stream, predicate, pattern)

    def _draw(self, stream: Stream, predicate: str, pattern: tuple[str | None, ...]) -> Iterator[Args]:
        atom = next(a for a in stream.certified if a.predicate == predicate)
        known = {v: p for v, p in zip(atom.args, pattern, strict=True) if p is not None}
        if any(output in known for output in stream.outputs):
            return  # a new entity never equals a given one
        waiting = self._inputs(stream, known)
        while waiting:
            again = []
            for inputs in waiting:
                if self.base.drawn(stream, inputs) >= self._limit(stream.name) or self.base.exhausted(stream, inputs):
                    continue
                again.append(inputs)
                outputs = self.base.draw(stream, inputs)
                if outputs is not None:
                    binding = dict(zip(stream.inputs + stream.outputs, inputs + outputs, strict=True))
                    yield tuple(binding.get(a, a) for a in atom.args)
            waiting = again

    def _inputs(self, stream: Stream, known: dict[str, str]) -> list[Args]:
        guard: Formula = And(stream.domain)
        closed = View(self.program, self.base, self.state)
        given = {v: name for v, name in known.items() if v in stream.inputs}
        found = (tuple(b[v] for v in stream.inputs) for b in closed.solutions(guard, given))
        return list(dict.fromkeys(found))


@dataclass(frozen=True)
class _Phases:
    """A schema's precondition in two parts: what its effects depend on, and the rest."""

    schema: ActionSchema
    early: Formula
    late: Formula

    @classmethod
    def of(cls, schema: ActionSchema, precondition: Formula, base: FactBase) -> _Phases:
        """Conditions on parameters that no effect mentions and that only a stream can supply come late."""
        decisive = {a for e in schema.effects for a in e.atom.args} | {
            v for e in schema.effects for v in free_variables(e.condition)
        }
        made = {
            arg
            for atom in atoms(precondition)
            for stream in base.makers.get(atom.predicate, ())
            for certified in stream.certified
            if certified.predicate == atom.predicate
            for arg, name in zip(atom.args, certified.args, strict=True)
            if name in stream.outputs
        }
        postponed = made - decisive
        parts = conjuncts(precondition)
        late = tuple(p for p in parts if free_variables(p) & postponed)
        return cls(schema, And(tuple(p for p in parts if p not in late)), And(late))


@dataclass
class GuidedResult:
    """A plan found by following a policy, with the abstract action of each step."""

    steps: list[Step]
    states: list[State]
    abstract: list[str]
    rounds: int
    backtracks: int


@dataclass
class DeadEnd(NoAnswer):
    """Following the policy led nowhere; `state` is where it stopped, `reason` what was missing there."""

    reason: str
    state: State = frozenset()
    path: list[State] = field(default_factory=list)

    def __str__(self) -> str:
        return self.reason


class GuidedPlanner:
    """Follows one policy on one instance."""

    def __init__(self, policy: Policy, instance: Instance) -> None:
        self.policy = policy
        self.instance = instance
        self.base = instance.base
        self.features = Features.of(policy.features)
        domain = instance.task.folder.domain
        self.program = Program.of(domain, self.features.axioms)
        self.kinds = {f.name: f.kind for f in policy.features}
        self.actions = {a.name: a for a in policy.actions}
        self.phases = {s.name: _Phases.of(s, self.program.preconditions[s.name], self.base) for s in domain.actions}
        self._round = 0
        self._deadline = 0.0
        self._values: dict[tuple[State, int], dict[str, int]] = {}
        self._strays: dict[State, dict[str, int]] = {}  # state -> values of a refused successor without a rule
        read = {p for axiom in self.features.axioms for p in reads(axiom.body, self.program)}
        self._read = read | reads(instance.task.goal, self.program)

    def solve(self, *, time_limit: float, max_rounds: int = 8) -> GuidedResult:
        """Follow the policy from the initial state to a goal.

        Raises DeadEnd when the policy has no rule for a state it leads to or no round succeeded, LimitReached at the
        time limit.
        """
        self._deadline = time.monotonic() + time_limit
        quota = quota_for(self.base, self._read, self.instance.task.file.samples)
        sample(self.base, quota, self._deadline)  # features that quantify over samples need the task's number of them
        failure = DeadEnd("the policy was not tried")
        total = 0
        for self._round in range(max_rounds):
            result, failure, backtracks = self._search(_BACKTRACKS * 2**self._round)
            total += backtracks
            if result is not None:
                return GuidedResult(*result, rounds=self._round + 1, backtracks=total)
        raise failure

    def limit(self, stream: str) -> int:
        """How often a stream may be called on the same inputs in this round."""
        return int(self.instance.task.file.samples.get(stream, 1) * 4**self._round)

    def _check_time(self) -> None:
        if time.monotonic() > self._deadline:
            raise LimitReached("the time limit ended guided planning")

    def _view(self, state: State) -> View:
        return View(self.program, self.base, state)

    def values(self, state: State) -> dict[str, int]:
        """Feature values of a state over the entities sampled so far."""
        key = (state, sum(len(self.base.relation(p)) for p in self._read))
        if key not in self._values:
            self._values[key] = self.features.values(self._view(state))
        return self._values[key]

    def _search(self, budget: int) -> tuple[tuple[list[Step], list[State], list[str]] | None, DeadEnd, int]:
        start = self.instance.state
        goal = self.instance.task.goal
        states = [start]
        steps: list[Step] = []
        names: list[str] = []
        visited = {start}
        failure = DeadEnd("no step was possible")
        deepest = -1
        choices: list[Iterator[tuple[Step, State, str]]] = []
        backtracks = 0
        while True:
            self._check_time()
            state = states[-1]
            if len(choices) < len(states):
                if self._view(state).holds(goal):
                    return (steps, states, names), failure, backtracks
                choices.append(self._expand(state))
            following = next((c for c in choices[-1] if c[1] not in visited), None)
            if following is not None:
                step, successor, name = following
                visited.add(successor)
                steps.append(step)
                states.append(successor)
                names.append(name)
                continue
            if len(states) > deepest:
                deepest = len(states)
                failure = DeadEnd(self._reason(state), state, list(states))
            backtracks += 1
            if len(states) == 1 or backtracks > budget:
                return None, failure, backtracks
            for stack in (choices, states, steps, names):
                stack.pop()

    def _reason(self, state: State) -> str:
        values = self.values(state)
        rule = self.policy.rule_for(valuation(values))
        shown = ", ".join(f"{name}={value}" for name, value in values.items())
        if rule is None:
            return f"the policy has no rule for the abstract state {shown}"
        reason = f"no concrete step carries out abstract action {rule.action} in the abstract state {shown}"
        if state in self._strays:
            stray = ", ".join(f"{name}={value}" for name, value in self._strays[state].items())
            reason += f" and stays where the policy has a rule: there is none for {stray}"
        return reason

    def _expand(self, state: State) -> Iterator[tuple[Step, State, str]]:
        """Steps that carry out the policy's abstract action, lazily, each with its successor."""
        rule = self.policy.rule_for(valuation(self.values(state)))
        if rule is None:
            return
        action = self.actions[rule.action]
        tried: set[State] = set()
        for name in action.schemas:
            phases = self.phases[name]
            view = LazyView(self.program, self.base, state, self.limit)
            for early in view.solutions(phases.early):
                self._check_time()
                partial = tuple(early.get(p, "") for p in phases.schema.parameters)
                successor = apply(view, Step(name, partial))
                if successor in tried:
                    continue
                if not self._acceptable(state, successor, action):
                    tried.add(successor)
                    continue
                binding = {p: early[p] for p in phases.schema.parameters if p in early}
                late = next(view.solutions(phases.late, binding), None)
                if late is not None:
                    tried.add(successor)
                    yield Step(name, tuple(late[p] for p in phases.schema.parameters)), successor, action.name

    def _acceptable(self, state: State, successor: State, action: AbstractAction) -> bool:
        """Whether the step has the abstract effect and leads where the policy knows what to do next."""
        before, after = self.values(state), self.values(successor)
        if not matches_effects(action.effects, self.kinds, before, after):
            return False
        if self.policy.rule_for(valuation(after)) or self._view(successor).holds(self.instance.task.goal):
            return True
        self._strays[state] = after
        return False
