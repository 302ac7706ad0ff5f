"""The PDDL and stream files: syntax trees and a parser that names file and line.

Supported: untyped `:strips`, `:equality`, negative, disjunctive and quantified conditions, conditional and
quantified effects, derived predicates, constants; streams and test streams. Everything else is refused.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
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
    atoms,
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
    path: Path | None = None
    text: str = ""

    @property
    def fluents(self) -> frozenset[str]:
        """Predicates that some action changes."""
        return frozenset(e.atom.predicate for a in self.actions for e in a.effects)

    @property
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
class Stream:
    """A declared stream; without outputs it is a test."""

    name: str
    inputs: tuple[str, ...]
    domain: tuple[Atom, ...]
    outputs: tuple[str, ...]
    certified: tuple[Atom, ...]
    line: int = 0

    @property
    def is_test(self) -> bool:
        """Whether the stream decides facts about its inputs instead of making entities."""
        return not self.outputs


@dataclass
class _Reader(Reader):
    predicates: dict[str, Predicate] = field(default_factory=dict)
    constants: frozenset[str] = frozenset()

    def variables(self, group: Group) -> tuple[str, ...]:
        names = []
        for item in group.items:
            name = self.symbol(item, "a variable")
            if name.name == "-":
                raise self.error("types are not supported", name.line, "use unary predicates instead")
            if not name.name.startswith("?"):
                raise self.error(f"`{name.spelling}` is not a variable", name.line, f"write `?{name.spelling}`")
            names.append(name.name)
        if len(set(names)) != len(names):
            raise self.error("a variable is declared twice", group.line)
        return tuple(names)

    def atom(self, group: Group, scope: frozenset[str]) -> Atom:
        head = self.symbol(group.items[0], "a predicate") if group.items else None
        if head is None:
            raise self.error("expected a condition, found `()`", group.line)
        args = tuple(self.symbol(item, "a variable or a constant") for item in group.items[1:])
        arity = 2 if head.name == "=" else self.arity(head)
        if len(args) != arity:
            raise self.error(f"`{head.spelling}` takes {arity} argument(s), not {len(args)}", head.line)
        for arg in args:
            if arg.name.startswith("?") and arg.name not in scope:
                raise self.error(f"variable `{arg.spelling}` is not declared", arg.line)
            if not arg.name.startswith("?") and arg.name not in self.constants:
                raise self.error(f"unknown constant `{arg.spelling}`", arg.line, "declare it in `:constants`")
        return Atom(head.name, tuple(arg.name for arg in args))

    def arity(self, head: Symbol) -> int:
        if head.name not in self.predicates:
            known = ", ".join(sorted(p.spelling for p in self.predicates.values()))
            raise self.error(f"unknown predicate `{head.spelling}`", head.line, f"known: {known}")
        return self.predicates[head.name].arity

    def formula(self, item: Symbol | Group, scope: frozenset[str]) -> Formula:
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
                variables = self.variables(self.group(group.items[1], "a list of variables"))
                body = self.formula(group.items[2], scope | set(variables))
                return Exists(variables, body) if group.head == "exists" else Forall(variables, body)
        if not group.items:
            return TRUE
        return self.atom(group, scope)

    def size(self, group: Group, expected: int) -> None:
        if len(group.items) != expected:
            raise self.error(f"`{group.head}` takes {expected - 1} part(s)", group.line)

    def effects(
        self, item: Symbol | Group, scope: frozenset[str], variables: tuple[str, ...], condition: Formula
    ) -> Iterable[Effect]:
        group = self.group(item, "an effect")
        match group.head:
            case "and":
                for part in group.items[1:]:
                    yield from self.effects(part, scope, variables, condition)
            case "forall":
                self.size(group, 3)
                bound = self.variables(self.group(group.items[1], "a list of variables"))
                yield from self.effects(group.items[2], scope | set(bound), variables + bound, condition)
            case "when":
                self.size(group, 3)
                when = self.formula(group.items[1], scope)
                yield from self.effects(group.items[2], scope, variables, And((*conjuncts(condition), when)))
            case "not":
                self.size(group, 2)
                yield Effect(self.atom(self.group(group.items[1], "an atom"), scope), False, variables, condition)
            case "increase" | "decrease" | "assign":
                raise self.error("action costs and numbers are not supported", group.line)
            case _:
                yield Effect(self.atom(group, scope), True, variables, condition)

    def sections(self, group: Group, start: int, allowed: set[str]) -> dict[str, Symbol | Group]:
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


def parse_domain(text: str, path: Path | None = None) -> Domain:
    """Parse a PDDL domain. Raises InputError with file, line and remedy."""
    reader = _Reader(path)
    name = ""
    constants: tuple[str, ...] = ()
    groups = read_groups(text, path)
    if len(groups) != 1 or groups[0].head != "define":
        raise reader.error("expected one `(define (domain ...) ...)`", groups[0].line if groups else 1)
    sections = [reader.group(item, "a section") for item in groups[0].items[1:]]
    for group in sections:
        match group.head:
            case "domain":
                name = reader.symbol(group.items[1], "the domain's name").name
            case ":constants":
                constants = tuple(reader.symbol(item, "a constant").name for item in group.items[1:])
                reader.constants = frozenset(constants)
            case ":predicates":
                for item in group.items[1:]:
                    declaration = reader.group(item, "a predicate declaration")
                    head = reader.symbol(declaration.items[0], "a predicate")
                    arity = len(reader.variables(Group(declaration.items[1:], declaration.line)))
                    reader.predicates[head.name] = Predicate(head.name, head.spelling, arity)
            case ":requirements" | ":action" | ":derived":
                pass
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
    return Domain(name, reader.predicates, constants, tuple(actions), tuple(axioms), path, text)


def _action(reader: _Reader, group: Group) -> ActionSchema:
    name = reader.symbol(group.items[1], "the action's name").name
    parts = reader.sections(group, 2, {":parameters", ":precondition", ":effect"})
    if ":effect" not in parts:
        raise reader.error(f"action `{name}` has no `:effect`", group.line)
    parameters: tuple[str, ...] = ()
    if ":parameters" in parts:
        parameters = reader.variables(reader.group(parts[":parameters"], "a list of variables"))
    scope = frozenset(parameters)
    precondition = reader.formula(parts[":precondition"], scope) if ":precondition" in parts else TRUE
    effects = tuple(reader.effects(parts[":effect"], scope, (), TRUE))
    return ActionSchema(name, parameters, precondition, effects, group.line)


def _axiom(reader: _Reader, group: Group) -> Axiom:
    reader.size(group, 3)
    head = reader.group(group.items[1], "the derived atom")
    variables = reader.variables(Group(head.items[1:], head.line))
    scope = frozenset(variables)
    return Axiom(reader.atom(head, scope), reader.formula(group.items[2], scope), group.line)


def parse_streams(text: str, domain: Domain, path: Path | None = None) -> tuple[Stream, ...]:
    """Parse a stream file against the domain whose predicates it certifies."""
    reader = _Reader(path, dict(domain.predicates), frozenset(domain.constants))
    groups = read_groups(text, path)
    if len(groups) != 1 or groups[0].head != "define":
        raise reader.error("expected one `(define (stream ...) ...)`", groups[0].line if groups else 1)
    streams: dict[str, Stream] = {}
    for item in groups[0].items[1:]:
        group = reader.group(item, "a section")
        if group.head == "stream":
            continue
        if group.head != ":stream":
            raise reader.error(f"unsupported section `{group.head or '()'}`", group.line, "only `:stream`")
        stream = _stream(reader, group, domain)
        if stream.name in streams:
            raise reader.error(f"stream `{stream.name}` is declared twice", group.line)
        streams[stream.name] = stream
    return tuple(streams.values())


def _stream(reader: _Reader, group: Group, domain: Domain) -> Stream:
    name = reader.symbol(group.items[1], "the stream's name").name
    parts = reader.sections(group, 2, {":inputs", ":domain", ":outputs", ":certified"})

    def variables(key: str) -> tuple[str, ...]:
        return reader.variables(reader.group(parts[key], "a list of variables")) if key in parts else ()

    def literals(key: str, scope: frozenset[str]) -> tuple[Atom, ...]:
        found = conjuncts(reader.formula(parts[key], scope)) if key in parts else ()
        for literal in found:
            if not isinstance(literal, Atom):
                raise reader.error(f"`{key}` of stream `{name}` must be a conjunction of atoms", group.line)
        return tuple(a for a in found if isinstance(a, Atom))

    inputs, outputs = variables(":inputs"), variables(":outputs")
    if set(inputs) & set(outputs):
        raise reader.error(f"stream `{name}` uses a variable as input and output", group.line)
    conditions = literals(":domain", frozenset(inputs))
    certified = literals(":certified", frozenset(inputs + outputs))
    if not certified:
        raise reader.error(f"stream `{name}` certifies nothing", group.line, "add `:certified`")
    unguarded = set(inputs) - {arg for atom in conditions for arg in atom.args}
    if unguarded:
        raise reader.error(
            f"input(s) {', '.join(sorted(unguarded))} of stream `{name}` occur in no `:domain` fact",
            group.line,
        )
    for atom in (*conditions, *certified):
        if atom.predicate in domain.fluents or atom.predicate in domain.derived:
            raise reader.error(
                f"stream `{name}` uses `{atom.predicate}`, which actions or axioms change",
                group.line,
                "streams speak of static and certified predicates only",
            )
    if not outputs and any(set(a.args) - set(inputs) for a in certified):
        raise reader.error(f"test `{name}` certifies a fact about variables that are not inputs", group.line)
    return Stream(name, inputs, conditions, outputs, certified, group.line)


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
    reader = _Reader(path, dict(domain.predicates), known)
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


def infer_sorts(
    domain: Domain, streams: Iterable[Stream], facts: Iterable[tuple[str, ...]] = ()
) -> dict[str, tuple[str, ...]]:
    """Group argument positions into sorts: positions filled by one variable, or one entity, have one sort.

    Union-find over the predicates' argument positions; a variable that occurs in two positions of one action,
    axiom or stream joins them, and so does an entity in two positions of `facts`. Returns for every predicate the
    sort of each argument, named after a variable that fills it (`?p` gives the sort `p`).
    """
    parent: dict[tuple[str, int], tuple[str, int]] = {}
    label: dict[tuple[str, int], str] = {}

    def find(position: tuple[str, int]) -> tuple[str, int]:
        while parent.setdefault(position, position) != position:
            parent[position] = parent[parent[position]]
            position = parent[position]
        return position

    def join(together: Iterable[Atom]) -> None:
        first: dict[str, tuple[str, int]] = {}
        for atom in together:
            for index, arg in enumerate(atom.args):
                if atom.predicate == "=" or not arg.startswith("?"):
                    continue
                here = (atom.predicate, index)
                label.setdefault(here, arg[1:])
                if arg in first:
                    parent[find(first[arg])] = find(here)
                first[arg] = here

    for schema in domain.actions:
        join([*atoms(schema.precondition), *(effect.atom for effect in schema.effects)])
    for axiom in domain.axioms:
        join([axiom.head, *atoms(axiom.body)])
    for stream in streams:
        join([*stream.domain, *stream.certified])
    seen: dict[str, tuple[str, int]] = {}
    for name, *args in facts:
        for index, entity in enumerate(args):
            parent[find((name, index))] = find(seen.setdefault(entity, (name, index)))
    names: dict[tuple[str, int], str] = {}
    sorts: dict[str, tuple[str, ...]] = {}
    for predicate in domain.predicates.values():
        row = []
        for index in range(predicate.arity):
            root = find((predicate.name, index))
            if root not in names:
                base = re.sub(r"\W", "_", label.get((predicate.name, index), predicate.name))
                base = base if base[:1].islower() else f"s{base}"  # an atom of Prolog and ASP
                taken = set(names.values())
                names[root] = next(n for n in (base, *(f"{base}{i}" for i in range(2, 999))) if n not in taken)
            row.append(names[root])
        sorts[predicate.name] = tuple(row)
    return sorts
