"""What an action schema does to a formula, as a condition on the schema's parameters and on the state before.

First-order regression (Reiter, *Knowledge in Action*, 2001, section 4.5): an atom is true after an action if the action
adds it, or if it was true and the action does not delete it. Of the result only what differs from before is written
down (`becomes`), and simplified with the schema's precondition and with what the domain's invariants say of it: of a
thing in the hand, that it stands nowhere. Often nothing is left but static conditions on the parameters.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from itertools import count, product

from gentamp_lp.streams.formula import (
    FALSE,
    TRUE,
    And,
    Atom,
    Exists,
    Forall,
    Formula,
    Not,
    Or,
    atoms,
    conjuncts,
    normalize,
    rebuilt,
    substitute,
)
from gentamp_lp.streams.pddl import ActionSchema
from gentamp_lp.streams.queries import unfold
from gentamp_lp.streams.relations import bind
from gentamp_lp.streams.semantics import Program
from gentamp_lp.tasks.invariants import Group, key_of

Facts = frozenset[Formula]


class Regression:
    """Regression through one schema, in states where its precondition and the `known` literals hold.

    Formulas are normalized; a quantifier's variables are none of the schema's. `groups` are invariants of all states,
    and nothing satisfies the `empty` predicates in these states.
    """

    def __init__(
        self,
        schema: ActionSchema,
        program: Program,
        groups: Sequence[Group] = (),
        known: Iterable[Formula] = (),
        empty: Iterable[str] = (),
    ) -> None:
        self.schema, self.program, self._groups, self._empty = schema, program, groups, frozenset(empty)
        self._changed = frozenset(effect.atom.predicate for effect in schema.effects)
        self._known: Facts = frozenset(conjuncts(program.preconditions[schema.name])) | frozenset(known)
        self._numbers = count(1)

    def can(self, formula: Formula) -> bool:
        """Whether the schema leaves all recursive axioms alone that the formula reads: else it has no regression."""
        left = atoms(unfold(formula, self.program))
        return not any(self._affects(atom) for atom in left if atom.predicate in self.program.recursive)

    def becomes(self, formula: Formula, truth: bool, exact: bool = True) -> Formula:
        """That the action changes the formula's truth value to this one; if not exact, a condition for it."""
        if not self._affects(formula):
            return FALSE
        match formula:
            case Atom() if formula.predicate in self.program.axioms and not truth:
                body = self._definition(formula)
                if isinstance(body, Exists):
                    return self.turns(body, False, exact)
            case Exists() if not truth:  # whatever makes it false makes something false that was true
                return self.turns(formula, False, exact)
            case And(parts) if not truth:
                return Or(tuple(And((self.becomes(p, False, exact), *(o for o in parts if o is not p))) for p in parts))
        return And((Not(formula) if truth else formula, self.turns(formula, truth, exact)))

    def turns(self, formula: Formula, truth: bool, exact: bool = True) -> Formula:
        """The same where the formula has the other value before. If exact, it implies this value after in any case."""
        if not self._affects(formula):
            return FALSE
        match formula:
            case Atom() if formula.predicate in self.program.axioms:
                return self.turns(self._definition(formula), truth, exact)
            case Atom():
                added = self._hits(formula, True)
                return added if truth else And((self._hits(formula, False), Not(added)))
            case Not(body):
                return self.turns(body, not truth, exact)
            case Exists(variables, body) if truth:
                return Exists(variables, self.turns(body, True, exact))
            case Exists(variables, body):
                some = Exists(variables, self.becomes(body, False, exact=False))
                return And((some, Not(Exists(variables, self.after(body))))) if exact else some
            case And(parts) | Or(parts):
                if truth == isinstance(formula, Or):  # so none of the parts has the new value
                    return Or(tuple(self.turns(part, truth, exact) for part in parts))
                options = []
                for part in filter(self._affects, parts):
                    others = (self.after(other) for other in parts if other is not part)
                    now = (other if truth else Not(other) for other in others)
                    options.append(And((self.turns(part, truth, exact), *now)))
                return Or(tuple(options))
        raise AssertionError(f"not normalized: {formula}")

    def after(self, formula: Formula) -> Formula:
        """That the formula is true after the action."""
        if not self._affects(formula):
            return formula
        match formula:
            case Atom() if formula.predicate in self.program.axioms:
                body = self._definition(formula)
                if self.simplified(self.turns(body, False)) == FALSE:
                    return Or((formula, self.turns(body, True)))
                return self.after(body)
            case Atom():
                return Or((self._hits(formula, True), And((formula, Not(self._hits(formula, False))))))
        return rebuilt(formula, self.after)

    def _affects(self, formula: Formula) -> bool:
        return any(
            not self._changed.isdisjoint(self.program.basis.get(atom.predicate, {atom.predicate}))
            for atom in atoms(formula)
        )

    def _definition(self, atom: Atom) -> Formula:
        bodies = _definitions(atom, self.program, next(self._numbers))
        return bodies[0] if len(bodies) == 1 else Or(tuple(bodies))

    def _hits(self, atom: Atom, positive: bool) -> Formula:
        """That some effect adds (or deletes) the atom, in terms of its arguments."""
        options: list[Formula] = []
        for effect in self.schema.effects:
            if effect.atom.predicate == atom.predicate and effect.positive == positive:
                number = next(self._numbers)
                own = {variable: f"{variable}~{number}" for variable in effect.variables}
                args = (own.get(arg, arg) for arg in effect.atom.args)
                same = (Atom("=", pair) for pair in zip(atom.args, args, strict=True))
                hit = And((*same, _renamed(normalize(effect.condition), own, number)))
                options.append(Exists(tuple(own.values()), hit) if own else hit)
        return Or(tuple(options))

    def implied(self, formula: Formula) -> Iterator[Formula]:
        """Literals on the parameters that follow from the negation of an existential condition and the precondition.

        They say nothing new, but planners read them when they ground the action.
        """
        if isinstance(formula, Not) and isinstance(formula.body, Exists):
            variables, body = formula.body.variables, formula.body.body
            pairs = product(conjuncts(body), conjuncts(self.program.preconditions[self.schema.name]))
            for part, other in pairs:
                if isinstance(part, Atom) and isinstance(other, Atom) and part.predicate == other.predicate:
                    names = {a: b for a, b in zip(part.args, other.args, strict=True) if a in variables}
                    if len(names) == len(variables) and substitute(part, names) == other:
                        literal = self.simplified(Not(substitute(body, names)))
                        if is_literal(literal):
                            yield literal

    # ---- Simplification

    def simplified(self, formula: Formula) -> Formula:
        """An equivalent formula, where the action is applicable, with less in it."""
        return self._simple(formula, self._known)

    def _simple(self, formula: Formula, known: Facts) -> Formula:
        match formula:
            case Atom("=", (left, right)):
                if left == right or not (left.startswith("?") or right.startswith("?")):
                    return TRUE if left == right else FALSE
                return _looked_up(Atom("=", (min(left, right), max(left, right))), known)
            case Atom():
                return self._simple_atom(formula, known)
            case Not(body):
                return _not(self._simple(body, known))
            case Or(parts):
                return _or(self._simple(part, known) for part in parts)
            case And(parts):
                return self._simple_and(list(dict.fromkeys(conjuncts(formula))), known)
            case Exists(variables, body):
                return self._simple_exists(variables, self._simple(body, known), known)
        raise AssertionError(f"not normalized: {formula}")

    def _simple_atom(self, atom: Atom, known: Facts) -> Formula:
        """What is known of it, what an invariant says of it, or what axioms say if that is static."""
        found = FALSE if atom.predicate in self._empty else _looked_up(atom, known)
        if found is not atom or atom.predicate in self.program.recursive:
            return found
        fluents = self.program.domain.fluents
        if atom.predicate in self.program.axioms:
            if self.program.basis[atom.predicate].isdisjoint(fluents):
                return atom
            meaning = self._simple(self._definition(atom), known)
            return meaning if self.static(meaning) else atom
        for group in self._groups:
            for other in known if atom.predicate in group else ():
                if isinstance(other, Atom) and other.predicate in group and key_of(atom, group) == key_of(other, group):
                    if other.predicate != atom.predicate:
                        return FALSE
                    same = And(tuple(Atom("=", pair) for pair in zip(atom.args, other.args, strict=True)))
                    return self._simple(same, known)
        return atom

    def static(self, formula: Formula) -> bool:
        """Whether no action changes the formula's truth."""
        fluents, basis = self.program.domain.fluents, self.program.basis
        return all(fluents.isdisjoint(basis.get(name, {name})) for name in formula.predicates)

    def _simple_and(self, parts: list[Formula], known: Facts) -> Formula:
        """Each part is simplified where the literals among the others hold."""
        if FALSE in parts:
            return FALSE
        for i, part in enumerate(parts):
            others = frozenset(other for other in parts[:i] + parts[i + 1 :] if is_literal(other))
            simple = self._simple(part, known | others)
            if simple != part:
                rest = [*parts[:i], *conjuncts(simple), *parts[i + 1 :]]
                return self._simple_and(list(dict.fromkeys(rest)), known)
        return parts[0] if len(parts) == 1 else And(tuple(parts))

    def _simple_exists(self, variables: tuple[str, ...], body: Formula, known: Facts) -> Formula:
        """A variable that equals something is replaced by it; what speaks of no variable is taken out."""
        if isinstance(body, Exists):
            return self._simple_exists(variables + body.variables, body.body, known)
        parts = conjuncts(body)
        for part in parts:
            match part:
                case Atom("=", (left, right)) if not {left, right}.isdisjoint(variables):
                    old, new = (left, right) if left in variables else (right, left)
                    rest = tuple(v for v in variables if v != old)
                    return self._simple(Exists(rest, substitute(body, {old: new})), known)
                case Or(options) if part is body or any(_equates(option, variables) for option in options):
                    rest_ = [other for other in parts if other is not part]
                    return _or(self._simple(Exists(variables, And((o, *rest_))), known) for o in options)
        inside = [part for part in parts if not part.free.isdisjoint(variables)]
        outside = [part for part in parts if part not in inside]
        if inside:
            used = tuple(v for v in variables if any(v in part.free for part in inside))
            outside.append(Exists(used, inside[0] if len(inside) == 1 else And(tuple(inside))))
        return outside[0] if len(outside) == 1 else And(tuple(outside))


