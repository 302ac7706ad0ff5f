"""A sampled problem as the two PDDL texts that a planner reads.

A test predicate used under negation is sent as its complement (`no-cfree` facts for refuted pairs).
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator

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
    rebuilt,
    substitute,
    to_pddl,
)
from gentamp_lp.streams.pddl import ActionSchema, Axiom, Effect
from gentamp_lp.streams.relations import bind, match
from gentamp_lp.streams.semantics import Program, State, View

COST_SCALE = 1000  # Fast Downward counts costs in whole numbers


def write_problem(
    program: Program, base: FactBase, state: State, goal: Formula, *, unit_costs: bool = False, exact: bool = False
) -> tuple[str, str]:
    """The texts of the domain and of the problem, with refuted tests as `no-...` facts.

    A test fails also where its stream's conditions do not hold. Almost always a formula that negates the test implies
    these conditions, and the text takes that for granted, which keeps the ground problem small; `exact` does not.
    """
    writer = _Writer(program, base, split_goal(program, base, goal), unit_costs, exact)
    return writer.domain_text(), writer.problem_text(state)


class _Writer:
    """What the texts of one domain and one problem have in common."""

    def __init__(self, program: Program, base: FactBase, goals: list[Formula], unit_costs: bool, exact: bool) -> None:
        self._program, self._base, self._exact = program, base, exact
        self._name, actions = program.domain.name or "d", program.domain.actions
        self._goals = [Atom(f"goal-part-{number}", ()) for number in range(len(goals))]
        self._axioms = [a for rows in program.axioms.values() for a in rows]
        self._axioms += [Axiom(head, part) for head, part in zip(self._goals, goals, strict=True)]
        charged = [] if unit_costs else [a for a in actions if a.cost or a.cost_terms]
        self._costs = {schema.name: _charge(schema) for schema in charged}
        self._values = {fact: value for schema in charged for fact, value in _charges(schema, base)}
        self._terms = {c.predicate: len(c.args) for c in self._costs.values() if isinstance(c, Atom)}
        formulas = [*program.preconditions.values(), *(a.body for a in self._axioms)]
        formulas += [normalize(e.condition) for s in actions for e in s.effects]
        self._constants = dict.fromkeys([*program.domain.constants, *_mentioned(formulas)])
        used = {a.predicate: len(a.args) for f in formulas for a in atoms(_complement(f, base, exact))}
        self._arities = self._declared(used)

    def _declared(self, used: dict[str, int]) -> dict[str, int]:
        """The arities of all predicates but equality and those that say that a cost has a value."""
        domain, heads = self._program.domain, {a.head.predicate: len(a.head.args) for a in self._axioms}
        declared: dict[str, int] = {}
        for name in sorted(used.keys() | domain.fluents | heads.keys()):
            if name != "=":
                known = domain.predicates.get(name)
                declared[name] = known.arity if known else used.get(name, 0)
        return declared | heads

    def domain_text(self) -> str:
        lines = [f"(define (domain {self._name})", "(:requirements :adl :derived-predicates)"]
        if self._constants:
            lines.append(f"(:constants {' '.join(self._constants)})")
        valued = {f"value-of-{name}": arity for name, arity in self._terms.items()}
        lines += ["(:predicates", *(f"  {_signature(*item)}" for item in (self._arities | valued).items()), ")"]
        if self._costs:
            terms = (f"  {_signature(*item)} - number" for item in self._terms.items())
            lines += ["(:functions (total-cost) - number", *terms, ")"]
        lines += map(self._action, self._program.domain.actions)
        lines += [f"(:derived {to_pddl(a.head)} {_text(a.body, self._base, self._exact)})" for a in self._axioms]
        return "\n".join([*lines, ")"])

    def _action(self, schema: ActionSchema) -> str:
        precondition = _text(self._program.preconditions[schema.name], self._base, self._exact)
        effect = " ".join(_effect(e, self._base, self._exact) for e in schema.effects)
        match self._costs.get(schema.name):
            case Atom(function, args):
                precondition = f"(and (value-of-{' '.join((function, *args))}) {precondition})"
                effect += f" (increase (total-cost) ({' '.join((function, *args))}))"
            case float(amount):
                effect += f" (increase (total-cost) {scaled(amount)})"
        parameters = " ".join(schema.parameters)
        return f"(:action {schema.name} :parameters ({parameters}) :precondition {precondition} :effect (and {effect}))"

    def problem_text(self, state: State) -> str:
        derived = {axiom.head.predicate for axiom in self._axioms}
        given = [name for name in self._arities if name not in derived]  # what axioms derive may not be stated
        facts = list(_facts(self._base, given)) + sorted(state) + [(f"value-of-{f[0]}", *f[1:]) for f in self._values]
        objects = dict.fromkeys(a for f in facts for a in f[1:] if a not in self._constants)
        lines = [
            f"(define (problem sampled) (:domain {self._name})",
            f"(:objects {' '.join(objects)})",
            "(:init",
            *(f"({' '.join(fact)})" for fact in facts),
            *(["(= (total-cost) 0)"] if self._costs else []),
            *(f"(= ({' '.join(fact)}) {scaled(value)})" for fact, value in self._values.items()),
            ")",
            f"(:goal (and {' '.join(map(to_pddl, self._goals))}))",
            "(:metric minimize (total-cost)))" if self._costs else ")",
        ]
        return "\n".join(lines)


def _signature(name: str, arity: int) -> str:
    return f"({name}{''.join(f' ?x{i}' for i in range(arity))})"


def _charge(schema: ActionSchema) -> float | Atom:
    """What an action costs in the planner's input: a number or one function, which may stand for a sum."""
    if not schema.cost_terms:
        return schema.cost
    if len(schema.cost_terms) == 1 and not schema.cost:
        return schema.cost_terms[0]
    return Atom(f"cost-of-{schema.name}", tuple(sorted(set().union(*(term.free for term in schema.cost_terms)))))


