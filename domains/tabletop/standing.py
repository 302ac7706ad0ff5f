"""Where a robot stands to work at several supports at once: a place from which it reaches all of them."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Sequence
from functools import lru_cache
from itertools import islice

import numpy as np

from gentamp_lp.geometry.mobile import Mobile
from gentamp_lp.geometry.robots import Robot
from gentamp_lp.geometry.shapes import GAP, Shape, box
from gentamp_lp.geometry.transforms import Array, pose

from . import rooms

SPOTS = 12
"""Places of each area that are tried."""

LEAST, ENOUGH = 0.25, 0.8
"""Shares of them in reach: with less than the one an area counts as out of reach, the other is good enough."""

_PLACES = 12  # where a robot that drives might stand, of those that are clear of the tables
_DRAWS = 300  # places drawn to find these, or others to start from
_HEIGHT = 0.05  # of the cube that is grasped

Rectangle = tuple[rooms.Span, rooms.Span]
"""The x and y (m) of an area."""


@lru_cache
def stand(robot: Robot, areas: tuple[Rectangle, ...]) -> rooms.Base | None:
    """The place, of those in front of the first area, from which the least reached area is reached best.

    Reached is a spot where the robot grasps a small thing from the top, other things not considered. A fixed robot
    stands at the origin. None where no place is clear of the tables with `LEAST` of the spots of each area in reach.
    """
    best, most = None, LEAST
    for base in islice(clear_parkings(robot, areas, np.random.default_rng(0)), _PLACES):
        share = _reached(robot, base, areas, most)
        if share is not None:
            best, most = base, share
            if share >= ENOUGH:
                break
    return best


def starts(robot: Robot, areas: Sequence[Rectangle]) -> Iterator[rooms.Base]:
    """Where a robot may stand at first, in front of the first area: the preferred place, then others, nearest first."""
    clear = clear_parkings(robot, areas, np.random.default_rng(0))
    for first in islice(clear, 1):
        yield first
        if not robot.flies:
            yield from sorted(clear, key=lambda base: math.dist(base.place, first.place))


def clear_parkings(robot: Robot, areas: Sequence[Rectangle], rng: np.random.Generator) -> Iterator[rooms.Base]:
    """Places to stand in front of the first of areas, clear of the tables; the origin for a fixed robot."""
    if not robot.mobile:
        return iter([rooms.Base(np.zeros(3))])
    return (base for base in islice(parkings(robot, areas[0], areas, rng), _DRAWS) if base)


def parkings(
    robot: Robot, area: Rectangle, areas: Iterable[Rectangle], rng: np.random.Generator
) -> Iterator[rooms.Base | None]:
    """Places for a mobile robot in front of an area, without end; None for each one in the tables under the areas."""
    if not isinstance(robot, Mobile):
        return
    tables = obstacles(areas)
    for base in rooms.parking(robot, *area, rng):
        yield base if rooms.clear(robot, rooms.Way(base.place[None], robot.opening), tables) else None


def obstacles(areas: Iterable[Rectangle]) -> list[tuple[Shape, Array]]:
    """What robots that drive keep clear of: the tables under the areas, with space for what stands on them."""
    return [rooms.table(*area, rooms.LOADED) for area in areas]


def _reached(robot: Robot, base: rooms.Base, areas: tuple[Rectangle, ...], most: float) -> float | None:
    """The share of spots in reach, in the area where it is smallest; None as soon as it is below `most`."""
    rng = np.random.default_rng(1)
    thing = box(robot.opening / 2, robot.opening / 2, _HEIGHT)
    grasps = list(robot.grasps(thing))
    least = 1.0
    for x, y in areas:
        share = 1.0
        for spot in rng.uniform([x[0], y[0], -np.pi / 4], [x[1], y[1], np.pi / 4], (SPOTS, 3)):
            target = pose(spot[0], spot[1], GAP, spot[2])
            if not any(robot.reach_from(base.place, target @ g.tool, g.opening, rng) for g in grasps):
                share -= 1 / SPOTS
                if share < most:
                    return None
        least = min(least, share)
    return least
