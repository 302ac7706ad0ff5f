"""The Python code behind streams: what it gave, how often it was called, how long it ran."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, field
from typing import Any

from gentamp_lp.errors import GentampError, code_fault
from gentamp_lp.streams.language import Generator
from gentamp_lp.streams.relations import Args, picked
from gentamp_lp.streams.stream_file import Stream


@dataclass
class StreamStatistics:
    """How often a stream was called, how often it gave something, and the seconds it took."""

    calls: int = 0
    successes: int = 0
    seconds: float = 0.0


@dataclass
class Source:
    """One stream on one tuple of inputs."""

    rows: Iterator[Any]
    drawn: int = 0
    exhausted: bool = False
    outputs: list[Args] = field(default_factory=list)


@dataclass(frozen=True)
class DecidingStream:
    """A test stream as seen from a predicate it decides: how the others' arguments are taken from its own."""

    stream: str
    pattern: Args
    plain: bool  # whether the pattern has different variables only, so that all arguments match it
    inputs: Callable[[Args], Args]
    domain: tuple[tuple[str, Callable[[Args], Args]], ...]
    certified: tuple[tuple[str, Callable[[Args], Args]], ...]

    @classmethod
    def of(cls, stream: Stream, pattern: Args) -> DecidingStream:
        """The stream of which one certified fact has the arguments of this pattern."""

        def taken(names: Args) -> Callable[[Args], Args]:
            if not all(name in pattern for name in names):  # constants
                return lambda args: tuple(args[pattern.index(n)] if n in pattern else n for n in names)
            return picked(pattern.index(name) for name in names)

        plain = len(set(pattern)) == len(pattern) and all(arg.startswith("?") for arg in pattern)
        domain = tuple((atom.predicate, taken(atom.args)) for atom in stream.domain)
        certified = tuple((atom.predicate, taken(atom.args)) for atom in stream.certified)
        return cls(stream.name, pattern, plain, taken(stream.inputs), domain, certified)


def failed(stream: str, inputs: Iterable[str], error: Exception) -> GentampError:
    """What to raise when the Python code behind a stream raises: where it did, and on which inputs."""
    if isinstance(error, GentampError):
        return error
    return code_fault(f"stream `{stream}` failed on ({', '.join(inputs)})", error)


def rows_of(generator: Generator, values: Iterable[Any]) -> Iterator[Any]:
    """What a generator gives, called when the first row is asked for."""
    yield from generator(*values)
