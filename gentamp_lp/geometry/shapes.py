"""Object shapes: rigid unions of boxes, cylinders and convex hulls, in metres.

The frame of a shape is at the centre of its bottom face with z up, so an object that stands on a surface at
height h has a pose with z = h + `GAP` (a gap of exactly 0 counts as a collision).
"""

from __future__ import annotations

import hashlib
import math
from collections.abc import Iterator
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, cast

import numpy as np

from gentamp_lp.geometry.transforms import Array, pose

if TYPE_CHECKING:
    import trimesh

GAP = 0.001
"""Distance (m) left between an object and what it stands on."""

Rgba = tuple[float, float, float, float]

BLUE: Rgba = (0.30, 0.47, 0.66, 1.0)
ORANGE: Rgba = (0.95, 0.56, 0.17, 1.0)
GREY: Rgba = (0.55, 0.57, 0.60, 1.0)

_DIMENSIONS = {"box": 3, "cylinder": 2, "hull": 3}
_FLAT = 0.0002  # vertices of a hull whose heights differ by less (m) are on one face


@dataclass(frozen=True)
class Hull:
    """A convex solid: vertices (n, 3) in m and triangles (m, 3) that point outwards; `digest` is what is compared."""

    digest: str
    vertices: Array = field(compare=False, repr=False)
    faces: np.ndarray[Any, np.dtype[np.int64]] = field(compare=False, repr=False)


@dataclass(frozen=True)
class Part:
    """A box (`size` = full lengths x, y, z), an upright cylinder (`size` = radius, height) or a `hull` (`size` = full
    lengths of its bounding box, whose centre is the origin of its vertices).

    `xyz` is its centre in the object frame, `yaw` its turn about the vertical.
    Raises ValueError when the size does not fit the kind or is not positive.
    """

    kind: Literal["box", "cylinder", "hull"]
    size: tuple[float, ...]
    xyz: tuple[float, float, float]
    yaw: float = 0.0
    hull: Hull | None = None

    def __post_init__(self) -> None:
        if _DIMENSIONS.get(self.kind) != len(self.size):
            raise ValueError(f"a part is a box or hull with 3 or a cylinder with 2 sizes, not {self.kind} {self.size}")
        if (self.kind == "hull") != (self.hull is not None):
            raise ValueError("a hull, and nothing else, has vertices")
        if not all(math.isfinite(s) and s > 0 for s in self.size):
            raise ValueError(f"sizes of a {self.kind} must be positive: {self.size}")

    @cached_property
    def height(self) -> float:
        """Vertical length (m)."""
        return self.size[-1]

    @cached_property
    def bounds(self) -> tuple[tuple[float, float, float], tuple[float, float, float]]:
        """Lower and upper corner of the axis-aligned bounding box in the object frame."""
        if self.kind != "cylinder":
            c, s = abs(math.cos(self.yaw)), abs(math.sin(self.yaw))
            x = (c * self.size[0] + s * self.size[1]) / 2
            y = (s * self.size[0] + c * self.size[1]) / 2
        else:
            x = y = self.size[0]
        z = self.height / 2
        cx, cy, cz = self.xyz
        return (cx - x, cy - y, cz - z), (cx + x, cy + y, cz + z)

    @cached_property
    def pose(self) -> Array:
        """4×4 pose of the part's centre in the object frame."""
        return pose(*self.xyz, self.yaw)

    def below(self, frame: Array) -> float:
        """How far (m) the part, posed by `frame` (4×4), reaches below its centre."""
        if self.hull is not None:
            return -float((self.hull.vertices @ frame[2, :3]).min())
        if self.kind == "box":
            return float(np.abs(frame[2, :3]) @ np.array(self.size)) / 2
        radius, height = self.size
        return float(radius * np.hypot(frame[2, 0], frame[2, 1]) + height / 2 * abs(frame[2, 2]))

    def carries(self, x: float, y: float) -> bool:
        """Whether a point (m, seen from the part's centre) is over its flat top."""
        if self.hull is not None:
            from scipy.spatial import Delaunay  # as long to import as all the rest: few worlds have meshes

            top = self.hull.vertices[self.hull.vertices[:, 2] > self.height / 2 - _FLAT, :2]
            if len(top) < 3 or np.linalg.matrix_rank(top - top[0], tol=_FLAT) < 2:
                return False
            return int(Delaunay(top).find_simplex((x, y))) >= 0
        if self.kind == "box":
            return abs(x) <= self.size[0] / 2 and abs(y) <= self.size[1] / 2
        return math.hypot(x, y) <= self.size[0]


def hull(vertices: Array) -> Part:
    """Return the convex hull of points (n, 3), in m in the object frame, as a part. Raises ValueError for flat ones."""
    import trimesh

    if len(vertices) < 4 or np.linalg.matrix_rank(vertices - vertices[0], tol=1e-6) < 3:
        raise ValueError("points in a plane, or as near as that, have no hull: make them larger")
    solid = trimesh.convex.convex_hull(vertices)
    centre = solid.bounds.mean(axis=0)
    corners = np.asarray(solid.vertices - centre, dtype=np.float64)
    found = Hull(hashlib.sha256(corners.tobytes()).hexdigest(), corners, np.asarray(solid.faces, dtype=np.int64))
    x, y, z = (float(v) for v in centre)
    return Part("hull", tuple(float(v) for v in solid.extents), (x, y, z), hull=found)


@dataclass(frozen=True)
class Look:
    """A mesh file that is drawn in place of a shape's parts: `scale` is applied first, then `pose` (4×4) puts it into
    the object frame.
    """

    file: Path
    scale: float
    pose: Array = field(compare=False, repr=False)


