"""What a planner may hope for: outputs that streams have not given yet, and tests that have not been run.

A `World` holds the facts known so far together with optimistic ones: for every call of a stream that is possible on
known or hoped-for inputs, placeholders for its outputs and the facts it would certify. A test not run yet has no truth
value; `split` turns the domain into one where such a test counts as true wherever that helps and as false wherever that
does, so that the planner misses no plan. What a plan hopes for is then found out by calling streams and running tests.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from itertools import count, islice
from typing import Any

import networkx as nx

from gentamp_lp.errors import LimitReached
from gentamp_lp.streams.facts import Fact, FactBase
from gentamp_lp.streams.formula import (
    And,
    Atom,
    Exists,
    Forall,
    Formula,
    Not,
    Or,
    conjuncts,
    normalize,
    rebuilt,
)
from gentamp_lp.streams.language import Generator, Outputs, one_by_one
from gentamp_lp.streams.pddl import ActionSchema, Axiom, Domain
from gentamp_lp.streams.relations import Args, Relation, bind
from gentamp_lp.streams.semantics import Program
from gentamp_lp.streams.stream_code import failed
from gentamp_lp.streams.stream_file import Stream

Literal = tuple[Fact, bool]
Key = tuple[str, Args, int]
MAX_CALLS = 100_000


class TooManyCalls(LimitReached):
    """More stream calls are possible than were wanted."""

    remedy = "--algorithm incremental"


@dataclass(frozen=True)
class Placeholder:
    """Stands for a value that is not sampled yet, where a cost is to be bounded."""

    name: str


@dataclass(frozen=True)
class Call:
    """A stream call not made yet; `outputs` are placeholders, `requires` tests that its inputs have to pass."""

    stream: Stream
    inputs: Args
    copy: int
    outputs: Args
    requires: tuple[Fact, ...] = ()

    @property
    def key(self) -> Key:
        """What identifies the call."""
        return self.stream.name, self.inputs, self.copy


@dataclass(frozen=True)
class Failure:
    """A fact that a stream with `:fluents` could not certify in a state with these facts of the `fluents`.

    `exact`: in states with no others; else in states with more of them, too. `true`: a test certified it, which was not
    wished for.
    """

    fact: Fact
    situation: frozenset[Fact]
    fluents: tuple[str, ...]
    exact: bool
    true: bool = False

    def axiom(self, domain: Domain) -> Axiom:
        """The rule by which a planner knows the failure again."""
        variables = tuple(f"?x{i}" for i in range(len(self.fact) - 1))
        conditions: list[Formula] = [Atom("=", (v, a)) for v, a in zip(variables, self.fact[1:], strict=True)]
        conditions += [Atom(f[0], f[1:]) for f in sorted(self.situation)]
        for fluent in self.fluents if self.exact else ():
            others = tuple(f"?y{i}" for i in range(domain.predicates[fluent].arity))
            same = [
                And(tuple(Atom("=", (v, a)) for v, a in zip(others, f[1:], strict=True)))
                for f in sorted(self.situation)
                if f[0] == fluent
            ]
            conditions.append(Not(Exists(others, And((Atom(fluent, others), *map(Not, same))))))
        head = f"certain-{self.fact[0]}" if self.true else f"given-up-{self.fact[0]}"
        return Axiom(Atom(head, variables), And(tuple(conditions)))

    def names(self) -> set[str]:
        """All entities it is about."""
        return {a for f in (self.fact, *self.situation) for a in f[1:]}


@dataclass
class Hopes:
    """What optimism has been given up for now, and how far it reaches."""

    literals: set[Literal] = field(default_factory=set)
    costs: dict[Fact, float] = field(default_factory=dict)  # what functions of placeholders turned out to be
    calls: set[tuple[str, Args, int]] = field(default_factory=set)
    in_state: list[Failure] = field(default_factory=list)
    hidden: set[str] = field(default_factory=set)  # sampled, but not shown to the planner
    copies: int = 1
    depth: int = 1
    names: dict[Key, Args] = field(default_factory=dict)
    values: dict[Key, Outputs | None] = field(default_factory=dict)  # what `opt_gen_fn` gave
    counter: Iterator[int] = field(default_factory=lambda: count(1))
    coarse: bool = False  # the calls of a stream share their placeholders

    def outputs(self, stream: Stream, key: Key) -> Args:
        """The placeholders of a call."""
        if self.coarse:
            return coarse_outputs(stream)
        if key not in self.names:
            self.names[key] = tuple(f"{v[1:]}-opt{next(self.counter)}" for v in stream.outputs)
        return self.names[key]

    def clear(self) -> bool:
        """Hope for everything again; False when nothing had been given up."""
        exact = [failure for failure in self.in_state if failure.exact]
        given_up = bool(self.literals or self.calls or self.costs or len(exact) < len(self.in_state))
        self.literals.clear()
        self.costs.clear()
        self.calls.clear()
        self.in_state = exact
        return given_up


def coarse_outputs(stream: Stream) -> Args:
    """The placeholders that all calls of a stream share in a coarse world."""
    return tuple(f"{v[1:]}-any-{stream.name}" for v in stream.outputs)


@dataclass
class World(FactBase):
    """Known and optimistic facts."""

    real: FactBase = field(kw_only=True)
    hopes: Hopes = field(kw_only=True)
    check_time: Callable[[], object] = field(kw_only=True)  # raises LimitReached at the deadline
    wanted: Callable[[World, Stream, Args], bool] = field(kw_only=True, default=lambda *_: True)
    most: int = field(kw_only=True, default=MAX_CALLS)  # calls
    opt_outputs: Mapping[str, Generator] = field(kw_only=True, default_factory=dict)

    def __post_init__(self) -> None:
        super().__post_init__()
        self.state_tests = {}  # hoped to be true: `split` says where, and that they may be false
        self.maker: dict[Fact, Call] = {}
        self.call_of: dict[str, Call] = {}
        self.made: dict[Key, Call] = {}
        self._opinions: dict[Fact, bool | None] = {}

    @classmethod
    def of(
        cls,
        base: FactBase,
        hopes: Hopes,
        lazy: Iterable[Stream],
        opt_costs: Mapping[str, Callable[..., float]],
        check_time: Callable[[], object],
        **limits: Any,
    ) -> World:
        """All that is known and not hidden, and what calls of the `lazy` streams might add.

        `limits` are `wanted`, which says of a stream and its inputs whether to assume the call, `most`, and the
        `opt_outputs` that streams are hoped to give. Raises TooManyCalls.
        """
        hidden = hopes.hidden
        world = cls(
            base.domain, (*base.streams, *base.functions.values()), base.generators,
            {name: value for name, value in base.values.items() if name not in hidden},
            base.sorts, {}, base.statistics, real=base, hopes=hopes, check_time=check_time, **limits,
        )  # fmt: skip
        for predicate, relation in base.static.items():
            rows = relation.rows if not hidden else [r for r in relation.rows if hidden.isdisjoint(r)]
            world.static[predicate] = Relation(rows)
        streams = list(lazy)
        for _ in range(hopes.depth):
            if not [call for stream in streams for call in world._hope_for(stream)]:
                break
        for name, stream in base.functions.items():
            for args in world.inputs(stream, check_time):
                fact = (name, *args)
                if all(a in base.values for a in args):
                    base.cost(name, args)
                elif fact in hopes.costs:
                    world.costs[fact] = hopes.costs[fact]
                else:
                    bound = opt_costs.get(name)
                    world.costs[fact] = float(world._optimistic(name, args, bound)) if bound else 0.0
        world.costs |= base.costs
        return world

    def _hope_for(self, stream: Stream) -> Iterator[Call]:
        """New calls of a stream; their facts are added after the last."""
        real = self.real
        certified: dict[Fact, Call] = {}
        for inputs in self.each_input(stream, self.check_time):
            known = all(name in real.values for name in inputs)
            if known and not stream.fluents and real.exhausted(stream, inputs):
                continue
            if not self.wanted(self, stream, inputs):
                continue
            for copy in range(self.hopes.copies if stream.outputs else 1):
                key = (stream.name, inputs, copy)
                if key in self.hopes.calls:
                    continue
                if key in self.made:
                    continue
                if len(self.made) >= self.most:
                    raise TooManyCalls(self._too_many())
                outputs = self.hopes.outputs(stream, key)
                values = self._hoped_values(key, outputs)
                if values is None:
                    continue
                binding = dict(zip(stream.inputs + stream.outputs, inputs + outputs, strict=True))
                tests = [a for a in stream.domain if a.predicate in self.tests]
                facts = [(a.predicate, *bind(a, binding)) for a in tests]
                call = Call(stream, inputs, copy, outputs, tuple(f for f in facts if self.opinion(f) is None))
                self.made[key] = call
                self.call_of |= dict.fromkeys(outputs, call)
                self.values |= zip(outputs, values, strict=True)
                for atom in stream.certified:
                    certified.setdefault((atom.predicate, *bind(atom, binding)), call)
                yield call
        for fact, call in certified.items():
            if self.add(fact):
                self.maker[fact] = call

    def _too_many(self) -> str:
        (name, number), *_ = Counter(key[0] for key in self.made).most_common(1)
        return (
            f"more than {self.most} stream calls are possible, {number} of them calls of `{name}`: "
            f"narrow its `:domain` down, or try `incremental`, which assumes no calls"
        )

    def _optimistic(self, name: str, args: Args, function: Callable[..., Any]) -> Any:
        """What a user's optimistic function says of known values and placeholders. Raises InputError if it fails."""
        try:
            return function(*(self.values[arg] for arg in args))
        except Exception as error:
            raise failed(name, args, error) from error

    def _hoped_values(self, key: Key, outputs: Args) -> Outputs | None:
        """Values for the placeholders of a call: what its `opt_gen_fn` gives, None if it gives nothing."""
        function = self.opt_outputs.get(key[0])
        if function is None or not outputs:
            return tuple(map(Placeholder, outputs))
        if key not in self.hopes.values:
            rows = one_by_one(self._optimistic(key[0], key[1], lambda *values: list(islice(function(*values), 9))))
            self.hopes.values[key] = next(islice((row for row in rows if row), key[2], None), None)
        return self.hopes.values[key]

    def coarse_name(self, name: str) -> str:
        """What stands for a placeholder in a coarse world."""
        call = self.call_of.get(name)
        return name if call is None else coarse_outputs(call.stream)[call.outputs.index(name)]

    def opinion(self, fact: Fact) -> bool | None:
        """Whether a test fact is true as far as is known or given up, None if it may turn out either way."""
        predicate, *rest = fact
        args = tuple(rest)
        if args in self.relation(predicate):
            return True
        known = self.real.known(predicate, args)
        if known is not None:
            return known
        if (fact, True) in self.hopes.literals:
            return False
        if (fact, False) in self.hopes.literals:
            return True
        if fact not in self._opinions:
            self._opinions[fact] = None if self._meets_conditions(fact) else False
        return self._opinions[fact]

    def _meets_conditions(self, fact: Fact) -> bool:
        stream = self.tests[fact[0]]
        head = next(a.args for a in stream.certified if a.predicate == fact[0])
        binding = dict(zip(head, fact[1:], strict=True))
        if not all(self.truth(a.predicate, bind(a, binding)) for a in stream.domain):
            return False
        hope = self.opt_outputs.get(stream.name)
        inputs = tuple(binding[variable] for variable in stream.inputs)
        return hope is None or any(row != [] for row in self._optimistic(stream.name, inputs, hope))

    def truth(self, predicate: str, args: Args) -> bool:
        """Whether a fact is or may become true."""
        if args in self.relation(predicate):
            return True
        return predicate in self.tests and self.opinion((predicate, *args)) is not False

    def alike(self, literal: Literal) -> set[Literal]:
        """The outcome of a test and those that differ only in which samples of the same streams it is about."""
        fact, value = literal
        calls = {self.call_of[name].key: self.call_of[name] for name in fact[1:] if name in self.call_of}
        if len(calls) != 1:
            return {literal}
        call = calls.popitem()[1]
        others = {other.key: other for other in self.call_of.values() if self._origin(other) == self._origin(call)}
        renamings = [dict(zip(call.outputs, other.outputs, strict=True)) for other in others.values()]
        return {((fact[0], *(renaming.get(name, name) for name in fact[1:])), value) for renaming in renamings}

    def _origin(self, call: Call) -> tuple[str, tuple[str | None, ...]]:
        """The stream of a call and the inputs that no stream has made."""
        made = self.real.made_by
        return call.stream.name, tuple(None if n in made or n in self.call_of else n for n in call.inputs)

    def candidates(self, predicate: str) -> Iterator[Args]:
        """Arguments on which a test might be run."""
        stream = self.tests[predicate]
        head = next(atom for atom in stream.certified if atom.predicate == predicate)
        for inputs in self.inputs(stream, self.check_time):
            yield bind(head, dict(zip(stream.inputs, inputs, strict=True)))

    def _rows(self, atom: Atom, binding: Mapping[str, str]) -> list[Args]:
        pattern = tuple(binding.get(a) if a.startswith("?") else a for a in atom.args)
        rows = self.relation(atom.predicate).matches(pattern)
        if atom.predicate not in self.tests:
            return rows
        if None not in pattern:
            row = tuple(str(name) for name in pattern)
            return [row] if self.truth(atom.predicate, row) else []
        more = (
            row
            for row in self.candidates(atom.predicate)
            if all(p is None or p == v for p, v in zip(pattern, row, strict=True)) and self.truth(atom.predicate, row)
        )
        return list(dict.fromkeys([*rows, *more]))


