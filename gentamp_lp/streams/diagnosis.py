"""Why there is no plan: what cannot be reached even if nothing is ever undone, and which streams gave nothing."""

from __future__ import annotations

import time
from collections.abc import Iterator
from dataclasses import replace

from gentamp_lp.errors import LimitReached
from gentamp_lp.streams.engine import Engine
from gentamp_lp.streams.facts import FactBase
from gentamp_lp.streams.formula import TRUE, And, Atom, Formula, Not, conjuncts, normalize, rebuilt, to_pddl
from gentamp_lp.streams.interruption import interrupting
from gentamp_lp.streams.pddl import ActionSchema
from gentamp_lp.streams.semantics import Program, State, View, effects_of

TIME_LIMIT = 0.3  # seconds that a diagnosis may take


def diagnose(engine: Engine) -> Iterator[str]:
    """What to know and to try, most telling first."""
    yield from _streams(engine)
    try:
        with interrupting(engine.base, TIME_LIMIT):
            yield from _reachability(engine.program, engine.base, engine.state, engine.goal)
    except LimitReached:
        yield "the diagnosis of what can be reached was ended by its own time limit"
    if not engine.options.adaptive:
        yield "try algorithm='adaptive', which samples only what a plan needs"
    elif engine.options.max_cost < float("inf"):
        yield "try a larger max_cost"


def _streams(engine: Engine) -> Iterator[str]:
    for stream in engine.base.streams:
        statistics = engine.base.statistics.get(stream.name)
        if statistics is None:
            continue
        if not statistics.calls and not stream.is_test and stream in engine.streams:
            missing = [a.predicate for a in stream.domain if not engine.base.relation(a.predicate).rows]
            because = f": there are no facts of {', '.join(missing)}" if missing else ""
            yield f"stream `{stream.name}` was never called{because}"
        elif statistics.calls and not statistics.successes:
            what = "never succeeded" if stream.is_test else "never gave anything"
            yield f"stream `{stream.name}` {what} in {statistics.calls} call(s): is it what you mean?"


def _reachability(program: Program, base: FactBase, state: State, goal: Formula) -> Iterator[str]:
    """What stays out of reach of the samples although negative conditions and deletions are ignored."""
    relaxed = _relaxed(program, base)
    deadline = time.monotonic() + TIME_LIMIT
    reached, growing = state, True
    while growing and time.monotonic() < deadline:
        view = View(relaxed, base, reached)
        more: set[tuple[str, ...]] = set()
        for schema in relaxed.domain.actions:
            for found in view.solutions(relaxed.preconditions[schema.name]):
                more |= effects_of(view, schema, {p: found[p] for p in schema.parameters})[0]
                if time.monotonic() > deadline:
                    raise LimitReached
        growing = not more <= reached
        reached |= more
    view = View(relaxed, base, reached)
    missing = [part for part in conjuncts(normalize(goal)) if not view.holds(_positive(part, base))]
    for part in missing[:1]:
        yield f"no sequence of actions over the samples so far reaches the goal {_text(part)}"
    for schema in relaxed.domain.actions:
        blocking = _blocking(view, schema, relaxed)
        if blocking is not None:
            yield f"action `{schema.name}` never becomes applicable: nothing satisfies {_text(blocking)} with the rest"
    if not missing:
        yield "every goal can be reached when negative conditions are ignored: collisions or their like are in the way"


def _blocking(view: View, schema: ActionSchema, program: Program) -> Formula | None:
    """The first conjunct that cannot be satisfied together with those before it."""
    parts = conjuncts(program.preconditions[schema.name])
    for number in range(len(parts)):
        if not view.holds(And(parts[: number + 1])):
            return parts[number]
    return None


def _relaxed(program: Program, base: FactBase) -> Program:
    domain = program.domain
    actions = tuple(
        replace(
            a,
            precondition=_positive(program.preconditions[a.name], base),
            effects=tuple(
                replace(e, condition=_positive(normalize(e.condition), base)) for e in a.effects if e.positive
            ),
        )
        for a in domain.actions
    )
    axioms = tuple(replace(a, body=_positive(a.body, base)) for rows in program.axioms.values() for a in rows)
    return Program.of(replace(domain, actions=actions, axioms=axioms))


def _positive(formula: Formula, base: FactBase) -> Formula:
    """A normalized formula without what it denies and what a test says of one state."""
    match formula:
        case Not():
            return TRUE
        case Atom(predicate, args) if predicate in base.state_tests:
            return And(tuple(base.test_conditions(predicate, args)))
    return rebuilt(formula, lambda part: _positive(part, base))


def _text(formula: Formula) -> str:
    return to_pddl(formula).replace("#", "_")
