"""First-order formulas over PDDL atoms, and the few transformations the engine needs.

Variables are strings that begin with `?`; every other argument is the name of an entity.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from itertools import count


@dataclass(frozen=True, slots=True)
class Atom:
    """`predicate(args)`; the predicate `=` is equality."""

    predicate: str
    args: tuple[str, ...]


@dataclass(frozen=True, slots=True)
class Not:
    """Negation."""

    body: Formula


@dataclass(frozen=True, slots=True)
class And:
    """Conjunction; the empty one is true."""

    parts: tuple[Formula, ...]


@dataclass(frozen=True, slots=True)
class Or:
    """Disjunction; the empty one is false."""

    parts: tuple[Formula, ...]


@dataclass(frozen=True, slots=True)
class Exists:
    """Existential quantification over all entities."""

    variables: tuple[str, ...]
    body: Formula


@dataclass(frozen=True, slots=True)
class Forall:
    """Universal quantification over all entities."""

    variables: tuple[str, ...]
    body: Formula


Formula = Atom | Not | And | Or | Exists | Forall

TRUE = And(())
FALSE = Or(())


def imply(premise: Formula, conclusion: Formula) -> Formula:
    """Material implication."""
    return Or((Not(premise), conclusion))


def conjuncts(formula: Formula) -> tuple[Formula, ...]:
    """The parts of a (nested) conjunction."""
    if isinstance(formula, And):
        return tuple(c for part in formula.parts for c in conjuncts(part))
    return (formula,)


def atoms(formula: Formula) -> Iterator[Atom]:
    """All atoms in the order they are written."""
    match formula:
        case Atom():
            yield formula
        case Not(body) | Exists(_, body) | Forall(_, body):
            yield from atoms(body)
        case And(parts) | Or(parts):
            for part in parts:
                yield from atoms(part)


def free_variables(formula: Formula) -> frozenset[str]:
    """Variables not bound by a quantifier."""
    match formula:
        case Atom(_, args):
            return frozenset(a for a in args if a.startswith("?"))
        case Not(body):
            return free_variables(body)
        case And(parts) | Or(parts):
            return frozenset().union(*(free_variables(part) for part in parts))
        case Exists(variables, body) | Forall(variables, body):
            return free_variables(body) - set(variables)


def rebuilt(formula: Formula, change: Callable[[Formula], Formula]) -> Formula:
    """The formula with `change` applied to its direct parts; an atom as it is."""
    match formula:
        case Not(body):
            return Not(change(body))
        case And(parts):
            return And(tuple(change(part) for part in parts))
        case Or(parts):
            return Or(tuple(change(part) for part in parts))
        case Exists(variables, body):
            return Exists(variables, change(body))
        case Forall(variables, body):
            return Forall(variables, change(body))
    return formula


def substitute(formula: Formula, binding: Mapping[str, str]) -> Formula:
    """Replace free variables; quantified variables shadow the binding."""
    match formula:
        case Atom(predicate, args):
            return Atom(predicate, tuple(binding.get(a, a) for a in args))
        case Exists(variables) | Forall(variables):
            binding = _without(binding, variables)
    return rebuilt(formula, lambda part: substitute(part, binding))


def _without(binding: Mapping[str, str], variables: tuple[str, ...]) -> dict[str, str]:
    return {k: v for k, v in binding.items() if k not in variables}


def normalize(formula: Formula) -> Formula:
    """Equivalent formula where Not stands only before atoms and Exists, Forall is gone, and every quantifier
    binds variables of its own.
    """
    return _normalize(formula, False, {}, count())


def _normalize(formula: Formula, negated: bool, names: Mapping[str, str], fresh: Iterator[int]) -> Formula:
    match formula:
        case Atom():
            atom = substitute(formula, names)
            return Not(atom) if negated else atom
        case Not(body):
            return _normalize(body, not negated, names, fresh)
        case And(parts) | Or(parts):
            flipped = tuple(_normalize(part, negated, names, fresh) for part in parts)
            return And(flipped) if isinstance(formula, And) != negated else Or(flipped)
        case Exists(variables, body) | Forall(variables, body):
            existential = isinstance(formula, Exists)
            renamed = {v: f"{v}#{next(fresh)}" for v in variables}
            inner = Exists(tuple(renamed.values()), _normalize(body, not existential, {**names, **renamed}, fresh))
            return inner if existential != negated else Not(inner)


def restricts(formula: Formula, variable: str, fills: Callable[[Atom, str], bool]) -> bool:
    """Whether a formula can only be true of entities that an atom names: one that `fills` accepts for the variable."""
    return _restricts(normalize(formula), variable, fills)


def _restricts(formula: Formula, variable: str, fills: Callable[[Atom, str], bool]) -> bool:
    match formula:
        case Atom(predicate, args):
            return predicate != "=" and variable in args and fills(formula, variable)
        case And(parts):
            return any(_restricts(part, variable, fills) for part in parts)
        case Or(parts):
            return bool(parts) and all(_restricts(part, variable, fills) for part in parts)
        case Exists(_, body):  # normalized: binds other variables
            return _restricts(body, variable, fills)
    return False


def to_pddl(formula: Formula) -> str:
    """The formula in PDDL syntax."""
    match formula:
        case Atom(predicate, args):
            return f"({' '.join((predicate, *args))})"
        case Not(body):
            return f"(not {to_pddl(body)})"
        case And(parts):
            return f"(and{''.join(' ' + to_pddl(p) for p in parts)})"
        case Or(parts):
            return f"(or{''.join(' ' + to_pddl(p) for p in parts)})"
        case Exists(variables, body):
            return f"(exists ({' '.join(variables)}) {to_pddl(body)})"
        case Forall(variables, body):
            return f"(forall ({' '.join(variables)}) {to_pddl(body)})"