@dataclass(frozen=True)
class Split:
    """A domain in which every test is read hopefully.

    A test, and a derived predicate that depends on one, becomes two predicates: the hopeful one where its truth helps
    to make a condition true, the doubtful one (`-low`) where it hinders. `uses` lists the (test, hopeful, negated)
    predicates that occur.
    """

    program: Program
    goal: Formula
    uses: frozenset[tuple[str, bool, bool]]


def split(program: Program, goal: Formula, base: FactBase, exact: bool = False) -> Split:
    """Compile the hopeful reading. `exact`: mind that a test fails where its stream's conditions do not hold."""
    splitter = _Splitter(program, base, exact)
    actions, named = [], []
    for schema in program.domain.actions:
        effects = tuple(
            replace(e, condition=splitter.read(normalize(e.condition), True)) if e.condition != And(()) else e
            for e in schema.effects
        )
        precondition, more = _name_denials(splitter.read(program.preconditions[schema.name], True), schema, program)
        named += more
        actions.append(replace(schema, precondition=precondition, effects=effects))
    goal = splitter.read(normalize(goal), True)
    axioms = splitter.axioms()
    domain = replace(program.domain, actions=tuple(actions), axioms=(*axioms, *named))
    return Split(Program.of(domain), goal, frozenset(splitter.uses))


