"""One drawn world: what stands where, and what the robot reaches there."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from itertools import islice
from typing import Any

import numpy as np

from gentamp_lp.geometry.grasping import Grasp
from gentamp_lp.geometry.mobile import Mobile
from gentamp_lp.geometry.robots import Robot, Trajectory
from gentamp_lp.geometry.shapes import GAP, Shape
from gentamp_lp.geometry.transforms import Array, pose
from gentamp_lp.streams.facts import Fact
from gentamp_lp.tasks import domain_code

from . import rooms, standing
from .scene import Area, Span, Support

TRIES = 400
"""Draws of a place before an instance is called impossible."""


@dataclass(frozen=True, eq=False)
class Placement:
    """A value of sort pose: `transform` (4x4) of the object in `frame` ("world" or the name of a tray).

    `base` is the placement of the movable support it rests on, None on fixed supports and on trays.
    """

    frame: str
    transform: Array
    base: Placement | None = None


@dataclass(eq=False, kw_only=True)
class World(domain_code.World):
    """One drawn world: shapes, the robot, and the facts of the initial state (predicates lower-case).

    `grasps` are those of each thing, in the order to try; `approaches` has the trajectories of those grasps that the
    layout was made for, `reached` those by which a place was found to be within reach. `base` is where the robot stands
    at first; `tables` are solid tables of finite size with their poses, for mobile robots (a fixed one has a table
    without end). `avoided` has digests of reaches that the streams do not give.
    """

    static: list[Fact] = field(default_factory=list)
    fluents: list[Fact] = field(default_factory=list)
    values: dict[str, Any] = field(default_factory=dict)
    robot: Robot
    supports: Mapping[str, Support]
    shapes: dict[str, Shape] = field(default_factory=dict)
    grasps: dict[str, list[Grasp]] = field(default_factory=dict)
    approaches: dict[Grasp, Trajectory] = field(default_factory=dict)
    reached: dict[tuple[Placement, Grasp, rooms.Base], Trajectory] = field(default_factory=dict)
    cells: dict[str, tuple[int, float]] = field(default_factory=dict)
    base: rooms.Base = field(default_factory=lambda: rooms.Base(np.zeros(3)))

    @property
    def tables(self) -> list[tuple[Shape, Array]]:
        """The tables of a room."""
        return [rooms.table(*spans) for spans in spans(self.supports)] if self.robot.mobile else []

    def parkings(self, support: str, rng: np.random.Generator) -> Iterator[rooms.Base | None]:
        """Places for a mobile robot in front of a support, None for each one that is not free."""
        yield from standing.parkings(self.robot, self.supports[support].area.spans, spans(self.supports), rng)

    @property
    def obstacles(self) -> list[tuple[Shape, Array]]:
        """What drives keep clear of: the tables, with space for what stands on them."""
        return standing.obstacles(spans(self.supports))

    def fits(self, name: str, support: str, placement: Placement) -> bool:
        """Whether a thing stands wholly on a table of finite size."""
        if not self.robot.mobile:
            return True
        area = self.supports[support].area
        (x0, y0, _), (x1, y1, _) = self.shapes[name].bounds
        corners = placement.transform @ [[x0, x0, x1, x1], [y0, y1, y0, y1], [0.0] * 4, [1.0] * 4]
        return bool(
            all(
                low - rooms.EDGE <= value <= high + rooms.EDGE
                for (low, high), row in zip((area.x, area.y), corners[:2], strict=True)
                for value in row
            )
        )

    @property
    def start(self) -> dict[str, Placement]:
        """Initial placements."""
        return {fact[1]: self.values[fact[2]] for fact in self.fluents if fact[0] == "atpose"}


def spans(supports: Mapping[str, Support]) -> tuple[tuple[Span, Span], ...]:
    """The x and y of each support's area."""
    return tuple(support.area.spans for support in supports.values())


def uniform_placements(area: Area, rng: np.random.Generator, tries: int = TRIES) -> Iterator[Placement]:
    """Placements with their centre uniform in an area and any yaw."""
    for _ in range(tries):
        x, y, yaw = rng.uniform(*area.x), rng.uniform(*area.y), rng.uniform(-np.pi / 4, np.pi / 4)
        yield Placement("world", pose(x, y, GAP, yaw))


def reachable(world: World, name: str, placement: Placement, rng: np.random.Generator) -> bool:
    """Whether some grasp of the thing can be reached where it stands (other things not considered).

    A robot that drives must find it twice: it comes back, and then chance must not decide.
    """
    return _reached(world, name, placement, world.base, rng, times=1 + world.robot.mobile)


def serves(world: World, name: str, support: str, placement: Placement, rng: np.random.Generator) -> bool:
    """Whether an arm that drives reaches what stands in each cell of a tray, from the first place at the support."""
    if name not in world.cells or not isinstance(world.robot, Mobile) or world.robot.arm.flies:
        return True
    base = next((base for base in islice(world.parkings(support, rng), TRIES) if base), None)
    riders = [fact[1] for fact in world.static if fact[0] == "stackable" and fact[2] == name]
    cells = (Placement("world", placement.transform @ cell.transform) for cell in cell_placements(world, name))
    return base is not None and all(_reached(world, rider, cell, base, rng) for cell in cells for rider in riders[:1])


def cell_placements(world: World, support: str) -> Iterator[Placement]:
    """The cells of a tray, from the end away from its handle; each holds one thing."""
    cells, side = world.cells[support]
    interior = world.shapes[support].interior
    assert interior is not None
    for index in range(cells):
        yield Placement(support, pose((index - (cells - 1) / 2) * side, 0.0, interior[2] + GAP))


def _reached(
    world: World, name: str, placement: Placement, base: rooms.Base, rng: np.random.Generator, times: int = 1
) -> bool:
    """Whether inverse kinematics finds, so many times in a row, an approach for some grasp of a thing."""

    def reach(grasp: Grasp) -> bool:
        found = world.robot.reach_from(base.place, placement.transform @ grasp.tool, grasp.opening, rng)
        if found is not None:
            world.reached[placement, grasp, base] = found
        return found is not None

    return any(all(reach(grasp) for _ in range(times)) for grasp in world.grasps[name])
