"""Rooms for robots that drive: tables of finite size, places to stand in front of them, and ways between those."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from gentamp_lp.geometry.grasping import Grasp
from gentamp_lp.geometry.mobile import Mobile
from gentamp_lp.geometry.replay import ANGLE
from gentamp_lp.geometry.robots import Robot, Trajectory
from gentamp_lp.geometry.shapes import Shape, box
from gentamp_lp.geometry.transforms import Array, inverse, pose

EDGE = 0.05  # a table is so much wider, on each side, than the area for the centres of things
HEIGHT = 0.70  # of the table tops above the floor
LOADED = 0.15  # drives keep clear of the space up to this height over every table, whatever stands there
SLACK = 0.10  # the robot may stand so much farther from a table than it must

Span = tuple[float, float]


@dataclass(frozen=True, eq=False)
class Base:
    """A value of sort base: where the robot stands (x, y in m, yaw in rad)."""

    place: Array


@dataclass(frozen=True, eq=False)
class Way:
    """A value of sort way: the base poses (n, 3) of a drive and the finger distance (m) meanwhile."""

    path: Array
    opening: float

    def trajectory(self, robot: Robot) -> Trajectory:
        """The drive with the arm at home."""
        rest = np.broadcast_to(robot.home[3:], (len(self.path), len(robot.home) - 3))
        return Trajectory(np.hstack([self.path, rest]), self.opening)


def table(x: Span, y: Span, above: float = 0.0) -> tuple[Shape, Array]:
    """A solid table under an area for centres of things, and `above` (m) over it, with its pose."""
    shape = box(x[1] - x[0] + 2 * EDGE, y[1] - y[0] + 2 * EDGE, HEIGHT + above)
    return shape, pose((x[0] + x[1]) / 2, (y[0] + y[1]) / 2, -HEIGHT)


def parking(robot: Mobile, x: Span, y: Span, rng: np.random.Generator) -> Iterator[Base]:
    """Places to stand in front of an area: the middle of each side, the nearest to the origin first, then any.

    "Middle" is meant of the arm, which may be off the middle of the robot.
    """

    def at(side: int, along: float, distance: float) -> Base:
        yaw = side * math.pi / 2
        half = ((x[1] - x[0]) / 2, (y[1] - y[0]) / 2)
        deep, wide = half if side % 2 == 0 else half[::-1]
        centre = pose((x[0] + x[1]) / 2, (y[0] + y[1]) / 2, 0.0, yaw)
        across = min(max(along * wide - robot.aside, -wide), wide)
        x0, y0 = (centre @ [-deep - distance, across, 0.0, 1.0])[:2]
        return Base(np.array([x0, y0, math.remainder(yaw, 2 * math.pi)]))

    middles = [at(side, 0.0, robot.stance) for side in range(4)]
    yield from sorted(middles, key=lambda base: round(math.hypot(*base.place[:2]), 6))
    while True:
        yield at(int(rng.integers(4)), rng.uniform(-1, 1), robot.stance + rng.uniform(0, SLACK))


def distance(place: Array, x: Span, y: Span) -> float:
    """How far (m) a base is from an area."""
    return math.hypot(*(max(low - v, v - high, 0.0) for v, (low, high) in zip(place, (x, y), strict=False)))


def clear(
    robot: Robot,
    way: Way,
    tables: Sequence[tuple[Shape, Array]],
    held: Shape | None = None,
    grasp: Grasp | None = None,
) -> bool:
    """Whether the robot drives a way clear of tables, and holds what it carries level and clear of itself."""
    path = way.trajectory(robot)
    if held is not None and grasp is not None:
        start = robot.tool(path.configurations[0]) @ inverse(grasp.tool)
        still = Trajectory(path.configurations[:1], path.opening)
        if start[2, 2] < math.cos(ANGLE) or robot.swept(still).hits(held, start):
            return False
    swept = robot.swept(path, held, grasp)
    return not any(swept.hits(shape, where) for shape, where in tables)