def _charges(schema: ActionSchema, base: FactBase) -> Iterator[tuple[Fact, float]]:
    """The values of the function that says what an action costs."""
    match _charge(schema):
        case Atom() as function:
            sums: list[tuple[dict[str, str], float]] = [({}, schema.cost)]
            for term in schema.cost_terms:
                rows = [(fact[1:], value) for fact, value in base.costs.items() if fact[0] == term.predicate]
                sums = [
                    (extended, total + value)
                    for binding, total in sums
                    for row, value in rows
                    if (extended := match(term.args, row, binding)) is not None
                ]
            for binding, total in sums:
                yield (function.predicate, *bind(function, binding)), total


def scaled(cost: float) -> int:
    """A cost in Fast Downward's units."""
    return min(round(COST_SCALE * cost), 10**8)


def _mentioned(formulas: Iterable[Formula]) -> Iterator[str]:
    return (arg for formula in formulas for atom in atoms(formula) for arg in atom.args if not arg.startswith("?"))


def split_goal(program: Program, base: FactBase, goal: Formula) -> list[Formula]:
    """The goal as a list of conditions: what it says of all entities is said of each one separately.

    Planners take a quantified goal for a single one that is reached or not; of many they can count how many are. Only
    quantifiers whose range unchanging facts determine are written out. The parts are normalized.
    """
    changing = program.domain.fluents | program.axioms.keys() | base.tests.keys()
    parts: list[Formula] = []
    for part in conjuncts(normalize(goal)):
        match part:
            case Not(Exists(variables, body)):
                fixed = [c for c in conjuncts(body) if c.predicates.isdisjoint(changing)]
                bound = {arg for c in fixed if isinstance(c, Atom) and c.predicate != "=" for arg in c.args}
                if not bound.issuperset(variables):
                    parts.append(part)
                    continue
                rest = Not(And(tuple(c for c in conjuncts(body) if c not in fixed)))
                found = View(program, base, frozenset()).solutions(And(tuple(fixed)))
                ranges = dict.fromkeys(tuple(solution[v] for v in variables) for solution in found)
                parts += [normalize(substitute(rest, dict(zip(variables, row, strict=True)))) for row in ranges]
            case _:
                parts.append(part)
    return parts


def _facts(base: FactBase, declared: Iterable[str]) -> Iterator[tuple[str, ...]]:
    for name in declared:
        if name.startswith("no-") and name[3:] in base.tests:
            yield from ((name, *args) for args in base.refuted(name[3:]))
        else:
            yield from ((name, *args) for args in base.relation(name).rows)


def _complement(formula: Formula, base: FactBase, exact: bool = False) -> Formula:
    match formula:
        case Not(Atom(predicate, args)) if predicate in base.tests:
            refuted = Atom(f"no-{predicate}", args)
            if not exact:
                return refuted
            return Or((refuted, *(_complement(Not(c), base, exact) for c in base.test_conditions(predicate, args))))
    return rebuilt(formula, lambda part: _complement(part, base, exact))


def _text(formula: Formula, base: FactBase, exact: bool) -> str:
    return to_pddl(_complement(formula, base, exact)).replace("#", "_")


def _effect(effect: Effect, base: FactBase, exact: bool) -> str:
    text = to_pddl(effect.atom) if effect.positive else f"(not {to_pddl(effect.atom)})"
    if conjuncts(effect.condition):
        text = f"(when {_text(normalize(effect.condition), base, exact)} {text})"
    return f"(forall ({' '.join(effect.variables)}) {text})" if effect.variables else text
