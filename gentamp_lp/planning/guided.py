"""Guided planning: follow the policy, sample only what it asks for, backtrack where geometry refuses.

In every state the policy names one abstract action. The planner binds the arguments of the concrete actions that
were seen with it, cheapest conditions first, and checks the abstract effect before the expensive streams (inverse
kinematics, arm collisions) are called. One state is changed in place, and feature values follow its changes. Streams
are drawn from lazily and their results kept; where they run dry, more is drawn, then steps are undone chronologically;
when a round's budget is spent, the search restarts with larger sampling limits. In every second round, a plan is
repaired in place where it gets stuck (module `repair`).
"""

from __future__ import annotations

import time
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, field
from functools import cache, cached_property, partial
from itertools import chain

from gentamp_lp.errors import LimitReached, NoAnswer
from gentamp_lp.features.axioms import Features
from gentamp_lp.features.values import effect_of, valuation
from gentamp_lp.planning.feature_changes import Prospect, Watches
from gentamp_lp.planning.repair import Wish, Wishes
from gentamp_lp.policy.model import AbstractAction
from gentamp_lp.policy.policy import Policy
from gentamp_lp.streams.facts import Fact, FactBase
from gentamp_lp.streams.formula import (
    And,
    Atom,
    Exists,
    Formula,
    Not,
    Or,
    atoms,
    conjuncts,
    normalize,
    substitute,
)
from gentamp_lp.streams.pddl import ActionSchema, Axiom
from gentamp_lp.streams.queries import Query, Situation
from gentamp_lp.streams.relations import Args
from gentamp_lp.streams.semantics import Program, State, Step, reads
from gentamp_lp.streams.stream_file import Stream
from gentamp_lp.tasks.task import Instance

_BACKTRACKS = 30  # per round, doubled every round
_MOVES = 15  # how often one thing is put elsewhere by repairs, per round
_GROWTH = 4  # by how much sampling limits grow where samples run out, and every round


class _Phases:
    """A schema's precondition in two parts: what decides the effects, and what is looked at when these are right.

    Conditions come late on parameters that no effect mentions and that only a stream can supply, and, unless features
    run tests themselves, conditions that run tests. `needed` is what the wanted effects ask of the parameters.
    """

    def __init__(
        self, schema: ActionSchema, needed: Sequence[Atom], program: Program, situation: Situation, tests_late: bool
    ) -> None:
        base, precondition = situation.base, program.preconditions[schema.name]
        postponed = _made(precondition, base) - _decisive(schema)
        parts = conjuncts(precondition)
        late = tuple(
            part for part in parts if part.free & postponed or (tests_late and reads(part, program) & base.tests.keys())
        )
        early = And((*needed, *(part for part in parts if part not in late)))
        self.schema = schema
        self.known = tuple(p for p in schema.parameters if p in early.free)
        self.early: Query = situation.query(early, (), self.known, lazy=True)
        self.allows: Query = situation.query(early, self.known)
        self.narrowed = cache(lambda more: situation.query(And((more, *early.parts)), (), self.known, lazy=True))
        self._wishes = partial(Wishes, schema.name, early.parts, late, self.known, schema.parameters, situation)
        self.failed: set[Args] = set()  # values of `known` that were no use in some state
        self.late: Query = situation.query(And(late), self.known, schema.parameters, lazy=True)

    @cached_property
    def wishes(self) -> Wishes:
        """Made at the first dead end: most plans have none to repair."""
        return self._wishes()


def _decisive(schema: ActionSchema) -> set[str]:
    """Parameters that the effects depend on."""
    named = {a for e in schema.effects for a in e.atom.args}
    return named | {v for e in schema.effects for v in e.condition.free}


def _made(formula: Formula, base: FactBase) -> set[str]:
    """Variables of a formula that stand where a stream puts new entities."""
    return {
        arg
        for atom in atoms(formula)
        for stream in base.makers.get(atom.predicate, ())
        for certified in stream.certified
        if certified.predicate == atom.predicate
        for arg, name in zip(atom.args, certified.args, strict=True)
        if name in stream.outputs
    }


def _unmet(goal: Formula) -> list[Axiom]:
    """What keeps the goal from holding: for each conjunct, the entities that violate it, or that it does not hold."""
    axioms = []
    for number, part in enumerate(conjuncts(normalize(goal))):
        match part:
            case Not(Exists(variables, body)):
                axioms.append(Axiom(Atom(f"unmet-{number}", variables), body))
            case _:
                axioms.append(Axiom(Atom(f"unmet-{number}", ()), Not(part)))
    return axioms


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


