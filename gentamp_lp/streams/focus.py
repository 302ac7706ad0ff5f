"""Which stream calls matter to a plan, where too many are possible to plan over all of them.

In a coarse view all calls of a stream share their placeholders: one pose stands for all poses that a stream may give.
It is small, and a plan over it tells which calls are worth assuming: those that a step of the plan is about, and those
that their inputs come from. Streams of which no other stream takes an output, motions say, connect whatever there is.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable

from gentamp_lp.streams.hopes import Call
from gentamp_lp.streams.optimistic_facts import OptimisticFacts
from gentamp_lp.streams.relations import Args
from gentamp_lp.streams.semantics import Step
from gentamp_lp.streams.stream_file import Stream


def focus(
    coarse: OptimisticFacts, steps: Iterable[Step], streams: Iterable[Stream]
) -> Callable[[OptimisticFacts, Stream, Args], bool]:
    """What a plan over a coarse view says of calls in a finer one: whether they are `wanted`."""
    streams = list(streams)
    taken = {atom.predicate for stream in streams for atom in stream.domain}
    last = {stream.name for stream in streams if taken.isdisjoint(atom.predicate for atom in stream.certified)}
    makers: dict[str, list[Call]] = {}
    for call in coarse.made.values():
        for name in call.outputs:
            makers.setdefault(name, []).append(call)
    about = [set(step.args) for step in steps]
    waiting = [c for c in coarse.made.values() if any(names.issuperset(c.inputs + c.outputs) for names in about)]
    made = {name for call in waiting for name in call.outputs}
    keys: set[tuple[str, Args]] = set()
    names = [name for step in about for name in sorted(step)]
    while names or waiting:
        for name in names:
            if name in makers and name not in made:
                made.add(name)
                waiting += makers[name]
        names = []
        if waiting:
            call = waiting.pop()
            keys.add((call.stream.name, call.inputs))
            names = list(call.inputs)

    def wanted(hoped: OptimisticFacts, stream: Stream, inputs: Args) -> bool:
        return stream.name in last or (stream.name, tuple(map(hoped.coarse_name, inputs))) in keys

    return wanted
