"""Selected features on the Python side: first-order formulas that become axioms and are evaluated in states."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

from gentamp_lp.base.terms import Term, parse_term
from gentamp_lp.features.feature import Feature
from gentamp_lp.streams.facts import sort_predicate
from gentamp_lp.streams.formula import (
    And,
    Atom,
    Exists,
    Forall,
    Formula,
    Not,
    Or,
    imply,
    restricts,
    substitute,
)
from gentamp_lp.streams.pddl import Axiom
from gentamp_lp.streams.semantics import View


def to_formula(term: str, name: str = "f") -> tuple[Formula, list[Axiom]]:
    """Read `some(v1,object,conj(on(v0,v1),movable(v1)))` and the like.

    Quantifiers range over the entities of their sort; the guard is left out where the body implies it. Each
    `closure(U,W,Sort,F,Y,X)` becomes a recursive axiom, named after `name`, that is returned beside the formula.
    Raises ValueError for anything else.
    """
    reader = _Reader(name)
    try:
        parsed = parse_term(term)
    except ValueError as error:
        raise ValueError(f"not a formula: {term}: {error}") from None
    return reader.read(parsed), reader.axioms


_CONNECTIVES = {"neg", "conj", "disj", "implies", "some", "every", "closure", "true"}


class _Reader:
    """Turns terms into formulas and collects the axioms that they need."""

    def __init__(self, name: str) -> None:
        self.name = name
        self.axioms: list[Axiom] = []

    def read(self, term: Term) -> Formula:
        name, parts = term
        match name, len(parts):
            case "neg", 1:
                return Not(self.read(parts[0]))
            case "conj", 2:
                return And((self.read(parts[0]), self.read(parts[1])))
            case "disj", 2:
                return Or((self.read(parts[0]), self.read(parts[1])))
            case "implies", 2:
                return imply(self.read(parts[0]), self.read(parts[1]))
            case (("some" | "every"), 3):
                variable, body = f"?{parts[0][0]}", self.read(parts[2])
                guard = Atom(sort_predicate(parts[1][0]), (variable,))
                if name == "some":
                    return Exists((variable,), body if _guarded(body, variable) else And((guard, body)))
                return Forall((variable,), body if _guarded(Not(body), variable) else imply(guard, body))
            case "closure", 6:
                return self._closure(f"?{parts[0][0]}", f"?{parts[1][0]}", parts[3], parts[4][0], parts[5][0])
            case "true", 0:
                return And(())
        if name in _CONNECTIVES or any(inner for _, inner in parts):
            raise ValueError(f"not a formula: {name} with {len(parts)} part(s)")
        return Atom(name, tuple(f"?{part[0]}" for part in parts))

    def _closure(self, first: str, last: str, step: Term, start: str, end: str) -> Formula:
        """The transitive closure of `step`, a relation of the variables first and last."""
        head = Atom(f"{self.name}-closure{len(self.axioms) + 1}", (first, last))
        body, between = self.read(step), f"{last}-between"
        onward = Exists((between,), And((substitute(body, {last: between}), Atom(head.predicate, (between, last)))))
        self.axioms.append(Axiom(head, Or((body, onward))))
        return Atom(head.predicate, (f"?{start}", f"?{end}"))


def _guarded(formula: Formula, variable: str) -> bool:
    """Whether the formula can only be true of entities that fill some predicate's argument."""
    return restricts(formula, variable, lambda atom, _: True)


@dataclass(frozen=True)
class Features:
    """A policy's features as axioms `(f1 ?v0)`, in the policy's order."""

    features: tuple[Feature, ...]
    axioms: tuple[Axiom, ...]

    @classmethod
    def of(cls, features: Iterable[Feature]) -> Features:
        """Turn features into axioms."""
        chosen = tuple(features)
        axioms: list[Axiom] = []
        for feature in chosen:
            body, closures = to_formula(feature.formula, feature.name)
            axioms += closures
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
