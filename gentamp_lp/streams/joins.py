"""Nested loops over tuples, put together from closures: variables are places in a list."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from typing import NamedTuple

from gentamp_lp.streams.relations import Args

Env = list[str]  # the value of each variable and constant of a query
Test = Callable[[Env], bool]
Loop = Callable[[Env], Iterator[None]]  # sets variables of the list, once for each solution


class Join(NamedTuple):
    """Rows that set variables at (position, slot) `places`, equal at `same` positions, and what is asked of each."""

    rows: Callable[[Env], Iterable[Args]]
    places: list[tuple[int, int]]
    same: list[tuple[int, int]]
    check: Test
    loop: Loop | None


def each(joins: list[Join]) -> Loop:
    """A loop over all solutions."""

    def run(env: Env) -> Iterator[None]:
        for rows, places, same, check, loop in joins:
            for row in rows(env):
                for position, slot in places:
                    env[slot] = row[position]
                if same and any(row[i] != row[j] for i, j in same):
                    continue
                if check(env):
                    if loop is None:
                        yield
                    else:
                        yield from loop(env)

    return run


def some(joins: list[Join]) -> Test:
    """Whether there is a solution, of joins without loops; sharing `each`'s loop costs up to a third more time."""
    if len(joins) > 1:
        one, others = some(joins[:1]), some(joins[1:])
        return lambda env: one(env) or others(env)
    [(rows, places, same, check, _)] = joins

    def found(env: Env) -> bool:
        for row in rows(env):
            for position, slot in places:
                env[slot] = row[position]
            if same and any(row[i] != row[j] for i, j in same):
                continue
            if check(env):
                return True
        return False

    return found


def all_of(tests: list[Test]) -> Test:
    """Whether all of the tests hold, tried in turn."""
    match tests:
        case []:
            return lambda _: True
        case [one]:
            return one
        case [one, two]:
            return lambda env: one(env) and two(env)
        case [one, two, *rest]:
            others = all_of(rest)
            return lambda env: one(env) and two(env) and others(env)
    raise AssertionError(tests)
