"""Selected features on the Python side: first-order formulas that become axioms and are evaluated in states."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass

from gentamp_lp.policy import Feature
from gentamp_lp.pool import Term, parse_term
from gentamp_lp.streams.facts import sort_predicate
from gentamp_lp.streams.formula import (
    And,
    Atom,
    Exists,
    Forall,
    Formula,
    Not,
    Or,
    conjuncts,
    imply,
    normalize,
)
from gentamp_lp.streams.pddl import Axiom
from gentamp_lp.streams.semantics import View

def to_formula(term: str) -> Formula:
    """Read `some(v1,object,conj(on(v0,v1),movable(v1)))` and the like. Raises InputError for anything else.

    Quantifiers range over the entities of their sort; the guard is left out where the body implies it.
    """
    return _convert(parse_term(term), frozenset())


def _convert(tree: Term, scope: frozenset[str]) -> Formula:
    name, parts = tree
    match name, len(parts):
        case "neg", 1:
            return Not(_convert(parts[0], scope))
        case "conj", 2:
            return And((_convert(parts[0], scope), _convert(parts[1], scope)))
        case "disj", 2:
            return Or((_convert(parts[0], scope), _convert(parts[1], scope)))
        case "implies", 2:
            return imply(_convert(parts[0], scope), _convert(parts[1], scope))
        case (("some" | "every"), 3):
            variable, sort = f"?{parts[0][0]}", parts[1][0]
            body = _convert(parts[2], scope | {variable})
            guard = Atom(sort_predicate(sort), (variable,))
            if name == "some":
                return Exists((variable,), body if _guarded(body, variable) else And((guard, body)))
            return Forall((variable,), body if _guarded(Not(body), variable) else imply(guard, body))
        case "true", 0:
            return And(())
    return Atom(name, tuple(f"?{part[0]}" for part in parts))


def _guarded(formula: Formula, variable: str) -> bool:
    """Whether the formula can only be true of entities that fill some predicate's argument."""
    return any(isinstance(part, Atom) and variable in part.args for part in conjuncts(normalize(formula)))


@dataclass(frozen=True)
class Features:
    """A policy's features as axioms `(f1 ?v0)`, in the policy's order."""

    features: tuple[Feature, ...]
    axioms: tuple[Axiom, ...]

    @classmethod
    def of(cls, features: Iterable[Feature]) -> Features:
        """Turn features into axioms."""
        chosen = tuple(features)
        axioms = []
        for feature in chosen:
            body = to_formula(feature.formula)
            head = Atom(feature.name, ())
            if feature.variable and feature.sort:
                variable = f"?{feature.variable}"
                head = Atom(feature.name, (variable,))
                if not _guarded(body, variable):
                    body = And((Atom(sort_predicate(feature.sort), (variable,)), body))
            axioms.append(Axiom(head, body))
        return cls(chosen, tuple(axioms))

    def values(self, view: View) -> dict[str, int]:
        """How many entities satisfy each feature (1 or 0 for closed ones)."""
        return {f.name: len(view.extension(f.name)) for f in self.features}


def valuation(values: Mapping[str, int]) -> dict[str, bool]:
    """The qualitative state: which features are positive."""
    return {name: value > 0 for name, value in values.items()}


def matches_effects(
    effects: Mapping[str, str], kinds: Mapping[str, str], before: Mapping[str, int], after: Mapping[str, int]
) -> bool:
    """Whether a change of values is the qualitative change that an abstract action names (and no other)."""
    for name, old in before.items():
        new = after[name]
        if kinds[name] == "boolean":
            change = "true" if new and not old else "false" if old and not new else None
        else:
            change = "increase" if new > old else "decrease" if new < old else None
        if effects.get(name) != change:
            return False
    return True
