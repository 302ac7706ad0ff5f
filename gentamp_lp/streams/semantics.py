"""Truth of formulas in a state, stratified axioms, and what actions do.

A state is a frozenset of fluent facts. A `View` answers questions about one state: it joins a formula's
atoms smallest relation first and evaluates axioms on demand (negation as failure, so the axioms must be
stratified as PDDL demands).
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from functools import lru_cache
from typing import NamedTuple

import networkx as nx

from gentamp_lp.errors import Diagnostic, InputError
from gentamp_lp.streams.facts import Fact, FactBase
from gentamp_lp.streams.formula import (
    And,
    Atom,
    Exists,
    Formula,
    Not,
    Or,
    conjuncts,
    normalize,
)
from gentamp_lp.streams.pddl import ActionSchema, Axiom, Domain
from gentamp_lp.streams.relations import Args, Relation, bind, match

State = frozenset[Fact]
Binding = Mapping[str, str]


class Step(NamedTuple):
    """A ground action."""

    schema: str
    args: Args

    def __str__(self) -> str:
        return f"{self.schema}({', '.join(self.args)})"


_UNBOUND_JOIN, _BRANCH, _GENERATE, _TEST_JOIN, _NEVER = 10, 10**4, 10**6, 10**7, 10**9


@dataclass(frozen=True)
class Program:
    """A domain's axioms and preconditions, normalized once."""

    domain: Domain
    axioms: Mapping[str, tuple[Axiom, ...]]
    recursive: Mapping[str, frozenset[str]]  # derived predicate that needs itself -> all that need it and it needs
    basis: Mapping[str, frozenset[str]]  # derived predicate -> basic predicates its truth depends on
    preconditions: Mapping[str, Formula]

    @classmethod
    def of(cls, domain: Domain, extra: Iterable[Axiom] = ()) -> Program:
        """Normalize a domain (and additional axioms). Raises InputError if the axioms are not stratified."""
        table: dict[str, list[Axiom]] = {}
        graph = nx.DiGraph()
        for axiom in (*domain.axioms, *extra):
            body = normalize(axiom.body)
            table.setdefault(axiom.head.predicate, []).append(Axiom(axiom.head, body, axiom.line))
            for predicate, negative in _polarity(body):
                weak = graph.get_edge_data(axiom.head.predicate, predicate, {}).get("negative", False)
                graph.add_edge(axiom.head.predicate, predicate, negative=negative or weak)
        recursive: dict[str, frozenset[str]] = {}
        for component in nx.strongly_connected_components(graph):
            if len(component) == 1 and not graph.has_edge(*component, *component):
                continue
            recursive.update(dict.fromkeys(component, frozenset(component)))
            for head, _, negative in graph.subgraph(component).edges(data="negative"):
                if negative:
                    line = table[head][0].line
                    raise InputError(
                        Diagnostic(f"derived predicate `{head}` depends on its own negation", domain.path, line)
                    )
        preconditions = {a.name: normalize(a.precondition) for a in domain.actions}
        basis = {
            head: frozenset(nx.descendants(graph, head)) - table.keys() if head in graph else frozenset()
            for head in table
        }
        return cls(domain, {k: tuple(v) for k, v in table.items()}, recursive, basis, preconditions)


def _polarity(formula: Formula, negative: bool = False) -> Iterator[tuple[str, bool]]:
    match formula:
        case Atom(predicate):
            yield predicate, negative
        case Not(body):
            yield from _polarity(body, not negative)
        case Exists(_, body):
            yield from _polarity(body, negative)
        case And(parts) | Or(parts):
            for part in parts:
                yield from _polarity(part, negative)


@lru_cache(maxsize=10_000)
def _normal(formula: Formula) -> Formula:
    return normalize(formula)


