"""Robots that drive: an arm on a base that moves in the plane, and the ways of that base."""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import pairwise

import numpy as np

from gentamp_lp.geometry.description import Drive
from gentamp_lp.geometry.gripper import block
from gentamp_lp.geometry.robots import Robot, Trajectory
from gentamp_lp.geometry.transforms import Array, Bools, inverse, pose

BACK = 0.35
"""How far (m) the base backs off before it goes elsewhere."""

_STEP, _TURN = 0.02, 0.03  # the base stops every 2 cm and 0.03 rad, the tool then every 5 cm


class Mobile(Robot):
    """An arm on a base that drives in any direction; a configuration is x, y, yaw (m, rad), then the arm's own.

    `stance` and `aside` are how far (m) in front of the base and to its left things should be for the arm to reach
    them; `platform` is the body that drives, in the base's frame, where the arm has none of its own.
    """

    mobile = True

    def __init__(self, name: str, arm: Robot, base: Drive) -> None:
        self.name = name
        self.arm = arm
        self.base = base
        self.flies = arm.flies
        self.stance, self.aside = base.stance, base.aside
        self.opening = arm.opening
        self.home = np.concatenate([np.zeros(3), arm.home])
        self.platform = block("platform", base.platform.lower, base.platform.upper) if base.platform else None
        self.links = (*arm.links, self.platform) if self.platform else arm.links
        self.fingers, self.description = arm.fingers, arm.description

    def enlarged(self, factor: float) -> Mobile:
        """Return the robot with its arm for a stretched world."""
        return Mobile(self.name, self.arm.enlarged(factor), self.base) if self.flies else self

    def close(self) -> None:
        """Free what the arm holds."""
        self.arm.close()

    @property
    def hand(self) -> Sequence[int]:
        """Positions of the links that move with the arm's tool."""
        return self.arm.hand

    def tools(self, configurations: Array) -> Array:
        """Return the tool poses (n, 4, 4) of configurations (n, 3 + dof of the arm)."""
        return np.asarray(_places(configurations) @ self.arm.tools(configurations[:, 3:]))

    def frames(self, configurations: Array, opening: float) -> Array:
        """Return the poses (n, links, 4, 4) of the arm's links and the platform."""
        places = _places(configurations)
        arm = places[:, None] @ self.arm.frames(configurations[:, 3:], opening)
        return np.concatenate([arm, places[:, None]], axis=1) if self.platform else arm

    def reach(self, tool_pose: Array, opening: float, rng: np.random.Generator) -> Trajectory | None:
        """Return an approach from a base at the origin."""
        return self.reach_from(np.zeros(3), tool_pose, opening, rng)

    def reach_from(self, base: Array, tool_pose: Array, opening: float, rng: np.random.Generator) -> Trajectory | None:
        """Return an approach from a base at x, y, yaw."""
        found = self.arm.reach(inverse(pose(base[0], base[1], 0.0, base[2])) @ tool_pose, opening, rng)
        if found is None:
            return None
        rows = np.broadcast_to(base, (len(found.configurations), 3))
        return Trajectory(np.hstack([rows, found.configurations]), opening)

    def between(self, first: Array, second: Array, count: int) -> Array:
        """Return configurations between two; base and arm move evenly."""
        base = super().between(first[:3], second[:3], count)
        return np.hstack([base, self.arm.between(first[3:], second[3:], count)])

    def near(self, configurations: Array, tools: Array) -> tuple[Array, Bools]:
        """Return configurations whose arm has its tool at poses in the world; the base stays."""
        inside = np.array([inverse(place) for place in _places(configurations)]).reshape(-1, 4, 4) @ tools
        found, solved = self.arm.near(configurations[:, 3:], inside)
        return np.hstack([configurations[:, :3], found]), solved

    def alike(self, first: Array, second: Array) -> Array:
        """Return a configuration with the arm in the form nearest to another's."""
        return np.concatenate([second[:3], self.arm.alike(first[3:], second[3:])])

    def anywhere(self, first: Array, last: Array, rng: np.random.Generator) -> Array:
        """Return a random configuration of the arm on the base where it is."""
        return np.concatenate([first[:3], self.arm.anywhere(first[3:], last[3:], rng)])

    def fault(self, configurations: Array, opening: float) -> tuple[int, str] | None:
        """Return what the arm finds wrong, its table being everywhere around the base."""
        return self.arm.fault(configurations[:, 3:], opening)


def drive(first: Array, last: Array) -> Array:
    """Return base poses (n, 3: x, y, yaw) from one to another: back off, cross and turn, come in again."""
    turn = math.remainder(last[2] - first[2], 2 * math.pi)
    corners = [first, _behind(first), _behind(last), last]
    corners[2:] = [np.array([x, y, first[2] + turn]) for x, y, _ in corners[2:]]
    path = [corners[0]]
    for start, end in pairwise(corners):
        pieces = max(np.linalg.norm(end[:2] - start[:2]) / _STEP, abs(end[2] - start[2]) / _TURN)
        path += [start + (end - start) * share for share in np.linspace(0, 1, max(2, math.ceil(pieces) + 1))[1:]]
    return np.array(path)


def _behind(base: Array) -> Array:
    return base - BACK * np.array([math.cos(base[2]), math.sin(base[2]), 0.0])


def _places(configurations: Array) -> Array:
    """Return the base's poses (n, 4, 4)."""
    return np.array([pose(x, y, 0.0, yaw) for x, y, yaw in configurations[:, :3]]).reshape(-1, 4, 4)
