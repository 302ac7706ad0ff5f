"""Robots as PyBullet bodies, for replay and pictures: their own links, joints and forward kinematics."""

from __future__ import annotations

from typing import Protocol

import numpy as np

from gentamp_lp.geometry.bullet import Bullet
from gentamp_lp.geometry.robots import Robot
from gentamp_lp.geometry.shapes import Rgba
from gentamp_lp.geometry.transforms import Array

_WHITE: Rgba = (0.93, 0.93, 0.94, 1.0)


class Model(Protocol):
    """A robot in a PyBullet world.

    `pieces` are its bodies; `fingers` are pairs of a body and a link of it (-1: the base); `names` gives the
    name of each (body, link); those in `mounted` belong to the base and may touch the table.
    """

    pieces: tuple[int, ...]
    fingers: tuple[tuple[int, int], ...]
    names: dict[tuple[int, int], str]
    mounted: frozenset[tuple[int, int]]

    def set(self, configuration: Array, opening: float) -> None:
        """Take on a configuration (dof,) with a finger distance (m)."""

    def tool(self) -> Array:
        """Return the tool pose (4×4) as PyBullet computes it."""

    def beyond_limits(self, configuration: Array) -> list[str]:
        """Return the names of the joints beyond the limits that PyBullet reads from the URDF."""


class Jointed:
    """A robot that PyBullet loads from its URDF."""

    def __init__(self, world: Bullet, robot: Robot) -> None:
        if robot.urdf is None:
            raise ValueError(f"the robot {robot.name} has no URDF")
        body = world.load(robot.urdf)
        links = world.links(body)
        self._world = world
        self._body = body
        self._tip = links[robot.tip]
        self._joints = list(range(len(robot.home)))
        self._fingers = [links[name] for name in robot.fingers]
        self._lower, self._upper = world.limits(body, self._joints)
        self.pieces: tuple[int, ...] = (body,)
        self.fingers = tuple((body, link) for link in self._fingers)
        self.names = {(body, index): name for name, index in links.items()} | {(body, -1): "base"}
        self.mounted = frozenset((body, link) for link in range(-1, robot.fixed - 1))

    def set(self, configuration: Array, opening: float) -> None:
        """Set all joints."""
        self._world.set_joints(self._body, self._joints, configuration)
        self._world.set_joints(self._body, self._fingers, [opening / 2] * len(self._fingers))

    def tool(self) -> Array:
        """Return the pose of the tip link."""
        return self._world.pose(self._body, self._tip)

    def beyond_limits(self, configuration: Array) -> list[str]:
        """Compare with the hard limits of the URDF."""
        outside = (configuration < self._lower) | (configuration > self._upper)
        return [self.names[self._body, int(joint)] for joint in np.flatnonzero(outside)]


class Flying:
    """A robot without joints: one body a link, put where the robot says."""

    def __init__(self, world: Bullet, robot: Robot) -> None:
        self._world = world
        self._robot = robot
        placed = robot.bodies(robot.home, robot.opening)
        self.pieces: tuple[int, ...] = tuple(
            world.add_hull(b.link.vertices, _WHITE, b.pose, b.link.look) for b in placed
        )
        self.names = {(piece, -1): b.link.name for piece, b in zip(self.pieces, placed, strict=True)}
        self.fingers = tuple(key for key, name in self.names.items() if name in robot.fingers)
        self.mounted: frozenset[tuple[int, int]] = frozenset()
        self._tool = robot.tool(robot.home)

    def set(self, configuration: Array, opening: float) -> None:
        """Move all bodies."""
        for piece, body in zip(self.pieces, self._robot.bodies(configuration, opening), strict=True):
            self._world.move(piece, body.pose)
        self._tool = self._robot.tool(configuration)

    def tool(self) -> Array:
        """Return the tool pose."""
        return self._tool

    def beyond_limits(self, configuration: Array) -> list[str]:
        """Report a quaternion that is not one."""
        return [] if abs(float(np.linalg.norm(configuration[-4:])) - 1) < 1e-6 else ["quaternion"]


def load_model(world: Bullet, robot: Robot) -> Model:
    """Return the robot's bodies in a PyBullet world, at its home configuration with open fingers."""
    model: Model = Flying(world, robot) if robot.urdf is None else Jointed(world, robot)
    model.set(robot.home, robot.opening)
    return model
