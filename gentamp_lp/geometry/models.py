"""Robots as PyBullet bodies, for replay and pictures: their own links, joints and forward kinematics."""

from __future__ import annotations

from typing import Protocol

import numpy as np

from gentamp_lp.geometry.arm import load_urdf
from gentamp_lp.geometry.bullet import Bullet
from gentamp_lp.geometry.description import Description
from gentamp_lp.geometry.mobile import Mobile
from gentamp_lp.geometry.robots import Robot
from gentamp_lp.geometry.shapes import GREY, Rgba
from gentamp_lp.geometry.transforms import Array, pose

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
    """A robot that PyBullet loads from its URDF, and the platform it may stand on."""

    def __init__(self, world: Bullet, robot: Robot, description: Description) -> None:
        body = load_urdf(world, description)
        links, joints = world.links(body), world.joints(body)
        self._world = world
        self._body = body
        self._tip, self._tool, self._mount = links[description.tip], description.tool.matrix, description.mount.matrix
        self._base = 3 if robot.mobile else 0
        self._joints = [joints[name] for name in description.home]
        self._fingers = [joints[finger.joint] for finger in description.fingers]
        self._opening = [finger.value for finger in description.fingers]
        world.set_joints(body, [joints[name] for name in description.posture], list(description.posture.values()))
        self._lower, self._upper = world.limits(body, self._joints)
        platform = robot.platform if isinstance(robot, Mobile) else None
        self.pieces: tuple[int, ...] = (body,)
        if platform is not None:
            self.pieces += (world.add_hull(platform.vertices, GREY, np.eye(4)),)
        self.fingers = tuple((body, links[name]) for name in description.pads)
        self.names = {(body, index): name for name, index in links.items()} | {(body, -1): "base"}
        self.names |= {(piece, -1): "platform" for piece in self.pieces[1:]}
        mounted = {robot.links[index].name for index in robot.mounted}
        self.mounted = frozenset(key for key, name in self.names.items() if name in mounted or key == (body, -1))

    def set(self, configuration: Array, opening: float) -> None:
        """Set the base and all joints."""
        if self._base:
            x, y, yaw = configuration[:3]
            place = pose(x, y, 0.0, yaw)
            self._world.move(self._body, place @ self._mount)
            for piece in self.pieces[1:]:
                self._world.move(piece, place)
        else:
            self._world.move(self._body, self._mount)
        self._world.set_joints(self._body, self._joints, configuration[self._base :])
        self._world.set_joints(self._body, self._fingers, [value(opening) for value in self._opening])

    def tool(self) -> Array:
        """Return the tool pose, from that of the tip link."""
        return self._world.pose(self._body, self._tip) @ self._tool

    def beyond_limits(self, configuration: Array) -> list[str]:
        """Compare with the hard limits of the URDF; a joint without any has a lower one above the upper."""
        values = configuration[self._base :]
        outside = ((values < self._lower) | (values > self._upper)) & (self._lower <= self._upper)
        return [self.names[self._body, self._joints[joint]] for joint in np.flatnonzero(outside)]


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
    description = robot.description
    model: Model = Flying(world, robot) if description is None else Jointed(world, robot, description)
    model.set(robot.home, robot.opening)
    return model
