"""Antipodal parallel-jaw grasps on boxes and cylinders.

A tool frame has its origin between the finger pads, z along the approach (out of the palm) and y along the
closing direction. All lengths in m.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Literal

import numpy as np

from gentamp_lp.geometry.shapes import Part, Shape
from gentamp_lp.geometry.transforms import Array

CLEARANCE = 0.001
"""Gap left between each finger pad and the object."""

PALM = 0.030
"""How far the object may reach from the tool origin towards the palm."""

TIP = 0.010
"""Least height of the tool origin above the bottom of the grasped part (the fingers reach 7 mm beyond it)."""

SIDE_HEIGHT = 0.060
"""Least height of a level grasp from the side: below it the wrist is too close to the table."""

CYLINDER_YAWS = 8
SIDE_TILT = 0.2

Approach = Literal["top", "side", "any"]


@dataclass(frozen=True, eq=False)
class Grasp:
    """A way to hold an object: the `tool` frame (4×4) in the object frame and the finger distance (m)."""

    tool: Array
    opening: float


def grasps(shape: Shape, opening: float, approach: Approach = "top") -> Iterator[Grasp]:
    """Yield the grasps of a shape whose width fits a gripper that opens to `opening`, in a fixed order.

    From the top: both turns for each pair of sides of a box that fits, `CYLINDER_YAWS` turns of a cylinder.
    From the side (parts as high as `SIDE_HEIGHT` + `TIP`): level and tilted down by `SIDE_TILT` rad, in the
    same directions.
    """
    for part in shape.graspable:
        for yaw, width, depth in _closings(part):
            if width + 2 * CLEARANCE > opening:
                continue
            if approach != "side":
                yield Grasp(_from_top(part, yaw), width + 2 * CLEARANCE)
            if approach != "top" and part.height >= SIDE_HEIGHT + TIP:
                for tilt in (0.0, SIDE_TILT):
                    yield Grasp(_from_side(part, yaw, tilt, depth), width + 2 * CLEARANCE)


def _closings(part: Part) -> Iterator[tuple[float, float, float]]:
    """Yield yaw in the object frame, the width along the closing direction and the depth across it."""
    if part.kind == "cylinder":
        for turn in range(CYLINDER_YAWS):
            yield 2 * math.pi * turn / CYLINDER_YAWS, 2 * part.size[0], 2 * part.size[0]
    else:
        x, y, _ = part.size
        for turn, (width, depth) in enumerate([(y, x), (x, y)] * 2):
            yield part.yaw + turn * math.pi / 2, width, depth


def _from_top(part: Part, yaw: float) -> Array:
    """Return the tool frame that points straight down and closes at right angles to `yaw`."""
    bottom, top = part.xyz[2] - part.height / 2, part.xyz[2] + part.height / 2
    c, s = math.cos(yaw), math.sin(yaw)
    tool = np.eye(4)
    tool[:3, :3] = [[c, s, 0.0], [s, -c, 0.0], [0.0, 0.0, -1.0]]
    tool[:3, 3] = [part.xyz[0], part.xyz[1], max(part.xyz[2], top - PALM, bottom + TIP)]
    return tool


def _from_side(part: Part, yaw: float, tilt: float, depth: float) -> Array:
    """Return the tool frame that comes along `yaw`, tilted down by `tilt`, and closes horizontally."""
    c, s = math.cos(yaw), math.sin(yaw)
    forward = np.array([c * math.cos(tilt), s * math.cos(tilt), -math.sin(tilt)])
    closing = np.array([-s, c, 0.0])
    tool = np.eye(4)
    tool[:3, :3] = np.column_stack([np.cross(closing, forward), closing, forward])
    height = max(part.xyz[2], part.xyz[2] - part.height / 2 + SIDE_HEIGHT)
    back = max(0.0, depth / 2 - PALM)
    tool[:3, 3] = [part.xyz[0] - back * c, part.xyz[1] - back * s, height]
    return tool
