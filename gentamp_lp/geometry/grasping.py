"""Antipodal parallel-jaw grasps on boxes, cylinders and meshes.

A tool frame has its origin between the finger pads, z along the approach (out of the palm) and y along the
closing direction. All lengths in m.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from functools import lru_cache
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from gentamp_lp.geometry.shapes import Part, Shape, to_trimesh
from gentamp_lp.geometry.transforms import Array, inverse

if TYPE_CHECKING:
    import trimesh

CLEARANCE = 0.001
"""Gap left between each finger pad and the object."""

PALM = 0.030
"""How far the object may reach from the tool origin towards the palm."""

TIP = 0.010
"""Least height of the tool origin above the bottom of the grasped part (the fingers reach 7 mm beyond it)."""

SIDE_HEIGHT = 0.060
"""Least height of a level grasp from the side: below it the wrist is too close to the table."""

PAD = (0.010, 0.015, 0.007)
"""What a finger pad touches of a mesh: so far to each side of the tool origin, towards the palm and beyond it."""

FRICTION = 0.5
"""Coefficient that keeps a finger from sliding off a slanted face of a mesh."""

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
    same directions. On meshes as on a cylinder below the centre of mass, where the faces between the pads are steep
    enough not to slide off; whether the hand itself is clear of the mesh is not looked at.
    """
    if shape.meshed:
        yield from (Grasp(found.tool, found.opening) for found in _on_mesh(shape.parts, opening, approach))
        return
    for part in shape.graspable:
        for yaw, width, depth in _closings(part):
            if width + 2 * CLEARANCE > opening:
                continue
            if approach != "side":
                yield Grasp(_from_top(part, yaw), width + 2 * CLEARANCE)
            if approach != "top" and part.height >= SIDE_HEIGHT + TIP:
                for tilt in (0.0, SIDE_TILT):
                    yield Grasp(_from_side(part, yaw, tilt, depth), width + 2 * CLEARANCE)


@lru_cache
def _on_mesh(parts: tuple[Part, ...], opening: float, approach: Approach) -> tuple[Grasp, ...]:
    """Return the grasps of a mesh; this takes 50 ms, and things are often alike."""
    shape = Shape(parts)
    solid = to_trimesh(shape)
    found = []
    column = Part("cylinder", (opening / 2, shape.height), (0.0, 0.0, shape.height / 2))
    for yaw, _, _ in _closings(column):
        tools = [_from_top(column, yaw)] if approach != "side" else []
        if approach != "top" and shape.height >= SIDE_HEIGHT + TIP:
            tools += [_from_side(column, yaw, tilt, 0.0) for tilt in (0.0, SIDE_TILT)]
        found += [grasp for tool in tools if (grasp := _close(solid, tool, opening))]
    return tuple(found)


def _close(solid: trimesh.Trimesh, tool: Array, opening: float) -> Grasp | None:
    """Close a gripper on a mesh near a tool pose (4×4), None where the mesh is too wide or the pads slide off it."""
    seen = solid.copy().apply_transform(inverse(tool))
    wide, behind, beyond = PAD
    between = _cut(seen, (-wide, -opening / 2, -math.inf), (wide, opening / 2, math.inf))
    back = max(0.0, -PALM - float(between.bounds[0][2])) if len(between.faces) else 0.0
    held = _cut(seen, (-wide, -math.inf, -back - behind), (wide, math.inf, -back + beyond))
    if not len(held.faces):
        return None
    low, high = (float(y) for y in held.bounds[:, 1])
    width = high - low + 2 * CLEARANCE
    if width > opening or not (_sticks(held, low, -1.0) and _sticks(held, high, 1.0)):
        return None
    closed = np.array(tool)
    closed[:3, 3] += closed[:3, :3] @ [0.0, (low + high) / 2, -back]
    return Grasp(closed, width)


def _cut(solid: trimesh.Trimesh, lower: tuple[float, ...], upper: tuple[float, ...]) -> trimesh.Trimesh:
    """Return the surface of a mesh within an axis-aligned box, whose sides may be at infinity."""
    import trimesh

    slicing: Any = trimesh.intersections.slice_faces_plane
    vertices, faces = solid.vertices, solid.faces
    for sign, bound in ((1.0, lower), (-1.0, upper)):
        for axis, value in zip(np.eye(3), bound, strict=True):
            if math.isfinite(value) and len(faces):
                vertices, faces, _ = slicing(vertices, faces, sign * axis, value * axis)
    return trimesh.Trimesh(vertices, faces)


def _sticks(held: trimesh.Trimesh, end: float, side: float) -> bool:
    """Whether a face at one end along y looks that way, to within the angle of friction."""
    touching = (np.abs(held.triangles[:, :, 1] - end) < CLEARANCE / 2).any(axis=1)
    return bool((side * held.face_normals[touching, 1] >= math.cos(math.atan(FRICTION))).any())


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
