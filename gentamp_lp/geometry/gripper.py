"""A free-flying parallel gripper with the measures of the Panda's hand: the cheap robot."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np

from gentamp_lp.geometry.assets import data_path
from gentamp_lp.geometry.links import Link
from gentamp_lp.geometry.robots import STANDOFF, STEPS, Robot, Trajectory
from gentamp_lp.geometry.transforms import Array, Bools, pose, quaternion, rotation

TOOL = 0.105
"""Distance (m) of the tool origin from the hand's frame along the approach."""

KNUCKLE = 0.0584
"""Distance (m) of the fingers' frames from the hand's frame along the approach."""

OPENING = 0.08
"""Largest finger distance (m)."""

AROUND = 0.3
"""How far (m) beyond the ends of a motion the hand looks for a way round."""

_BACK = np.linspace(-STANDOFF, 0.0, STEPS + 1)


def finger_frames(hands: Array, opening: float) -> Array:
    """Return the poses (n, 2, 4, 4) of the two fingers of hands (n, 4, 4)."""
    left = np.eye(4)
    left[:3, 3] = 0.0, opening / 2, KNUCKLE
    right = np.diag([-1.0, -1.0, 1.0, 1.0])
    right[:3, 3] = 0.0, -opening / 2, KNUCKLE
    return np.asarray(hands[:, None] @ np.stack([left, right]))


def approach_poses(tool_pose: Array) -> Array:
    """Return the tool poses (STEPS + 1, 4, 4) of the straight approach that ends at `tool_pose`."""
    result = np.repeat(tool_pose[None], STEPS + 1, axis=0)
    result[:, :3, 3] += _BACK[:, None] * tool_pose[:3, 2]
    return result


def block(name: str, lower: tuple[float, ...], upper: tuple[float, ...], look: Path | None = None) -> Link:
    """Return a box-shaped link between two corners (m), drawn as the mesh `look`."""
    corners = np.array([[(lower, upper)[i][0], (lower, upper)[j][1], (lower, upper)[k][2]]
                        for i in (0, 1) for j in (0, 1) for k in (0, 1)])  # fmt: skip
    faces = [[0, 1, 3], [0, 3, 2], [4, 6, 7], [4, 7, 5], [0, 4, 5], [0, 5, 1],
             [2, 3, 7], [2, 7, 6], [0, 2, 6], [0, 6, 4], [1, 5, 7], [1, 7, 3]]  # fmt: skip
    return Link(name, corners, np.array(faces), look)


class Gripper(Robot):
    """Hand and two fingers that fly; a configuration is the tool's position and quaternion (x, y, z, w)."""

    flies = True

    def __init__(self, furthest: float = math.inf) -> None:
        """Make a hand that keeps within `furthest` (m) of the origin, seen from above."""
        self.name = "gripper"
        self.furthest = furthest
        self.opening = OPENING
        self.home = np.array([0.3, 0.0, 0.5, 1.0, 0.0, 0.0, 0.0])
        looks = data_path("franka_panda", "meshes", "visual")
        finger = (-0.0105, 0.0, 0.0), (0.0105, 0.0265, 0.054), looks / "finger.obj"
        self.links = (
            block("hand", (-0.032, -0.104, -0.026), (0.032, 0.101, 0.066), looks / "hand.obj"),
            block("left_finger", *finger),
            block("right_finger", *finger),
        )

    def enlarged(self, factor: float) -> Gripper:
        """Return a hand that keeps within `factor` times the distance."""
        return Gripper(self.furthest * factor)

    def tools(self, configurations: Array) -> Array:
        """Return the tool poses (n, 4, 4) of configurations (n, 7)."""
        result = np.zeros((len(configurations), 4, 4))
        result[:, :3, :3] = rotation(configurations[:, 3:])
        result[:, :3, 3] = configurations[:, :3]
        result[:, 3, 3] = 1.0
        return result

    def frames(self, configurations: Array, opening: float) -> Array:
        """Return the poses (n, 3, 4, 4) of the hand and the fingers."""
        hands = self.tools(configurations)
        hands[:, :3, 3] -= TOOL * hands[:, :3, 2]
        return np.concatenate([hands[:, None], finger_frames(hands, opening)], axis=1)

    def between(self, first: Array, second: Array, count: int) -> Array:
        """Return configurations between two, with unit quaternions along the shorter turn."""
        result = super().between(first, self.alike(first, second), count)
        result[:, 3:] /= np.linalg.norm(result[:, 3:], axis=1, keepdims=True)
        return result

    def alike(self, first: Array, second: Array) -> Array:
        """Return a configuration with the one of its two quaternions that is nearer to another's."""
        return np.concatenate([second[:3], second[3:] * math.copysign(1.0, first[3:] @ second[3:])])

    def near(self, configurations: Array, tools: Array) -> tuple[Array, Bools]:
        """Return the configurations of tool poses, with quaternions on the side of the given ones."""
        turns = quaternion(tools)
        turns *= np.where((turns * configurations[:, 3:]).sum(axis=1) < 0, -1.0, 1.0)[:, None]
        return np.hstack([tools[:, :3, 3], turns]), np.hypot(*tools[:, :2, 3].T) <= self.furthest

    def anywhere(self, first: Array, last: Array, rng: np.random.Generator) -> Array:
        """Return a position in the box around both ends and `AROUND` wider, above the table, with the tool as at
        one of the ends but for a turn about the vertical.
        """
        ends = np.array([first[:3], last[:3]])
        lower = np.maximum(ends.min(axis=0) - AROUND, [-np.inf, -np.inf, 0.0])
        turned = pose(yaw=rng.uniform(-math.pi, math.pi)) @ self.tool((first, last)[rng.integers(2)])
        return np.concatenate([rng.uniform(lower, ends.max(axis=0) + AROUND), quaternion(turned)])

    def fault(self, configurations: Array, opening: float) -> tuple[int, str] | None:
        """Return the first configuration that is too far away or in the table, and why."""
        far = np.flatnonzero(np.hypot(*configurations[:, :2].T) > self.furthest)
        found = [(int(far[0]), "the hand is too far away")] if len(far) else []
        low = super().fault(configurations, opening)
        return min([*found, low] if low else found, default=None)

    def reach(self, tool_pose: Array, opening: float, rng: np.random.Generator) -> Trajectory | None:
        """Return the straight approach to a tool pose, None when it would touch the table or is too far away."""
        if math.hypot(*tool_pose[:2, 3]) > self.furthest:
            return None
        poses = approach_poses(tool_pose)
        turn = quaternion(tool_pose)
        configurations = np.column_stack([poses[:, :3, 3], np.broadcast_to(turn, (len(poses), 4))])
        ends = configurations[[0, -1]]  # the path is straight: its ends decide
        return Trajectory(configurations, opening) if self.above_table(self.frames(ends, opening)) else None
