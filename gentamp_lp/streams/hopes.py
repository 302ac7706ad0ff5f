"""What optimism hopes for: stream calls not made yet, with placeholders for their outputs, and test outcomes.

`Hopes` remembers what has been given up, because streams and tests disappointed it, and how far hope reaches.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from itertools import count

from gentamp_lp.streams.facts import Fact
from gentamp_lp.streams.formula import And, Atom, Exists, Formula, Not
from gentamp_lp.streams.language import Outputs
from gentamp_lp.streams.pddl import Axiom, Domain
from gentamp_lp.streams.relations import Args
from gentamp_lp.streams.stream_file import Stream

Literal = tuple[Fact, bool]
Key = tuple[str, Args, int]


@dataclass(frozen=True)
class Placeholder:
    """Stands for a value that is not sampled yet, where a cost is to be bounded."""

    name: str


@dataclass(frozen=True)
class Call:
    """A stream call not made yet; `outputs` are placeholders, `requires` tests that its inputs have to pass."""

    stream: Stream
    inputs: Args
    copy: int
    outputs: Args
    requires: tuple[Fact, ...] = ()

    @property
    def key(self) -> Key:
        """What identifies the call."""
        return self.stream.name, self.inputs, self.copy


@dataclass(frozen=True)
class StateFailure:
    """A fact that a stream with `:fluents` could not certify in a state with these facts of the `fluents`.

    `exact`: in states with no others; else in states with more of them, too. `true`: a test certified it, which was not
    wished for.
    """

    fact: Fact
    situation: frozenset[Fact]
    fluents: tuple[str, ...]
    exact: bool
    true: bool = False

    def axiom(self, domain: Domain) -> Axiom:
        """The rule by which a planner knows the failure again."""
        variables = tuple(f"?x{i}" for i in range(len(self.fact) - 1))
        conditions: list[Formula] = [Atom("=", (v, a)) for v, a in zip(variables, self.fact[1:], strict=True)]
        conditions += [Atom(f[0], f[1:]) for f in sorted(self.situation)]
        for fluent in self.fluents if self.exact else ():
            others = tuple(f"?y{i}" for i in range(domain.predicates[fluent].arity))
            same = [
                And(tuple(Atom("=", (v, a)) for v, a in zip(others, f[1:], strict=True)))
                for f in sorted(self.situation)
                if f[0] == fluent
            ]
            conditions.append(Not(Exists(others, And((Atom(fluent, others), *map(Not, same))))))
        head = f"certain-{self.fact[0]}" if self.true else f"given-up-{self.fact[0]}"
        return Axiom(Atom(head, variables), And(tuple(conditions)))

    def names(self) -> set[str]:
        """All entities it is about."""
        return {a for f in (self.fact, *self.situation) for a in f[1:]}


@dataclass
class Hopes:
    """What optimism has been given up for now, and how far it reaches."""

    literals: set[Literal] = field(default_factory=set)
    costs: dict[Fact, float] = field(default_factory=dict)  # what functions of placeholders turned out to be
    calls: set[tuple[str, Args, int]] = field(default_factory=set)
    in_state: list[StateFailure] = field(default_factory=list)
    hidden: set[str] = field(default_factory=set)  # sampled, but not shown to the planner
    copies: int = 1
    depth: int = 1
    names: dict[Key, Args] = field(default_factory=dict)
    values: dict[Key, Outputs | None] = field(default_factory=dict)  # what `opt_gen_fn` gave
    counter: Iterator[int] = field(default_factory=lambda: count(1))
    coarse: bool = False  # the calls of a stream share their placeholders

    def outputs(self, stream: Stream, key: Key) -> Args:
        """The placeholders of a call."""
        if self.coarse:
            return coarse_outputs(stream)
        if key not in self.names:
            self.names[key] = tuple(f"{v[1:]}-opt{next(self.counter)}" for v in stream.outputs)
        return self.names[key]

    def clear(self) -> bool:
        """Hope for everything again; False when nothing had been given up."""
        exact = [failure for failure in self.in_state if failure.exact]
        given_up = bool(self.literals or self.calls or self.costs or len(exact) < len(self.in_state))
        self.literals.clear()
        self.costs.clear()
        self.calls.clear()
        self.in_state = exact
        return given_up


def coarse_outputs(stream: Stream) -> Args:
    """The placeholders that all calls of a stream share in a coarse view."""
    return tuple(f"{v[1:]}-any-{stream.name}" for v in stream.outputs)
