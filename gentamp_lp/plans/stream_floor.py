"""The stream floor of a plan: the seconds that its own stream calls take, replayed alone.

No planner that uses the same streams can be faster. What is left out: calls whose outcome the plan does not use,
earlier draws of a stream whose later draw it uses, and all search.
"""

from __future__ import annotations

from collections.abc import Sequence

from gentamp_lp.plans.plan import by_dependency
from gentamp_lp.streams.relations import Args
from gentamp_lp.streams.semantics import Step, View, apply, precondition_holds
from gentamp_lp.tasks.task import Instance


def stream_floor(instance: Instance, steps: Sequence[Step]) -> float | None:
    """Seconds of the stream calls behind the steps' entities and of the tests that the preconditions read.

    The calls are repeated on the same problem. None when a stream does not repeat itself.
    """
    task, made = instance.task, instance.base.made_by
    fresh = instance.renewed()
    base = fresh.base
    streams = {stream.name: stream for stream in base.streams}
    together: dict[object, list[str]] = {}
    for name, call in made.items():
        together.setdefault(call, []).append(name)
    names: dict[str, str] = {}
    calls: dict[tuple[str, Args, int], tuple[Args | None, float]] = {}  # what each draw gave, and its seconds
    floor = 0.0
    for name in by_dependency([a for step in steps for a in step.args], instance):
        if name in names:
            continue
        stream, inputs, draw = made[name]
        here = tuple(names.get(i, i) for i in inputs)
        for number in range(base.drawn(streams[stream], here), draw):
            before = base.statistics[stream].seconds
            outputs = base.draw(streams[stream], here)
            calls[stream, here, number + 1] = outputs, base.statistics[stream].seconds - before
        outputs, seconds = calls.get((stream, here, draw), (None, 0.0))
        if outputs is None:
            return None
        floor += seconds
        names |= zip(together[made[name]], outputs, strict=True)
    spent = sum(s.seconds for s in base.statistics.values())
    state = fresh.state
    for step in steps:
        again = Step(step.schema, tuple(names.get(a, a) for a in step.args))
        view = View(task.program, base, state)
        if not precondition_holds(view, again):
            return None
        state = apply(view, again)
    return floor + sum(s.seconds for s in base.statistics.values()) - spent