@dataclass(frozen=True)
class Shape:
    """A rigid object made of parts.

    `handles` are the parts a gripper may grasp (empty: the only part of a single-part shape), `envelope` is
    extra volume that counts as occupied for other objects and for trajectories (the load space of a tray),
    `interior` is the flat area that carries other objects: length along x, width along y, height of the floor
    above the frame; `look` is drawn instead of the parts.
    """

    parts: tuple[Part, ...]
    rgba: Rgba = BLUE
    handles: tuple[Part, ...] = ()
    envelope: Part | None = None
    interior: tuple[float, float, float] | None = None
    look: Look | None = None

    def __post_init__(self) -> None:
        if not self.parts:
            raise ValueError("a shape needs at least one part")

    @property
    def meshed(self) -> bool:
        """Whether it is a mesh: made of hulls only."""
        return all(part.hull is not None for part in self.parts)

    @property
    def carries(self) -> bool:
        """Whether something can stand on the middle of its top."""
        return any(part.bounds[1][2] == self.height and part.carries(-part.xyz[0], -part.xyz[1]) for part in self.parts)

    @property
    def graspable(self) -> tuple[Part, ...]:
        """The parts a gripper may grasp."""
        return self.handles or (self.parts if len(self.parts) == 1 else ())

    @cached_property
    def bounds(self) -> tuple[tuple[float, float, float], tuple[float, float, float]]:
        """Lower and upper corner of the bounding box of the solid parts in the object frame."""
        lower = np.min([p.bounds[0] for p in self.parts], axis=0)
        upper = np.max([p.bounds[1] for p in self.parts], axis=0)
        return (float(lower[0]), float(lower[1]), float(lower[2])), (
            float(upper[0]),
            float(upper[1]),
            float(upper[2]),
        )

    @cached_property
    def extent(self) -> tuple[float, float, float]:
        """Lengths of the bounding box of the solid parts along x, y, z."""
        (x0, y0, z0), (x1, y1, z1) = self.bounds
        return x1 - x0, y1 - y0, z1 - z0

    @property
    def height(self) -> float:
        """Height of the top above the object frame."""
        return self.bounds[1][2]

    @cached_property
    def radius(self) -> float:
        """Radius of a sphere about the object frame that holds all parts and the envelope."""
        corners = [c for p in self.volumes(envelope=True) for c in zip(*p.bounds, strict=True)]
        boxes = [corners[i : i + 3] for i in range(0, len(corners), 3)]
        return max(math.sqrt(sum(max(abs(a), abs(b)) ** 2 for a, b in box)) for box in boxes)

    def volumes(self, *, envelope: bool) -> Iterator[Part]:
        """The solid parts and, if asked for, the envelope."""
        yield from self.parts
        if envelope and self.envelope is not None:
            yield self.envelope


def box(x: float, y: float, z: float, rgba: Rgba = BLUE) -> Shape:
    """Return a box with full lengths x, y, z (m)."""
    return Shape((Part("box", (x, y, z), (0.0, 0.0, z / 2)),), rgba)


def cylinder(radius: float, height: float, rgba: Rgba = ORANGE) -> Shape:
    """Return an upright cylinder (m)."""
    return Shape((Part("cylinder", (radius, height), (0.0, 0.0, height / 2)),), rgba)


PLATE = 0.01
"""Thickness (m) of a tray."""

FIN = (0.04, 0.012, 0.10)
"""Lengths (m) of the upright fin by which a tray is grasped."""

FIN_DISTANCE = 0.03
"""Distance (m) of the fin from the short end of the tray."""


def tray(
    length: float,
    width: float,
    headroom: float = 0.12,
    rgba: Rgba = GREY,
    body: tuple[Part, ...] = (),
    floor: float = PLATE,
) -> Shape:
    """Return a tray, `length` along x and `width` along y, that carries objects up to `headroom` (m).

    It is a plate, or the parts of `body` whose floor of that size is at the height `floor` (m). The upright fin beyond
    the end at +x is the only part to grasp; a gripper closes on it along y and keeps clear of the load. The column
    above the floor up to `headroom` is the envelope. Lengths in m.
    """
    if headroom <= floor:
        raise ValueError(f"the headroom of a tray must exceed its thickness of {floor} m, not {headroom}")
    body = body or (Part("box", (length, width, PLATE), (0.0, 0.0, PLATE / 2)),)
    neck = max(FIN_DISTANCE, max(part.bounds[1][0] for part in body) - length / 2) + FIN[0]
    arm = Part("box", (neck, FIN[0], PLATE), (length / 2 + neck / 2, 0.0, PLATE / 2))
    fin = Part("box", FIN, (length / 2 + neck - FIN[0] / 2, 0.0, PLATE + FIN[2] / 2))
    space = Part("box", (length, width, headroom - floor), (0.0, 0.0, (headroom + floor) / 2))
    return Shape((*body, arm, fin), rgba, handles=(fin,), envelope=space, interior=(length, width, floor))


def to_trimesh(shape: Shape) -> trimesh.Trimesh:
    """Return a coloured mesh of the solid parts, in the object frame."""
    import trimesh

    meshes = []
    for part in shape.parts:
        if part.hull is not None:
            meshes.append(trimesh.Trimesh(part.hull.vertices, part.hull.faces).apply_transform(part.pose))
        elif part.kind == "box":
            meshes.append(trimesh.creation.box(extents=part.size, transform=part.pose))
        else:
            radius, height = part.size
            meshes.append(trimesh.creation.cylinder(radius, height, sections=48, transform=part.pose))
    mesh: Any = trimesh.util.concatenate(meshes)
    mesh.visual.face_colors = [round(255 * c) for c in shape.rgba]
    return cast("trimesh.Trimesh", mesh)