def _name_denials(precondition: Formula, schema: ActionSchema, program: Program) -> tuple[Formula, list[Axiom]]:
    """Give names to what a precondition says does not exist, restricted by the static facts that it also demands.

    A planner would name it too, but for all objects instead of those that the action can be about.
    """
    changing = program.domain.fluents | program.axioms.keys()
    parts = conjuncts(precondition)
    static = [a for a in parts if isinstance(a, Atom) and a.predicate not in changing and a.predicate != "="]
    found: list[Formula] = []
    axioms: list[Axiom] = []
    for part in parts:
        free = tuple(sorted(part.free))
        if not isinstance(part, Not) or not isinstance(part.body, Exists) or not free:
            found.append(part)
            continue
        head = Atom(f"denied-{schema.name}-{len(axioms)}", free)
        about = [a for a in static if set(a.args) & set(free)]
        others = tuple(sorted({v for a in about for v in a.free} - set(free)))
        guard = Exists(others, And(tuple(about))) if others else And(tuple(about))
        axioms.append(Axiom(head, And((guard, part.body)), schema.line))
        found.append(Not(head))
    return And(tuple(found)), axioms


class _Splitter:
    def __init__(self, program: Program, base: FactBase, exact: bool) -> None:
        self.program = program
        self.base = base
        self.exact = exact
        self.uses: set[tuple[str, bool, bool]] = set()
        self.heads: dict[tuple[str, bool], None] = {}
        self.of_state = {a.predicate for s in base.streams if s.fluents for a in s.certified}

    def axioms(self) -> list[Axiom]:
        """The axioms of all heads that were read, which may read others."""
        found: list[Axiom] = []
        done: set[tuple[str, bool]] = set()
        while waiting := [key for key in self.heads if key not in done]:
            for name, hopeful in waiting:
                done.add((name, hopeful))
                for axiom in self.program.axioms[name]:
                    head = Atom(self.derived(name, hopeful), axiom.head.args)
                    found.append(Axiom(head, self.read(axiom.body, hopeful), axiom.line))
        return found

    def derived(self, name: str, hopeful: bool) -> str:
        return name if hopeful or not self.doubtful(name) else f"{name}-low"

    def doubtful(self, name: str) -> bool:
        """Whether a derived predicate depends on tests, or on facts that only hold in a state."""
        return not self.program.basis[name].isdisjoint(self.base.tests.keys() | self.of_state)

    def read(self, formula: Formula, hopeful: bool) -> Formula:
        """A normalized formula whose truth is hoped for (or feared)."""
        match formula:
            case Atom(predicate, args):
                if predicate in self.base.tests:
                    self.uses.add((predicate, hopeful, False))
                    return Atom(predicate if hopeful else f"{predicate}-low", args)
                if predicate in self.program.axioms:
                    self.heads[predicate, hopeful or not self.doubtful(predicate)] = None
                    return Atom(self.derived(predicate, hopeful), args)
                if predicate in self.base.state_tests and not hopeful:
                    return Atom(f"certain-{predicate}", args)
                if predicate in self.of_state and hopeful:
                    return And((formula, Not(Atom(f"given-up-{predicate}", args))))
                return formula
            case Not(Atom(predicate, args)) if predicate in self.base.tests:
                self.uses.add((predicate, hopeful, True))
                refuted = Atom(f"no-{predicate}" if hopeful else f"no-{predicate}-low", args)
                if not self.exact:
                    return refuted
                conditions = self.base.test_conditions(predicate, args)
                return Or((refuted, *(self.read(Not(c), hopeful) for c in conditions)))
            case Not(body):
                return Not(self.read(body, not hopeful))
            case Forall():
                raise AssertionError(f"not normalized: {formula}")
        return rebuilt(formula, lambda part: self.read(part, hopeful))


