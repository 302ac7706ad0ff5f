"""What a robot moves among, and what of it the robot or its load touches in a configuration (FCL)."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import fcl
import numpy as np

from gentamp_lp.geometry.collision import Geometry, at, geometry
from gentamp_lp.geometry.replay import TABLE
from gentamp_lp.geometry.robots import Robot
from gentamp_lp.geometry.shapes import Shape
from gentamp_lp.geometry.transforms import Array, inverse

Placed = Mapping[str, tuple[Shape, Array]]
"""Shapes with 4×4 poses."""

_REQUEST = fcl.CollisionRequest(num_max_contacts=1)


class Surroundings:
    """Tables and things that stand still around a robot whose fingers are `opening` (m) apart.

    `load` is what the hand carries, with poses in the tool frame, those of the others are in the world. Links that
    belong to the base may touch the tables.
    """

    def __init__(
        self, robot: Robot, opening: float, tables: Sequence[tuple[Shape, Array]], things: Placed, load: Placed
    ) -> None:
        self.robot = robot
        self.opening = opening
        carried = [(name, part, where) for name, (shape, where) in load.items() for part in shape.parts]
        standing = [*((TABLE, table) for table in tables), *things.items()]
        parts = [(name, part, where @ part.pose) for name, (shape, where) in standing for part in shape.parts]
        self._names = [f"the robot's {link.name}" for link in robot.links] + [
            f"the held {name}" for name, *_ in carried
        ]
        self._geometries: list[Geometry] = [link.geometry for link in robot.links]
        self._geometries += [geometry(part) for _, part, _ in carried]
        self._offsets = np.array([where @ part.pose for _, part, where in carried]).reshape(-1, 4, 4)
        halves = [np.linalg.norm(_half(part.size)) for _, part, _ in carried]
        self._centres = np.array([link.centre for link in robot.links] + [np.zeros(3)] * len(carried))
        self._radii = np.array([link.radius for link in robot.links] + halves)
        self._obstacles = [name for name, *_ in parts]
        self._placed = [at(geometry(part), where) for _, part, where in parts]
        self._inverses = np.array([inverse(where) for *_, where in parts]).reshape(-1, 4, 4)
        self._halves = np.array([_half(part.size) for _, part, _ in parts]).reshape(-1, 3)
        solid = np.array([name == TABLE for name in self._obstacles], dtype=bool)
        mounted = np.array([link in robot.mounted for link in range(len(self._names))])
        self._counts = ~(mounted[:, None] & solid)
        self._others = np.array(sorted(set(range(len(robot.links))) - set(robot.hand)), dtype=int)

    def first_contact(self, configurations: Array) -> tuple[int, str] | None:
        """Return the first of configurations (n, dof) that is not free, and what is wrong there, or None."""
        fault = self.robot.fault(configurations, self.opening)
        contact = self._contact(configurations[: fault[0]] if fault else configurations)
        return contact or fault

    def _contact(self, configurations: Array) -> tuple[int, str] | None:
        frames = self.robot.frames(configurations, self.opening)
        tools = self.robot.tools(configurations)
        frames = np.concatenate([frames, tools[:, None] @ self._offsets], axis=1)
        centres = np.einsum("nlij,lj->nli", frames[..., :3, :3], self._centres) + frames[..., :3, 3]
        found = [self._with_things(frames, centres), self._with_robot(frames, centres)]
        return min((contact for contact in found if contact), default=None)

    def _with_things(self, frames: Array, centres: Array) -> tuple[int, str] | None:
        """Look at what is near a thing: bounding spheres against the boxes around the parts."""
        seen = np.einsum("oij,nlj->nloi", self._inverses[:, :3, :3], centres) + self._inverses[:, :3, 3]
        beyond = np.maximum(np.abs(seen) - self._halves, 0.0)
        near = ((beyond * beyond).sum(axis=-1) < (self._radii**2)[:, None]) & self._counts
        for step, moving, thing in np.argwhere(near):
            body = at(self._geometries[moving], frames[step, moving])
            if fcl.collide(body, self._placed[thing], _REQUEST, fcl.CollisionResult()):
                return int(step), f"{self._names[moving]} touches {self._obstacles[thing]}"
        return None

    def _with_robot(self, frames: Array, centres: Array) -> tuple[int, str] | None:
        """Look at the load near links other than the hand, with which it moves."""
        first = len(self.robot.links)
        apart = centres[:, first:, None] - centres[:, None, self._others]
        reach = self._radii[first:, None] + self._radii[self._others]
        for step, part, link in np.argwhere((apart * apart).sum(axis=-1) < reach * reach):
            indices = first + part, self._others[link]
            pair = [at(self._geometries[i], frames[step, i]) for i in indices]
            if fcl.collide(*pair, _REQUEST, fcl.CollisionResult()):
                return int(step), f"{self._names[indices[0]]} touches {self._names[indices[1]]}"
        return None


def _half(size: tuple[float, ...]) -> Array:
    """Half the lengths of the box around a part: a cylinder's size is radius and height."""
    return np.array([size[0], size[0], size[1] / 2] if len(size) == 2 else [length / 2 for length in size])
