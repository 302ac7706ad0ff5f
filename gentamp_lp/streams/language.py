"""Wrappers that make streams of Python functions.

Names and meaning follow PDDLStream (Garrett, Lozano-Pérez, Kaelbling, ICAPS 2020), so that samplers written for it
can be used here.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from typing import Any

Outputs = tuple[Any, ...]
#: A stream's Python side: called on input values, it yields tuples of output values. An empty tuple is a
#: success without outputs for a test, and a failed attempt for a generator; None entries are failed attempts.
Generator = Callable[..., Iterable[Outputs]]


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
