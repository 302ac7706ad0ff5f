"""First-order formulas over PDDL atoms, and the few transformations the engine needs.

Variables are strings that begin with `?`; every other argument is the name of an entity.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import count


class _Formula:
    """What is found out about a formula once, when it is first asked for."""

    @cached_property
    def free(self) -> frozenset[str]:
        """Variables not bound by a quantifier."""
        match self:
            case Atom(_, args):
                return frozenset([a for a in args if a.startswith("?")])
            case Not(body):
                return body.free
            case And(parts) | Or(parts):
                return frozenset().union(*[part.free for part in parts])
            case Exists(variables, body) | Forall(variables, body):
                return body.free.difference(variables)
        raise AssertionError(self)

    @cached_property
    def predicates(self) -> frozenset[str]:
        """The predicates of its atoms."""
        match self:
            case Atom(predicate):
                return frozenset((predicate,))
            case Not(body) | Exists(_, body) | Forall(_, body):
                return body.predicates
            case And(parts) | Or(parts):
                return frozenset().union(*[part.predicates for part in parts])
        raise AssertionError(self)


@dataclass(frozen=True)
class Atom(_Formula):
    """`predicate(args)`; the predicate `=` is equality."""

    predicate: str
    args: tuple[str, ...]


@dataclass(frozen=True)
class Not(_Formula):
    """Negation."""

    body: Formula


@dataclass(frozen=True)
class And(_Formula):
    """Conjunction; the empty one is true."""

    parts: tuple[Formula, ...]


@dataclass(frozen=True)
class Or(_Formula):
    """Disjunction; the empty one is false."""

    parts: tuple[Formula, ...]


@dataclass(frozen=True)
class Exists(_Formula):
    """Existential quantification over all entities."""

    variables: tuple[str, ...]
    body: Formula


@dataclass(frozen=True)
class Forall(_Formula):
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


#: For an atom that is defined, the bodies that define it, each with what stands for its free variables.
Definitions = Callable[[Atom], Sequence[tuple["Formula", Mapping[str, str]]]]


def normalize(formula: Formula, definitions: Definitions = lambda _: ()) -> Formula:
    """Equivalent formula where Not stands only before atoms and Exists, Forall is gone, every quantifier binds
    variables of its own, and atoms with `definitions` are replaced by them.
    """
    return _normalize(formula, False, {}, count(), definitions)


def _normalize(
    formula: Formula, negated: bool, names: Mapping[str, str], fresh: Iterator[int], definitions: Definitions
) -> Formula:
    match formula:
        case Atom(predicate, args):
            atom = Atom(predicate, tuple([names.get(arg, arg) for arg in args])) if names else formula
            cases = [_normalize(body, negated, own, fresh, definitions) for body, own in definitions(atom)]
            if cases:
                return cases[0] if len(cases) == 1 else And(tuple(cases)) if negated else Or(tuple(cases))
            return Not(atom) if negated else atom
        case Not(body):
            return _normalize(body, not negated, names, fresh, definitions)
        case And(parts) | Or(parts):
            flipped = tuple([_normalize(part, negated, names, fresh, definitions) for part in parts])
            return And(flipped) if isinstance(formula, And) != negated else Or(flipped)
        case Exists(variables, body) | Forall(variables, body):
            existential = isinstance(formula, Exists)
            own = {v: f"{v}#{next(fresh)}" for v in variables}
            inner = _normalize(body, not existential, {**names, **own}, fresh, definitions)
            found = Exists(tuple(own.values()), inner)
            return found if existential != negated else Not(found)


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