def is_literal(formula: Formula) -> bool:
    """Whether it is an atom or the negation of one."""
    return isinstance(formula.body if isinstance(formula, Not) else formula, Atom)


def _looked_up(atom: Atom, known: Facts) -> Formula:
    return TRUE if atom in known else FALSE if Not(atom) in known else atom


def _equates(formula: Formula, variables: Iterable[str]) -> bool:
    return any(isinstance(p, Atom) and p.predicate == "=" and not set(p.args).isdisjoint(variables)
               for p in conjuncts(formula))  # fmt: skip


def _not(body: Formula) -> Formula:
    match body:
        case Not(inner):
            return inner
        case Or(parts):
            negated = tuple(_not(part) for part in parts)
            return negated[0] if len(negated) == 1 else And(negated)
        case And(parts) if parts and all(isinstance(part, Atom) and part.predicate == "=" for part in parts):
            return Or(tuple(Not(part) for part in parts))
    return FALSE if body == TRUE else Not(body)


def _or(parts: Iterable[Formula]) -> Formula:
    found: dict[Formula, None] = {}
    for part in parts:
        if part == TRUE:
            return TRUE
        found |= dict.fromkeys(part.parts if isinstance(part, Or) else (part,))
    return next(iter(found)) if len(found) == 1 else Or(tuple(found))


def _definitions(atom: Atom, program: Program, number: int) -> list[Formula]:
    """The bodies of a derived predicate's axioms for these arguments; the number keeps quantified variables apart."""
    axioms = program.axioms[atom.predicate]
    return [_renamed(axiom.body, dict(zip(axiom.head.args, atom.args, strict=True)), number) for axiom in axioms]


def _renamed(formula: Formula, names: dict[str, str], number: int) -> Formula:
    """The formula with other names, and with quantified variables that occur nowhere else."""
    match formula:
        case Atom():
            return Atom(formula.predicate, bind(formula, names))
        case Exists(variables, body):
            own = {v: f"{v}~{number}" for v in variables}
            return Exists(tuple(own.values()), _renamed(body, {**names, **own}, number))
        case Forall():
            raise AssertionError(f"not normalized: {formula}")
    return rebuilt(formula, lambda part: _renamed(part, names, number))