def hopeful_problem(split: Split, world: World) -> tuple[Program, FactBase]:
    """The domain and the facts to be sent to a planner that knows nothing of streams and tests."""
    base = FactBase(split.program.domain, (), {}, world.values, {}, dict(world.static))
    base.costs = world.costs
    for predicate, hopeful, negated in split.uses:
        name = f"no-{predicate}" if negated else predicate
        rows = base.static[name if hopeful else f"{name}-low"] = Relation()
        if not negated:
            rows.rows.update(world.relation(predicate).rows)
        if negated and not hopeful:  # few are refuted
            tried = [*world.real.refuted(predicate)]
            given_up = [f[1:] for f, value in world.hopes.literals if f[0] == predicate and value]
            possible: Iterable[Args] = [r for r in (*tried, *given_up) if all(a in world.values for a in r)]
        elif not negated and not hopeful:
            possible = [f[1:] for f, value in world.hopes.literals if f[0] == predicate and not value]
        else:
            possible = world.candidates(predicate)
        wanted = (None, not negated) if hopeful else (not negated,)
        for args in possible:
            if world.opinion((predicate, *args)) in wanted:
                rows.add(args)
    failures = [f for f in world.hopes.in_state if f.names() <= world.values.keys()]
    axioms = [failure.axiom(split.program.domain) for failure in failures]
    return (Program.of(split.program.domain, axioms) if axioms else split.program), base


