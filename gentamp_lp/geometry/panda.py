"""The Franka Panda that comes with PyBullet, mounted at the origin, flush with the table."""

from __future__ import annotations

import math
import xml.etree.ElementTree as ET
from functools import lru_cache
from pathlib import Path
from typing import Any

import fcl
import numpy as np

from gentamp_lp.geometry.assets import data_path
from gentamp_lp.geometry.bullet import Bullet
from gentamp_lp.geometry.chain import Chain, read_chain
from gentamp_lp.geometry.gripper import OPENING, TOOL, approach_poses, finger_frames
from gentamp_lp.geometry.robots import STEPS, Link, Robot, Trajectory
from gentamp_lp.geometry.transforms import Array

URDF = data_path("franka_panda", "panda.urdf")
TIP = "panda_grasptarget"

HOME = (0.0, -math.pi / 4, 0.0, -3 * math.pi / 4, 0.0, math.pi / 2, math.pi / 4)

ARM_REACH = 0.81
"""Largest distance (m) of the last joint from the shoulder."""

SHOULDER = (0.0, 0.0, 0.333)
FLANGE = 0.107
"""Distance (m) of the hand's frame from the last joint."""

SEEDS = 6
"""Random restarts of inverse kinematics that are polished together."""

ROUNDS = 4
"""Batches of restarts before a target is given up."""

SEED_ITERATIONS = 40
POLISH_ITERATIONS = 12
TOLERANCE = 1e-6
"""Largest residual (m and rad together) of a solution."""

MAX_STEP = 0.2
"""Largest change (rad) of a joint in one step of an approach; more is a jump between branches."""

NAMES = (*(f"link{i}" for i in range(8)), "hand", "left_finger", "right_finger")

SELF = tuple((i, j) for i in (0, 1, 2) for j in range(5, 11)) + tuple((5, j) for j in range(7, 11))
"""Pairs of links, by position, that can collide within the joint limits (found with 20 000 random
configurations; neighbours overlap by design and are left out)."""


def _mesh(urdf: Path, link: str) -> Path:
    """Return the collision mesh of a link of a URDF whose packages are beside it."""
    element = ET.parse(urdf).getroot().find(f"link[@name='{link}']/collision/geometry/mesh")
    if element is None:
        raise ValueError(f"{urdf}: link {link} has no collision mesh")
    return urdf.parent / element.attrib["filename"].removeprefix("package://")


@lru_cache(maxsize=1)
def _links() -> tuple[Link, ...]:
    """Return the convex hulls of all links: base, seven arm links, hand, two fingers."""
    import trimesh

    names = [f"panda_link{i}" for i in range(8)] + ["panda_hand", "panda_leftfinger", "panda_leftfinger"]
    hulls: dict[str, Any] = {name: trimesh.load_mesh(_mesh(URDF, name)).convex_hull for name in set(names)}
    return tuple(
        Link(name, np.array(hulls[mesh].vertices), np.array(hulls[mesh].faces))
        for name, mesh in zip(NAMES, names, strict=True)
    )


