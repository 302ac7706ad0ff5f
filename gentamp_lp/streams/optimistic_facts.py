"""The facts known so far together with optimistic ones.

For every call of a stream that is possible on known or hoped-for inputs there are placeholders for its outputs, and the
facts it would certify. A test not run yet has no truth value: the `hopeful_domain` counts it as true or as false,
whichever helps.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from itertools import islice
from typing import Any

from gentamp_lp.errors import LimitReached
from gentamp_lp.streams.facts import Fact, FactBase
from gentamp_lp.streams.formula import Atom
from gentamp_lp.streams.hopes import Call, Hopes, Key, Literal, Placeholder, coarse_outputs
from gentamp_lp.streams.language import Generator, Outputs, one_by_one
from gentamp_lp.streams.relations import Args, Relation, bind
from gentamp_lp.streams.stream_code import failed
from gentamp_lp.streams.stream_file import Stream

MAX_CALLS = 100_000


class TooManyCalls(LimitReached):
    """More stream calls are possible than were wanted."""

    remedy = "--algorithm incremental"


@dataclass
class OptimisticFacts(FactBase):
    """Known and optimistic facts."""

    real: FactBase = field(kw_only=True)
    hopes: Hopes = field(kw_only=True)
    check_time: Callable[[], object] = field(kw_only=True)  # raises LimitReached at the deadline
    wanted: Callable[[OptimisticFacts, Stream, Args], bool] = field(kw_only=True, default=lambda *_: True)
    most: int = field(kw_only=True, default=MAX_CALLS)  # calls
    opt_outputs: Mapping[str, Generator] = field(kw_only=True, default_factory=dict)

    def __post_init__(self) -> None:
        super().__post_init__()
        self.state_tests = {}  # hoped to be true: `split` says where, and that they may be false
        self.maker: dict[Fact, Call] = {}
        self.call_of: dict[str, Call] = {}
        self.made: dict[Key, Call] = {}
        self._opinions: dict[Fact, bool | None] = {}

    @classmethod
    def of(
        cls,
        base: FactBase,
        hopes: Hopes,
        lazy: Iterable[Stream],
        opt_costs: Mapping[str, Callable[..., float]],
        check_time: Callable[[], object],
        **limits: Any,
    ) -> OptimisticFacts:
        """All that is known and not hidden, and what calls of the `lazy` streams might add.

        `limits` are `wanted`, which says of a stream and its inputs whether to assume the call, `most`, and the
        `opt_outputs` that streams are hoped to give. Raises TooManyCalls.
        """
        hidden = hopes.hidden
        hoped = cls(
            base.domain, (*base.streams, *base.functions.values()), base.generators,
            {name: value for name, value in base.values.items() if name not in hidden},
            base.sorts, {}, base.statistics, real=base, hopes=hopes, check_time=check_time, **limits,
        )  # fmt: skip
        for predicate, relation in base.static.items():
            rows = relation.rows if not hidden else [r for r in relation.rows if hidden.isdisjoint(r)]
            hoped.static[predicate] = Relation(rows)
        streams = list(lazy)
        for _ in range(hopes.depth):
            if not [call for stream in streams for call in hoped._hope_for(stream)]:
                break
        for name, stream in base.functions.items():
            for args in hoped.inputs(stream, check_time):
                fact = (name, *args)
                if all(a in base.values for a in args):
                    base.cost(name, args)
                elif fact in hopes.costs:
                    hoped.costs[fact] = hopes.costs[fact]
                else:
                    bound = opt_costs.get(name)
                    hoped.costs[fact] = float(hoped._optimistic(name, args, bound)) if bound else 0.0
        hoped.costs |= base.costs
        return hoped

    def _hope_for(self, stream: Stream) -> Iterator[Call]:
        """New calls of a stream; their facts are added after the last."""
        real = self.real
        certified: dict[Fact, Call] = {}
        for inputs in self.each_input(stream, self.check_time):
            known = all(name in real.values for name in inputs)
            if known and not stream.fluents and real.exhausted(stream, inputs):
                continue
            if not self.wanted(self, stream, inputs):
                continue
            for copy in range(self.hopes.copies if stream.outputs else 1):
                key = (stream.name, inputs, copy)
                if key in self.hopes.calls:
                    continue
                if key in self.made:
                    continue
                if len(self.made) >= self.most:
                    raise TooManyCalls(self._too_many())
                outputs = self.hopes.outputs(stream, key)
                values = self._hoped_values(key, outputs)
                if values is None:
                    continue
                binding = dict(zip(stream.inputs + stream.outputs, inputs + outputs, strict=True))
                tests = [a for a in stream.domain if a.predicate in self.tests]
                facts = [(a.predicate, *bind(a, binding)) for a in tests]
                call = Call(stream, inputs, copy, outputs, tuple(f for f in facts if self.opinion(f) is None))
                self.made[key] = call
                self.call_of |= dict.fromkeys(outputs, call)
                self.values |= zip(outputs, values, strict=True)
                for atom in stream.certified:
                    certified.setdefault((atom.predicate, *bind(atom, binding)), call)
                yield call
        for fact, call in certified.items():
            if self.add(fact):
                self.maker[fact] = call

    def _too_many(self) -> str:
        (name, number), *_ = Counter(key[0] for key in self.made).most_common(1)
        return (
            f"more than {self.most} stream calls are possible, {number} of them calls of `{name}`: "
            f"narrow its `:domain` down, or try `incremental`, which assumes no calls"
        )

    def _optimistic(self, name: str, args: Args, function: Callable[..., Any]) -> Any:
        """What a user's optimistic function says of known values and placeholders. Raises InputError if it fails."""
        try:
            return function(*(self.values[arg] for arg in args))
        except Exception as error:
            raise failed(name, args, error) from error

    def _hoped_values(self, key: Key, outputs: Args) -> Outputs | None:
        """Values for the placeholders of a call: what its `opt_gen_fn` gives, None if it gives nothing."""
        function = self.opt_outputs.get(key[0])
        if function is None or not outputs:
            return tuple(map(Placeholder, outputs))
        if key not in self.hopes.values:
            rows = one_by_one(self._optimistic(key[0], key[1], lambda *values: list(islice(function(*values), 9))))
            self.hopes.values[key] = next(islice((row for row in rows if row), key[2], None), None)
        return self.hopes.values[key]

    def coarse_name(self, name: str) -> str:
        """What stands for a placeholder in a coarse view."""
        call = self.call_of.get(name)
        return name if call is None else coarse_outputs(call.stream)[call.outputs.index(name)]

    def opinion(self, fact: Fact) -> bool | None:
        """Whether a test fact is true as far as is known or given up, None if it may turn out either way."""
        predicate, *rest = fact
        args = tuple(rest)
        if args in self.relation(predicate):
            return True
        known = self.real.known(predicate, args)
        if known is not None:
            return known
        if (fact, True) in self.hopes.literals:
            return False
        if (fact, False) in self.hopes.literals:
            return True
        if fact not in self._opinions:
            self._opinions[fact] = None if self._meets_conditions(fact) else False
        return self._opinions[fact]

    def _meets_conditions(self, fact: Fact) -> bool:
        stream = self.tests[fact[0]]
        head = next(a.args for a in stream.certified if a.predicate == fact[0])
        binding = dict(zip(head, fact[1:], strict=True))
        if not all(self.truth(a.predicate, bind(a, binding)) for a in stream.domain):
            return False
        hope = self.opt_outputs.get(stream.name)
        inputs = tuple(binding[variable] for variable in stream.inputs)
        return hope is None or any(row != [] for row in self._optimistic(stream.name, inputs, hope))

    def truth(self, predicate: str, args: Args) -> bool:
        """Whether a fact is or may become true."""
        if args in self.relation(predicate):
            return True
        return predicate in self.tests and self.opinion((predicate, *args)) is not False

    def alike(self, literal: Literal) -> set[Literal]:
        """The outcome of a test and those that differ only in which samples of the same streams it is about."""
        fact, value = literal
        calls = {self.call_of[name].key: self.call_of[name] for name in fact[1:] if name in self.call_of}
        if len(calls) != 1:
            return {literal}
        call = calls.popitem()[1]
        others = {other.key: other for other in self.call_of.values() if self._origin(other) == self._origin(call)}
        renamings = [dict(zip(call.outputs, other.outputs, strict=True)) for other in others.values()]
        return {((fact[0], *(renaming.get(name, name) for name in fact[1:])), value) for renaming in renamings}

    def _origin(self, call: Call) -> tuple[str, tuple[str | None, ...]]:
        """The stream of a call and the inputs that no stream has made."""
        made = self.real.made_by
        return call.stream.name, tuple(None if n in made or n in self.call_of else n for n in call.inputs)

    def candidates(self, predicate: str) -> Iterator[Args]:
        """Arguments on which a test might be run."""
        stream = self.tests[predicate]
        head = next(atom for atom in stream.certified if atom.predicate == predicate)
        for inputs in self.inputs(stream, self.check_time):
            yield bind(head, dict(zip(stream.inputs, inputs, strict=True)))

    def _rows(self, atom: Atom, binding: Mapping[str, str]) -> list[Args]:
        pattern = tuple(binding.get(a) if a.startswith("?") else a for a in atom.args)
        rows = self.relation(atom.predicate).matches(pattern)
        if atom.predicate not in self.tests:
            return rows
        if None not in pattern:
            row = tuple(str(name) for name in pattern)
            return [row] if self.truth(atom.predicate, row) else []
        more = (
            row
            for row in self.candidates(atom.predicate)
            if all(p is None or p == v for p, v in zip(pattern, row, strict=True)) and self.truth(atom.predicate, row)
        )
        return list(dict.fromkeys([*rows, *more]))
