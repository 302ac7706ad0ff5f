"""Constraints on plans: skeletons, of which a plan follows exactly one, and a bound on the cost."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, NamedTuple

from gentamp_lp.errors import InputError
from gentamp_lp.streams.formula import FALSE, TRUE, And, Atom, Formula, Not, Or
from gentamp_lp.streams.language import INF
from gentamp_lp.streams.pddl import ActionSchema, Effect
from gentamp_lp.streams.problem import PlanningProblem, Translator
from gentamp_lp.streams.semantics import Program, Step

WILD = "*"


class OrderedSkeleton(NamedTuple):
    """Actions of which only some have an order: pairs (i, j) of positions, i before j."""

    actions: Sequence[tuple[str, Sequence[Any]]]
    orders: Iterable[tuple[int, int]]


@dataclass(frozen=True)
class PlanConstraints:
    """What a plan has to look like.

    `skeletons`: lists of ('action', [argument, ...]); an argument is a value, WILD, a '?variable' that stands for one
    value throughout the skeleton, or the key of one of the `groups` of values. A plan follows one of the skeletons;
    other actions may occur in between unless `exact`. No plan costs more than `max_cost`.
    """

    skeletons: Sequence[Any] | None = None
    groups: Mapping[str, Iterable[Any]] = field(default_factory=dict)
    exact: bool = True
    hint: bool = False
    max_cost: float = INF


@dataclass(frozen=True)
class Constrained:
    """A problem whose plans meet the constraints, and the actions that its own stand for."""

    problem: PlanningProblem
    originals: Mapping[str, str]

    def original(self, step: Step) -> Step:
        """The step of the user's domain."""
        return Step(self.originals.get(step.schema, step.schema), step.args)


def constrain(problem: PlanningProblem, constraints: PlanConstraints) -> Constrained:
    """Compile skeletons into the domain: one copy of an action for each step of each skeleton.

    Facts `done` say which steps were taken, `chosen` which skeleton is followed, `bound` what a variable stands for.
    Raises InputError for a skeleton with an unknown action or a wrong number of arguments.
    """
    if constraints.skeletons is None:
        return Constrained(problem, {})
    domain = problem.program.domain
    translator = Translator(domain, problem.base)
    groups = {str(key): [translator.name(v) for v in values] for key, values in constraints.groups.items()}
    copies: list[ActionSchema] = []
    originals: dict[str, str] = {}
    finished: list[Formula] = []
    count = len(constraints.skeletons)
    for k, skeleton in enumerate(constraints.skeletons):
        ordered = isinstance(skeleton, OrderedSkeleton)
        actions = list(skeleton.actions if ordered else skeleton)
        orders = set(skeleton.orders) if ordered else {(i, i + 1) for i in range(len(actions) - 1)}
        others = [Not(Atom(f"chosen-{j}", ())) for j in range(count) if j != k]
        for i, (name, arguments) in enumerate(actions):
            schema = _schema(domain.actions, str(name).lower(), arguments)
            conditions: list[Formula] = [*others, Not(Atom(f"done-{k}-{i}", ()))]
            conditions += [Atom(f"done-{k}-{a}", ()) for a, b in sorted(orders) if b == i]
            effects = [Effect(Atom(f"done-{k}-{i}", ()), True), Effect(Atom(f"chosen-{k}", ()), True)]
            first: dict[str, str] = {}
            for parameter, argument in zip(schema.parameters, arguments, strict=True):
                if isinstance(argument, str) and argument.startswith("?"):
                    conditions.append(Atom("=", (parameter, first.setdefault(argument.lower(), parameter))))
                condition, more = _argument(argument, parameter, k, groups, translator)
                conditions.append(condition)
                effects += more
            copy = f"{schema.name}-skeleton-{k}-{i}"
            originals[copy] = schema.name
            precondition = And((*conditions, schema.precondition))
            copies.append(replace(schema, name=copy, precondition=precondition, effects=(*schema.effects, *effects)))
        finished.append(And(tuple(Atom(f"done-{k}-{i}", ()) for i in range(len(actions)))))
    kept = () if constraints.exact else domain.actions
    program = Program.of(replace(domain, actions=(*kept, *copies)))
    goal = And((problem.goal, Or(tuple(finished)) if finished else FALSE))
    return Constrained(replace(problem, program=program, goal=goal), originals)


def _schema(actions: Iterable[ActionSchema], name: str, arguments: Sequence[Any]) -> ActionSchema:
    schema = next((a for a in actions if a.name == name), None)
    if schema is None:
        raise InputError(f"a skeleton uses the unknown action `{name}`")
    if len(schema.parameters) != len(arguments):
        raise InputError(f"a skeleton gives `{name}` {len(arguments)} argument(s), not {len(schema.parameters)}")
    return schema


def _argument(
    argument: Any, parameter: str, k: int, groups: Mapping[str, list[str]], translator: Translator
) -> tuple[Formula, list[Effect]]:
    """What an argument of a skeleton demands of a parameter, and what it records."""
    if isinstance(argument, str):
        if argument == WILD:
            return TRUE, []
        if argument.startswith("?"):
            here, free = Atom(f"bound-{k}-{argument[1:].lower()}", (parameter,)), f"named-{k}-{argument[1:].lower()}"
            condition = Or((here, Not(Atom(free, ()))))
            return condition, [Effect(here, True), Effect(Atom(free, ()), True)]
        if argument in groups:
            return Or(tuple(Atom("=", (parameter, name)) for name in groups[argument])), []
    return Atom("=", (parameter, translator.name(argument))), []