class View:
    """One state of one problem, ready to be questioned."""

    def __init__(self, program: Program, base: FactBase, state: State) -> None:
        self.program = program
        self.base = base
        self.state = state
        self._fluents: dict[str, Relation] = {}
        for fact in sorted(state):
            self._fluents.setdefault(fact[0], Relation()).add(fact[1:])
        self.in_state: dict[Fact, bool] = {}  # what tests with `:fluents` said of this state
        self._tests = {**base.tests, **base.state_tests} if base.state_tests else base.tests
        self._truth: dict[Fact, bool] = {}
        self._extensions: dict[str, Relation] = {}

    def holds(self, formula: Formula, binding: Binding | None = None) -> bool:
        """Whether a formula is true; unbound free variables are read existentially."""
        return next(self.solutions(formula, binding), None) is not None

    def solutions(self, formula: Formula, binding: Binding | None = None) -> Iterator[dict[str, str]]:
        """Bindings of the free variables that make the formula true (repetitions possible)."""
        return self._solve(list(conjuncts(_normal(formula))), dict(binding or {}))

    def extension(self, predicate: str) -> list[Args]:
        """All tuples of a fluent, derived, static or already tested predicate."""
        if predicate in self.program.axioms:
            return list(self._derive_all(predicate).rows)
        return list(self._relation(predicate).rows)

    def _relation(self, predicate: str) -> Relation:
        return self._fluents.get(predicate) or self.base.relation(predicate)

    def _solve(self, goals: list[Formula], binding: dict[str, str]) -> Iterator[dict[str, str]]:
        if not goals:
            yield binding
            return
        ranks = [self._rank(goal, binding) for goal in goals]
        chosen = min(range(len(goals)), key=ranks.__getitem__)
        goal, rest = goals[chosen], goals[:chosen] + goals[chosen + 1 :]
        if ranks[chosen] >= _NEVER:  # only negations with unbound variables are left: range over everything
            variable = min(goal.free - binding.keys())
            for name in self.base.values:
                yield from self._solve(goals, {**binding, variable: name})
            return
        match goal:
            case Atom("=", (left, right)):
                yield from self._unify(left, right, rest, binding)
            case Atom(predicate, args):
                bound = tuple(binding.get(a) if a.startswith("?") else a for a in args)
                if None not in bound:
                    if self._true(predicate, bound):  # type: ignore[arg-type]
                        yield from self._solve(rest, binding)
                    return
                if ranks[chosen] == _TEST_JOIN:
                    stream = self._tests[predicate]
                    pattern = next(a.args for a in stream.certified if a.predicate == predicate)
                    names = dict(zip(pattern, args, strict=True))
                    guards: list[Formula] = [Atom(a.predicate, bind(a, names)) for a in stream.domain]
                    for found in self._solve(guards, binding):
                        yield from self._solve([goal, *rest], found)
                    return
                for row in self.rows(predicate, bound):
                    extended = match(args, row, binding)
                    if extended is not None:
                        yield from self._solve(rest, extended)
            case Not(body):
                if next(self._solve(list(conjuncts(body)), dict(binding)), None) is None:
                    yield from self._solve(rest, binding)
            case Exists(_, body):
                if goal.free <= binding.keys():
                    if next(self._solve(list(conjuncts(body)), dict(binding)), None) is not None:
                        yield from self._solve(rest, binding)
                else:
                    yield from self._solve([*conjuncts(body), *rest], binding)
            case Or(parts):
                if goal.free <= binding.keys():
                    if any(next(self._solve(list(conjuncts(p)), dict(binding)), None) is not None for p in parts):
                        yield from self._solve(rest, binding)
                else:
                    for part in parts:
                        yield from self._solve([*conjuncts(part), *rest], binding)
            case _:
                raise AssertionError(f"not normalized: {goal}")

    def _unify(self, left: str, right: str, rest: list[Formula], binding: dict[str, str]) -> Iterator[dict[str, str]]:
        a, b = binding.get(left, left), binding.get(right, right)
        if a.startswith("?"):
            yield from self._solve(rest, {**binding, a: b})
        elif b.startswith("?"):
            yield from self._solve(rest, {**binding, b: a})
        elif a == b:
            yield from self._solve(rest, binding)

    def _rank(self, goal: Formula, binding: Binding) -> int:
        """How costly it is to look at this conjunct next (cheapest first)."""
        unbound = goal.free - binding.keys()
        match goal:
            case Atom("=", args):
                return _NEVER if unbound.issuperset(args) else 0
            case Atom(predicate, args):
                if not unbound:
                    return 3 if predicate in self._tests else int(predicate in self.program.axioms)
                if predicate in self._tests:
                    return _TEST_JOIN
                if predicate in self.program.axioms:
                    known = self._extensions.get(predicate)
                    return _UNBOUND_JOIN + (100 if known is None else len(known))
                if self.generates(predicate):
                    return _GENERATE
                return _UNBOUND_JOIN + len(self._relation(predicate))
            case Not(Atom(predicate)):
                if unbound:
                    return _NEVER
                return 3 if predicate in self._tests else int(predicate in self.program.axioms)
            case Not():
                return _NEVER if unbound else 2
            case _:
                return _BRANCH if unbound else 2

    def generates(self, predicate: str) -> bool:
        """Whether unbound arguments of this predicate may be filled by calling streams (not here)."""
        return False

    def rows(self, predicate: str, pattern: tuple[str | None, ...]) -> Iterable[Args]:
        """Tuples of a predicate that agree with a pattern."""
        if predicate not in self.program.axioms:
            return self._relation(predicate).matches(pattern)
        if self._cheap(predicate) or all(p is None for p in pattern):
            return self._derive_all(predicate).matches(pattern)
        return self._derive(predicate, pattern)

    def _true(self, predicate: str, args: Args) -> bool:
        if predicate in self.base.state_tests:
            return self._true_in_state(predicate, args)
        if predicate not in self.program.axioms:
            return args in self._fluents.get(predicate, ()) or self.base.truth(predicate, args)
        if self._cheap(predicate):
            return args in self._derive_all(predicate)
        fact = (predicate, *args)
        if fact not in self._truth:
            self._truth[fact] = next(iter(self._derive(predicate, args)), None) is not None
        return self._truth[fact]

    def _true_in_state(self, predicate: str, args: Args) -> bool:
        fact = (predicate, *args)
        if fact not in self.in_state:
            given = args in self.base.relation(predicate)
            self.in_state[fact] = given or self.base.true_in_state(predicate, args, self.state)
        return self.in_state[fact]

    def _cheap(self, predicate: str) -> bool:
        """Whether to derive all tuples of a predicate at once: no tests are run for it."""
        return predicate in self.program.recursive or self.program.basis[predicate].isdisjoint(self._tests)

    def _derive(self, predicate: str, pattern: tuple[str | None, ...]) -> Iterator[Args]:
        found: set[Args] = set()
        for axiom in self.program.axioms[predicate]:
            binding = {v: p for v, p in zip(axiom.head.args, pattern, strict=True) if p is not None}
            for solution in self._solve(list(conjuncts(axiom.body)), binding):
                row = bind(axiom.head, solution)
                if row not in found:
                    found.add(row)
                    yield row

    def _derive_all(self, predicate: str) -> Relation:
        if predicate in self._extensions:
            return self._extensions[predicate]
        relation = self._extensions[predicate] = Relation()
        everything: tuple[None, ...] = (None,) * len(self.program.axioms[predicate][0].head.args)
        if predicate not in self.program.recursive:
            for row in self._derive(predicate, everything):
                relation.add(row)
            return relation
        component = self.program.recursive[predicate]
        for name in component:
            self._extensions.setdefault(name, Relation())
        growing = True
        while growing:
            growing = False
            for name in sorted(component):
                arity = (None,) * len(self.program.axioms[name][0].head.args)
                for row in list(self._derive(name, arity)):
                    growing |= self._extensions[name].add(row)
        return relation


