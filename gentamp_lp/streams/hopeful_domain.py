"""A domain for a planner that knows nothing of streams and tests, in which what is not known may be hoped for.

A test not run yet counts as true wherever that helps and as false wherever that does, so that the planner misses no
plan. What a plan hopes for is then found out by calling streams and running tests.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace

from gentamp_lp.streams.facts import FactBase
from gentamp_lp.streams.formula import (
    And,
    Atom,
    Exists,
    Forall,
    Formula,
    Not,
    Or,
    conjuncts,
    normalize,
    rebuilt,
)
from gentamp_lp.streams.optimistic_facts import OptimisticFacts
from gentamp_lp.streams.pddl import ActionSchema, Axiom
from gentamp_lp.streams.relations import Args, Relation
from gentamp_lp.streams.semantics import Program


@dataclass(frozen=True)
class Split:
    """A domain in which every test is read hopefully.

    A test, and a derived predicate that depends on one, becomes two predicates: the hopeful one where its truth helps
    to make a condition true, the doubtful one (`-low`) where it hinders. `uses` lists the (test, hopeful, negated)
    predicates that occur.
    """

    program: Program
    goal: Formula
    uses: frozenset[tuple[str, bool, bool]]


def split(program: Program, goal: Formula, base: FactBase, exact: bool = False) -> Split:
    """Compile the hopeful reading. `exact`: mind that a test fails where its stream's conditions do not hold."""
    splitter = _Splitter(program, base, exact)
    actions, named = [], []
    for schema in program.domain.actions:
        effects = tuple(
            replace(e, condition=splitter.read(normalize(e.condition), True)) if e.condition != And(()) else e
            for e in schema.effects
        )
        precondition, more = _name_denials(splitter.read(program.preconditions[schema.name], True), schema, program)
        named += more
        actions.append(replace(schema, precondition=precondition, effects=effects))
    goal = splitter.read(normalize(goal), True)
    axioms = splitter.axioms()
    domain = replace(program.domain, actions=tuple(actions), axioms=(*axioms, *named))
    return Split(Program.of(domain), goal, frozenset(splitter.uses))


def _name_denials(precondition: Formula, schema: ActionSchema, program: Program) -> tuple[Formula, list[Axiom]]:
    """Give names to what a precondition says does not exist, restricted by the static facts that it also demands.

    A planner would name it too, but for all objects instead of those that the action can be about.
    """
    changing = program.domain.fluents | program.axioms.keys()
    parts = conjuncts(precondition)
    static = [a for a in parts if isinstance(a, Atom) and a.predicate not in changing and a.predicate != "="]
    found: list[Formula] = []
    axioms: list[Axiom] = []
    for part in parts:
        free = tuple(sorted(part.free))
        if not isinstance(part, Not) or not isinstance(part.body, Exists) or not free:
            found.append(part)
            continue
        head = Atom(f"denied-{schema.name}-{len(axioms)}", free)
        about = [a for a in static if set(a.args) & set(free)]
        others = tuple(sorted({v for a in about for v in a.free} - set(free)))
        guard = Exists(others, And(tuple(about))) if others else And(tuple(about))
        axioms.append(Axiom(head, And((guard, part.body)), schema.line))
        found.append(Not(head))
    return And(tuple(found)), axioms


class _Splitter:
    def __init__(self, program: Program, base: FactBase, exact: bool) -> None:
        self.program = program
        self.base = base
        self.exact = exact
        self.uses: set[tuple[str, bool, bool]] = set()
        self.heads: dict[tuple[str, bool], None] = {}
        self.of_state = {a.predicate for s in base.streams if s.fluents for a in s.certified}

    def axioms(self) -> list[Axiom]:
        """The axioms of all heads that were read, which may read others."""
        found: list[Axiom] = []
        done: set[tuple[str, bool]] = set()
        while waiting := [key for key in self.heads if key not in done]:
            for name, hopeful in waiting:
                done.add((name, hopeful))
                for axiom in self.program.axioms[name]:
                    head = Atom(self.derived(name, hopeful), axiom.head.args)
                    found.append(Axiom(head, self.read(axiom.body, hopeful), axiom.line))
        return found

    def derived(self, name: str, hopeful: bool) -> str:
        return name if hopeful or not self.doubtful(name) else f"{name}-low"

    def doubtful(self, name: str) -> bool:
        """Whether a derived predicate depends on tests, or on facts that only hold in a state."""
        return not self.program.basis[name].isdisjoint(self.base.tests.keys() | self.of_state)

    def read(self, formula: Formula, hopeful: bool) -> Formula:
        """A normalized formula whose truth is hoped for (or feared)."""
        match formula:
            case Atom(predicate, args):
                if predicate in self.base.tests:
                    self.uses.add((predicate, hopeful, False))
                    return Atom(predicate if hopeful else f"{predicate}-low", args)
                if predicate in self.program.axioms:
                    self.heads[predicate, hopeful or not self.doubtful(predicate)] = None
                    return Atom(self.derived(predicate, hopeful), args)
                if predicate in self.base.state_tests and not hopeful:
                    return Atom(f"certain-{predicate}", args)
                if predicate in self.of_state and hopeful:
                    return And((formula, Not(Atom(f"given-up-{predicate}", args))))
                return formula
            case Not(Atom(predicate, args)) if predicate in self.base.tests:
                self.uses.add((predicate, hopeful, True))
                refuted = Atom(f"no-{predicate}" if hopeful else f"no-{predicate}-low", args)
                if not self.exact:
                    return refuted
                conditions = self.base.test_conditions(predicate, args)
                return Or((refuted, *(self.read(Not(c), hopeful) for c in conditions)))
            case Not(body):
                return Not(self.read(body, not hopeful))
            case Forall():
                raise AssertionError(f"not normalized: {formula}")
        return rebuilt(formula, lambda part: self.read(part, hopeful))


def hopeful_problem(split: Split, hoped: OptimisticFacts) -> tuple[Program, FactBase]:
    """The domain and the facts to be sent to a planner that knows nothing of streams and tests."""
    base = FactBase(split.program.domain, (), {}, hoped.values, {}, dict(hoped.static))
    base.costs = hoped.costs
    for predicate, hopeful, negated in split.uses:
        name = f"no-{predicate}" if negated else predicate
        rows = base.static[name if hopeful else f"{name}-low"] = Relation()
        if not negated:
            rows.rows.update(hoped.relation(predicate).rows)
        if negated and not hopeful:  # few are refuted
            tried = [*hoped.real.refuted(predicate)]
            given_up = [f[1:] for f, value in hoped.hopes.literals if f[0] == predicate and value]
            possible: Iterable[Args] = [r for r in (*tried, *given_up) if all(a in hoped.values for a in r)]
        elif not negated and not hopeful:
            possible = [f[1:] for f, value in hoped.hopes.literals if f[0] == predicate and not value]
        else:
            possible = hoped.candidates(predicate)
        wanted = (None, not negated) if hopeful else (not negated,)
        for args in possible:
            if hoped.opinion((predicate, *args)) in wanted:
                rows.add(args)
    failures = [f for f in hoped.hopes.in_state if f.names() <= hoped.values.keys()]
    axioms = [failure.axiom(split.program.domain) for failure in failures]
    return (Program.of(split.program.domain, axioms) if axioms else split.program), base
