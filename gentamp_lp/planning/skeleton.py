"""Partial skeletons: planning when the names of the actions are known, in order, and their arguments are free.

A step without arguments before each action says whose turn it is, so the ground problem grows by one such step for each
name, and not by a copy of every ground action for each of its turns. All solvers then follow the skeleton.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from gentamp_lp.errors import Diagnostic, InputError
from gentamp_lp.streams.facts import Fact
from gentamp_lp.streams.formula import And, Atom, Formula
from gentamp_lp.streams.pddl import ActionSchema, Domain, Effect, Predicate
from gentamp_lp.streams.semantics import Step

_TURN = "turn-"
_FREE = Atom("no-turn", ())


def skeleton_domain(domain: Domain, goal: Formula, names: Sequence[str]) -> tuple[Domain, Formula, set[Fact]]:
    """The domain and the goal of a skeleton, and the fluents to add to a problem's initial state.

    Raises InputError when the domain has no such action.
    """
    known = {schema.name for schema in domain.actions}
    for name in names:
        if name not in known:
            hint = f"actions of the domain: {', '.join(sorted(known))}"
            raise InputError(Diagnostic(f"the skeleton names an unknown action `{name}`", domain.path, hint=hint))
    turn = {name: Atom(f"{_TURN}{name}", ()) for name in sorted(known)}
    made = [Atom(f"made-{number}", ()) for number in range(len(names) + 1)]
    actions = [
        replace(
            schema,
            precondition=And((turn[schema.name], schema.precondition)),
            effects=(*schema.effects, Effect(turn[schema.name], False), Effect(_FREE, True)),
        )
        for schema in domain.actions
    ]
    for name, before, after in zip(names, made, made[1:], strict=False):
        changes = {_FREE: False, before: False, after: True, turn[name]: True}
        effects = tuple(Effect(atom, positive) for atom, positive in changes.items())
        actions.append(ActionSchema(f"{_TURN}{after.predicate}", (), And((_FREE, before)), effects))
    added = {atom.predicate: Predicate(atom.predicate, atom.predicate, 0) for atom in (_FREE, *made, *turn.values())}
    constrained = replace(domain, actions=tuple(actions), predicates={**domain.predicates, **added}, text="", path=None)
    return constrained, And((goal, made[-1], _FREE)), {(_FREE.predicate,), (made[0].predicate,)}


def original_steps(steps: Sequence[Step]) -> list[Step]:
    """A plan along a skeleton without the steps that say whose turn it is."""
    return [step for step in steps if not step.schema.startswith(_TURN)]
