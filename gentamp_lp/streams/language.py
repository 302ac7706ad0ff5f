"""The values a user of the engine writes: problems, actions, and wrappers for Python samplers.

Names and meaning follow PDDLStream (Garrett, Lozano-Pérez, Kaelbling: PDDLStream, ICAPS 2020), so that a
problem written for it runs here after changing its imports.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

Outputs = tuple[Any, ...]
#: A stream's Python side: called on input values, it yields tuples of output values. An empty tuple is a
#: success without outputs for a test, and a failed attempt for a generator; None entries are failed attempts.
Generator = Callable[..., Iterable[Outputs]]


class PDDLProblem(NamedTuple):
    """A problem: two PDDL texts, values for constants and streams, initial facts and a goal.

    `init` and `goal` are tuples such as `("AtPose", block, pose)`; arguments may be any Python values.
    """

    domain_pddl: str
    constant_map: Mapping[str, Any]
    stream_pddl: str
    stream_map: Mapping[str, Generator]
    init: Sequence[tuple[Any, ...]]
    goal: Any


class Action(NamedTuple):
    """One step of a plan."""

    name: str
    args: tuple[Any, ...]


class Solution(NamedTuple):
    """What `solve` returns: the plan (None when there is none), its length, and the facts it rests on."""

    plan: list[Action] | None
    cost: float
    certificate: list[tuple[Any, ...]]


@dataclass(frozen=True)
class _Test:
    test: Callable[..., bool]

    def __call__(self, *inputs: Any) -> Iterator[Outputs]:
        if self.test(*inputs):
            yield ()


def from_test(test: Callable[..., bool]) -> Generator:
    """A test stream from a Boolean function."""
    return _Test(test)


def negate_test(test: Callable[..., bool]) -> Callable[..., bool]:
    """The opposite of a Boolean function."""
    return lambda *inputs: not test(*inputs)


def from_fn(function: Callable[..., Outputs | None]) -> Generator:
    """A stream that gives at most one tuple; None is a failure."""

    def generate(*inputs: Any) -> Iterator[Outputs]:
        outputs = function(*inputs)
        if outputs is not None:
            yield outputs

    return generate


def from_gen_fn(function: Callable[..., Iterable[Outputs | None]]) -> Generator:
    """A stream from a generator function; None entries are failed attempts."""

    def generate(*inputs: Any) -> Iterator[Outputs]:
        for outputs in function(*inputs):
            yield () if outputs is None else outputs

    return generate


def from_list_fn(function: Callable[..., Iterable[Outputs]]) -> Generator:
    """A stream from a function that returns a list of tuples."""
    return lambda *inputs: iter(function(*inputs))


def from_constant(constant: Outputs) -> Generator:
    """A stream that always gives the same tuple."""
    return from_fn(lambda *_: constant)
