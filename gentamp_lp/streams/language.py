"""The Python side of the PDDLStream language: problems, solutions, formulas, and wrappers that make streams.

Names and meaning follow PDDLStream (Garrett, Lozano-Pérez, Kaelbling, ICAPS 2020), so that problems written for it run
here with other imports.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import count
from typing import Any, NamedTuple

INF = float("inf")
#: Values of `stream_map`: every stream gives a symbol, every test is passed.
DEBUG, SHARED_DEBUG = "debug", "shared_debug"
TOTAL_COST = "total-cost"

Outputs = tuple[Any, ...]
#: A stream's Python side: called on input values, it yields tuples of output values. An empty tuple is a
#: success without outputs for a test, and a failed attempt for a generator; None entries are failed attempts.
Generator = Callable[..., Iterable[Any]]


class PDDLProblem(NamedTuple):
    """A problem: the two files' texts, what constants and streams are in Python, initial facts, and the goal."""

    domain_pddl: str
    constant_map: Mapping[str, Any]
    stream_pddl: str | Sequence[str] | None
    stream_map: Mapping[str, Any] | str
    init: Iterable[Any]
    goal: Any


class Action(NamedTuple):
    """A step of a plan; `args` are Python values."""

    name: str
    args: tuple[Any, ...]


class Certificate(NamedTuple):
    """Why a plan is one: all facts known at the end, and those about what the plan uses."""

    all_facts: list[tuple[Any, ...]]
    preimage_facts: list[tuple[Any, ...]] | None


class Solution(NamedTuple):
    """A plan (None without one), its cost (infinite without one), and its certificate."""

    plan: list[Action] | None
    cost: float
    certificate: Certificate


@dataclass(frozen=True)
class WildOutput:
    """What a stream may yield instead of a tuple: tuples of outputs, and additional static facts."""

    values: Sequence[Outputs] = ()
    facts: Sequence[tuple[Any, ...]] = ()


@dataclass(frozen=True)
class _Test:
    test: Callable[..., bool]

    def __call__(self, *inputs: Any, **more: Any) -> Iterator[Outputs]:
        if self.test(*inputs, **more):
            yield ()


def from_test(test: Callable[..., bool]) -> Generator:
    """A test stream from a Boolean function."""
    return _Test(test)


def decision(generator: Generator, values: Sequence[Any]) -> Outputs | WildOutput | None:
    """The first that a test stream gives: None where it fails."""
    if isinstance(generator, _Test):  # as the generator would, without making one
        return () if generator.test(*values) else None
    return next(iter(generator(*values)), None)


def negate_test(test: Callable[..., bool]) -> Callable[..., bool]:
    """The opposite of a Boolean function."""
    return lambda *inputs, **more: not test(*inputs, **more)


def universe_test(*_: Any, **__: Any) -> bool:
    """Always true."""
    return True


def empty_test(*_: Any, **__: Any) -> bool:
    """Always false."""
    return False


def from_fn(function: Callable[..., Any]) -> Generator:
    """A stream that gives at most one tuple; None is a failure."""

    def generate(*inputs: Any, **more: Any) -> Iterator[Any]:
        outputs = function(*inputs, **more)
        if outputs is not None:
            yield outputs if isinstance(outputs, WildOutput) else tuple(outputs)

    return generate


def from_gen_fn(function: Callable[..., Iterable[Any]]) -> Generator:
    """A stream from a generator function; None entries are failed attempts."""

    def generate(*inputs: Any, **more: Any) -> Iterator[Any]:
        for outputs in function(*inputs, **more):
            yield () if outputs is None else outputs if isinstance(outputs, WildOutput) else tuple(outputs)

    return generate


def from_list_gen_fn(function: Callable[..., Iterable[Any]]) -> Generator:
    """A stream from a generator function that yields lists of tuples (or WildOutput)."""
    return lambda *inputs, **more: one_by_one(function(*inputs, **more))


def one_by_one(batches: Iterable[Any]) -> Iterator[Any]:
    """The tuples of batches: lists and wild outputs are taken apart, an empty list is a failed attempt."""
    for batch in batches:
        if isinstance(batch, WildOutput):
            yield from split_wild(batch)
        elif isinstance(batch, list):
            yield from batch or [None]
        else:
            yield batch


def split_wild(batch: WildOutput) -> Iterator[WildOutput]:
    """One wild output for each of its tuples; the facts come with the first."""
    yield WildOutput(batch.values[:1], batch.facts)
    for outputs in batch.values[1:]:
        yield WildOutput([outputs])


def from_sampler(sampler: Callable[..., Outputs | None], max_attempts: float = INF) -> Generator:
    """A stream that calls a sampler again and again."""

    def generate(*inputs: Any, **more: Any) -> Iterator[Outputs | None]:
        attempts = 0
        while attempts < max_attempts:
            attempts += 1
            yield sampler(*inputs, **more)

    return from_gen_fn(generate)


