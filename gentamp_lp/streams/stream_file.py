"""Stream files: streams, tests, rules, predicates, functions and fluent streams. Everything else is refused."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Literal

import networkx as nx

from gentamp_lp.streams.formula import Atom, Formula, conjuncts
from gentamp_lp.streams.pddl import Domain, PDDLReader, Predicate
from gentamp_lp.streams.sexpr import Group, Symbol, read_groups


@dataclass(frozen=True)
class Stream:
    """A declared stream; without outputs it is a test.

    A rule is a test that always succeeds, a predicate a test given as a Boolean function, and a function computes a
    cost: its one certified atom is its own head.
    """

    name: str
    inputs: tuple[str, ...]
    domain: tuple[Atom, ...]
    outputs: tuple[str, ...]
    certified: tuple[Atom, ...]
    line: int = 0
    kind: Literal["stream", "rule", "predicate", "function"] = "stream"
    fluents: tuple[str, ...] = ()  # predicates whose facts, in the state where it is used, the stream is given
    recursive: bool = False  # a test whose `:domain` depends on what it certifies

    @property
    def is_test(self) -> bool:
        """Whether the stream decides facts about its inputs instead of making entities."""
        return not self.outputs

    @property
    def decides(self) -> bool:
        """Whether the stream can be asked about one fact: a test whose facts name all its inputs."""
        return self._names_inputs and not self.fluents and not self.recursive

    @property
    def decides_in_state(self) -> bool:
        """Whether it can be asked about one fact in one state: a test with `:fluents`."""
        return self._names_inputs and bool(self.fluents)

    @property
    def _names_inputs(self) -> bool:
        return self.is_test and self.kind != "rule" and all(set(self.inputs) <= set(a.args) for a in self.certified)


def parse_streams(text: str, domain: Domain, path: Path | str | None = None) -> tuple[Stream, ...]:
    """Parse a stream file against the domain whose predicates it certifies."""
    return declared_streams(read_groups(text, path), domain, path)


def declared_streams(
    groups: Sequence[Group], domain: Domain, path: Path | str | None = None, before: int = 0
) -> tuple[Stream, ...]:
    """The streams of a file that was taken apart already (see `parse_streams`), with `before` streams in others."""
    reader = PDDLReader(
        path, dict(domain.predicates), frozenset(domain.constants), dict(domain.supertypes), dict(domain.functions)
    )
    if len(groups) != 1 or groups[0].head != "define":
        raise reader.error("expected one `(define (stream ...) ...)`", groups[0].line if groups else 1)
    streams: dict[str, Stream] = {}
    for number, item in enumerate(groups[0].items[1:]):
        group = reader.group(item, "a section")
        match group.head:
            case "stream":
                continue
            case ":stream":
                stream = _stream(reader, group, domain)
            case ":rule":
                stream = _rule(reader, group, domain, before + number)
            case ":function" | ":predicate":
                stream = _function(reader, group, domain)
            case ":optimizer" | ":constraint" | ":objective" | ":variables":
                raise reader.error("optimizers are not supported", group.line, "sample with a `:stream` instead")
            case _:
                hint = "known: :stream, :rule, :predicate, :function"
                raise reader.error(f"unsupported section `{group.head or '()'}`", group.line, hint)
        if stream.name in streams:
            raise reader.error(f"stream `{stream.name}` is declared twice", group.line)
        streams[stream.name] = stream
    return mark_recursive(streams.values())


def mark_recursive(streams: Iterable[Stream]) -> tuple[Stream, ...]:
    """The streams, those marked that are recursive: such a test cannot be asked about one fact without end."""
    streams = tuple(streams)
    needs = nx.DiGraph()
    for stream in streams:
        if stream.is_test:
            needs.add_edges_from((a.predicate, b.predicate) for a in stream.certified for b in stream.domain)
    cyclic = [needs.subgraph(component) for component in nx.strongly_connected_components(needs)]
    within = {edge for component in cyclic for edge in component.edges}
    return tuple(
        replace(
            s, recursive=s.is_test and any((a.predicate, b.predicate) in within for a in s.certified for b in s.domain)
        )
        for s in streams
    )


def _atoms(reader: PDDLReader, item: Symbol | Group, scope: frozenset[str], what: str) -> tuple[Atom, ...]:
    found = conjuncts(reader.formula(item, scope))
    for literal in found:
        if not isinstance(literal, Atom) or literal.predicate == "=":
            raise reader.error(f"{what} must be a conjunction of atoms", item.line)
    return tuple(a for a in found if isinstance(a, Atom))


def _typed_atoms(reader: PDDLReader, guards: Iterable[Formula], line: int) -> tuple[Atom, ...]:
    """What types say about the variables of a stream."""
    atoms = [guard for guard in guards if isinstance(guard, Atom)]
    if len(atoms) != len(list(guards)):
        raise reader.error("`either` is not supported in streams", line, "name a common supertype")
    return tuple(atoms)


def _check_static(reader: PDDLReader, name: str, atoms: Iterable[Atom], domain: Domain, line: int) -> None:
    for atom in atoms:
        if atom.predicate in domain.fluents or atom.predicate in domain.derived:
            raise reader.error(
                f"stream `{name}` uses `{atom.predicate}`, which actions or axioms change",
                line,
                "streams speak of static and certified predicates only",
            )


def _check_guarded(
    reader: PDDLReader, name: str, inputs: tuple[str, ...], conditions: Iterable[Atom], line: int
) -> None:
    unguarded = set(inputs) - {arg for atom in conditions for arg in atom.args}
    if unguarded:
        raise reader.error(
            f"input(s) {', '.join(sorted(unguarded))} of stream `{name}` occur in no `:domain` fact", line
        )


def _stream(reader: PDDLReader, group: Group, domain: Domain) -> Stream:
    name = reader.symbol(reader.item(group, 1, "the stream's name"), "the stream's name").name
    parts = reader.sections(group, 2, {":inputs", ":domain", ":outputs", ":certified", ":fluents"})
    declared = {
        key: reader.declared(reader.group(parts[key], "a list of variables")) if key in parts else ((), ())
        for key in (":inputs", ":outputs")
    }
    (inputs, input_types), (outputs, output_types) = declared[":inputs"], declared[":outputs"]
    if set(inputs) & set(outputs):
        raise reader.error(f"stream `{name}` uses a variable as input and output", group.line)
    conditions = _typed_atoms(reader, input_types, group.line)
    if ":domain" in parts:
        conditions += _atoms(reader, parts[":domain"], frozenset(inputs), f"`:domain` of stream `{name}`")
    certified = _typed_atoms(reader, output_types, group.line)
    if ":certified" in parts:
        scope = frozenset(inputs + outputs)
        certified += _atoms(reader, parts[":certified"], scope, f"`:certified` of stream `{name}`")
    if not certified:
        raise reader.error(f"stream `{name}` certifies nothing", group.line, "add `:certified`")
    _check_guarded(reader, name, inputs, conditions, group.line)
    _check_static(reader, name, (*conditions, *certified), domain, group.line)
    if not outputs and any({v for v in a.args if v.startswith("?")} - set(inputs) for a in certified):
        raise reader.error(f"test `{name}` certifies a fact about variables that are not inputs", group.line)
    fluents = (
        [reader.symbol(s, "a predicate") for s in reader.group(parts[":fluents"], "predicates").items]
        if (":fluents" in parts)
        else []
    )
    for fluent in fluents:
        reader.arity(fluent)
        if fluent.name not in domain.fluents:
            raise reader.error(f"no action changes `{fluent.spelling}`", fluent.line, "remove it from `:fluents`")
    if fluents and not outputs and any(set(inputs) - set(a.args) for a in certified):
        hint = "a test with `:fluents` certifies facts about all its inputs"
        raise reader.error(f"test `{name}` certifies a fact that leaves out an input", group.line, hint)
    return Stream(name, inputs, conditions, outputs, certified, group.line, "stream", tuple(f.name for f in fluents))


def _rule(reader: PDDLReader, group: Group, domain: Domain, number: int) -> Stream:
    parts = reader.sections(group, 1, {":inputs", ":domain", ":certified"})
    for key in (":inputs", ":domain", ":certified"):
        if key not in parts:
            raise reader.error(f"a rule needs `{key}`", group.line)
    inputs, types = reader.declared(reader.group(parts[":inputs"], "a list of variables"))
    conditions = _typed_atoms(reader, types, group.line)
    conditions += _atoms(reader, parts[":domain"], frozenset(inputs), "`:domain` of a rule")
    certified = _atoms(reader, parts[":certified"], frozenset(inputs), "`:certified` of a rule")
    _check_guarded(reader, f"rule {number}", inputs, conditions, group.line)
    _check_static(reader, f"rule {number}", (*conditions, *certified), domain, group.line)
    return Stream(f"rule-{number}", inputs, conditions, (), certified, group.line, "rule")


def _function(reader: PDDLReader, group: Group, domain: Domain) -> Stream:
    """`(:function (Head ?x) conditions)` or the same of a `:predicate`."""
    if len(group.items) not in (2, 3):
        raise reader.error(f"`{group.head}` takes a head and its conditions", group.line)
    declaration = reader.group(group.items[1], "the head")
    head = reader.symbol(reader.item(declaration, 0, "a name"), "a name")
    inputs, types = reader.declared(Group(declaration.items[1:], declaration.line))
    conditions = _typed_atoms(reader, types, group.line)
    if len(group.items) == 3:
        conditions += _atoms(reader, group.items[2], frozenset(inputs), f"the conditions of `{head.spelling}`")
    table = reader.predicates if group.head == ":predicate" else reader.functions
    if group.head == ":function":
        table.setdefault(head.name, Predicate(head.name, head.spelling, len(inputs)))
    if head.name not in table:
        raise reader.error(f"unknown predicate `{head.spelling}`", head.line, "declare it in the domain")
    if table[head.name].arity != len(inputs):
        arity = table[head.name].arity
        raise reader.error(f"`{head.spelling}` takes {arity} argument(s), not {len(inputs)}", head.line)
    certified = (Atom(head.name, inputs),)
    _check_guarded(reader, head.name, inputs, conditions, group.line)
    if group.head == ":function":
        _check_static(reader, head.name, conditions, domain, group.line)
        return Stream(head.name, inputs, conditions, (), certified, group.line, "function")
    _check_static(reader, head.name, (*conditions, *certified), domain, group.line)
    return Stream(head.name, inputs, conditions, (), certified, group.line, "predicate")
