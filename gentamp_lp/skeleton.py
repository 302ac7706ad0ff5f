"""Partial skeletons: planning when the names of the actions are known, in order, and their arguments are free.

The problem is compiled like the original's `PlanConstraints`: a fluent says how many steps were made, and every action
needs a fact `turn-ACTION` that leads from that step to the next one. All solvers then follow the skeleton.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from gentamp_lp.errors import Diagnostic, InputError
from gentamp_lp.streams.facts import Fact
from gentamp_lp.streams.formula import And, Atom, Formula
from gentamp_lp.streams.pddl import Domain, Effect, Predicate


def _turn(name: str) -> str:
    return f"turn-{name}"


def skeleton_domain(domain: Domain, goal: Formula, names: Sequence[str]) -> tuple[Domain, Formula, list[Fact], Fact]:
    """The domain and the goal of a skeleton, the static facts to add to a problem, and the fluent to add to its state.

    Actions have two more parameters at the end, the steps before and after them.
    Raises InputError when the domain has no such action.
    """
    known = {schema.name for schema in domain.actions}
    for name in names:
        if name not in known:
            hint = f"actions of the domain: {', '.join(sorted(known))}"
            raise InputError(Diagnostic(f"the skeleton names an unknown action `{name}`", domain.path, hint=hint))
    actions = tuple(
        replace(
            schema,
            parameters=(*schema.parameters, "?step", "?next"),
            precondition=And(
                (Atom("done", ("?step",)), Atom(_turn(schema.name), ("?step", "?next")), schema.precondition)
            ),
            effects=(*schema.effects, Effect(Atom("done", ("?step",)), False), Effect(Atom("done", ("?next",)), True)),
        )
        for schema in domain.actions
    )
    added = {"done": Predicate("done", "done", 1)} | {_turn(n): Predicate(_turn(n), _turn(n), 2) for n in known}
    facts: list[Fact] = [(_turn(name), f"step-{i}", f"step-{i + 1}") for i, name in enumerate(names)]
    last = Atom("done", (f"step-{len(names)}",))
    constrained = replace(domain, actions=actions, predicates={**domain.predicates, **added}, text="", path=None)
    return constrained, And((goal, last)), facts, ("done", "step-0")