def in_order(streams: Iterable[Stream], domain: Domain) -> tuple[list[Stream], bool]:
    """Streams, each after those that feed it, and whether some feed themselves."""
    named = {stream.name: stream for stream in streams}
    feeds = nx.DiGraph()
    feeds.add_nodes_from(named)
    for stream in named.values():
        certified = {a.predicate for a in stream.certified}
        certified.update(*(domain.supertypes.get(predicate, ()) for predicate in certified))
        feeds.add_edges_from(
            (stream.name, other.name)
            for other in named.values()
            if not certified.isdisjoint(a.predicate for a in other.domain)
        )
    groups = nx.condensation(feeds)
    place = {name: number for number, name in enumerate(named)}
    members = nx.get_node_attributes(groups, "members")
    order = nx.lexicographical_topological_sort(groups, key=lambda group: min(place[n] for n in members[group]))
    ordered = [named[name] for group in order for name in sorted(members[group], key=place.__getitem__)]
    return ordered, not nx.is_directed_acyclic_graph(feeds)


def relevant_streams(program: Program, goal: Formula, base: FactBase) -> set[str]:
    """Streams whose facts some condition reads, directly or as inputs of others."""
    formulas = [goal, *program.preconditions.values(), *(a.body for rows in program.axioms.values() for a in rows)]
    formulas += [e.condition for a in program.domain.actions for e in a.effects]
    waiting = set().union(*(f.predicates for f in formulas))
    waiting |= {a.predicate for f in base.functions.values() for a in f.domain}
    found: set[str] = set()
    seen: set[str] = set()
    while waiting:
        predicate = waiting.pop()
        seen.add(predicate)
        below = {p for p, above in program.domain.supertypes.items() if predicate in above}
        streams = [s for s in base.streams if {a.predicate for a in s.certified} & (below | {predicate})]
        found |= {s.name for s in streams}
        waiting |= {a.predicate for s in streams for a in s.domain} - seen
    return found
