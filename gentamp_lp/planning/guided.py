"""Guided planning: follow the policy, sample only what it asks for, backtrack where geometry refuses.

In every state the policy names one abstract action. The planner binds the arguments of the concrete actions that
were seen with it (module `bindings`), cheapest conditions first, and checks the abstract effect (`outcome`) before the
expensive streams (inverse kinematics, arm collisions) are called. One state is changed in place, and feature values
follow its changes. Streams are drawn from lazily and their results kept; where they run dry, more is drawn
(`expansion`), then steps are undone chronologically; when a round's budget is spent, the search restarts with larger
sampling limits. In every second round, a plan is repaired in place where it gets stuck (`repair`).
"""

from __future__ import annotations

import time
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass, field
from functools import partial

from gentamp_lp.errors import LimitReached, NoAnswer
from gentamp_lp.features.axioms import Features
from gentamp_lp.planning.bindings import Bindings
from gentamp_lp.planning.expansion import GROWTH, Expander, Move
from gentamp_lp.planning.outcome import Outlook
from gentamp_lp.policy.model import AbstractAction
from gentamp_lp.policy.policy import Policy
from gentamp_lp.streams.facts import Fact
from gentamp_lp.streams.relations import Args
from gentamp_lp.streams.semantics import Program, State, Step
from gentamp_lp.tasks.task import Instance

_BACKTRACKS = 30  # per round, doubled every round
_MOVES = 15  # how often one thing is put elsewhere by repairs, per round


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
        self.instance = instance
        self.features = Features.of(policy.features)
        self.program = Program.of(instance.task.folder.domain, self.features.axioms)
        self._deadline = 0.0
        self._moved: Counter[Fact] = Counter()  # how often facts, and what is given of them, were moved in this round
        self._hints: dict[int, tuple[str, Args]] = {}  # depth -> the step to try first there
        self._expander = Expander(policy, instance, self.features, self.program, self._check_time)
        self.outcomes = self._expander.outcomes

    def solve(self, *, time_limit: float, max_rounds: int = 8) -> GuidedResult:
        """Follow the policy from the initial state to a goal.

        Raises DeadEnd when the policy has no rule for a state it leads to or no round succeeded, LimitReached at the
        time limit.
        """
        self._deadline = time.monotonic() + time_limit
        self._check_time()
        for watches in (self.outcomes.values, self.outcomes.unmet):
            watches.sample()  # what quantifies over samples needs the task's number of them
        failure = DeadEnd("the policy was not tried")
        total = 0
        for number in range(max_rounds):
            self._expander.growth = GROWTH**number
            moves, failure, backtracks = self._search(_BACKTRACKS * 2**number, repairing=number % 2 == 1)
            total += backtracks
            if moves is not None:
                states = [self.instance.state, *(m.successor for m in moves)]
                return GuidedResult([m.step for m in moves], states, [m.abstract for m in moves], number + 1, total)
        raise failure

    def _check_time(self) -> None:
        if time.monotonic() > self._deadline:
            raise LimitReached("the time limit ended guided planning")

    def _search(self, budget: int, repairing: bool) -> tuple[list[Move] | None, DeadEnd, int]:
        """One round: the moves that lead to a goal, if they were found within a budget of backtracks; the deepest dead
        end; and the number of backtracks.
        """
        states = [self.instance.state]
        moves: list[Move] = []
        choices: list[Iterator[Move]] = []
        failure = DeadEnd("no step was possible")
        deepest, backtracks = -1, 0
        expander = self._expander
        expander.visited, expander.wish, self._hints = {states[0]}, None, {}
        self._moved.clear()
        while True:
            self._check_time()
            if len(choices) < len(states):
                if not self.outcomes.unmet.any():
                    return moves, failure, backtracks
                choices.append(expander.moves(states[-1], self._hints.pop(len(choices), ("", ()))))
            following = next(choices[-1], None)
            if following is not None:
                expander.visited.add(following.successor)
                moves.append(following)
                if expander.wish and expander.wish[0][:2] == (following.step.schema, following.known):
                    expander.wish = None
                states.append(following.successor)
                self.outcomes.change(following.added, following.deleted, following.outlook)
                continue
            if len(states) > deepest:
                deepest = len(states)
                failure = DeadEnd(self.outcomes.reason(states[-1]), states[-1], list(states))
            backtracks += 1
            if backtracks > budget or not moves:
                self._back(0, states, moves, choices)
                return None, failure, backtracks
            kept = self._repair(states[-1], moves) if repairing else len(moves) - 1
            self._back(kept, states, moves, choices)

    def _back(self, depth: int, states: list[State], moves: list[Move], choices: list[Iterator[Move]]) -> None:
        """Undo steps."""
        while len(moves) > depth:
            move = moves.pop()
            self.outcomes.change(move.deleted, move.added)
        del states[depth + 1 :], choices[depth + 1 :]

    def _repair(self, state: State, moves: list[Move]) -> int:
        """How many steps to keep at a dead end: those before the first that made what is in the way, or all but one.

        In the former case, the steps after it will be tried again first.
        """
        expander = self._expander
        expander.wish, self._hints = None, {}
        added = ((fact, number) for number, move in enumerate(moves) for fact in move.added)
        made = {fact: number for fact, number in added if self._moved[self._given(fact)] < _MOVES}
        rule = expander.rule()
        if rule is None:
            return len(moves) - 1
        action = expander.actions[rule.action]
        for name in action.schemas:
            bindings = expander.bindings(name, action.name)
            suits = partial(self._suits, state, bindings, action)
            wish = bindings.wishes.best(made, lambda fact: 1 + self._moved[fact], suits)
            if wish is not None:
                self._moved.update({*wish.obstacles, *map(self._given, wish.obstacles)})
                expander.wish = wish, bindings.wishes
                again = ((i, move) for i, move in enumerate(moves) if wish.obstacles.isdisjoint(move.added))
                self._hints = {i: (move.step.schema, move.known) for i, move in again}
                self._hints[len(moves)] = wish[:2]
                return min(made[fact] for fact in wish.obstacles)
        return len(moves) - 1

    def _suits(self, state: State, bindings: Bindings, action: AbstractAction, known: Args) -> bool:
        """Whether a step would have the abstract effect."""
        return isinstance(self.outcomes.of(state, *bindings.changes(known), action), Outlook)

    def _given(self, fact: Fact) -> Fact:
        """A fact without what streams have made."""
        return tuple(name for name in fact if name not in self.instance.base.made_by)
