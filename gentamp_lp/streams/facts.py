"""The facts of one problem: static ones, the ones streams have certified so far, and lazy tests."""

from __future__ import annotations

import math
import re
import time
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from typing import Any

from gentamp_lp.errors import Diagnostic, InputError
from gentamp_lp.streams.formula import Atom, Formula, substitute
from gentamp_lp.streams.language import Generator, WildOutput, decision
from gentamp_lp.streams.naming import Names
from gentamp_lp.streams.pddl import Domain
from gentamp_lp.streams.relations import EMPTY, Args, Relation, bind, match
from gentamp_lp.streams.stream_code import DecidingStream, Source, StreamStatistics, failed, rows_of
from gentamp_lp.streams.stream_file import Stream

Fact = tuple[str, ...]  # ("atpose", "b1", "p3")


@dataclass
class FactBase:
    """Everything known about one problem besides its fluents. Grows while streams are called.

    Names stand for values: `values[name]` is what the streams' Python code receives. With `names`, equal values that
    streams give have one name (as in PDDLStream); without, every output is a new entity.
    """

    domain: Domain
    streams: tuple[Stream, ...]
    generators: Mapping[str, Generator]
    values: dict[str, Any]
    sorts: Mapping[str, tuple[str, ...]] = field(default_factory=dict)
    static: dict[str, Relation] = field(default_factory=dict)
    statistics: dict[str, StreamStatistics] = field(default_factory=dict)
    made_by: dict[str, tuple[str, Args, int]] = field(default_factory=dict)
    names: Names | None = None

    def __post_init__(self) -> None:
        self.tests: dict[str, Stream] = {}
        self.state_tests: dict[str, Stream] = {}
        self.makers: dict[str, list[Stream]] = {}
        self.revision = 0  # grows with the facts, save those that tests decide
        self.costs: dict[Fact, float] = {}  # values of functions, given or computed
        self.functions = {s.name: s for s in self.streams if s.kind == "function"}
        self.streams = tuple(s for s in self.streams if s.kind != "function")
        self._tests: dict[str, DecidingStream] = {}
        self._sorted: set[str] = set()  # test predicates that tell no sorts
        self._answers: dict[str, dict[Args, bool]] = {}  # of tests, by predicate
        self._sources: dict[tuple[str, Args], Source] = {}
        self._counts: dict[str, int] = {}
        self._in_state: dict[tuple[str, Args, tuple[Fact, ...]], bool] = {}
        self.calling: tuple[str, Args] | None = None  # the stream, and its inputs, whose code is running
        for name in self.functions:
            self.statistics.setdefault(name, StreamStatistics())
        for stream in self.streams:
            if stream.kind != "rule":
                self.statistics.setdefault(stream.name, StreamStatistics())
            for atom in stream.certified:
                if stream.decides:
                    self.tests[atom.predicate] = stream
                    self._tests[atom.predicate] = DecidingStream.of(stream, atom.args)
                    self._answers[atom.predicate] = {}
                    if self._says_no_sort(atom, stream):
                        self._sorted.add(atom.predicate)
                elif stream.decides_in_state:
                    self.state_tests[atom.predicate] = stream
                elif stream not in self.makers.setdefault(atom.predicate, []):
                    self.makers[atom.predicate].append(stream)

    def _says_no_sort(self, atom: Atom, stream: Stream) -> bool:
        """Whether a test's conditions say all that its fact says of its arguments' sorts."""
        known = {pair for a in stream.domain for pair in zip(a.args, self.sorts.get(a.predicate, ()), strict=False)}
        said = set(zip(atom.args, self.sorts.get(atom.predicate, ()), strict=False))
        return said <= known and not self.domain.supertypes.get(atom.predicate)

    def relation(self, predicate: str) -> Relation:
        """The known tuples of a static or certified predicate."""
        return self.static.get(predicate, EMPTY)

    def add(self, fact: Fact) -> bool:
        """Record a static or certified fact (and the sorts of its entities); False when it was known."""
        if not self.growing(fact[0]).add(fact[1:]):
            return False
        self.revision += 1
        self.add_sorts(fact)
        for supertype in self.domain.supertypes.get(fact[0], ()):
            self.add((supertype, *fact[1:]))
        return True

    def add_sorts(self, fact: Fact) -> None:
        """Record the sorts of a fact's entities."""
        for sort, name in zip(self.sorts.get(fact[0], ()), fact[1:], strict=False):
            self.growing(sort_predicate(sort)).add((name,))

    def growing(self, predicate: str) -> Relation:
        """The known tuples of a predicate, to which others will be added."""
        if predicate not in self.static:
            self.static[predicate] = Relation()
        return self.static[predicate]

    def entities(self, sort: str) -> list[str]:
        """Entities that stand in a position of this sort in some static or certified fact."""
        return [row[0] for row in self.relation(sort_predicate(sort)).rows]

    def truth(self, predicate: str, args: Args) -> bool:
        """Whether a static or certified fact holds; tests are run on demand and remembered."""
        static = self.static
        test = self._tests.get(predicate)
        if test is None:
            return predicate in static and args in static[predicate].rows
        answers = self._answers[predicate]
        known = answers.get(args)
        if known or (predicate in static and args in static[predicate].rows):
            return True
        if known is None:
            if not test.plain and match(test.pattern, args, {}) is None:
                return False
            for name, take in test.domain:
                condition = take(args)
                if (name not in static or condition not in static[name].rows) and not self.truth(name, condition):
                    return False  # not remembered: another stream may certify the conditions later
            known = answers[args] = self._run_test(test, args)
        return known

    def answers(self, predicate: str) -> Mapping[Args, bool]:
        """What the test behind a predicate has said so far; grows."""
        return self._answers[predicate]

    def test_conditions(self, predicate: str, args: Args) -> list[Formula]:
        """What must hold of the arguments before the test behind a predicate is run."""
        stream = self.tests.get(predicate) or self.state_tests[predicate]
        head = next(atom.args for atom in stream.certified if atom.predicate == predicate)
        binding = dict(zip(head, args, strict=True))
        return [substitute(atom, binding) for atom in stream.domain]

    def refuted(self, predicate: str) -> Iterator[Args]:
        """Arguments on which a test predicate was tried and found false."""
        return (args for args, true in self._answers.get(predicate, {}).items() if not true)

    def run_test(self, stream: Stream, inputs: Args) -> bool:
        """Run a test on all its inputs (unless that was done)."""
        atom, binding = stream.certified[0], dict(zip(stream.inputs, inputs, strict=True))
        return self.truth(atom.predicate, bind(atom, binding))

    def known(self, predicate: str, args: Args) -> bool | None:
        """Whether a test predicate is known to be true or false without running its test."""
        return True if args in self.relation(predicate) else self._answers.get(predicate, {}).get(args)

    def cost(self, function: str, args: Args) -> float | None:
        """The value of a function, computed on demand; None where it has none.

        Raises InputError for a value that is not a number from 0.
        """
        fact = (function, *args)
        stream = self.functions.get(function)
        if fact in self.costs or stream is None:
            return self.costs.get(fact)
        binding = dict(zip(stream.inputs, args, strict=True))
        if not all(self.truth(a.predicate, bind(a, binding)) for a in stream.domain):
            return None
        value = self._ask(function, args, self.generators[function], *(self.values[name] for name in args))
        if not isinstance(value, (int, float)) and not hasattr(value, "__float__"):
            raise InputError(f"function `{function}` gave {value!r}, which is not a number")
        number = float(value)
        if not 0 <= number < math.inf:
            raise InputError(f"function `{function}` gave {number}: costs are numbers from 0")
        self.statistics[function].successes += 1
        self.costs[fact] = number
        return number

    def _run_test(self, test: DecidingStream, args: Args) -> bool:
        inputs = test.inputs(args)
        values = [self.values[name] for name in inputs]
        row = self._ask(test.stream, inputs, decision, self.generators[test.stream], values)
        if row is None:
            return False
        self.statistics[test.stream].successes += 1
        if isinstance(row, WildOutput):
            self._add_wild(row)
        for name, take in test.certified:
            if name in self._sorted:
                self.growing(name).add(take(args))
            else:
                self.add((name, *take(args)))
        return True

    def inputs(self, stream: Stream, check_time: Callable[[], object] = lambda: None) -> list[Args]:
        """All tuples of known entities that satisfy the stream's domain conditions; `check_time` may end the search."""
        return list(dict.fromkeys(self.each_input(stream, check_time)))

    def each_input(self, stream: Stream, check_time: Callable[[], object]) -> Iterator[Args]:
        """The same, one by one; no facts may be added before the last."""
        goals = self.tests_last(stream.domain)
        for binding in self._bindings(goals, {}, check_time):
            yield tuple(binding[v] for v in stream.inputs)

    def _bindings(
        self, goals: Sequence[Atom], binding: dict[str, str], check_time: Callable[[], object]
    ) -> Iterator[dict[str, str]]:
        if not goals:
            yield binding
            return
        check_time()
        for row in self._rows(goals[0], binding):
            extended = match(goals[0].args, row, binding)
            if extended is not None:
                yield from self._bindings(goals[1:], extended, check_time)

    def tests_last(self, atoms: Iterable[Atom]) -> list[Atom]:
        """Atoms in an order of which the tests come last."""
        return sorted(atoms, key=lambda atom: atom.predicate in self.tests)

    def _rows(self, atom: Atom, binding: Mapping[str, str]) -> list[Args]:
        """Known tuples of an atom under a binding; a test is run on all that its own conditions allow."""
        pattern = tuple(binding.get(a) if a.startswith("?") else a for a in atom.args)
        stream = self.tests.get(atom.predicate)
        if stream is not None:
            if None not in pattern:
                row = tuple(str(name) for name in pattern)
                return [row] if self.truth(atom.predicate, row) else []
            head = next(a.args for a in stream.certified if a.predicate == atom.predicate)
            for inputs in self.inputs(stream):
                given = dict(zip(stream.inputs, inputs, strict=True))
                row = tuple(given.get(a, a) for a in head)
                if all(p is None or p == v for p, v in zip(pattern, row, strict=True)):
                    self.truth(atom.predicate, row)
        return self.relation(atom.predicate).matches(pattern)

    def drawn_outputs(self, stream: Stream, inputs: Args) -> list[Args]:
        """What this stream has given on these inputs so far."""
        source = self._sources.get((stream.name, inputs))
        return source.outputs if source else []

    def drawn(self, stream: Stream, inputs: Args) -> int:
        """How many times this stream was asked on these inputs."""
        source = self._sources.get((stream.name, inputs))
        return source.drawn if source else 0

    def exhausted(self, stream: Stream, inputs: Args) -> bool:
        """Whether the stream has nothing more to give on these inputs."""
        source = self._sources.get((stream.name, inputs))
        return source.exhausted if source else False

    def draw(self, stream: Stream, inputs: Args) -> Args | None:
        """Ask a generator stream once; returns the names of its outputs, or None when it gave nothing."""
        key = (stream.name, inputs)
        if stream.is_test:
            return self._decide(stream, inputs)
        if key not in self._sources:
            binding = dict(zip(stream.inputs, inputs, strict=True))
            if any(not self.truth(a.predicate, bind(a, binding)) for a in stream.domain):
                return None
            values = [self.values[name] for name in inputs]
            self._sources[key] = Source(rows_of(self.generators[stream.name], values))
        source = self._sources[key]
        if source.exhausted:
            return None
        outputs = self._ask(stream.name, inputs, next, source.rows, None)
        source.drawn += 1
        if outputs is None:
            source.exhausted = True
            return None
        if isinstance(outputs, WildOutput):
            self._add_wild(outputs)
            outputs = outputs.values[0] if outputs.values else ()
        if not outputs:  # a failed attempt of a generator that may still succeed later
            return None
        self.statistics[stream.name].successes += 1
        source.outputs.append(self.certify(stream, inputs, outputs, source.drawn))
        return source.outputs[-1]

    def draw_beside(self, stream: Stream, inputs: Args, context: list[tuple[Args, Args]], limit: int) -> Iterator[Args]:
        """Up to `limit` samples of a contextual generator, newly started, given what other calls gave."""
        others = [tuple(tuple(self.values[name] for name in names) for names in other) for other in context]
        rows = rows_of(partial(self.generators[stream.name], context=others), [self.values[name] for name in inputs])
        for _ in range(limit):
            row = self._ask(stream.name, inputs, next, rows, None)
            if row is None:
                return
            if row:
                self.statistics[stream.name].successes += 1
                yield self.certify(stream, inputs, row, 0)

    def _ask(self, stream: str, inputs: Args, call: Callable[..., Any], *args: Any) -> Any:
        """Run Python code of the domain: `calling` names it while it runs, and it is timed and counted."""
        statistics = self.statistics[stream]
        statistics.calls += 1
        self.calling = (stream, inputs)
        start = time.perf_counter()
        try:
            return call(*args)
        except Exception as error:
            raise failed(stream, inputs, error) from error
        finally:
            statistics.seconds += time.perf_counter() - start
            self.calling = None

    def _decide(self, stream: Stream, inputs: Args) -> Args | None:
        """Apply a rule, or run a test whose facts do not name all its inputs."""
        if self.exhausted(stream, inputs):
            return None
        binding = dict(zip(stream.inputs, inputs, strict=True))
        if any(not self.truth(a.predicate, bind(a, binding)) for a in stream.domain):
            return None
        source = self._sources[stream.name, inputs] = Source(iter(()), 1, True)
        if stream.kind == "rule":
            for atom in stream.certified:
                self.add((atom.predicate, *bind(atom, binding)))
        elif not self._passes(stream, inputs):
            return None
        source.outputs.append(())
        return ()

    def _passes(self, stream: Stream, inputs: Args) -> bool:
        """Run a test that decides no single fact, and add what it certifies."""
        decided = Stream(stream.name, stream.inputs, stream.domain, (), (Atom(stream.name, stream.inputs),))
        if not self._run_test(replace(DecidingStream.of(decided, stream.inputs), certified=()), inputs):
            return False
        binding = dict(zip(stream.inputs, inputs, strict=True))
        for atom in stream.certified:
            self.add((atom.predicate, *bind(atom, binding)))
        return True

    def call_in_state(self, stream: Stream, inputs: Args, facts: Iterable[Fact]) -> tuple[Args, set[Fact]] | None:
        """Ask a fluent stream once, in a state of which it receives the facts of its `:fluents`.

        Returns the outputs and what they are certified to be in this state only; None for a failure.
        """
        received = [(fact[0], *(self.values[name] for name in fact[1:])) for fact in facts]
        statistics = self.statistics[stream.name]
        generator, values = self.generators[stream.name], [self.values[name] for name in inputs]
        outputs = self._ask(stream.name, inputs, lambda: next(iter(generator(*values, fluents=received)), None))
        if outputs is None or (stream.outputs and not outputs):
            return None
        statistics.successes += 1
        names = self._name_outputs(stream, inputs, outputs, statistics.calls)
        binding = dict(zip(stream.inputs + stream.outputs, (*inputs, *names), strict=True))
        return names, {(atom.predicate, *bind(atom, binding)) for atom in stream.certified}

    def true_in_state(self, predicate: str, args: Args, facts: Iterable[Fact]) -> bool:
        """Whether a test with `:fluents` holds of the arguments in a state with these facts (remembered)."""
        stream = self.state_tests[predicate]
        head = next(atom for atom in stream.certified if atom.predicate == predicate)
        binding = match(head.args, args, {})
        if binding is None or not all(self.truth(a.predicate, bind(a, binding)) for a in stream.domain):
            return False
        inputs = tuple(binding[variable] for variable in stream.inputs)
        relevant = tuple(sorted(fact for fact in facts if fact[0] in stream.fluents))
        key = (stream.name, inputs, relevant)
        if key not in self._in_state:
            self._in_state[key] = self.call_in_state(stream, inputs, relevant) is not None
        return self._in_state[key]

    def _add_wild(self, output: WildOutput) -> None:
        """Record the additional facts of a wild stream. Raises InputError for one that is not static."""
        for head, *values in output.facts:
            predicate = str(head).lower()
            declared = self.domain.predicates.get(predicate)
            if declared is None or declared.arity != len(values):
                raise InputError(f"a stream gave the fact {(head, *values)!r}, which the domain does not declare")
            if predicate in self.domain.fluents | self.domain.derived:
                raise InputError(f"a stream gave `{head}`, which actions or axioms change")
            self.add((predicate, *(self.name_of(value, "x") for value in values)))

    def name_of(self, value: Any, prefix: str) -> str:
        """The name of a value, a new one if it has none."""
        name = self.names.find(value) if self.names else None
        if name is None:
            name = self.new_name(prefix)
            self.values[name] = value
            if self.names:
                self.names.add(value, name)
        return name

    def certify(self, stream: Stream, inputs: Args, outputs: tuple[Any, ...], draw: int) -> Args:
        """Name the outputs of a stream and add the facts it certifies. Raises InputError for a wrong number."""
        names = self._name_outputs(stream, inputs, outputs, draw)
        binding = dict(zip(stream.inputs + stream.outputs, (*inputs, *names), strict=True))
        for atom in stream.certified:
            self.add((atom.predicate, *bind(atom, binding)))
        return names

    def _name_outputs(self, stream: Stream, inputs: Args, outputs: tuple[Any, ...], draw: int) -> Args:
        if not isinstance(outputs, tuple | list) or len(outputs) != len(stream.outputs):
            raise InputError(
                Diagnostic(
                    f"stream `{stream.name}` gave {outputs!r} for ({', '.join(inputs)}), "
                    f"not a tuple of {len(stream.outputs)} output(s)",
                    line=stream.line,
                )
            )
        names = []
        for variable, value in zip(stream.outputs, outputs, strict=True):
            name = self.name_of(value, re.sub(r"[^a-z0-9_]", "_", variable[1:]) if self.names else variable[1:])
            if name not in self.made_by and (self.names is None or name not in self.names.given):
                self.made_by[name] = (stream.name, inputs, draw)
            names.append(name)
        return tuple(names)

    def trimmed(self, quota: Mapping[str, int], needed: Iterable[str]) -> FactBase:
        """What is known of the first `quota[stream]` (default 1) draws on each inputs, and of the `needed` entities.

        The result grows on its own; streams go on where they are, so that what was left out is never drawn again.
        """
        wanted: set[str] = set()
        waiting = list(needed)
        while waiting:
            name = waiting.pop()
            if name not in wanted:
                wanted.add(name)
                waiting += self.made_by[name][1] if name in self.made_by else ()
        kept = dict.fromkeys(wanted, True)

        def keep(name: str) -> bool:
            if name not in kept:
                made = self.made_by.get(name)
                kept[name] = made is None or (made[2] <= quota.get(made[0], 1) and all(map(keep, made[1])))
            return kept[name]

        base = replace(
            self,
            values={name: value for name, value in self.values.items() if keep(name)},
            static={},
            made_by={name: made for name, made in self.made_by.items() if keep(name)},
        )
        for predicate, relation in self.static.items():
            rows = base.static.setdefault(predicate, Relation())
            for row in relation.rows:
                if all(map(keep, row)):
                    rows.add(row)
        for predicate, answers in self._answers.items():
            base._answers[predicate] = {args: true for args, true in answers.items() if all(map(keep, args))}
        base._counts = dict(self._counts)
        base._sources = {
            key: Source(source.rows, min(source.drawn, quota.get(key[0], 1)), source.exhausted, source.outputs)
            for key, source in self._sources.items()
            if all(map(keep, key[1]))
        }
        return base

    def new_name(self, prefix: str) -> str:
        """A fresh entity name."""
        while True:
            self._counts[prefix] = self._counts.get(prefix, 0) + 1
            name = f"{prefix}{self._counts[prefix]}"
            if name not in self.values:
                return name


def sort_predicate(sort: str) -> str:
    """The predicate that is true of the entities of a sort."""
    return f"sort-{sort}"
