"""What a robot can do: grasp, reach a tool pose along a straight approach, sweep a volume."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import ClassVar

import fcl
import numpy as np

from gentamp_lp.geometry.collision import Swept, at, placed
from gentamp_lp.geometry.description import Description
from gentamp_lp.geometry.grasping import Approach, Grasp, grasps
from gentamp_lp.geometry.links import Body, Link
from gentamp_lp.geometry.shapes import Shape
from gentamp_lp.geometry.transforms import Array, Bools, inverse

__all__ = ["STANDOFF", "STEPS", "Approach", "Grasp", "Robot", "Trajectory"]

STANDOFF = 0.10
"""Length (m) of the straight approach."""

STEPS = 10
"""Steps of an approach: every 1 cm, so that joint motions between two of them stay close to the straight line."""


@dataclass(frozen=True, eq=False)
class Trajectory:
    """A straight approach: configurations (n, dof) from `STANDOFF` before the tool pose to that pose.

    `opening` is the finger distance (m) throughout.
    """

    configurations: Array
    opening: float


class Robot(ABC):
    """A robot with a parallel gripper whose base stands at the world's origin, flush with the table.

    Subclasses set the attributes: `name`; `opening`, the largest finger distance (m); `home`, a configuration
    (dof,); `links`; `flies`, whether it gets everywhere; `mounted`, the positions of links that may touch the table
    (they belong to the base); `fingers`, the names of the links that touch what is held; `description`, unless it is
    a hand only.
    """

    mobile: ClassVar[bool] = False
    """Whether the first three numbers of a configuration are the base's x, y, yaw."""

    name: str
    opening: float
    home: Array
    links: tuple[Link, ...]
    flies: bool = False
    mounted: frozenset[int] = frozenset()
    fingers: tuple[str, ...] = ("left_finger", "right_finger")
    description: Description | None = None

    def enlarged(self, factor: float) -> Robot:
        """Return the robot for a world stretched by `factor`: a hand that flies reaches so many times as far."""
        return self

    def close(self) -> None:  # noqa: B027 (most robots hold nothing)
        """Free what the robot holds."""

    # kinematics

    @abstractmethod
    def tools(self, configurations: Array) -> Array:
        """Return the tool poses (n, 4, 4) of configurations (n, dof)."""

    @abstractmethod
    def frames(self, configurations: Array, opening: float) -> Array:
        """Return the poses (n, number of links, 4, 4) of all links."""

    @abstractmethod
    def reach(self, tool_pose: Array, opening: float, rng: np.random.Generator) -> Trajectory | None:
        """Return an approach that ends with the tool at `tool_pose` (4×4), or None when none was found.

        The end is exact within 1 mm and 1 degree; every configuration keeps the joint limits and is free of
        collision with the robot itself and with the table. Other objects are not considered: see `swept`.
        """

    def reach_from(self, base: Array, tool_pose: Array, opening: float, rng: np.random.Generator) -> Trajectory | None:
        """Return an approach with the base at x, y, yaw (3,), as `reach` does; a fixed robot stays where it is."""
        return self.reach(tool_pose, opening, rng)

    def tool(self, configuration: Array) -> Array:
        """Return the tool pose (4×4) of a configuration (dof,)."""
        return np.asarray(self.tools(np.asarray(configuration)[None])[0])

    def standing(self, base: Array | None) -> Array:
        """Return the configuration (dof,) at rest; a mobile robot's base is at x, y, yaw (3,) if these are given."""
        configuration = np.array(self.home)
        if self.mobile and base is not None:
            configuration[:3] = base
        return configuration

    def between(self, first: Array, second: Array, count: int) -> Array:
        """Return `count` configurations (count, dof) evenly spaced after `first` and before `second`."""
        share = np.arange(1, count + 1)[:, None] / (count + 1)
        return np.asarray(first + share * (second - first))

    # motions in free space

    @abstractmethod
    def near(self, configurations: Array, tools: Array) -> tuple[Array, Bools]:
        """Return configurations (n, dof) near the given ones with the tools at 4×4 poses (n, 4, 4), and which do it."""

    def alike(self, first: Array, second: Array) -> Array:
        """Return `second` in the form nearest to `first`, of those that stand for the same configuration (dof,)."""
        return second

    @abstractmethod
    def anywhere(self, first: Array, last: Array, rng: np.random.Generator) -> Array:
        """Return a random configuration (dof,) to make a detour by; the base of a mobile robot stays at `first`."""

    def fault(self, configurations: Array, opening: float) -> tuple[int, str] | None:
        """Return the first of configurations (n, dof) that is impossible even in an empty room, and why, or None."""
        low = np.flatnonzero(self.heights(self.frames(configurations, opening)) <= 0)
        return (int(low[0]), "the robot touches the table") if len(low) else None

    # grasping

    def grasps(self, shape: Shape, approach: Approach = "top") -> Iterator[Grasp]:
        """Yield the grasps of a shape that fit the gripper, always in the same order."""
        found = grasps(shape, self.opening, approach)
        return (grasp for grasp in found if self._clear_of(shape, grasp)) if shape.meshed else found

    @property
    def hand(self) -> Sequence[int]:
        """Positions of the links that move with the tool."""
        return range(len(self.links))

    def _clear_of(self, shape: Shape, grasp: Grasp) -> bool:
        """Whether the hand comes straight to a grasp without touching the shape (whose frame is the world's)."""
        tool = self.tool(self.home)
        frames = grasp.tool @ inverse(tool) @ self.frames(self.home[None], grasp.opening)[0, list(self.hand)]
        steps = -np.linspace(0.0, STANDOFF, STEPS + 1)[:, None] * grasp.tool[:3, 2]
        links = [
            fcl.CollisionObject(self.links[link].geometry, fcl.Transform(frame[:3, :3], frame[:3, 3] + step))
            for link, frame in zip(self.hand, frames, strict=True)
            for step in steps
        ]
        return not Swept(links).hits(shape, np.eye(4))

    # volumes

    def bodies(self, configuration: Array, opening: float) -> list[Body]:
        """Return all links with their poses."""
        frames = self.frames(np.asarray(configuration)[None], opening)[0]
        return [Body(link, frame) for link, frame in zip(self.links, frames, strict=True)]

    def swept(self, trajectory: Trajectory, held: Shape | None = None, grasp: Grasp | None = None) -> Swept:
        """Return all that the robot occupies along a trajectory, and the held object with it.

        The held object moves with the tool all the way, so the same volume serves picking (backwards) and
        placing. Callers leave the grasped object itself out of their queries, and need not ask about the
        table: `reach` did. Raises ValueError for `held` without `grasp`.
        """
        frames = self.frames(trajectory.configurations, trajectory.opening)
        still = np.zeros(frames.shape[:2], dtype=bool)
        still[1:] = (frames[1:] == frames[:-1]).all(axis=(2, 3))
        solid = [at(self.links[link].geometry, frames[step, link]) for step, link in np.argwhere(~still)]
        centres = np.concatenate(
            [
                f[:, :3, :3] @ link.centre + f[:, :3, 3]
                for link, f in zip(self.links, frames.swapaxes(0, 1), strict=True)
            ]
        )
        radii = np.repeat([link.radius for link in self.links], len(frames))
        if held is None:
            return Swept(solid, (), (centres, radii))
        if grasp is None:
            raise ValueError("a held object needs a grasp")
        space = []
        poses = self.tools(trajectory.configurations) @ inverse(grasp.tool)
        for pose in poses:
            solid.extend(placed(part, pose) for part in held.parts)
            if held.envelope is not None:
                space.append(placed(held.envelope, pose))
        centres = np.concatenate([centres, poses[:, :3, 3]])
        radii = np.concatenate([radii, np.full(len(poses), held.radius)])
        return Swept(solid, space, (centres, radii))

    def above_table(self, frames: Array) -> bool:
        """Tell whether all moving links, posed by `frames` (n, links, 4, 4), stay above the table."""
        return all(heights.min() > 0 for heights in self._heights(frames))

    def heights(self, frames: Array) -> Array:
        """Return how high (m) the lowest point of the moving links is, posed by `frames` (n, links, 4, 4)."""
        return np.asarray(np.min(list(self._heights(frames)), axis=0))

    def _heights(self, frames: Array) -> Iterator[Array]:
        for index in range(len(self.links)):
            if index not in self.mounted:
                rows = frames[:, index, 2]
                yield (rows[:, :3] @ self.links[index].vertices.T).min(axis=1) + rows[:, 3]