def applicable(view: View) -> Iterator[Step]:
    """All ground actions whose precondition holds, schema by schema in the order of the domain file."""
    for schema in view.program.domain.actions:
        yield from dict.fromkeys(
            Step(schema.name, tuple(binding[p] for p in schema.parameters))
            for binding in view.solutions(view.program.preconditions[schema.name])
        )


def apply(view: View, step: Step) -> State:
    """The successor state; the caller has checked the precondition."""
    schema = view.program.domain.action(step.schema)
    added, deleted = effects_of(view, schema, dict(zip(schema.parameters, step.args, strict=True)))
    return (view.state - deleted) | added


def effects_of(view: View, schema: ActionSchema, binding: Binding) -> tuple[set[Fact], set[Fact]]:
    """Facts added and facts deleted by a ground action (an added fact wins over a deleted one)."""
    added: set[Fact] = set()
    deleted: set[Fact] = set()
    for effect in schema.effects:
        target = added if effect.positive else deleted
        if not effect.variables and not conjuncts(effect.condition):
            target.add((effect.atom.predicate, *bind(effect.atom, binding)))
            continue
        for solution in view.solutions(effect.condition, binding):
            target.add((effect.atom.predicate, *bind(effect.atom, solution)))
    return added, deleted


def precondition_holds(view: View, step: Step) -> bool:
    """Whether a ground action is applicable."""
    schema = view.program.domain.action(step.schema)
    binding = dict(zip(schema.parameters, step.args, strict=True))
    return view.holds(view.program.preconditions[step.schema], binding)


def polarities(program: Program, formula: Formula) -> Iterator[tuple[str, bool]]:
    """Predicates that a formula reads, directly and through axioms, each with whether it is negated there."""
    waiting = list(_polarity(normalize(formula)))
    seen: set[tuple[str, bool]] = set()
    while waiting:
        predicate, negative = waiting.pop()
        if (predicate, negative) in seen:
            continue
        seen.add((predicate, negative))
        yield predicate, negative
        for axiom in program.axioms.get(predicate, ()):
            waiting += _polarity(axiom.body, negative)


def reads(formula: Formula, program: Program) -> frozenset[str]:
    """Basic predicates (fluent, static, certified) that the truth of a formula depends on."""
    named = formula.predicates
    derived = named & program.axioms.keys()
    return frozenset((named - derived).union(*(program.basis[p] for p in derived)))
