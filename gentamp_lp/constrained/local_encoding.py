"""The encoding `local`: what each copy of an action has to do to the features, as conditions on its parameters.

Literals are written as they are, anything else as the atom of a derived predicate `case-i`, also below negations.
Planners ground such a predicate without the conditions that stand beside it where it is used; so those that never
change are repeated in its axiom where they keep the ground axioms few.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from itertools import count

from gentamp_lp.constrained.regression import Regression, is_literal
from gentamp_lp.features.feature import Feature
from gentamp_lp.policy.model import AbstractAction
from gentamp_lp.policy.policy import Policy
from gentamp_lp.streams.formula import (
    FALSE,
    And,
    Atom,
    Exists,
    Formula,
    Not,
    conjuncts,
    rebuilt,
    restricts,
    substitute,
)
from gentamp_lp.streams.pddl import ActionSchema, Axiom
from gentamp_lp.streams.semantics import Program
from gentamp_lp.tasks.invariants import Group

PREFIX = "case-"
#: A derived predicate has at most so many arguments: its ground axioms grow with the number of entities to that power.
WIDEST = 3


class Conditions:
    """Conditions on the copies of actions, and the axioms they need.

    `decided` has, for an abstract action and a schema, the condition for each feature that regression decides, and
    `undecided` for each other feature why it does not. `program` defines the features and `some-f` for each.
    """

    def __init__(self, policy: Policy, program: Program, groups: Sequence[Group], heads: Mapping[str, Atom]) -> None:
        self._policy, self._program, self._groups, self._heads = policy, program, groups, heads
        self._names: dict[Exists, str] = {}
        self.decided: dict[tuple[str, str], dict[str, Formula]] = {}
        self.undecided: dict[tuple[str, str], dict[str, str]] = {}
        for action in policy.actions:
            for name in action.schemas:
                self.decided[action.name, name], self.undecided[action.name, name] = {}, {}
                self._decide(action, program.domain.action(name))

    @property
    def axioms(self) -> list[Axiom]:
        """The definitions of the named conditions."""
        return [Axiom(Atom(name, closed.variables), closed.body) for closed, name in self._names.items()]

    def _decide(self, action: AbstractAction, schema: ActionSchema) -> None:
        looks = action.preconditions
        known = [Atom(f"some-{name}", ()) for name, positive in looks.items() if positive]
        empty = [each for name, positive in looks.items() if not positive for each in (name, f"some-{name}")]
        regression = Regression(schema, self._program, self._groups, known, empty)
        for feature in self._policy.features:
            why = f"{schema.name} changes what its closure reads"
            if regression.can(self._heads[feature.name]):
                change = regression.simplified(self._change(feature, action.effects.get(feature.name), regression))
                before = dict(self._names)
                condition = FALSE if change == FALSE else self._condition(change, regression)
                if all(len(closed.variables) <= WIDEST for closed in self._names):
                    self.decided[action.name, schema.name][feature.name] = condition
                    continue
                self._names = before
                why = f"its change by {schema.name} depends on more than {WIDEST} entities at once"
            self.undecided[action.name, schema.name][feature.name] = why

    def _change(self, feature: Feature, effect: str | None, regression: Regression) -> Formula:
        """That the feature changes like this: of counts, that entities enter or leave, and none do the opposite."""
        head = self._heads[feature.name]
        own = {variable: f"{variable}#" for variable in head.args}
        atom, variables = substitute(head, own), tuple(own.values())
        if feature.kind == "boolean":
            some, any_ = Atom(f"some-{feature.name}", ()), Exists(variables, atom)
            rises: Formula = And((Not(some), regression.turns(any_, True)))
            falls: Formula = And((some, regression.turns(any_, False)))
        else:
            rises, falls = (Exists(variables, regression.becomes(atom, truth)) for truth in (True, False))
        match effect:
            case "increase" | "true":
                return And((rises, Not(falls)))
            case "decrease" | "false":
                return And((falls, Not(rises)))
        return And((Not(rises), Not(falls)))

    def _condition(self, change: Formula, regression: Regression) -> Formula:
        parts = conjuncts(change)
        implied = dict.fromkeys(literal for part in parts for literal in regression.implied(part))
        return And((*implied, *(self._named(part, regression, ()) for part in parts)))

    def _named(self, formula: Formula, regression: Regression, beside: Sequence[Formula]) -> Formula:
        """A literal in place of the formula, where the static conditions `beside` it hold."""
        if is_literal(formula):
            return formula
        if isinstance(formula, Not):
            return Not(self._named(formula.body, regression, beside))
        variables = tuple(sorted(formula.free))
        parts = [*_about(beside, variables), *conjuncts(self._inside(formula, regression))]
        required = conjuncts(self._program.preconditions[regression.schema.name])
        static = [part for part in required if isinstance(part, Atom) and regression.static(part)]
        for variable in variables:
            if not any(_restricts(part, variable) for part in parts):
                options = [part for part in _about(static, variables) if _restricts(part, variable)]
                parts += sorted(options, key=lambda part: isinstance(part, Exists) and len(part.variables))[:1]
        closed = Exists(variables, And(tuple(parts)) if len(parts) > 1 else parts[0])
        name = self._names.setdefault(_tidy(closed), f"{PREFIX}{len(self._names) + 1}")
        return Atom(name, variables)

    def _inside(self, formula: Formula, regression: Regression) -> Formula:
        """The formula with names for what stands below negations."""
        if is_literal(formula):
            return formula
        if isinstance(formula, Not):
            return self._named(formula, regression, ())
        if not isinstance(formula, And):
            return rebuilt(formula, lambda part: self._inside(part, regression))
        negated = [part for part in formula.parts if isinstance(part, Not)]
        others = [part for part in formula.parts if part not in negated]
        static = [part for part in others if regression.static(part)]
        named = [self._named(part, regression, static) for part in negated]
        return And((*(self._inside(part, regression) for part in others), *named))


def _restricts(formula: Formula, variable: str) -> bool:
    return restricts(formula, variable, lambda *_: True)


def _about(formulas: Iterable[Formula], variables: Sequence[str]) -> Iterator[Formula]:
    """What formulas say of the variables; others are quantified."""
    for formula in formulas:
        free = formula.free
        if not free.isdisjoint(variables):
            others = tuple(sorted(free.difference(variables)))
            yield Exists(others, formula) if others else formula


def _tidy(closed: Exists) -> Exists:
    """A closed formula with variables named `?x1`, `?x2`, ... as they come."""
    numbers = count(1)

    def rename(formula: Formula, names: Mapping[str, str]) -> Formula:
        match formula:
            case Atom():
                return substitute(formula, names)
            case Exists(variables, body):
                own = {variable: f"?x{next(numbers)}" for variable in variables}
                return Exists(tuple(own.values()), rename(body, {**names, **own}))
        return rebuilt(formula, lambda part: rename(part, names))

    found = rename(closed, {})
    assert isinstance(found, Exists)
    return found
