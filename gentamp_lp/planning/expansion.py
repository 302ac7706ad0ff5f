"""The steps from one state that carry out the policy's abstract action there, found lazily.

Streams are drawn from no more often than the task's limits say, times a growing factor; where steps run dry, more is
drawn. Calls whose outputs cannot have the abstract effect are not made again.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, field
from functools import cache
from itertools import chain

from gentamp_lp.features.axioms import Features
from gentamp_lp.planning.bindings import Bindings, needed
from gentamp_lp.planning.feature_changes import Prospect
from gentamp_lp.planning.outcome import Outcomes, Outlook, Refused
from gentamp_lp.planning.repair import Wish, Wishes
from gentamp_lp.policy.model import AbstractAction, Rule
from gentamp_lp.policy.policy import Policy
from gentamp_lp.streams.facts import Fact
from gentamp_lp.streams.queries import Situation
from gentamp_lp.streams.relations import Args
from gentamp_lp.streams.semantics import Program, State, Step, reads
from gentamp_lp.streams.stream_file import Stream
from gentamp_lp.tasks.task import Instance

GROWTH = 4  # by how much sampling limits grow where samples run out, and every round


@dataclass
class Move:
    """A step that the policy allows, with what it changes; `known` are the parameters that decide that."""

    step: Step
    known: Args
    abstract: str
    added: list[Fact]
    deleted: list[Fact]
    outlook: Outlook
    successor: State


@dataclass
class _Expansion:
    """What is known of the steps from one state that carry out its abstract action.

    `barren` calls give only what refused entities are, too; steps to a `dead` abstract state led nowhere; `short` says
    that a stream would give more if it were called more often.
    """

    state: State = frozenset()
    tried: set[State] = field(default_factory=set)
    barren: set[tuple[str, Args]] = field(default_factory=set)
    dead: set[tuple[bool, ...]] = field(default_factory=set)
    growth: int = 1
    short: bool = False


class Expander:
    """Finds the steps of one policy on one instance, in its present situation.

    `growth` multiplies the task's sampling limits; no step leads to a state that was `visited`; and none gets in the
    way of the `wish`, if there is one. `check_time` raises LimitReached at the deadline.
    """

    def __init__(
        self, policy: Policy, instance: Instance, features: Features, program: Program, check_time: Callable[[], object]
    ) -> None:
        self.actions = {a.name: a for a in policy.actions}
        self.growth = 1
        self.visited: set[State] = set()
        self.wish: tuple[Wish, Wishes] | None = None
        self._base, self._policy, self._features, self._check_time = instance.base, policy, features, check_time
        self._samples = instance.task.file.samples
        self._open = {  # abstract states whose action may end at a goal or not
            r.valuation for r in policy.rules if len({o in policy.goals for o in r.outcomes}) == 2
        }
        self._here = _Expansion()  # that of the generator that runs at present
        self._situation = Situation(program, instance.base, instance.state, self._spent)
        self.outcomes = Outcomes(policy, features, self._situation, instance.task.goal)
        tested = {p for axiom in features.axioms for p in reads(axiom.body, program)} & self._base.tests.keys()
        self._tests_late = not tested
        self._settled = {stream.name: self._settled_by(stream) for stream in self._base.streams}
        self.bindings = cache(self._bindings)

    def _spent(self, stream: Stream, inputs: Args) -> bool:
        """Whether a stream is not to be called on these inputs at present."""
        here = self._here
        if (stream.name, inputs) in here.barren or self._base.exhausted(stream, inputs):
            return True
        limit = self._samples.get(stream.name, 1) * here.growth
        spent = self._base.drawn(stream, inputs) >= limit
        here.short |= spent
        return spent

    def _bindings(self, schema_name: str, action: str) -> Bindings:
        schema = self._situation.program.domain.action(schema_name)
        asked = list(needed(schema, self.actions[action], self._features, self.outcomes.values))
        return Bindings(schema, asked, self._situation, self._tests_late)

    def _settled_by(self, stream: Stream) -> set[str]:
        """Features that read nothing of a stream's outputs but what is certified with them."""
        made = {atom.predicate for atom in stream.certified}
        users = [other for other in self._base.streams if made & {atom.predicate for atom in other.domain}]
        more = {atom.predicate for other in users for atom in other.certified} | self._base.tests.keys()
        heads = {axiom.head.predicate: axiom for axiom in self._features.axioms}
        program = self._situation.program
        return {name for name in self.outcomes.kinds if more.isdisjoint(reads(heads[name].body, program))}

    def rule(self) -> Rule | None:
        """The policy's rule for the present situation."""
        return self._policy.rule_for(self.outcomes.values.positive())

    def moves(self, state: State, hint: tuple[str, Args]) -> Iterator[Move]:
        """Steps from the present `state` to new ones that carry out the policy's abstract action, lazily; more is
        sampled when there are none.

        The step that `hint` names (schema and known parameters) is the first, if it is one of them.
        """
        rule = self.rule()
        if rule is None:
            return
        action = self.actions[rule.action]
        here = _Expansion(state)
        found = False
        for here.growth in (self.growth, self.growth * GROWTH, self.growth * GROWTH**2):
            here.short = False
            for name in action.schemas:
                self._here = here
                bindings = self.bindings(name, action.name)
                first = [hint[1]] if hint[0] == name and bindings.allows.holds(hint[1]) else []
                last = self._last_steps(bindings) if rule.valuation in self._open else ()
                for move in self._moves(bindings, action, here, chain(first, last)):
                    found = True
                    yield move
                    here.dead.add(move.outlook.abstract)
                    self._here = here  # meanwhile other states were expanded
            if found or not here.short:
                return

    def _last_steps(self, bindings: Bindings) -> Iterator[Args]:
        """Bindings with which a step ends at a goal, where one thing is missing."""
        unmet = self.outcomes.unmet
        missing = unmet.single()
        if missing is not None:
            for known in bindings.narrowed(unmet.puts_out(missing, bindings.schema)).solutions():
                if not unmet.any_after(*bindings.changes(known), Prospect()):
                    yield known

    def _moves(
        self, bindings: Bindings, action: AbstractAction, here: _Expansion, first: Iterable[Args]
    ) -> Iterator[Move]:
        state = here.state
        postponed: list[Args] = []  # for the others lead elsewhere than where nothing was found
        for known in chain(first, bindings.in_order(), postponed):
            self._check_time()
            added, deleted = bindings.changes(known)
            successor = (state - frozenset(deleted)) | frozenset(added)
            if successor in here.tried or successor in self.visited:
                continue
            outlook = self.outcomes.of(state, added, deleted, action)
            if isinstance(outlook, Refused):
                self._learn(here, outlook.feature, known)
                here.tried.add(successor)
                bindings.failed.add(known)
                continue
            if outlook.abstract in here.dead and known not in postponed:
                postponed.append(known)
            elif self._in_the_way(added, deleted):
                continue
            elif args := next(bindings.late.solutions(known), None):
                here.tried.add(successor)
                step = Step(bindings.schema.name, args)
                yield Move(step, known, action.name, added, deleted, outlook, successor)
            else:
                bindings.failed.add(known)

    def _in_the_way(self, added: list[Fact], deleted: list[Fact]) -> bool:
        """Whether a step would make an obstacle for what is wished for."""
        if self.wish is None:
            return False
        wish, wishes = self.wish
        self._situation.change(added, deleted)
        hindered = not wishes.obstacles(wish).isdisjoint(added)
        self._situation.change(deleted, added)
        return hindered

    def _learn(self, here: _Expansion, feature: str | None, known: Args) -> None:
        """A feature refused a binding: if that is settled by the call that made an entity of it, call no more.

        Outputs of one call differ in tests and in what other streams make of them only.
        """
        if feature is None:
            return
        made_by = self._base.made_by
        present = {name for fact in here.state for name in fact[1:]}
        makers = [made_by[n] for n in known if n not in present and n in made_by]
        if len(makers) == 1 and feature in self._settled[makers[0][0]]:
            here.barren.add(makers[0][:2])