def from_list_fn(function: Callable[..., Iterable[Outputs] | WildOutput]) -> Generator:
    """A stream from a function that returns a list of tuples (or a WildOutput)."""

    def generate(*inputs: Any, **more: Any) -> Iterator[Any]:
        batch = function(*inputs, **more)
        yield from split_wild(batch) if isinstance(batch, WildOutput) else map(tuple, batch)

    return generate


def from_constant(constant: Outputs) -> Generator:
    """A stream that always gives the same tuple."""
    return from_fn(fn_from_constant(constant))


def fn_from_constant(constant: Any) -> Callable[..., Any]:
    """A function that always returns the same."""
    return lambda *_, **__: constant


def from_gen(rows: Iterable[Outputs]) -> Generator:
    """A stream that gives these tuples, which may be endless, whatever the inputs are."""
    rest, kept = iter(rows), list[Outputs]()

    def replay(*_: Any, **__: Any) -> Iterator[Outputs]:
        for number in count():
            if number == len(kept):
                try:
                    kept.append(next(rest))
                except StopIteration:
                    return
            yield kept[number]

    return from_gen_fn(replay)


def empty_gen() -> Generator:
    """A stream that gives nothing."""
    return from_gen([])


@dataclass(frozen=True)
class PartialInputs:
    """Accepted for compatibility: which inputs optimistic outputs depend on. Here they depend on all."""

    inputs: str = ""
    unique: bool = False
    test: Callable[..., bool] = universe_test


@dataclass(frozen=True)
class ExternalInfo:
    """Hints about a stream. Only `eager` changes what this engine does; the others are accepted and not needed."""

    eager: bool = False
    eager_skeleton: bool = False
    defer_fn: Any = None
    p_success: Any = None
    overhead: Any = None
    effort: Any = None
    estimate: bool = False
    verbose: bool = True


@dataclass(frozen=True)
class StreamInfo(ExternalInfo):
    """Hints about a stream: `eager` tests are run before planning; `contextual` generators see what already stands.

    A contextual generator is called with the keyword argument `context`: a list of (inputs, outputs) that other calls
    of the same stream have in the plan being completed. It should then give outputs that go with them.
    """

    opt_gen_fn: Any = None
    negate: bool = False
    simultaneous: bool = False
    contextual: bool = False


@dataclass(frozen=True)
class FunctionInfo(ExternalInfo):
    """Hints about a function: `opt_fn` is a lower bound of the cost of values not sampled yet (0 if not given)."""

    opt_fn: Callable[..., float] | None = None


@dataclass(frozen=True)
class PredicateInfo(ExternalInfo):
    """Hints about a predicate."""

    opt_fn: Any = None


def Output(*values: Any) -> Outputs:
    """A tuple of output values."""
    return values


def Fact(predicate: str, args: Iterable[Any]) -> tuple[Any, ...]:
    """A fact as a tuple."""
    return (predicate, *args)


def And(*parts: Any) -> Any:
    """Conjunction."""
    return parts[0] if len(parts) == 1 else ("and", *parts)


def Or(*parts: Any) -> Any:
    """Disjunction."""
    return parts[0] if len(parts) == 1 else ("or", *parts)


def Not(part: Any) -> Any:
    """Negation."""
    return ("not", part)


def Imply(premise: Any, conclusion: Any) -> Any:
    """Implication."""
    return ("imply", premise, conclusion)


def Equal(left: Any, right: Any) -> Any:
    """Equality of two objects, or the value of a function."""
    return ("=", left, right)


def Exists(variables: Sequence[Any], part: Any) -> Any:
    """There are values of the variables (strings that begin with `?`)."""
    return ("exists", variables, part)


def ForAll(variables: Sequence[Any], part: Any) -> Any:
    """For all values of the variables (strings that begin with `?`)."""
    return ("forall", variables, part)


Forall = ForAll


def Type(parameter: str, kind: str) -> Any:
    """A typed variable of a quantifier."""
    return (parameter, "-", kind)


def Minimize(expression: Any) -> Any:
    """Accepted in the initial facts; total cost is what plans are measured by."""
    return ("minimize", expression)


def print_solution(solution: Solution) -> None:
    """Print a solution as PDDLStream does, and why there is none."""
    plan, cost, certificate = solution
    lines = [f"Solved: {plan is not None}", f"Cost: {cost:.3f}", f"Length: {len(plan) if plan is not None else INF}"]
    lines += [f"Evaluations: {len(certificate.all_facts)}"]
    lines += [f"{n:2}) {a.name} {' '.join(map(str, a.args))}" for n, a in enumerate(plan or (), 1)]
    report = getattr(solution, "report", None)  # what our `solve` returns has one
    lines += [str(report)] if plan is None and report else []
    print("\n".join(lines))  # noqa: T201
