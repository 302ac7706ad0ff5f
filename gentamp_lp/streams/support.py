"""What an optimistic plan hopes for: the test outcomes and the stream calls that would make it a plan."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from itertools import islice

from gentamp_lp.streams.facts import Fact
from gentamp_lp.streams.formula import (
    And,
    Atom,
    Exists,
    Formula,
    Not,
    Or,
    conjuncts,
    normalize,
    substitute,
)
from gentamp_lp.streams.hopes import Call, Literal
from gentamp_lp.streams.optimistic_facts import OptimisticFacts
from gentamp_lp.streams.pddl import ActionSchema
from gentamp_lp.streams.relations import Args, Relation, bind, match
from gentamp_lp.streams.semantics import Program, State, Step

Binding = dict[str, str]
#: Ways to make a condition true that are compared before one is chosen.
ALTERNATIVES = 20


@dataclass(frozen=True)
class _Denied:
    """A condition that a way relies on being false."""

    body: Formula
    binding: tuple[tuple[str, str], ...]


Item = Literal | Call | _Denied


@dataclass
class Needs:
    """Test outcomes, calls, and for each call of a fluent stream the steps that use it."""

    literals: set[Literal] = field(default_factory=set)
    calls: dict[tuple[str, Args, int], Call] = field(default_factory=dict)

    def add_call(self, call: Call, hoped: OptimisticFacts) -> None:
        """Add a call, the calls that its inputs and conditions come from, and the tests they have to pass."""
        if call.key in self.calls:
            return
        for name in call.inputs:
            if name in hoped.call_of:
                self.add_call(hoped.call_of[name], hoped)
        binding = dict(zip(call.stream.inputs, call.inputs, strict=True))
        for atom in call.stream.domain:
            if maker := hoped.maker.get((atom.predicate, *bind(atom, binding))):
                self.add_call(maker, hoped)
        for fact in call.requires:
            self.literals.add((fact, True))
            for name in fact[1:]:
                if name in hoped.call_of:
                    self.add_call(hoped.call_of[name], hoped)
        self.calls[call.key] = call

    def complete(self, names: Args, hoped: OptimisticFacts) -> None:
        """Add the calls that placeholders come from."""
        for name in names:
            if name in hoped.call_of:
                self.add_call(hoped.call_of[name], hoped)


def plan_needs(
    program: Program, hoped: OptimisticFacts, state: State, steps: list[Step], goal: Formula
) -> Needs | None:
    """What the plan hopes for; None when no hope makes it a plan."""
    needs = Needs()
    for step in steps:
        view = Support(program, hoped, state)
        schema = program.domain.action(step.schema)
        binding = dict(zip(schema.parameters, step.args, strict=True))
        conditions = And((program.preconditions[step.schema], *_cost_conditions(hoped, schema)))
        if not view.require(conditions, binding, needs):
            return None
        added: set[Fact] = set()
        deleted: set[Fact] = set()
        for effect in schema.effects:
            target = added if effect.positive else deleted
            if not effect.variables and not conjuncts(effect.condition):
                target.add((effect.atom.predicate, *bind(effect.atom, binding)))
                continue
            for found, items in view.ways(list(conjuncts(normalize(effect.condition))), binding):
                view.take(items, needs)
                target.add((effect.atom.predicate, *bind(effect.atom, found)))
        state = (state - deleted) | added
        needs.complete(step.args, hoped)
    if not Support(program, hoped, state).require(normalize(goal), {}, needs):
        return None
    for fact, _ in list(needs.literals):
        needs.complete(fact[1:], hoped)
    return needs


def _cost_conditions(hoped: OptimisticFacts, schema: ActionSchema) -> Iterator[Formula]:
    """What has to hold for an action's cost to be computed."""
    for term in schema.cost_terms:
        if function := hoped.functions.get(term.predicate):
            binding = dict(zip(function.inputs, term.args, strict=True))
            yield from (substitute(atom, binding) for atom in function.domain)


