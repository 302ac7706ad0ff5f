"""Plans as they should be shown.

A demonstration should look like a policy at work: short, and choosing alike among equally good steps. Plans are
therefore stripped of steps they can do without and put into one canonical order: at each point the first action of
the domain file that can go next without spoiling the rest goes next. The rule is one for the whole domain.
"""

from __future__ import annotations

from collections.abc import Sequence

from gentamp_lp.streams.facts import FactBase
from gentamp_lp.streams.formula import Formula
from gentamp_lp.streams.incremental import simulate
from gentamp_lp.streams.semantics import Program, State, Step, View, apply, precondition_holds


def canonical(program: Program, base: FactBase, state: State, goal: Formula, plan: Sequence[Step]) -> list[Step]:
    """The plan without dispensable steps, in canonical order (see the module's text)."""
    steps = _without_detours(program, base, state, goal, list(plan))
    while True:
        ordered = _in_order(program, base, state, goal, steps)
        steps = _without_detours(program, base, state, goal, ordered)  # a new order may make steps dispensable
        if len(steps) == len(ordered):
            return ordered


def _in_order(program: Program, base: FactBase, state: State, goal: Formula, steps: list[Step]) -> list[Step]:
    rank = {schema.name: index for index, schema in enumerate(program.domain.actions)}
    ordered: list[Step] = []
    while steps:
        for index in sorted(range(len(steps)), key=lambda i: (rank[steps[i].schema], i)):
            moved = [steps[index], *steps[:index], *steps[index + 1 :]]
            if index == 0 or _reaches(program, base, state, goal, moved):
                break
        else:
            raise AssertionError("a valid plan can always keep its order")
        state = apply(View(program, base, state), moved[0])
        ordered.append(moved[0])
        steps = moved[1:]
    return ordered


def _without_detours(program: Program, base: FactBase, state: State, goal: Formula, steps: list[Step]) -> list[Step]:
    """Action elimination: drop a step with all later steps that need it, if the goal is still reached."""
    index = 0
    while index < len(steps):
        kept, current = steps[:index], state
        for step in kept:
            current = apply(View(program, base, current), step)
        for step in steps[index + 1 :]:
            view = View(program, base, current)
            if precondition_holds(view, step):
                kept.append(step)
                current = apply(view, step)
        if View(program, base, current).holds(goal):
            steps = kept
        else:
            index += 1
    return steps


def _reaches(program: Program, base: FactBase, state: State, goal: Formula, steps: list[Step]) -> bool:
    states = simulate(program, base, state, steps)
    return states is not None and View(program, base, states[-1]).holds(goal)