@dataclass
class _Outlook:
    """What a step will do to the features and to what keeps the goal from holding, and the abstract state it leads to
    (empty for a goal).
    """

    values: Prospect = field(default_factory=Prospect)
    unmet: Prospect = field(default_factory=Prospect)
    abstract: tuple[bool, ...] = ()


@dataclass
class _Move:
    """A step that the policy allows, with what it changes."""

    step: Step
    known: Args
    abstract: str
    added: list[Fact]
    deleted: list[Fact]
    outlook: _Outlook
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
        self._open = {  # abstract states whose action may end at a goal or not
            r.valuation for r in policy.rules if len({o in policy.goals for o in r.outcomes}) == 2
        }
        self._round = 1  # multiple of the task's sampling limits
        self._here = _Expansion()  # that of the generator that runs at present
        self._deadline = 0.0
        self._visited: set[State] = set()  # in this round
        self._moved: Counter[Fact] = Counter()  # how often facts, and what is given of them, were moved in this round
        self._wish: tuple[Wish, Wishes] | None = None  # what nothing may get in the way of before it is carried out
        self._hints: dict[int, tuple[str, Args]] = {}  # depth -> the step to try first there
        self._strays: dict[State, dict[str, int]] = {}  # state -> values of a refused successor without a rule
        self._situation = Situation(self.program, self.base, instance.state, self._spent)
        names = {f.name for f in policy.features}
        self._values = Watches(self._situation, [a for a in self.features.axioms if a.head.predicate in names])
        self._goal = Watches(self._situation, _unmet(instance.task.goal))
        tested = {p for axiom in self.features.axioms for p in reads(axiom.body, self.program)} & self.base.tests.keys()
        self._settled = {stream.name: self._settled_by(stream) for stream in self.base.streams}
        self._tests_late = not tested
        self._phases = cache(self._plan_phases)

    def solve(self, *, time_limit: float, max_rounds: int = 8) -> GuidedResult:
        """Follow the policy from the initial state to a goal.

        Raises DeadEnd when the policy has no rule for a state it leads to or no round succeeded, LimitReached at the
        time limit.
        """
        self._deadline = time.monotonic() + time_limit
        self._check_time()
        for watches in (self._values, self._goal):  # what quantifies over samples needs the task's number of them
            watches.sample()
        failure = DeadEnd("the policy was not tried")
        total = 0
        for number in range(max_rounds):
            self._round = _GROWTH**number
            result, failure, backtracks = self._search(_BACKTRACKS * 2**number, repairing=number % 2 == 1)
            total += backtracks
            if result is not None:
                return GuidedResult(*result, rounds=number + 1, backtracks=total)
        raise failure

    def _spent(self, stream: Stream, inputs: Args) -> bool:
        """Whether a stream is not to be called on these inputs at present."""
        here = self._here
        if (stream.name, inputs) in here.barren or self.base.exhausted(stream, inputs):
            return True
        limit = self.instance.task.file.samples.get(stream.name, 1) * here.growth
        spent = self.base.drawn(stream, inputs) >= limit
        here.short |= spent
        return spent

    def _plan_phases(self, name: str, abstract: str) -> _Phases:
        schema = self.program.domain.action(name)
        needed = list(self._needed(schema, self.actions[abstract]))
        return _Phases(schema, needed, self.program, self._situation, self._tests_late)

    def _needed(self, schema: ActionSchema, action: AbstractAction) -> Iterator[Atom]:
        """What the effects of an abstract action ask of an action's parameters: that what they make leave a feature's
        extension is in it, and that what they make enter is not, but fulfils what no action changes.
        """
        changing = self.program.domain.fluents
        for axiom in self.features.axioms:
            effect = action.effects.get(axiom.head.predicate)
            enters = effect in ("increase", "true")
            if effect is None or (enters and reads(axiom.body, self.program) & self.base.tests.keys()):
                continue
            rows = self._values.moved_by(axiom.head.predicate, schema, enters)
            if not rows or not axiom.head.args:
                continue
            body = normalize(axiom.body)
            if enters:
                lasting = (part for part in conjuncts(body) if reads(part, self.program).isdisjoint(changing))
                body = And((*lasting, Not(body)))
            options = [substitute(body, dict(zip(axiom.head.args, row, strict=True))) for row in sorted(rows)]
            names = tuple(dict.fromkeys(name for row in sorted(rows) for name in row if name.startswith("?")))
            yield self._situation.condition(Or(tuple(options)), names)

    def _settled_by(self, stream: Stream) -> set[str]:
        """Features that read nothing of a stream's outputs but what is certified with them."""
        made = {atom.predicate for atom in stream.certified}
        users = [other for other in self.base.streams if made & {atom.predicate for atom in other.domain}]
        more = {atom.predicate for other in users for atom in other.certified} | self.base.tests.keys()
        heads = {axiom.head.predicate: axiom for axiom in self.features.axioms}
        return {name for name in self.kinds if more.isdisjoint(reads(heads[name].body, self.program))}

    def _check_time(self) -> None:
        if time.monotonic() > self._deadline:
            raise LimitReached("the time limit ended guided planning")

    def _search(
        self, budget: int, repairing: bool
    ) -> tuple[tuple[list[Step], list[State], list[str]] | None, DeadEnd, int]:
        states = [self.instance.state]
        moves: list[_Move] = []
        self._visited = {states[0]}
        failure = DeadEnd("no step was possible")
        deepest = -1
        choices: list[Iterator[_Move]] = []
        backtracks = 0
        self._wish, self._hints = None, {}
        self._moved.clear()
        while True:
            self._check_time()
            if len(choices) < len(states):
                if not self._goal.any():
                    return ([m.step for m in moves], states, [m.abstract for m in moves]), failure, backtracks
                choices.append(self._expand(states[-1], self._hints.pop(len(choices), ("", ()))))
            following = next(choices[-1], None)
            if following is not None:
                self._visited.add(following.successor)
                moves.append(following)
                if self._wish and self._wish[0][:2] == (following.step.schema, following.known):
                    self._wish = None
                states.append(following.successor)
                self._change(following.added, following.deleted, following.outlook)
                continue
            if len(states) > deepest:
                deepest = len(states)
                failure = DeadEnd(self._reason(states[-1]), states[-1], list(states))
            backtracks += 1
            if backtracks > budget or not moves:
                self._back(0, states, moves, choices)
                return None, failure, backtracks
            kept = self._repair(states[-1], moves) if repairing else len(moves) - 1
            self._back(kept, states, moves, choices)

    def _back(self, depth: int, states: list[State], moves: list[_Move], choices: list[Iterator[_Move]]) -> None:
        """Undo steps."""
        while len(moves) > depth:
            move = moves.pop()
            self._change(move.deleted, move.added)
        del states[depth + 1 :], choices[depth + 1 :]

    def _repair(self, state: State, moves: list[_Move]) -> int:
        """How many steps to keep at a dead end: those before the first that made what is in the way, or all but one.

        In the former case, the steps after it will be tried again first.
        """
        self._wish, self._hints = None, {}
        added = ((fact, number) for number, move in enumerate(moves) for fact in move.added)
        made = {fact: number for fact, number in added if self._moved[self._given(fact)] < _MOVES}
        rule = self.policy.rule_for(self._values.positive())
        if rule is None:
            return len(moves) - 1
        action = self.actions[rule.action]
        for name in action.schemas:
            phases = self._phases(name, action.name)
            wanted = partial(self._wanted, phases, action, _Expansion(state))
            wish = phases.wishes.best(made, lambda fact: 1 + self._moved[fact], wanted)
            if wish is not None:
                self._moved.update({*wish.obstacles, *map(self._given, wish.obstacles)})
                self._wish = wish, phases.wishes
                again = ((i, move) for i, move in enumerate(moves) if wish.obstacles.isdisjoint(move.added))
                self._hints = {i: (move.step.schema, move.known) for i, move in again}
                self._hints[len(moves)] = wish[:2]
                return min(made[fact] for fact in wish.obstacles)
        return len(moves) - 1

    def _given(self, fact: Fact) -> Fact:
        """A fact without what streams have made."""
        return tuple(name for name in fact if name not in self.base.made_by)

    def _wanted(self, phases: _Phases, action: AbstractAction, here: _Expansion, known: Args) -> bool:
        """Whether a step would have the abstract effect."""
        return self._accept(here, *self._changes(phases, known), action, known) is not None

    def _change(self, added: list[Fact], deleted: list[Fact], outlook: _Outlook | None = None) -> None:
        self._situation.change(added, deleted)
        values, unmet = (outlook.values, outlook.unmet) if outlook else (None, None)
        self._values.change(added, deleted, values)
        self._goal.change(added, deleted, unmet)

    def _reason(self, state: State) -> str:
        values = self._values.counts()
        rule = self.policy.rule_for(valuation(values))
        shown = ", ".join(f"{name}={value}" for name, value in values.items())
        if rule is None:
            return f"the policy has no rule for the abstract state {shown}"
        reason = f"no concrete step carries out abstract action {rule.action} in the abstract state {shown}"
        if state in self._strays:
            stray = ", ".join(f"{name}={value}" for name, value in self._strays[state].items())
            reason += f" and stays where the policy has a rule: there is none for {stray}"
        return reason

    def _expand(self, state: State, hint: tuple[str, Args]) -> Iterator[_Move]:
        """Steps to new states that carry out the policy's abstract action, lazily; more is sampled when there are none.

        The step that `hint` names is the first, if it is one of them.
        """
        rule = self.policy.rule_for(self._values.positive())
        if rule is None:
            return
        action = self.actions[rule.action]
        here = _Expansion(state)
        found = False
        for here.growth in (self._round, self._round * _GROWTH, self._round * _GROWTH**2):
            here.short = False
            for name in action.schemas:
                self._here = here
                phases = self._phases(name, action.name)
                first = [hint[1]] if hint[0] == name and phases.allows.holds(hint[1]) else []
                last = self._last_steps(phases) if rule.valuation in self._open else ()
                for move in self._moves(phases, action, here, chain(first, last)):
                    found = True
                    yield move
                    here.dead.add(move.outlook.abstract)
                    self._here = here  # meanwhile other states were expanded
            if found or not here.short:
                return

    def _last_steps(self, phases: _Phases) -> Iterator[Args]:
        """Bindings with which a step ends at a goal, where one thing is missing."""
        missing = self._goal.single()
        if missing is not None:
            for known in phases.narrowed(self._goal.puts_out(missing, phases.schema)).solutions():
                if not self._goal.any_after(*self._changes(phases, known), Prospect()):
                    yield known

    def _moves(
        self, phases: _Phases, action: AbstractAction, here: _Expansion, first: Iterable[Args]
    ) -> Iterator[_Move]:
        schema, state = phases.schema, here.state
        postponed: list[Args] = []  # for the others lead elsewhere than where nothing was found
        for known in chain(first, self._in_order(phases), postponed):
            self._check_time()
            added, deleted = self._changes(phases, known)
            successor = (state - frozenset(deleted)) | frozenset(added)
            if successor in here.tried or successor in self._visited:
                continue
            outlook = self._accept(here, added, deleted, action, known)
            if outlook is None:
                here.tried.add(successor)
                phases.failed.add(known)
                continue
            if outlook.abstract in here.dead and known not in postponed:
                postponed.append(known)
            elif self._in_the_way(added, deleted):
                continue
            elif args := next(phases.late.solutions(known), None):
                here.tried.add(successor)
                yield _Move(Step(schema.name, args), known, action.name, added, deleted, outlook, successor)
            else:
                phases.failed.add(known)

    def _changes(self, phases: _Phases, known: Args) -> tuple[list[Fact], list[Fact]]:
        """The facts that a step adds and deletes."""
        values = dict(zip(phases.known, known, strict=True))
        return self._situation.effects(phases.schema, tuple(values.get(p, "") for p in phases.schema.parameters))

    def _in_the_way(self, added: list[Fact], deleted: list[Fact]) -> bool:
        """Whether a step would make an obstacle for what is wished for."""
        if self._wish is None:
            return False
        wish, wishes = self._wish
        self._situation.change(added, deleted)
        hindered = not wishes.obstacles(wish).isdisjoint(added)
        self._situation.change(deleted, added)
        return hindered

    def _in_order(self, phases: _Phases) -> Iterator[Args]:
        """Bindings of the parameters that decide the effects; those that failed in any state before come last."""
        later = []
        for known in phases.early.solutions():
            if known in phases.failed:
                later.append(known)
            else:
                yield known
        yield from later

    def _accept(
        self, here: _Expansion, added: list[Fact], deleted: list[Fact], action: AbstractAction, known: Args
    ) -> _Outlook | None:
        """Where a step leads, if it has the abstract effect and ends at a goal or where the policy has a rule."""
        outlook = _Outlook()
        looks: dict[str, Callable[[], bool]] = {}
        for name, change in self._values.peek(added, deleted, outlook.values):
            kind = self.kinds[name]
            after = kind == "boolean" and change.after()  # of the others, the sign is enough
            if action.effects.get(name) != effect_of(kind, change.before, after, change.sign):
                self._learn(here, name, known)
                return None
            looks[name] = change.after
        if not self._goal.any_after(added, deleted, outlook.unmet):
            return outlook
        abstract = {name: look() for name, look in looks.items()}
        if self.policy.rule_for(abstract):
            outlook.abstract = tuple(abstract.values())
            return outlook
        if here.state not in self._strays:
            self._change(added, deleted)
            self._strays[here.state] = self._values.counts()
            self._change(deleted, added)
        return None

    def _learn(self, here: _Expansion, feature: str, known: Args) -> None:
        """A feature refused a binding: if that is settled by the call that made an entity of it, call no more.

        Outputs of one call differ in tests and in what other streams make of them only.
        """
        present = {name for fact in here.state for name in fact[1:]}
        makers = [self.base.made_by[n] for n in known if n not in present and n in self.base.made_by]
        if len(makers) == 1 and feature in self._settled[makers[0][0]]:
            here.barren.add(makers[0][:2])
