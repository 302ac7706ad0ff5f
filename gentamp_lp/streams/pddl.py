"""PDDL domains and conditions: syntax trees and a parser that names file and line.

Supported: `:strips`, `:typing` (types become unary static predicates), `:equality`, negative, disjunctive and
quantified conditions, conditional and quantified effects, derived predicates, constants, action costs. Everything else
is refused.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path

from gentamp_lp.errors import Diagnostic, InputError
from gentamp_lp.streams.formula import (
    TRUE,
    And,
    Atom,
    Exists,
    Forall,
    Formula,
    Not,
    Or,
    conjuncts,
    imply,
)
from gentamp_lp.streams.sexpr import Group, Reader, Symbol, read_groups


@dataclass(frozen=True)
class Effect:
    """`forall variables: when condition: add (or delete) atom`."""

    atom: Atom
    positive: bool
    variables: tuple[str, ...] = ()
    condition: Formula = TRUE


@dataclass(frozen=True)
class ActionSchema:
    """A lifted action."""

    name: str
    parameters: tuple[str, ...]
    precondition: Formula
    effects: tuple[Effect, ...]
    line: int = 0
    cost: float = 0.0  # what `increase (total-cost)` adds
    cost_terms: tuple[Atom, ...] = ()  # functions whose values are added to that


@dataclass(frozen=True)
class Axiom:
    """`(:derived (head) body)`."""

    head: Atom
    body: Formula
    line: int = 0


@dataclass(frozen=True)
class Predicate:
    """A declared predicate; `spelling` is how the file writes it."""

    name: str
    spelling: str
    arity: int


@dataclass(frozen=True)
class Domain:
    """A parsed `domain.pddl`."""

    name: str
    predicates: Mapping[str, Predicate]
    constants: tuple[str, ...]
    actions: tuple[ActionSchema, ...]
    axioms: tuple[Axiom, ...]
    path: Path | str | None = None
    text: str = ""
    functions: Mapping[str, Predicate] = field(default_factory=dict)
    supertypes: Mapping[str, tuple[str, ...]] = field(default_factory=dict)  # every type -> the types above it
    facts: tuple[tuple[str, ...], ...] = ()  # the types of constants

    @cached_property
    def fluents(self) -> frozenset[str]:
        """Predicates that some action changes."""
        return frozenset(e.atom.predicate for a in self.actions for e in a.effects)

    @cached_property
    def derived(self) -> frozenset[str]:
        """Predicates that some axiom defines."""
        return frozenset(axiom.head.predicate for axiom in self.axioms)

    def action(self, name: str) -> ActionSchema:
        """The schema called `name` (KeyError if there is none)."""
        for schema in self.actions:
            if schema.name == name:
                return schema
        raise KeyError(name)


@dataclass(frozen=True)
class Cost:
    """`(increase (total-cost) term)`."""

    term: float | Atom
    line: int


def guarded(guards: tuple[Formula, ...], body: Formula) -> Formula:
    """The body under additional conditions."""
    return And((*guards, *conjuncts(body))) if guards else body


@dataclass
class PDDLReader(Reader):
    """Reads parts of PDDL, given what is declared."""

    predicates: dict[str, Predicate] = field(default_factory=dict)
    constants: frozenset[str] = frozenset()
    supertypes: dict[str, tuple[str, ...]] = field(default_factory=dict)
    functions: dict[str, Predicate] = field(default_factory=dict)

    def typed(self, items: Iterable[Symbol | Group], line: int) -> tuple[tuple[Symbol, tuple[str, ...]], ...]:
        """Names with the types they may have (none said: no restriction): `a b - block c`."""
        found: list[tuple[Symbol, tuple[str, ...]]] = []
        waiting: list[Symbol] = []
        rest = iter(items)
        for item in rest:
            name = self.symbol(item, "a name")
            if name.name != "-":
                waiting.append(name)
                continue
            kind = next(rest, None)
            if kind is None:
                raise self.error("a type is missing after `-`", name.line)
            found += ((one, self.types_of(kind)) for one in waiting)
            waiting = []
        found += ((one, ()) for one in waiting)
        names = [name.name for name, _ in found]
        if len(set(names)) != len(names):
            raise self.error("a name is declared twice", line)
        return tuple(found)

    def types_of(self, item: Symbol | Group) -> tuple[str, ...]:
        """The type that is named, or those of an `either`; none for `object`."""
        if isinstance(item, Group) and item.head == "either":
            return tuple(t for part in item.items[1:] for t in self.types_of(part))
        kind = self.symbol(item, "a type")
        if kind.name == "object":
            return ()
        if kind.name not in self.supertypes:
            raise self.error(f"unknown type `{kind.spelling}`", kind.line, "declare it in `:types`")
        return (kind.name,)

    def declared(self, group: Group) -> tuple[tuple[str, ...], tuple[Formula, ...]]:
        """Variables, and the conditions that their types impose."""
        found = self.typed(group.items, group.line)
        for name, _ in found:
            if not name.name.startswith("?"):
                raise self.error(f"`{name.spelling}` is not a variable", name.line, f"write `?{name.spelling}`")
        guards = [[Atom(t, (name.name,)) for t in types] for name, types in found if types]
        return tuple(n.name for n, _ in found), tuple(g[0] if len(g) == 1 else Or(tuple(g)) for g in guards)

    def item(self, group: Group, index: int, what: str) -> Symbol | Group:
        """An element of a list, by its index."""
        if len(group.items) <= index:
            raise self.error(f"expected {what}, found the end of the list", group.line)
        return group.items[index]

    def atom(self, group: Group, scope: frozenset[str]) -> Atom:
        """A predicate, or equality, applied to arguments."""
        head = self.symbol(group.items[0], "a predicate") if group.items else None
        if head is None:
            raise self.error("expected a condition, found `()`", group.line)
        return self.application(head, group, 2 if head.name == "=" else self.arity(head), scope)

    def application(self, head: Symbol, group: Group, arity: int, scope: frozenset[str]) -> Atom:
        """A name applied to declared variables and constants."""
        args = tuple(self.symbol(item, "a variable or a constant") for item in group.items[1:])
        if len(args) != arity:
            raise self.error(f"`{head.spelling}` takes {arity} argument(s), not {len(args)}", head.line)
        for arg in args:
            if arg.name.startswith("?") and arg.name not in scope:
                raise self.error(f"variable `{arg.spelling}` is not declared", arg.line)
            if not arg.name.startswith("?") and arg.name not in self.constants:
                raise self.error(f"unknown constant `{arg.spelling}`", arg.line, "declare it in `:constants`")
        return Atom(head.name, tuple(arg.name for arg in args))

    def arity(self, head: Symbol) -> int:
        """The number of arguments of a declared predicate."""
        if head.name not in self.predicates:
            known = ", ".join(sorted(p.spelling for p in self.predicates.values()))
            raise self.error(f"unknown predicate `{head.spelling}`", head.line, f"known: {known}")
        return self.predicates[head.name].arity

    def formula(self, item: Symbol | Group, scope: frozenset[str]) -> Formula:
        """A condition over the variables in scope."""
        group = self.group(item, "a condition")
        match group.head:
            case "and" | "or":
                parts = tuple(self.formula(part, scope) for part in group.items[1:])
                return And(parts) if group.head == "and" else Or(parts)
            case "not":
                self.size(group, 2)
                return Not(self.formula(group.items[1], scope))
            case "imply":
                self.size(group, 3)
                return imply(self.formula(group.items[1], scope), self.formula(group.items[2], scope))
            case "exists" | "forall":
                self.size(group, 3)
                variables, guards = self.declared(self.group(group.items[1], "a list of variables"))
                body = self.formula(group.items[2], scope | set(variables))
                if group.head == "exists":
                    return Exists(variables, guarded(guards, body))
                return Forall(variables, imply(And(guards), body) if guards else body)
        if not group.items:
            return TRUE
        return self.atom(group, scope)

    def size(self, group: Group, expected: int) -> None:
        """Refuse a list that has not the expected number of elements."""
        if len(group.items) != expected:
            raise self.error(f"`{group.head}` takes {expected - 1} part(s)", group.line)

    def effects(
        self, item: Symbol | Group, scope: frozenset[str], variables: tuple[str, ...], condition: Formula
    ) -> Iterable[Effect | Cost]:
        """The effects that an expression lists, under the given variables and condition, and its costs."""
        group = self.group(item, "an effect")
        match group.head:
            case "and":
                for part in group.items[1:]:
                    yield from self.effects(part, scope, variables, condition)
            case "forall":
                self.size(group, 3)
                bound, guards = self.declared(self.group(group.items[1], "a list of variables"))
                inner = guarded(guards, condition)
                yield from self.effects(group.items[2], scope | set(bound), variables + bound, inner)
            case "when":
                self.size(group, 3)
                when = self.formula(group.items[1], scope)
                yield from self.effects(group.items[2], scope, variables, And((*conjuncts(condition), when)))
            case "not":
                self.size(group, 2)
                yield Effect(self.atom(self.group(group.items[1], "an atom"), scope), False, variables, condition)
            case "increase":
                if variables or conjuncts(condition):
                    raise self.error("a conditional or quantified cost is not supported", group.line)
                yield self.cost(group, scope)
            case "decrease" | "assign" | "scale-up" | "scale-down":
                raise self.error(f"`{group.head}` is not supported", group.line, "only (increase (total-cost) ...)")
            case _:
                yield Effect(self.atom(group, scope), True, variables, condition)

    def cost(self, group: Group, scope: frozenset[str]) -> Cost:
        """What an `increase` adds."""
        self.size(group, 3)
        target = self.group(group.items[1], "(total-cost)")
        if target.head != "total-cost" or len(target.items) != 1:
            raise self.error("only `total-cost` can be increased", group.line)
        amount = group.items[2]
        if isinstance(amount, Group):
            head = self.symbol(self.item(amount, 0, "a function"), "a function")
            if head.name not in self.functions:
                known = ", ".join(sorted(f.spelling for f in self.functions.values())) or "none is declared"
                raise self.error(f"unknown function `{head.spelling}`", head.line, f"known: {known}")
            return Cost(self.application(head, amount, self.functions[head.name].arity, scope), group.line)
        try:
            number = float(amount.name)
        except ValueError:
            raise self.error(f"`{amount.spelling}` is not a number", amount.line) from None
        if not 0 <= number < float("inf"):
            raise self.error("a cost is a number from 0", amount.line)
        return Cost(number, group.line)

    def sections(self, group: Group, start: int, allowed: set[str]) -> dict[str, Symbol | Group]:
        """Keywords and their values, from the element `start` on."""
        found: dict[str, Symbol | Group] = {}
        items = group.items[start:]
        for key, value in zip(items[::2], items[1::2], strict=False):
            name = self.symbol(key, "a keyword")
            if name.name not in allowed:
                hint = f"allowed: {', '.join(sorted(allowed))}"
                raise self.error(f"unsupported keyword `{name.spelling}`", name.line, hint)
            found[name.name] = value
        if len(items) % 2:
            raise self.error("a keyword has no value", items[-1].line)
        return found


def parse_domain(text: str, path: Path | str | None = None, functions: Mapping[str, Predicate] | None = None) -> Domain:
    """Parse a PDDL domain; `functions` are declared elsewhere. Raises InputError with file, line and remedy."""
    reader = PDDLReader(path, functions=dict(functions or {}))
    name = ""
    constants: tuple[str, ...] = ()
    groups = read_groups(text, path)
    if len(groups) != 1 or groups[0].head != "define":
        raise reader.error("expected one `(define (domain ...) ...)`", groups[0].line if groups else 1)
    sections = [reader.group(item, "a section") for item in groups[0].items[1:]]
    facts: list[tuple[str, ...]] = []
    for group in sorted(sections, key=lambda g: _ORDER.get(g.head, len(_ORDER))):
        match group.head:
            case "domain":
                name = reader.symbol(reader.item(group, 1, "the domain's name"), "the domain's name").name
            case ":types":
                _types(reader, group)
            case ":constants":
                found = reader.typed(group.items[1:], group.line)
                constants = tuple(constant.name for constant, _ in found)
                reader.constants = frozenset(constants)
                facts = [(kind, constant.name) for constant, kinds in found for kind in kinds[:1]]
            case ":predicates":
                for item in group.items[1:]:
                    declaration = reader.group(item, "a predicate declaration")
                    head = reader.symbol(reader.item(declaration, 0, "a predicate"), "a predicate")
                    arity = len(reader.declared(Group(declaration.items[1:], declaration.line))[0])
                    if head.name in reader.supertypes and arity != 1:
                        raise reader.error(f"`{head.spelling}` is a type and takes 1 argument", head.line)
                    reader.predicates[head.name] = Predicate(head.name, head.spelling, arity)
            case ":functions":
                _functions(reader, group)
            case ":requirements" | ":action" | ":derived":
                pass
            case ":durative-action" | ":process" | ":event":
                raise reader.error("temporal planning is not supported", group.line, "write an `:action`")
            case _:
                raise reader.error(f"unsupported section `{group.head or '()'}`", group.line)
    actions, axioms = [], []
    for group in sections:
        if group.head == ":action":
            actions.append(_action(reader, group))
        elif group.head == ":derived":
            axioms.append(_axiom(reader, group))
    changed = {e.atom.predicate for a in actions for e in a.effects}
    for axiom in axioms:
        if axiom.head.predicate in changed:
            raise reader.error(f"derived predicate `{axiom.head.predicate}` is also an effect", axiom.line)
    seen: set[str] = set()
    for action in actions:
        if action.name in seen:
            raise reader.error(f"action `{action.name}` is declared twice", action.line)
        seen.add(action.name)
    return Domain(
        name, reader.predicates, constants, tuple(actions), tuple(axioms), path, text,
        reader.functions, reader.supertypes, tuple(facts),
    )  # fmt: skip


#: Declarations are read before what uses them, wherever they stand.
_ORDER = {":types": 0, ":constants": 1, ":predicates": 2, ":functions": 3}


def _types(reader: PDDLReader, group: Group) -> None:
    """`a b - c`: remember the types above each type; every type is a unary predicate."""
    parents: dict[str, str] = {}
    waiting: list[Symbol] = []
    rest = iter(group.items[1:])
    spelling: dict[str, str] = {}
    for item in rest:
        kind = reader.symbol(item, "a type")
        if kind.name != "-":
            waiting.append(kind)
            continue
        above = reader.symbol(next(rest, kind), "a type")
        spelling[above.name] = above.spelling
        parents |= {one.name: above.name for one in waiting}
        spelling |= {one.name: one.spelling for one in waiting}
        waiting = []
    spelling |= {one.name: one.spelling for one in waiting}
    spelling.pop("object", None)
    for name, written in spelling.items():
        chain: list[str] = []
        above_ = parents.get(name, "object")
        while above_ != "object":
            if above_ in chain or above_ == name:
                raise reader.error(f"type `{written}` is above itself", group.line)
            chain.append(above_)
            above_ = parents.get(above_, "object")
        reader.supertypes[name] = tuple(chain)
        reader.predicates[name] = Predicate(name, written, 1)


def _functions(reader: PDDLReader, group: Group) -> None:
    items = iter(group.items[1:])
    for item in items:
        if isinstance(item, Symbol) and item.name == "-":
            kind = reader.symbol(next(items, item), "a type")
            if kind.name != "number":
                raise reader.error("functions have numbers as values", kind.line, "write `- number`")
            continue
        declaration = reader.group(item, "a function declaration")
        head = reader.symbol(reader.item(declaration, 0, "a function"), "a function")
        arity = len(reader.declared(Group(declaration.items[1:], declaration.line))[0])
        reader.functions[head.name] = Predicate(head.name, head.spelling, arity)


def _action(reader: PDDLReader, group: Group) -> ActionSchema:
    name = reader.symbol(reader.item(group, 1, "the action's name"), "the action's name").name
    parts = reader.sections(group, 2, {":parameters", ":precondition", ":effect"})
    if ":effect" not in parts:
        raise reader.error(f"action `{name}` has no `:effect`", group.line)
    parameters: tuple[str, ...] = ()
    guards: tuple[Formula, ...] = ()
    if ":parameters" in parts:
        parameters, guards = reader.declared(reader.group(parts[":parameters"], "a list of variables"))
    scope = frozenset(parameters)
    precondition = reader.formula(parts[":precondition"], scope) if ":precondition" in parts else TRUE
    found = tuple(reader.effects(parts[":effect"], scope, (), TRUE))
    costs = [cost.term for cost in found if isinstance(cost, Cost)]
    effects = tuple(effect for effect in found if isinstance(effect, Effect))
    for effect in effects:
        if effect.atom.predicate == "=" or effect.atom.predicate in reader.supertypes:
            raise reader.error(f"an action cannot change `{effect.atom.predicate}`", group.line)
    amount = sum(cost for cost in costs if not isinstance(cost, Atom))
    terms = tuple(cost for cost in costs if isinstance(cost, Atom))
    return ActionSchema(name, parameters, guarded(guards, precondition), effects, group.line, amount, terms)


def _axiom(reader: PDDLReader, group: Group) -> Axiom:
    reader.size(group, 3)
    head = reader.group(group.items[1], "the derived atom")
    variables, guards = reader.declared(Group(head.items[1:], head.line))
    scope = frozenset(variables)
    atom = reader.atom(Group((*head.items[:1], *(Symbol(v, v, head.line) for v in variables)), head.line), scope)
    if atom.predicate == "=" or atom.predicate in reader.supertypes:
        raise reader.error(f"`{atom.predicate}` cannot be derived", head.line)
    return Axiom(atom, guarded(guards, reader.formula(group.items[2], scope)), group.line)


def parse_formula(
    text: str,
    domain: Domain,
    constants: Iterable[str] = (),
    path: Path | str | None = None,
    line_offset: int = 0,
    scope: Iterable[str] = (),
) -> Formula:
    """Parse one condition (a goal, say) over the domain's predicates."""
    known = frozenset(domain.constants) | {c.lower() for c in constants}
    reader = PDDLReader(path, dict(domain.predicates), known, dict(domain.supertypes))
    try:
        groups = read_groups(text, path)
        if len(groups) != 1:
            raise reader.error("expected exactly one condition in parentheses", 1)
        return reader.formula(groups[0], frozenset(scope))
    except InputError as error:
        raise _shift(error, line_offset) from None


def _shift(error: InputError, offset: int) -> InputError:
    return InputError(
        *(Diagnostic(d.message, d.path, (d.line or 1) + offset, d.column, d.hint) for d in error.diagnostics)
    )
