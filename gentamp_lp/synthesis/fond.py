"""PDDL with `oneof` effects, made propositional: every state that can be reached from the initial one.

Supported: types, constants, conjunctions of literals and (in)equalities as conditions, and effects of `and`, `not`,
`when`, `oneof` in any nesting. Everything else is refused with file and line. Outcomes of one action are the ways
to choose from its `oneof`s (Cimatti, Pistore, Roveri and Traverso, AIJ 147, 2003; PDDL: Bryce and Buffet, "6th
International Planning Competition: Uncertainty Part", 2008).

The parser of `gentamp_lp.streams.pddl` is not used: it has no types, and one outcome an action.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import product

from gentamp_lp.errors import Diagnostic, InputError, LimitReached
from gentamp_lp.streams.sexpr import Group, Reader, Symbol, read_groups
from gentamp_lp.synthesis.problem import Choice, Problem

_REQUIREMENTS = {
    ":strips", ":typing", ":equality", ":negative-preconditions", ":conditional-effects", ":non-deterministic",
}  # fmt: skip
_MOST_STATES = 100_000
_MOST_OUTCOMES = 1024  # of one action

Atom = tuple[str, ...]  # a predicate and its arguments; variables begin with `?`
State = frozenset[Atom]


@dataclass(frozen=True)
class Literal:
    """An atom or its negation."""

    atom: Atom
    positive: bool

    def holds(self, binding: Mapping[str, str], state: State | set[Atom]) -> bool:
        """Evaluate it; `=` compares objects."""
        atom = _bind(self.atom, binding)
        return (atom[1] == atom[2] if atom[0] == "=" else atom in state) == self.positive


@dataclass(frozen=True)
class Change:
    """`when` all conditions hold, the literal becomes true."""

    conditions: tuple[Literal, ...]
    literal: Literal


@dataclass(frozen=True)
class Schema:
    """An action: each member of `outcomes` is one way for it to end."""

    name: str
    parameters: tuple[tuple[str, tuple[str, ...]], ...]
    precondition: tuple[Literal, ...]
    outcomes: tuple[tuple[Change, ...], ...]


@dataclass
class _Task:
    """What both files say together."""

    parents: dict[str, str] = field(default_factory=lambda: {"object": ""})
    objects: dict[str, str] = field(default_factory=dict)  # name -> type
    predicates: dict[str, tuple[tuple[str, ...], ...]] = field(default_factory=dict)  # name -> types of arguments
    schemas: list[Schema] = field(default_factory=list)
    init: set[Atom] = field(default_factory=set)
    goal: tuple[Literal, ...] = ()

    def fits(self, name: str, types: Iterable[str]) -> bool:
        """Tell whether an object belongs to one of some types."""
        kind = self.objects[name]
        while kind:
            if kind in types:
                return True
            kind = self.parents[kind]
        return False


def parse_fond(sources: Sequence[tuple[str, str]]) -> Problem:
    """Read a domain and a problem, from one file or two in any order."""
    parts: dict[str, tuple[Group, str]] = {}
    for path, text in sources:
        for group in read_groups(text, path):
            named = group.items[1] if group.head == "define" and len(group.items) > 1 else None
            kind = named.head if isinstance(named, Group) else ""
            if kind not in ("domain", "problem"):
                raise InputError(
                    Diagnostic("expected `(define (domain ...` or `(define (problem ...`", path, group.line)
                )
            if kind in parts:
                raise InputError(Diagnostic(f"a second {kind}", path, group.line))
            parts[kind] = group, path
    for kind in ("domain", "problem"):
        if kind not in parts:
            hint = "give two files, or one file with both"
            raise InputError(Diagnostic(f"there is no {kind} (`(define ({kind} ...`)", sources[0][0], hint=hint))
    task = _Task()
    _Reader(task, parts["domain"][1]).domain(parts["domain"][0])
    _Reader(task, parts["problem"][1]).problem(parts["problem"][0])
    return _explore(task)


class _Reader(Reader):
    def __init__(self, task: _Task, path: str) -> None:
        super().__init__(path)
        self.task = task

    def domain(self, group: Group) -> None:
        sections = [self.group(item, "a section") for item in group.items[2:]]
        for section in sections:
            match section.head:
                case ":requirements":
                    self.requirements(section)
                case ":types":
                    self.types(section)
                case ":constants":
                    self.things(section)
                case ":predicates":
                    self.declare(section)
                case ":action":
                    pass
                case _:
                    raise self.error(f"`{section.head}` is not supported", section.line)
        for section in sections:
            if section.head == ":action":
                self.task.schemas.append(self.action(section))

    def problem(self, group: Group) -> None:
        sections = {section.head: section for section in (self.group(item, "a section") for item in group.items[2:])}
        for name, section in sections.items():
            if name not in (":domain", ":requirements", ":objects", ":init", ":goal"):
                raise self.error(f"`{name}` is not supported", section.line)
        for name in (":init", ":goal"):
            if name not in sections:
                raise self.error(f"the problem has no `{name}`", group.line)
        if ":requirements" in sections:
            self.requirements(sections[":requirements"])
        if ":objects" in sections:
            self.things(sections[":objects"])
        for item in sections[":init"].items[1:]:
            for literal in self.literals(item, {}):
                if not literal.positive or literal.atom[0] == "=":
                    raise self.error("the initial state is a list of atoms", item.line, "what is not listed is false")
                self.task.init.add(literal.atom)
        goal = sections[":goal"]
        self.task.goal = tuple(self.literals(self.one(goal), {}))

    def one(self, group: Group) -> Symbol | Group:
        if len(group.items) != 2:
            raise self.error(f"`{group.head}` takes one part", group.line)
        return group.items[1]

    def requirements(self, section: Group) -> None:
        for item in section.items[1:]:
            name = self.symbol(item, "a requirement")
            if name.name not in _REQUIREMENTS:
                hint = f"supported: {', '.join(sorted(_REQUIREMENTS))}"
                raise self.error(f"the requirement `{name.spelling}` is not supported", name.line, hint)

    def typed(self, items: Sequence[Symbol | Group]) -> Iterator[tuple[Symbol, tuple[str, ...]]]:
        """Read `a b - t c - (either t u)`."""
        waiting: list[Symbol] = []
        position = 0
        while position < len(items):
            word = self.symbol(items[position], "a name")
            position += 1
            if word.name != "-":
                waiting.append(word)
                continue
            if position == len(items):
                raise self.error("a type is missing after `-`", word.line)
            kinds = items[position]
            position += 1
            if isinstance(kinds, Group) and kinds.head == "either":
                names = tuple(self.symbol(item, "a type").name for item in kinds.items[1:])
            else:
                names = (self.symbol(kinds, "a type").name,)
            yield from ((name, names) for name in waiting)
            waiting = []
        yield from ((name, ("object",)) for name in waiting)

    def types(self, section: Group) -> None:
        for name, parents in self.typed(section.items[1:]):
            if len(parents) > 1:
                raise self.error(f"the type `{name.spelling}` has two parents", name.line)
            self.task.parents.setdefault(parents[0], "object" if parents[0] != "object" else "")
            if name.name != "object":
                self.task.parents[name.name] = parents[0]
        for name, _ in self.typed(section.items[1:]):
            kind, seen = name.name, {""}
            while kind not in seen:
                seen.add(kind)
                kind = self.task.parents[kind]
            if kind:
                raise self.error(f"the type `{name.spelling}` is its own ancestor", name.line)

    def known(self, name: Symbol, kinds: Iterable[str]) -> None:
        for kind in kinds:
            if kind not in self.task.parents:
                raise self.error(f"unknown type `{kind}` of `{name.spelling}`", name.line)

    def things(self, section: Group) -> None:
        for name, kinds in self.typed(section.items[1:]):
            self.known(name, kinds)
            if len(kinds) > 1 or name.name in self.task.objects:
                raise self.error(f"`{name.spelling}` has two types, or is declared twice", name.line)
            self.task.objects[name.name] = kinds[0]

    def declare(self, section: Group) -> None:
        for item in section.items[1:]:
            group = self.group(item, "a predicate")
            if not group.head:
                raise self.error("a predicate has no name", group.line)
            arguments = list(self.typed(group.items[1:]))
            for name, kinds in arguments:
                self.known(name, kinds)
            self.task.predicates[group.head] = tuple(kinds for _, kinds in arguments)

    def action(self, section: Group) -> Schema:
        if len(section.items) < 2 or len(section.items) % 2:
            raise self.error("an action is a name and pairs of keyword and value", section.line)
        name = self.symbol(section.items[1], "a name")
        parts: dict[str, Group] = {}
        for key, value in zip(section.items[2::2], section.items[3::2], strict=True):
            keyword = self.symbol(key, "a keyword")
            if keyword.name not in (":parameters", ":precondition", ":effect"):
                raise self.error(f"`{keyword.spelling}` is not supported", keyword.line)
            parts[keyword.name] = self.group(value, "a list")
        if any(schema.name == name.name for schema in self.task.schemas):
            raise self.error(f"a second action `{name.spelling}`", name.line)
        scope: dict[str, tuple[str, ...]] = {}
        for variable, kinds in self.typed(parts[":parameters"].items if ":parameters" in parts else ()):
            self.known(variable, kinds)
            if not variable.name.startswith("?") or variable.name in scope:
                raise self.error(f"`{variable.spelling}` is no variable, or declared twice", variable.line)
            scope[variable.name] = kinds
        condition = self.literals(parts[":precondition"], scope) if ":precondition" in parts else []
        outcomes = self.effect(parts[":effect"], scope) if ":effect" in parts else [()]
        return Schema(name.name, tuple(scope.items()), tuple(condition), tuple(dict.fromkeys(outcomes)))

    def literals(self, item: Symbol | Group, scope: Mapping[str, tuple[str, ...]]) -> list[Literal]:
        group = self.group(item, "a condition")
        if not group.items:
            return []
        if group.head == "and":
            return [literal for part in group.items[1:] for literal in self.literals(part, scope)]
        if group.head == "not":
            return [Literal(self.atom(self.group(self.one(group), "an atom"), scope), False)]
        return [Literal(self.atom(group, scope), True)]

    def atom(self, group: Group, scope: Mapping[str, tuple[str, ...]]) -> Atom:
        name = group.head
        if name in ("or", "imply", "forall", "exists", "not", "and", "when", "oneof", "increase", "assign", "decrease"):
            raise self.error(f"`{name}` is not supported here", group.line)
        if name != "=" and name not in self.task.predicates:
            known = ", ".join(sorted(self.task.predicates))
            raise self.error(f"unknown predicate `{name}`", group.line, f"known: {known}")
        arity = 2 if name == "=" else len(self.task.predicates[name])
        arguments = [self.symbol(argument, "a variable or an object") for argument in group.items[1:]]
        if len(arguments) != arity:
            raise self.error(f"`{name}` takes {arity} argument(s), not {len(arguments)}", group.line)
        for argument in arguments:
            if argument.name not in (scope if argument.name.startswith("?") else self.task.objects):
                raise self.error(f"`{argument.spelling}` is not declared", argument.line)
        return (name, *(argument.name for argument in arguments))

    def effect(self, item: Symbol | Group, scope: Mapping[str, tuple[str, ...]]) -> list[tuple[Change, ...]]:
        """Return the outcomes of an effect."""
        group = self.group(item, "an effect")
        match group.head:
            case "and":
                parts = [self.effect(part, scope) for part in group.items[1:]]
                outcomes = [tuple(change for part in row for change in part) for row in self.rows(parts, group)]
            case "oneof":
                outcomes = [outcome for part in group.items[1:] for outcome in self.effect(part, scope)]
                if not outcomes:
                    raise self.error("`oneof` has no outcome", group.line)
            case "when":
                if len(group.items) != 3:
                    raise self.error("`when` takes a condition and an effect", group.line)
                conditions = tuple(self.literals(group.items[1], scope))
                outcomes = [
                    tuple(Change((*conditions, *change.conditions), change.literal) for change in outcome)
                    for outcome in self.effect(group.items[2], scope)
                ]
            case _:
                literals = self.literals(group, scope)
                if any(literal.atom[0] == "=" for literal in literals):
                    raise self.error("`=` cannot be an effect", group.line)
                outcomes = [tuple(Change((), literal) for literal in literals)]
        return outcomes

    def rows(self, parts: list[list[tuple[Change, ...]]], group: Group) -> Iterable[tuple[tuple[Change, ...], ...]]:
        count = 1
        for part in parts:
            count *= len(part)
        if count > _MOST_OUTCOMES:
            raise self.error(f"more than {_MOST_OUTCOMES} outcomes", group.line)
        return product(*parts)


def _bind(atom: Atom, binding: Mapping[str, str]) -> Atom:
    return (atom[0], *(binding.get(name, name) for name in atom[1:]))


def _bindings(task: _Task, schema: Schema, changing: set[str]) -> Iterator[dict[str, str]]:
    """Bind the parameters in all ways that fit the types and the conditions which no action changes."""
    variables = [name for name, _ in schema.parameters]
    ready: list[list[Literal]] = [[] for _ in range(len(variables) + 1)]
    for literal in schema.precondition:
        if literal.atom[0] not in changing:
            ready[max((variables.index(v) + 1 for v in literal.atom[1:] if v in variables), default=0)].append(literal)

    def extend(binding: dict[str, str]) -> Iterator[dict[str, str]]:
        if not all(literal.holds(binding, task.init) for literal in ready[len(binding)]):
            return
        if len(binding) == len(variables):
            yield binding
            return
        variable, kinds = schema.parameters[len(binding)]
        for name in task.objects:
            if task.fits(name, kinds):
                yield from extend({**binding, variable: name})

    yield from extend({})


def _explore(task: _Task) -> Problem:
    """Expand states breadth first; goals are not expanded."""
    changing = {change.literal.atom[0] for schema in task.schemas for outcome in schema.outcomes for change in outcome}
    static = {atom for atom in task.init if atom[0] not in changing}
    actions = [(schema, binding) for schema in task.schemas for binding in _bindings(task, schema, changing)]
    number: dict[State, int] = {frozenset(task.init - static): 0}
    goals, choices = set[int](), list[Choice]()
    queue = list(number)
    for state in queue:
        everything = state | static
        if all(literal.holds({}, everything) for literal in task.goal):
            goals.add(number[state])
            continue
        for schema, binding in actions:
            if not all(literal.holds(binding, everything) for literal in schema.precondition):
                continue
            outcomes = []
            for outcome in schema.outcomes:
                after = _after(state, everything, outcome, binding)
                if after not in number:
                    number[after] = len(number)
                    queue.append(after)
                outcomes.append(number[after])
            name = _show((schema.name, *binding.values()))
            choices.append(Choice(number[state], name, tuple(sorted(set(outcomes)))))
        if len(number) > _MOST_STATES:
            raise LimitReached(f"more than {_MOST_STATES} states can be reached")
    names = tuple(", ".join(map(_show, sorted(state))) or "none" for state in number)
    return Problem(names, (0,), frozenset(goals), tuple(choices))


def _after(state: State, everything: State, outcome: Iterable[Change], binding: Mapping[str, str]) -> State:
    """Apply what happens at once; what is both added and deleted is added."""
    literals = [c.literal for c in outcome if all(condition.holds(binding, everything) for condition in c.conditions)]
    deleted = {_bind(literal.atom, binding) for literal in literals if not literal.positive}
    return (state - deleted) | {_bind(literal.atom, binding) for literal in literals if literal.positive}


def _show(atom: Atom) -> str:
    return f"{atom[0]}({','.join(atom[1:])})" if len(atom) > 1 else atom[0]