class Panda(Robot):
    """Franka Panda with its own hand; a configuration holds its seven joint angles (rad).

    PyBullet's inverse kinematics gives the seeds, from random restarts; damped least squares polishes them;
    soft limits, the straight approach, the table and the robot itself are then checked without PyBullet.
    """

    fixed = 2  # the base and link 1, which only turns on it
    urdf = URDF
    tip = TIP
    fingers = ("panda_leftfinger", "panda_rightfinger")

    def __init__(self) -> None:
        self.name = "panda"
        self.opening = OPENING
        self.home = np.array(HOME)
        self.links = _links()
        self.chain: Chain = read_chain(URDF, TIP)
        self._first, self._second = np.array(SELF).T
        self._centres = np.array([link.centre for link in self.links])
        radii = np.array([link.radius for link in self.links])
        self._contact = (radii[self._first] + radii[self._second]) ** 2
        self._bullet = Bullet()
        self._body = self._bullet.load(URDF)
        self._tip = self._bullet.links(self._body)[TIP]

    def close(self) -> None:
        """Free the PyBullet world."""
        self._bullet.close()

    def tools(self, configurations: Array) -> Array:
        """Return the tool poses (n, 4, 4) of configurations (n, 7)."""
        return self.chain.tool(configurations)

    def frames(self, configurations: Array, opening: float) -> Array:
        """Return the poses (n, 11, 4, 4) of the base, the arm links, the hand and the fingers."""
        result = np.empty((len(configurations), len(self.links), 4, 4))
        result[:, 0] = np.eye(4)
        result[:, 1:8] = self.chain.frames(configurations)
        hands = result[:, 7] @ self.chain.tip
        hands[:, :3, 3] -= TOOL * hands[:, :3, 2]
        result[:, 8] = hands
        result[:, 9:] = finger_frames(hands, opening)
        return result

    def reach(self, tool_pose: Array, opening: float, rng: np.random.Generator) -> Trajectory | None:
        """Return a straight approach in joint space that ends at a tool pose, None when none was found."""
        poses = approach_poses(tool_pose)
        last_joint = poses[[0, -1], :3, 3] - (TOOL + FLANGE) * tool_pose[:3, 2]
        if np.linalg.norm(last_joint - SHOULDER, axis=1).max() > ARM_REACH:
            return None
        for _ in range(ROUNDS):
            for candidate in self._solutions(tool_pose, rng):
                configurations = self._approach(poses, candidate)
                if configurations is not None and self._clear(configurations, opening):
                    return Trajectory(configurations, opening)
        return None

    def _solutions(self, tool_pose: Array, rng: np.random.Generator) -> Array:
        """Return distinct configurations (n, 7) within the limits whose tool is at a pose; n may be 0."""
        starts = rng.uniform(self.chain.lower, self.chain.upper, (SEEDS, self.chain.dof))
        seeds = [
            self._bullet.inverse_kinematics(
                self._body, self._tip, tool_pose, range(self.chain.dof), start, SEED_ITERATIONS
            )
            for start in starts
        ]
        targets = np.broadcast_to(tool_pose, (SEEDS, 4, 4))
        values, solved = self.chain.solve(targets, np.array(seeds), iterations=POLISH_ITERATIONS, tolerance=TOLERANCE)
        middle = (self.chain.lower + self.chain.upper) / 2
        values = middle + np.remainder(values - middle + math.pi, 2 * math.pi) - math.pi
        return np.asarray(values[solved & self.chain.within(values)])

    def _approach(self, poses: Array, end: Array) -> Array | None:
        """Return configurations along the tool poses (n, 4, 4) that end at `end`, None where that fails."""
        starts = np.repeat(end[None], STEPS, axis=0)
        before, solved = self.chain.solve(poses[:-1], starts, iterations=POLISH_ITERATIONS, tolerance=TOLERANCE)
        path = np.concatenate([before, end[None]])
        smooth = solved.all() and np.abs(np.diff(path, axis=0)).max() <= MAX_STEP
        return path if smooth and bool(self.chain.within(path).all()) else None

    def _clear(self, configurations: Array, opening: float) -> bool:
        """Tell whether the robot touches neither the table nor itself in any configuration (n, 7)."""
        frames = self.frames(configurations, opening)
        return self.above_table(frames) and not self._self_collision(frames)

    def _self_collision(self, frames: Array) -> bool:
        """Tell whether links collide with each other in any of the poses (n, 11, 4, 4)."""
        centres = np.einsum("nlij,lj->nli", frames[:, :, :3, :3], self._centres) + frames[:, :, :3, 3]
        apart = centres[:, self._first] - centres[:, self._second]
        near = (apart * apart).sum(axis=2) < self._contact
        for step, pair in zip(*np.nonzero(near), strict=True):
            first, second = (self._placed(int(i), frames[step, i]) for i in SELF[pair])
            if fcl.collide(first, second, fcl.CollisionRequest(), fcl.CollisionResult()):
                return True
        return False

    def _placed(self, index: int, frame: Array) -> fcl.CollisionObject:
        """Return a link at a pose as an FCL object."""
        return fcl.CollisionObject(self.links[index].geometry, fcl.Transform(frame[:3, :3], frame[:3, 3]))
