"""From the PDDLStream problem that a user wrote in Python to names that the engine works with, and back."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from gentamp_lp.errors import Diagnostic, InputError
from gentamp_lp.streams.facts import Fact, FactBase
from gentamp_lp.streams.formula import And, Atom, Exists, Forall, Formula, Not, Or, imply
from gentamp_lp.streams.language import (
    DEBUG,
    SHARED_DEBUG,
    TOTAL_COST,
    Generator,
    PDDLProblem,
    from_fn,
    from_test,
    one_by_one,
)
from gentamp_lp.streams.naming import RESERVED, Names, may_be_predicate, readable
from gentamp_lp.streams.pddl import Domain, parse_domain
from gentamp_lp.streams.semantics import Program, State
from gentamp_lp.streams.sexpr import read_groups
from gentamp_lp.streams.sorts import infer_sorts
from gentamp_lp.streams.stream_file import Stream, declared_streams, mark_recursive
from gentamp_lp.streams.undeclared import StreamFile, declare_undeclared, stream_functions, suspect


@dataclass(frozen=True)
class PlanningProblem:
    """A problem ready to be solved: what is known, the initial state, the goal."""

    program: Program
    base: FactBase
    state: State
    goal: Formula
    names: Names


@dataclass(frozen=True)
class DebugValue:
    """What the streams of a problem with `stream_map='debug'` give."""

    stream: str
    inputs: tuple[Any, ...]
    output: str

    def __str__(self) -> str:
        return f"{self.output}[{self.stream}({', '.join(map(str, self.inputs))})]"


def build(problem: PDDLProblem) -> PlanningProblem:
    """Read a problem. Raises InputError that names file and line, or the fact or stream at fault."""
    init, files = list(problem.init), _files(problem.stream_pddl)
    domain = parse_domain(problem.domain_pddl, "domain.pddl", stream_functions(files))
    domain = declare_undeclared(domain, files, init, problem.goal)
    streams, places = _streams(files, domain)
    generators = _generators(problem.stream_map, streams, places)
    values: dict[str, Any] = {}
    base = FactBase(domain, streams, generators, values, names=Names())
    translator = Translator(domain, base)
    given = {str(name).lower(): value for name, value in problem.constant_map.items()}
    for constant in domain.constants:
        translator.constant(constant, given.get(constant, constant))
    for fact in domain.facts:
        base.add(fact)
    state = translator.init(init)
    goal = translator.formula(problem.goal, frozenset())
    assert base.names is not None
    base.names.given |= values.keys()
    base.sorts = infer_sorts(domain, streams)
    for predicate, relation in list(base.static.items()):
        for row in relation.rows:
            base.add_sorts((predicate, *row))
    return PlanningProblem(Program.of(domain), base, state, goal, base.names)


def _files(stream_pddl: str | Sequence[str] | None) -> list[StreamFile]:
    """The stream files taken apart, each with what errors call it."""
    texts = [stream_pddl] if isinstance(stream_pddl, str) else stream_pddl or ()
    for text in texts:
        if not isinstance(text, str):
            raise InputError(f"`stream_pddl` holds {type(text).__name__}: only text is supported")
    paths = ["stream.pddl"] if len(texts) == 1 else [f"stream.pddl[{n}]" for n in range(len(texts))]
    return [(read_groups(text, path), path) for text, path in zip(texts, paths, strict=True)]


def _streams(files: Iterable[StreamFile], domain: Domain) -> tuple[tuple[Stream, ...], dict[str, str]]:
    """The streams of all files, and the file of each. Rules have no names of their own: they are numbered."""
    streams: dict[str, Stream] = {}
    places: dict[str, str] = {}
    for groups, path in files:
        for stream in declared_streams(groups, domain, path, len(streams)):
            if stream.name in streams:
                raise InputError(Diagnostic(f"stream `{stream.name}` is declared twice", path, stream.line))
            streams[stream.name], places[stream.name] = stream, path
    return mark_recursive(streams.values()), places


def _generators(
    stream_map: Mapping[str, Any] | str, streams: Iterable[Stream], places: Mapping[str, str]
) -> dict[str, Generator]:
    if isinstance(stream_map, str):
        if stream_map not in (DEBUG, SHARED_DEBUG):
            raise InputError(f"`stream_map` is {stream_map!r}, neither a mapping nor 'debug'")
        return {s.name: _debug(s, shared=stream_map == SHARED_DEBUG) for s in streams if s.kind != "rule"}
    lower = {str(name).lower(): generator for name, generator in stream_map.items()}
    found: dict[str, Generator] = {}
    for stream in streams:
        if stream.kind == "rule":
            continue
        if stream.name not in lower:
            raise InputError(
                Diagnostic(
                    f"{stream.kind} `{stream.name}` has no Python function",
                    places[stream.name],
                    stream.line,
                    hint=f"add '{stream.name}' to `stream_map`",
                )
            )
        function = lower[stream.name]
        if not callable(function):
            raise InputError(f"`stream_map` gives {function!r} for `{stream.name}`, which cannot be called")
        found[stream.name] = _wrapped(stream, function)
    return found


def _wrapped(stream: Stream, function: Any) -> Generator:
    match stream.kind:
        case "function":
            return function  # type: ignore[no-any-return]
        case "predicate":
            return from_test(function)
    if stream.is_test:  # an empty tuple is a success
        return lambda *inputs, **more: (row for row in one_by_one(function(*inputs, **more)) if row is not None)
    return lambda *inputs, **more: (() if row is None else row for row in one_by_one(function(*inputs, **more)))


def _debug(stream: Stream, *, shared: bool) -> Generator:
    if stream.kind == "function":
        return lambda *_: 1.0  # type: ignore[return-value]
    if stream.is_test:
        return from_test(lambda *_: True)
    return from_fn(lambda *i, **_: tuple(DebugValue(stream.name, () if shared else i, o) for o in stream.outputs))


class Translator:
    """Turns facts and formulas over Python values into ones over names."""

    def __init__(self, domain: Domain, base: FactBase) -> None:
        self.domain = domain
        self.base = base
        assert base.names is not None
        self.names = base.names

    def constant(self, name: str, value: Any) -> None:
        """Name a constant of the domain as the domain does."""
        self.base.values[name] = value
        self.names.add(value, name)

    def name(self, value: Any) -> str:
        """The name of a value; new ones look like the value."""
        known = self.names.find(value)
        if known is None:
            wanted = readable(value)
            taken = wanted in self.base.values or wanted in RESERVED or wanted in self.domain.supertypes
            known = self.base.new_name(f"{wanted}_") if taken or not isinstance(value, str) else wanted
            self.base.values[known] = value
            self.names.add(value, known)
        return known

    def init(self, facts: Iterable[Any]) -> State:
        """Add static facts and function values; returns the fluent facts."""
        fluents: set[Fact] = set()
        for fact in facts:
            if not isinstance(fact, tuple | list) or not fact or not isinstance(fact[0], str):
                raise InputError(f"the initial fact {fact!r} is not a tuple that begins with a predicate")
            head = fact[0].lower()
            if head in ("not", "minimize"):
                continue
            if head == "=":
                self._value(fact)
                continue
            if head not in self.domain.predicates:
                if not may_be_predicate(head):
                    raise InputError(f"the initial fact {fact!r} begins with no name of a predicate")
                known = [predicate.spelling for predicate in self.domain.predicates.values()]
                suspect("predicate", fact[0], known, "nothing reads it")
                continue
            atom = self.atom(fact, frozenset(), "the initial fact")
            if head in self.domain.derived:
                raise InputError(f"the initial fact {fact!r} is about `{head}`, which axioms derive")
            if head in self.domain.fluents:
                fluents.add((head, *atom.args))
            else:
                self.base.add((head, *atom.args))
        return frozenset(fluents)

    def _value(self, fact: Sequence[Any]) -> None:
        if len(fact) != 3 or not isinstance(fact[1], tuple | list) or not fact[1]:
            raise InputError(f"the initial fact {fact!r} is not ('=', (function, ...), number)")
        function, *args = fact[1]
        name = str(function).lower()
        if name == TOTAL_COST:
            return
        if name not in self.domain.functions:
            known = [one.spelling for one in self.domain.functions.values()]
            suspect("function", str(function), known, "no action's cost reads it")
            return
        if self.domain.functions[name].arity != len(args):
            raise InputError(f"the initial fact {fact!r} has the wrong number of arguments")
        try:
            value = float(fact[2])
        except (TypeError, ValueError):
            raise InputError(f"the initial fact {fact!r} gives no number") from None
        if not 0 <= value < float("inf"):
            raise InputError(f"the initial fact {fact!r}: costs are numbers from 0")
        self.base.costs[(name, *map(self.name, args))] = value

    def atom(self, fact: Sequence[Any], scope: frozenset[str], what: str) -> Atom:
        """One fact. Raises InputError for an unknown predicate or a wrong number of arguments."""
        head = str(fact[0]).lower()
        declared = self.domain.predicates.get(head)
        if declared is None:
            known = ", ".join(sorted(p.spelling for p in self.domain.predicates.values()))
            message = f"{what} {tuple(fact)!r}: unknown predicate `{fact[0]}`"
            raise InputError(Diagnostic(message, hint=f"known: {known}"))
        if declared.arity != len(fact) - 1:
            raise InputError(f"{what} {tuple(fact)!r}: `{fact[0]}` takes {declared.arity} argument(s)")
        return Atom(head, tuple(self.term(value, scope) for value in fact[1:]))

    def term(self, value: Any, scope: frozenset[str]) -> str:
        """A variable in scope, or the name of a value."""
        return value.lower() if isinstance(value, str) and value.lower() in scope else self.name(value)

    def formula(self, expression: Any, scope: frozenset[str]) -> Formula:
        """A goal or condition. Raises InputError for what is none."""
        if not isinstance(expression, tuple | list) or not expression or not isinstance(expression[0], str):
            raise InputError(f"the condition {expression!r} is not a tuple that begins with a predicate or operator")
        head, parts = expression[0].lower(), expression[1:]
        arity = {"not": 1, "imply": 2, "exists": 2, "forall": 2, "=": 2}.get(head, len(parts))
        if len(parts) != arity:
            raise InputError(f"the condition {tuple(expression)!r}: `{head}` takes {arity} part(s)")
        match head:
            case "and":
                return And(tuple(self.formula(part, scope) for part in parts))
            case "or":
                return Or(tuple(self.formula(part, scope) for part in parts))
            case "not":
                return Not(self.formula(parts[0], scope))
            case "imply":
                return imply(self.formula(parts[0], scope), self.formula(parts[1], scope))
            case "=":
                return Atom("=", (self.term(parts[0], scope), self.term(parts[1], scope)))
            case "exists" | "forall":
                variables, guards = zip(*self._variables(parts[0]), strict=True) if parts[0] else ((), ())
                inner = self.formula(parts[1], scope | set(variables))
                conditions = And(tuple(guard for guard in guards if guard is not None))
                if head == "exists":
                    return Exists(variables, And((*conditions.parts, inner)))
                return Forall(variables, imply(conditions, inner))
        return self.atom(expression, scope, "the condition")

    def _variables(self, declared: Iterable[Any]) -> Iterator[tuple[str, Atom | None]]:
        for item in declared:
            name, kind = (item[0], item[-1]) if isinstance(item, tuple | list) and len(item) == 3 else (item, None)
            if not isinstance(name, str) or not name.startswith("?"):
                raise InputError(f"{item!r} is not a variable: variables are strings that begin with `?`")
            if kind is None or kind == "object":
                yield name.lower(), None
            elif str(kind).lower() in self.domain.supertypes:
                yield name.lower(), Atom(str(kind).lower(), (name.lower(),))
            else:
                raise InputError(f"variable {name} has the unknown type `{kind}`")
