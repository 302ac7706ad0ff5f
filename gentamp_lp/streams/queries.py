"""Formulas compiled into nested loops over the facts of one state that is changed in place.

A `View` (module `semantics`) answers any question about any state; a `Situation` answers the same few questions about
thousands of states that follow each other. Axioms are unfolded (recursive ones are left to a View), the order of the
joins is fixed when a query is compiled, and variables are places in a list.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from functools import cached_property
from itertools import count

from gentamp_lp.streams.facts import Fact, FactBase
from gentamp_lp.streams.formula import (
    And,
    Atom,
    Exists,
    Formula,
    Not,
    Or,
    conjuncts,
    normalize,
)
from gentamp_lp.streams.joins import Env, Join, Loop, Test, all_of, each, some
from gentamp_lp.streams.pddl import ActionSchema
from gentamp_lp.streams.relations import Args, Places, Relation, bind, picked
from gentamp_lp.streams.semantics import Program, State, View, reads
from gentamp_lp.streams.stream_file import Stream

_NONE: list[Args] = []
_BRANCH, _GENERATE, _TEST_JOIN, _LAST, _NEVER = 1e4, 1e6, 1e7, 1e8, 1e9  # how late to join these


def unfold(formula: Formula, program: Program) -> Formula:
    """The formula without derived predicates, save recursive ones; normalized."""

    def definitions(atom: Atom) -> list[tuple[Formula, dict[str, str]]]:
        if atom.predicate in program.recursive:
            return []
        found = program.axioms.get(atom.predicate, ())
        return [(axiom.body, dict(zip(axiom.head.args, atom.args, strict=True))) for axiom in found]

    return normalize(formula, definitions)


class Query:
    """A formula compiled for a situation: its `given` variables are bound, its `wanted` ones are asked for."""

    def __init__(self, situation: Situation, formula: Formula, given: Sequence[str], wanted: Sequence[str], lazy: bool):
        self._situation, self._lazy = situation, lazy
        self._formula, self._given, self._asked = formula, given, wanted
        self._slots: dict[str, int] = {variable: i for i, variable in enumerate(given)}
        self._constants: list[tuple[int, str]] = []
        self._everywhere = False

    @cached_property
    def _compiled(self) -> tuple[Test, Loop | None]:
        """Made when the first question is asked: many a query never is."""
        goals = list(conjuncts(unfold(self._formula, self._situation.program)))
        found = self._compile(goals, frozenset(self._given), frozenset(self._asked))
        self._blank = [""] * (len(self._slots) - len(self._given))
        self._wanted = [self._slots[variable] for variable in self._asked]
        return found

    @property
    def unguarded(self) -> bool:
        """Whether some variable ranges over all entities."""
        _ = self._compiled
        return self._everywhere

    def _env(self, args: Sequence[str]) -> Env:
        env = [*args, *self._blank]
        for slot, constant in self._constants:
            env[slot] = constant
        return env

    def holds(self, args: Sequence[str] = ()) -> bool:
        """Whether there is a solution for these values of the given variables."""
        check, loop = self._compiled
        env = self._env(args)
        return check(env) and (loop is None or any(True for _ in loop(env)))

    def solutions(self, args: Sequence[str] = ()) -> Iterator[Args]:
        """Values of the wanted variables, with repetitions. The situation may change while this is suspended, if it is
        back in the same state when it goes on.
        """
        check, loop = self._compiled
        env = self._env(args)
        if check(env):
            if loop is None:
                yield tuple([env[slot] for slot in self._wanted])
            else:
                for _ in loop(env):
                    yield tuple([env[slot] for slot in self._wanted])

    def _slot(self, name: str) -> int:
        if name not in self._slots:
            self._slots[name] = len(self._slots)
            if not name.startswith("?"):
                self._constants.append((self._slots[name], name))
        return self._slots[name]

    def _compile(self, goals: list[Formula], bound: frozenset[str], wanted: frozenset[str]) -> tuple[Test, Loop | None]:
        """A test of all that is decided, and a loop over the rest (None when nothing is left)."""
        decided: list[Formula] = []
        rest: list[Formula] = []
        for goal in goals:
            self._divide(goal, bound, decided, rest)
        decided.sort(key=self._price)
        tests = [self._remembering(goal, bound) for goal in decided]
        loop: Loop | None = None
        if rest and wanted <= bound:  # one solution is as good as all
            early = all(self._price(goal) < 2 and not self._makes(goal) for goal in rest)  # looked up before tests
            place = sum(self._price(goal) < 2 for goal in decided) if early else len(tests)
            tests.insert(place, some(self._scan(rest, bound, wanted)))
        elif rest:
            loop = each(self._scan(rest, bound, wanted))
        elif not wanted <= bound:
            loop = each(self._everything(min(wanted - bound), [], bound, wanted))
        return all_of(tests), loop

    def _divide(self, goal: Formula, bound: frozenset[str], decided: list[Formula], rest: list[Formula]) -> None:
        """Conjuncts whose variables are bound go to one list, the others to another."""
        if isinstance(goal, And):
            for part in goal.parts:
                self._divide(part, bound, decided, rest)
        elif goal.free <= bound:
            decided.append(goal)
        elif isinstance(goal, Exists):
            self._divide(goal.body, bound, decided, rest)
        else:
            rest.append(goal)

    def _price(self, goal: Formula) -> int:
        """Of decided conjuncts, what is looked up comes before what is computed, and that before tests."""
        return int(not isinstance(goal, Atom)) if goal.predicates.isdisjoint(self._situation.tested) else 2

    def _remembering(self, goal: Formula, bound: frozenset[str]) -> Test:
        """The test of a conjunct; asked again and again with the same values, it looks once while nothing changes."""
        test, free = self._test(goal, bound), goal.free
        if isinstance(goal, Atom) or (isinstance(goal, Not) and isinstance(goal.body, Atom)) or not free < bound:
            return test
        situation, key = self._situation, self._key(tuple(sorted(free)))
        answers: dict[Args, bool] = {}
        stamp = (0, 0)

        def remembered(env: Env) -> bool:
            nonlocal stamp
            if stamp != situation.stamp():
                stamp = situation.stamp()
                answers.clear()
            values = key(env)
            answer = answers.get(values)
            if answer is None:
                answer = answers[values] = test(env)
            return answer

        return remembered

    def _makes(self, goal: Formula) -> bool:
        """Whether to look for a conjunct's solutions may call streams."""
        return self._lazy and not self._situation.base.makers.keys().isdisjoint(goal.predicates)

    def _test(self, goal: Formula, bound: frozenset[str]) -> Test:
        match goal:
            case Atom("=", (left, right)):
                one, two = self._slot(left), self._slot(right)
                return lambda env: env[one] == env[two]
            case Atom(predicate, args):
                key, contains = self._key(args), self._situation.contains(predicate)
                return lambda env: contains(key(env))
            case Not(Atom(predicate, args)) if predicate != "=":
                key, contains = self._key(args), self._situation.contains(predicate)
                return lambda env: not contains(key(env))
            case Not(body):
                inner = self._test(body, bound)
                return lambda env: not inner(env)
            case Or(parts):
                options = [self._test(part, bound) for part in parts]
                return lambda env: any(option(env) for option in options)
        check, _ = self._compile([goal.body if isinstance(goal, Exists) else goal], bound, frozenset())
        return check

    def _key(self, args: Args) -> Callable[[Env], Args]:
        return picked(self._slot(arg) for arg in args)

    def _scan(self, goals: list[Formula], bound: frozenset[str], wanted: frozenset[str]) -> list[Join]:
        """The cheapest of the undecided conjuncts, joined with the others: one join for each case of a disjunction."""
        ranks = [self._rank(goal, bound) for goal in goals]
        chosen = min(range(len(goals)), key=ranks.__getitem__)
        goal, others = goals[chosen], goals[:chosen] + goals[chosen + 1 :]
        if ranks[chosen] >= _NEVER:
            return self._everything(min(goal.free - bound), goals, bound, wanted)
        match goal:
            case Atom("=", (left, right)):
                known, new = (left, right) if left in bound or not left.startswith("?") else (right, left)
                source = self._slot(known)
                return self._nest(
                    lambda env: [(env[source],)], [(0, self._slot(new))], [], others, bound | {new}, wanted
                )
            case Atom(predicate, args) if predicate in self._situation.base.tests:
                stream = self._situation.base.tests[predicate]
                pattern = next(a.args for a in stream.certified if a.predicate == predicate)
                names = dict(zip(pattern, args, strict=True))
                conditions = [Atom(a.predicate, bind(a, names)) for a in stream.domain]
                return self._guarded(conditions, goals, bound, wanted)
            case Atom(predicate, args):
                given = [i for i, arg in enumerate(args) if arg in bound or not arg.startswith("?")]
                free: dict[str, int] = {}
                same: list[tuple[int, int]] = []
                for i, arg in enumerate(args):
                    if i not in given:
                        if arg in free:
                            same.append((free[arg], i))
                        free.setdefault(arg, i)
                key = self._key(tuple(args[i] for i in given))
                rows = self._situation.rows(predicate, tuple(given), len(args), self._lazy)
                places = [(i, self._slot(arg)) for arg, i in free.items()]
                return self._nest(lambda env: rows(key(env)), places, same, others, bound | free.keys(), wanted)
            case Or(parts):
                cases = [self._compile([part, *others], bound, wanted) for part in parts]
                return [Join(lambda _: [()], [], [], check, loop) for check, loop in cases]
        raise AssertionError(f"not normalized: {goal}")

    def _guarded(
        self, conditions: list[Atom], goals: list[Formula], bound: frozenset[str], wanted: frozenset[str]
    ) -> list[Join]:
        """The goals, with the conditions of a test stream joined first."""
        return self._nest(lambda _: [()], [], [], [*conditions, *goals], bound, wanted)

    def _nest(
        self,
        rows: Callable[[Env], Iterable[Args]],
        places: list[tuple[int, int]],
        same: list[tuple[int, int]],
        goals: list[Formula],
        bound: frozenset[str],
        wanted: frozenset[str],
    ) -> list[Join]:
        return [Join(rows, places, same, *self._compile(goals, bound, wanted))]

    def _everything(
        self, variable: str, goals: list[Formula], bound: frozenset[str], wanted: frozenset[str]
    ) -> list[Join]:
        """Only negations say something of the variable: it ranges over all entities."""
        self._everywhere = True
        values = self._situation.base.values
        return self._nest(
            lambda _: [(name,) for name in values], [(0, self._slot(variable))], [], goals, bound | {variable}, wanted
        )

    def _rank(self, goal: Formula, bound: frozenset[str]) -> float:
        match goal:
            case Atom("=", args):
                return _NEVER if not any(a in bound or not a.startswith("?") for a in args) else 0
            case Atom(predicate, args):
                if predicate in self._situation.base.tests:
                    return _TEST_JOIN
                if self._situation.is_condition(predicate):
                    return _LAST
                size = len(self._situation.relation(predicate)) + 1
                unbound = sum(arg.startswith("?") and arg not in bound for arg in args)
                return float(size ** (unbound / len(args)) + self._makes(goal) * _GENERATE)
            case Not():
                return _NEVER
        return _BRANCH


