"""Giving the placeholders of an optimistic plan real values.

The calls of a plan are the variables of a constraint problem, the tests that it hopes for its constraints. It is
solved by min-conflicts repair: a call takes the first of some samples that violates nothing; if there is none, it takes
the one that violates least (constraints weigh more each time they are violated), and the calls it conflicts with are
asked for other samples. So a placement that is in the way is moved, and all others stay.
"""

from __future__ import annotations

import random
import time
from collections import Counter, deque
from collections.abc import Iterator, Mapping
from dataclasses import dataclass

from gentamp_lp.errors import LimitReached
from gentamp_lp.streams.facts import FactBase
from gentamp_lp.streams.hopes import Call, Literal
from gentamp_lp.streams.relations import Args
from gentamp_lp.streams.support import Needs

Assignment = dict[str, str]
Key = tuple[str, Args, int]
SAMPLES = 20  # looked at before a conflict is accepted
REPAIRS = 50  # of each call, before the plan is given up


@dataclass(frozen=True)
class Refuted:
    """Why placeholders got no values: a call that gives nothing, or a test that keeps failing."""

    call: Call | None = None
    literal: Literal | None = None


class Binder:
    """The calls of one plan and the values they have got so far.

    `effort` multiplies the samples and repairs that are tried; `contextual` streams receive what the others gave;
    `cursor` counts the samples of each call that were looked at already.
    """

    def __init__(
        self,
        base: FactBase,
        needs: Needs,
        deadline: float,
        effort: int,
        rng: random.Random,
        contextual: set[str],
        cursor: Counter[tuple[str, Args]],
    ) -> None:
        self.base = base
        self.deadline = deadline
        self.effort = effort
        self.rng = rng
        self.contextual = contextual
        self.calls = {key: call for key, call in needs.calls.items() if not call.stream.fluents}
        self.assigned: Assignment = {}
        self.owner = {name: call for call in self.calls.values() for name in call.outputs}
        self.children: dict[Key, list[Call]] = {key: [] for key in self.calls}
        for call in self.calls.values():
            for key in dict.fromkeys(self.owner[n].key for n in call.inputs if n in self.owner):
                self.children[key].append(call)
        self.literals: dict[Key, list[Literal]] = {key: [] for key in self.calls}
        placeholders = {name for call in needs.calls.values() for name in call.outputs}
        for literal in sorted(needs.literals):
            names = [name for name in literal[0][1:] if name in placeholders]
            if all(name in self.owner for name in names):
                for key in dict.fromkeys(self.owner[name].key for name in names):
                    self.literals[key].append(literal)
        self.weight: Counter[Literal] = Counter()
        self.cursor = cursor

    def solve(self) -> Assignment | Refuted:
        """Assign every call. Raises LimitReached at the deadline."""
        queue = deque(self.calls.values())
        barren: Counter[Key] = Counter()
        patience = REPAIRS * self.effort
        for _ in range(patience * len(self.calls) + 1):
            if not queue:
                return self.assigned
            call = queue.popleft()
            if any(name in self.owner and name not in self.assigned for name in call.inputs):
                queue.append(call)  # after the calls its inputs come from
                continue
            found = self._best(call)
            if found is None:
                barren[call.key] += 1
                parents = [self.owner[name] for name in dict.fromkeys(call.inputs) if name in self.owner]
                if not parents or barren[call.key] > SAMPLES * self.effort:
                    return Refuted(call=call)
                self._release(self.rng.choice(parents), queue)
                queue.append(call)
                continue
            outputs, violated = found
            self.assigned |= zip(call.outputs, outputs, strict=True)
            for literal in violated:
                self.weight[literal] += 1
                others = self._others(literal, call)
                if not others or self.weight[literal] > patience:
                    return Refuted(literal=literal)
                self._release(self.rng.choice(others), queue)
        worst = self.weight.most_common(1)
        return Refuted(literal=worst[0][0]) if worst else Refuted(call=next(iter(self.calls.values())))

    def _others(self, literal: Literal, call: Call) -> list[Call]:
        """Calls that could give other values so that a violated test succeeds, the latest call aside."""
        involved = {self.owner[n].key: self.owner[n] for n in literal[0][1:] if n in self.owner}
        involved.pop(call.key, None)
        if not involved:  # only this call's values: they follow from what it was given
            involved = {self.owner[n].key: self.owner[n] for n in call.inputs if n in self.owner}
        return list(involved.values())

    def _release(self, call: Call, queue: deque[Call]) -> None:
        """Take back what a call gave, and all that was made of it."""
        for name in call.outputs:
            self.assigned.pop(name, None)
        if call not in queue:
            queue.append(call)
        for child in self.children[call.key]:
            self._release(child, queue)

    def _best(self, call: Call) -> tuple[Args, list[Literal]] | None:
        """Of some samples, the first that violates nothing, else the one that violates least."""
        inputs = tuple(self.assigned.get(name, name) for name in call.inputs)
        if not all((requirement := self._truth((fact, True))) in (True, None) for fact in call.requires):
            assert requirement is False
            return None
        best: tuple[Args, list[Literal]] | None = None
        least = float("inf")
        for outputs in self._samples(call, inputs):
            trial = dict(zip(call.outputs, outputs, strict=True))
            violated = [one for one in self.literals[call.key] if self._truth(one, trial) is False]
            cost = sum(1 + self.weight[one] for one in violated)
            if cost < least:
                best, least = (outputs, violated), cost
            if not violated:
                break
        return best

    def _truth(self, literal: Literal, trial: Mapping[str, str] | None = None) -> bool | None:
        """Whether a hoped-for test outcome comes true; None while some of its arguments have no value."""
        (predicate, *args), value = literal
        names = []
        for name in args:
            here = (trial or {}).get(name, self.assigned.get(name, name))
            if here in self.owner:
                return None
            names.append(here)
        self._check_time()
        return self.base.truth(predicate, tuple(names)) == value

    def _samples(self, call: Call, inputs: Args) -> Iterator[Args]:
        """New samples, and old ones again when there are no more."""
        base, stream = self.base, call.stream
        if stream.name in self.contextual:
            yield from self._contextual_samples(call, inputs)
        source = (stream.name, inputs)
        known = base.drawn_outputs(stream, inputs)
        seen = 0
        while seen < SAMPLES * self.effort:
            if self.cursor[source] < len(known):
                self.cursor[source] += 1
                seen += 1
                yield known[self.cursor[source] - 1]
                known = base.drawn_outputs(stream, inputs)
                continue
            if base.exhausted(stream, inputs):
                break
            self._check_time()
            base.draw(stream, inputs)
            known = base.drawn_outputs(stream, inputs)
            seen += self.cursor[source] >= len(known)  # a failed attempt counts too
        if base.exhausted(stream, inputs) and seen < len(known):
            self.cursor[source] = 0
            yield from self.rng.sample(known, min(len(known), SAMPLES * self.effort))

    def _contextual_samples(self, call: Call, inputs: Args) -> Iterator[Args]:
        """Samples of a generator that receives what stands already: newly started each time."""
        base, stream = self.base, call.stream
        context = [
            (tuple(self.assigned.get(n, n) for n in other.inputs), outputs)
            for other in self.calls.values()
            if other.stream is stream and other is not call
            if (outputs := tuple(self.assigned.get(n, n) for n in other.outputs))
            if all(name in base.values for name in outputs)
        ]
        for outputs in base.draw_beside(stream, inputs, context, SAMPLES * self.effort):
            self._check_time()
            yield outputs

    def _check_time(self) -> None:
        if time.monotonic() > self.deadline:
            raise LimitReached("the time limit ended the search for stream outputs")
