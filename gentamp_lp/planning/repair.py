"""What is in the way of a step: facts that an earlier step of the plan made and could have made otherwise.

Where nothing but such facts forbids a step, the plan is repaired in place, by min-conflicts (Minton et al., Artificial
Intelligence 58, 1992): of all bindings the one with the fewest obstacles is wished for, what is in its way is moved
elsewhere, and the other steps are kept where they still can be done. Obstacles weigh more each time they are moved.
"""

from __future__ import annotations

from collections.abc import Callable, Container, Iterable, Iterator, Sequence
from itertools import islice
from typing import NamedTuple

from gentamp_lp.streams.facts import Fact
from gentamp_lp.streams.formula import And, Atom, Exists, Formula, Not, Or
from gentamp_lp.streams.queries import Query, Situation, unfold
from gentamp_lp.streams.relations import Args, bind
from gentamp_lp.streams.semantics import Program

_LOOKED_AT = 8  # bindings with the fewest early obstacles, of which late ones are looked for


class Wish(NamedTuple):
    """A binding of a schema's parameters that its obstacles, facts of the state, forbid."""

    schema: str
    known: Args
    args: Args
    obstacles: frozenset[Fact]


class _Obstacles:
    """The facts of the state because of which negative conditions on some given variables do not hold."""

    def __init__(self, conditions: Iterable[Formula], given: Sequence[str], situation: Situation) -> None:
        self._queries: list[tuple[Atom, Sequence[str], Query]] = []
        for condition in conditions:
            for clause in _clauses(condition):
                for atom in clause:
                    if isinstance(atom, Atom) and atom.predicate in situation.program.domain.fluents:
                        wanted = tuple(dict.fromkeys(a for a in atom.args if a.startswith("?")))
                        self._queries.append((atom, wanted, situation.query(And(clause), given, wanted)))

    def of(self, args: Args) -> Iterator[Fact]:
        """The obstacles for one binding, with repetitions."""
        for atom, wanted, query in self._queries:
            for values in query.solutions(args):
                yield (atom.predicate, *bind(atom, dict(zip(wanted, values, strict=True))))


class Wishes:
    """The bindings of a schema's parameters that would satisfy its precondition without some facts of the state.

    `early` and `late` are the parts of the precondition, before and after all but the `known` parameters are bound.
    """

    def __init__(
        self,
        schema: str,
        early: Iterable[Formula],
        late: Iterable[Formula],
        known: Args,
        parameters: Args,
        situation: Situation,
    ) -> None:
        self._schema = schema
        program = situation.program
        early, against = _sides(early, program)
        self._known = situation.query(And(early), (), known)
        self._early = _Obstacles(against, known, situation)
        late, against = _sides(late, program)
        self._args = situation.query(And(late), known, parameters, lazy=True)
        self._late = _Obstacles(against, parameters, situation)

    def best(
        self, movable: Container[Fact], cost: Callable[[Fact], int], wanted: Callable[[Args], bool]
    ) -> Wish | None:
        """Of the bindings that are `wanted`, the one whose obstacles, all of them `movable`, cost least."""

        def weight(obstacles: Iterable[Fact]) -> int:
            return sum(map(cost, obstacles))

        early = ((known, frozenset(self._early.of(known))) for known in dict.fromkeys(self._known.solutions()))
        possible = [(known, facts) for known, facts in early if all(fact in movable for fact in facts)]
        possible.sort(key=lambda option: weight(option[1]))
        wishes = []
        for known, facts in islice((option for option in possible if wanted(option[0])), _LOOKED_AT):
            for args in self._args.solutions(known):
                obstacles = facts.union(self._late.of(args))
                if obstacles and all(fact in movable for fact in obstacles):
                    wishes.append(Wish(self._schema, known, args, obstacles))
        return min(wishes, key=lambda wish: weight(wish.obstacles), default=None)

    def obstacles(self, wish: Wish) -> set[Fact]:
        """What is in the way of a wish in the present state."""
        return {*self._early.of(wish.known), *self._late.of(wish.args)}


def _sides(conditions: Iterable[Formula], program: Program) -> tuple[tuple[Formula, ...], tuple[Formula, ...]]:
    """The conditions that stay, and the bodies of those that facts of the state stand against."""
    stay, against = [], []
    for condition in conditions:
        unfolded = unfold(condition, program)
        if isinstance(unfolded, Not) and not unfolded.predicates.isdisjoint(program.domain.fluents):
            against.append(unfolded.body)
        else:
            stay.append(condition)
    return tuple(stay), tuple(against)


def _clauses(formula: Formula) -> Iterator[tuple[Formula, ...]]:
    """The alternatives of a formula, each as the conjuncts under its quantifiers."""
    match formula:
        case Or(parts):
            for part in parts:
                yield from _clauses(part)
        case Exists(_, Or() as body):
            yield from _clauses(body)
        case _:
            yield tuple(_flat(formula))


def _flat(formula: Formula) -> Iterator[Formula]:
    match formula:
        case And(parts):
            for part in parts:
                yield from _flat(part)
        case Exists(_, body):
            yield from _flat(body)
        case _:
            yield formula