def _looking_up(relation: Relation, given: tuple[int, ...], direction: int) -> Callable[[Args], list[Args]]:
    """The tuples that agree with values for the given positions, as they came or (-1) the last first."""
    found = relation.index(given).get
    return lambda key: found(key, _NONE)[::direction]


class Situation:
    """One state of one problem, changed in place.

    Lazy queries call streams unless they are `spent`: not to be called on these inputs any more. Facts that came last
    are found first: nothing stands on what was put down last.
    """

    def __init__(
        self,
        program: Program,
        base: FactBase,
        state: State,
        spent: Callable[[Stream, Args], bool] = lambda *_: True,
    ) -> None:
        self.program, self.base = program, base
        self._spent = spent
        order = {name: i for i, name in enumerate(base.values)}
        self._fluents = {name: Relation() for name in program.domain.fluents}
        for fact in sorted(state, key=lambda f: (f[0], [order[a] for a in f[1:]], f)):
            self._fluents[fact[0]].add(fact[1:])
        self._versions = count()
        self._version = self._other = next(self._versions)  # of this state, and of the one before the last change
        self._opposite: tuple[Sequence[Fact], Sequence[Fact]] | None = None  # what undoes the last change
        self._places: dict[Fact, Places] = {}  # where the facts stood that the last change deleted
        self._recursive: tuple[tuple[int, int], View] | None = None
        self._effects: dict[str, list[tuple[bool, Atom, Query]]] = {}
        self._inputs: dict[tuple[str, tuple[str, ...]], Query] = {}
        self._conditions: dict[str, Query] = {}
        self.tested = set(base.tests)  # predicates whose truth takes tests to know

    def query(
        self, formula: Formula, given: Sequence[str] = (), wanted: Sequence[str] = (), *, lazy: bool = False
    ) -> Query:
        """Compile a formula; a lazy query calls streams for entities that are not sampled yet."""
        return Query(self, formula, given, wanted, lazy)

    def condition(self, formula: Formula, variables: Args) -> Atom:
        """An atom that is true where a formula is, and never calls streams, also in lazy queries; something else in the
        query has to bind the variables.
        """
        name = f"condition {len(self._conditions)}"
        self._conditions[name] = self.query(formula, variables)
        if not self.base.tests.keys().isdisjoint(reads(formula, self.program)):
            self.tested.add(name)
        return Atom(name, variables)

    def state(self) -> State:
        """The present state."""
        return frozenset((name, *row) for name, relation in self._fluents.items() for row in relation.rows)

    def stamp(self) -> tuple[int, int]:
        """What is different whenever the state or the facts that streams have certified are (but for tests)."""
        return self._version, self.base.revision

    def change(self, added: Sequence[Fact], deleted: Sequence[Fact]) -> None:
        """Add facts that do not hold and delete facts that do. The opposite of the last change undoes it: everything is
        found in the same order again.
        """
        undo, places = (added, deleted) == self._opposite, self._places
        self._version, self._other = self._other if undo else next(self._versions), self._version
        self._places = {fact: self._fluents[fact[0]].remove(fact[1:]) for fact in deleted}
        if undo:
            for fact in reversed(added):
                self._fluents[fact[0]].put_back(fact[1:], places[fact])
        else:
            for fact in added:
                self._fluents[fact[0]].add(fact[1:])
        self._opposite = (deleted, added)

    def effects(self, schema: ActionSchema, args: Args) -> tuple[list[Fact], list[Fact]]:
        """The facts that a ground action adds, of those that do not hold, and deletes, of those that do."""
        if schema.name not in self._effects:
            self._effects[schema.name] = [
                (e.positive, e.atom, self.query(e.condition, schema.parameters, (*schema.parameters, *e.variables)))
                for e in schema.effects
            ]
        added: dict[Fact, None] = {}
        deleted: dict[Fact, None] = {}
        for (positive, atom, query), effect in zip(self._effects[schema.name], schema.effects, strict=True):
            variables = (*schema.parameters, *effect.variables)
            for values in query.solutions(args):
                fact = (atom.predicate, *bind(atom, dict(zip(variables, values, strict=True))))
                (added if positive else deleted)[fact] = None
        return (
            [f for f in added if f[1:] not in self._fluents[f[0]]],
            [f for f in deleted if f not in added and f[1:] in self._fluents[f[0]]],
        )

    def is_condition(self, predicate: str) -> bool:
        """Whether a predicate is one made by `condition`."""
        return predicate in self._conditions

    def relation(self, predicate: str) -> Relation:
        """The tuples of a fluent, static, certified or recursively derived predicate."""
        if predicate in self.program.recursive:
            if self._recursive is None or self._recursive[0] != self.stamp():
                self._recursive = (self.stamp(), View(self.program, self.base, self.state()))
            return Relation(self._recursive[1].extension(predicate))
        found = self._fluents.get(predicate)
        return self.base.growing(predicate) if found is None else found

    def contains(self, predicate: str) -> Callable[[Args], bool]:
        """A test whether a tuple is in a relation."""
        if predicate in self.program.recursive:
            return lambda args: args in self.relation(predicate)
        if predicate in self._conditions:
            return self._conditions[predicate].holds
        rows = self.relation(predicate).rows
        if predicate in self.base.tests:
            known, truth = self.base.answers(predicate).get, self.base.truth
            return lambda args: known(args) or truth(predicate, args)
        return rows.__contains__

    def rows(self, predicate: str, given: tuple[int, ...], arity: int, lazy: bool) -> Callable[[Args], Iterable[Args]]:
        """A function from values for the `given` positions to the tuples that agree with them."""
        if predicate in self.program.recursive:
            return lambda key: self.relation(predicate).find(given, key)
        relation = self.relation(predicate)
        if predicate in self._fluents:
            return _looking_up(relation, given, -1)
        makers = [
            (stream, atom, self._possible(stream, [atom.args[i] for i in given]))
            for stream, atom in self._makers(predicate)
            if not {atom.args[i] for i in given} & set(stream.outputs)
        ]
        if not lazy or not makers:  # a new entity never equals a given one
            return _looking_up(relation, given, 1)

        def known_then_new(key: Args) -> Iterator[Args]:
            yield from relation.find(given, key)
            for stream, atom, possible in makers:
                if possible.holds(key):
                    known = {atom.args[i]: value for i, value in zip(given, key, strict=True)}
                    yield from self._draw(stream, atom, known)

        return known_then_new

    def _possible(self, stream: Stream, given: Sequence[str]) -> Query:
        """Of a stream's conditions, those on inputs that are given."""
        return self.query(And(tuple(atom for atom in stream.domain if atom.free <= set(given))), given)

    def _makers(self, predicate: str) -> Iterator[tuple[Stream, Atom]]:
        for stream in self.base.makers.get(predicate, ()):
            yield stream, next(atom for atom in stream.certified if atom.predicate == predicate)

    def _draw(self, stream: Stream, atom: Atom, known: dict[str, str]) -> Iterator[Args]:
        """New tuples for an atom that the stream certifies, one call on each inputs in turn up to the limit."""
        given = tuple(v for v in stream.inputs if v in known)
        if given == stream.inputs and self._spent(stream, tuple(known[v] for v in given)):
            return
        if (stream.name, given) not in self._inputs:
            self._inputs[stream.name, given] = self.query(And(stream.domain), given, stream.inputs, lazy=True)
        found = self._inputs[stream.name, given].solutions([known[v] for v in given])
        waiting = list(dict.fromkeys(found))
        while waiting:
            again = []
            for inputs in waiting:
                if self._spent(stream, inputs):
                    continue
                again.append(inputs)
                outputs = self.base.draw(stream, inputs)
                if outputs is not None:
                    binding = dict(zip(stream.inputs + stream.outputs, inputs + outputs, strict=True))
                    yield tuple(binding.get(a, a) for a in atom.args)
            waiting = again