class Support:
    """One state of an optimistic plan, ready to say what conditions rely on."""

    def __init__(self, program: Program, hoped: OptimisticFacts, state: State) -> None:
        self.program = program
        self.hoped = hoped
        self.fluents: dict[str, Relation] = {}
        for fact in sorted(state):
            self.fluents.setdefault(fact[0], Relation()).add(fact[1:])
        self._open: set[tuple[str, tuple[str | None, ...]]] = set()

    def require(self, formula: Formula, binding: Mapping[str, str], needs: Needs) -> bool:
        """Add what makes a normalized formula true to `needs`; False when nothing does."""
        ways = [items for _, items in islice(self.ways(list(conjuncts(formula)), dict(binding)), ALTERNATIVES)]
        if not ways:
            return False
        self.take(min(ways, key=len), needs)
        return True

    def take(self, items: tuple[Item, ...], needs: Needs) -> None:
        """Add the items of a way."""
        for item in items:
            match item:
                case Call():
                    needs.add_call(item, self.hoped)
                case _Denied(body, binding):
                    needs.literals |= self.denial(body, dict(binding)) or set()
                case _:
                    needs.literals.add(item)

    def ways(self, goals: list[Formula], binding: Binding) -> Iterator[tuple[Binding, tuple[Item, ...]]]:
        """How a conjunction can be true: a binding of its variables, and what that relies on."""
        if not goals:
            yield binding, ()
            return
        self.hoped.check_time()
        chosen = min(range(len(goals)), key=lambda i: self._rank(goals[i], binding))
        goal, rest = goals[chosen], goals[:chosen] + goals[chosen + 1 :]
        match goal:
            case Atom(predicate, args):
                unbound = [a for a in args if a.startswith("?") and a not in binding]
                if predicate == "=" and len(unbound) == 2:
                    for name in self.hoped.values:
                        yield from self.ways(goals, {**binding, unbound[0]: name})
                    return
                for found, items in self._atom(predicate, args, binding):
                    for last, more in self.ways(rest, found):
                        yield last, items + more
            case Not(body):
                free = sorted(body.free - binding.keys())
                if free:
                    for name in self.hoped.values:
                        yield from self.ways(goals, {**binding, free[0]: name})
                    return
                if self.denial(body, binding) is None:
                    return
                relevant = body.free
                item = _Denied(body, tuple((v, n) for v, n in binding.items() if v in relevant))
                for last, more in self.ways(rest, binding):
                    yield last, (item, *more)
            case Exists(_, body):
                yield from self.ways([*conjuncts(body), *rest], binding)
            case Or(parts):
                for part in parts:
                    yield from self.ways([*conjuncts(part), *rest], binding)
            case And():
                yield from self.ways([*conjuncts(goal), *rest], binding)
            case _:
                raise AssertionError(f"not normalized: {goal}")

    def _rank(self, goal: Formula, binding: Binding) -> int:
        match goal:
            case Atom(predicate, args):
                unbound = sum(a.startswith("?") and a not in binding for a in args)
                penalty = 10**6 * (predicate in self.hoped.tests) + 10**5 * (predicate in self.program.axioms)
                penalty += 10**8 * (predicate == "=" and unbound == 2)
                size = len(self.fluents.get(predicate) or self.hoped.relation(predicate))
                return 1 + unbound * (1 + penalty + size)
            case Not(body):
                return 10**8 if body.free - binding.keys() else 2
            case _:
                return 10**4 if goal.free - binding.keys() else 3

    def denial(self, formula: Formula, binding: Binding) -> set[Literal] | None:
        """Test outcomes that make a formula false; None when none do."""
        found: set[Literal] = set()
        for _, items in self.ways(list(conjuncts(formula)), binding):
            literals = [item for item in items if isinstance(item, tuple)]
            if any((fact, not value) in found for fact, value in literals):
                continue
            denied = [item for item in items if isinstance(item, _Denied)]
            if literals:
                fact, value = literals[0]
                found.add((fact, not value))
            elif denied:
                if (more := self._affirmed(denied)) is None:
                    return None
                found |= more
            elif not items:
                return None
        return found

    def _affirmed(self, denied: list[_Denied]) -> set[Literal] | None:
        """Test outcomes that make one of the conditions true."""
        for item in denied:
            for _, items in self.ways(list(conjuncts(item.body)), dict(item.binding)):
                needs = Needs()
                self.take(items, needs)
                return needs.literals
        return None

    def _atom(self, predicate: str, args: Args, binding: Binding) -> Iterator[tuple[Binding, tuple[Item, ...]]]:
        pattern = tuple(binding.get(a) if a.startswith("?") else a for a in args)
        if predicate == "=":
            left, right = pattern
            if left is None or right is None:
                variable, value = (args[0], right) if left is None else (args[1], left)
                yield {**binding, variable: str(value)}, ()
            elif left == right:
                yield binding, ()
            return
        if predicate in self.program.axioms:
            yield from self._derived(predicate, args, pattern, binding)
            return
        hoped = self.hoped
        fluents = self.fluents.get(predicate)
        if fluents is not None:
            for row in fluents.matches(pattern):
                if (extended := match(args, row, binding)) is not None:
                    yield extended, ()
        for row in hoped.relation(predicate).matches(pattern):
            if (extended := match(args, row, binding)) is not None:
                call = hoped.maker.get((predicate, *row))
                yield extended, (call,) if call else ()
        if predicate not in hoped.tests:
            return
        for row in [tuple(map(str, pattern))] if None not in pattern else list(hoped.candidates(predicate)):
            if row in hoped.relation(predicate) or (extended := match(args, row, binding)) is None:
                continue
            opinion = hoped.opinion((predicate, *row))
            if opinion is not False:
                yield extended, () if opinion else (((predicate, *row), True),)

    def _derived(
        self, predicate: str, args: Args, pattern: tuple[str | None, ...], binding: Binding
    ) -> Iterator[tuple[Binding, tuple[Item, ...]]]:
        key = (predicate, pattern)
        if key in self._open:  # a derivation that needs itself derives nothing new
            return
        self._open.add(key)
        try:
            for axiom in self.program.axioms[predicate]:
                given = {v: p for v, p in zip(axiom.head.args, pattern, strict=True) if p is not None}
                found = list(self.ways(list(conjuncts(axiom.body)), given))
                for solution, items in found:
                    row = bind(axiom.head, solution)
                    if not any(a.startswith("?") for a in row) and (extended := match(args, row, binding)) is not None:
                        yield extended, items
        finally:
            self._open.discard(key)
