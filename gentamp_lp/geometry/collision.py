"""Exact collision tests with FCL: pairs of shapes, and everything a robot sweeps through.

Boxes, cylinders and convex hulls are solid (an object wholly inside another collides with it). Two bodies
that touch collide; a gap of `shapes.GAP` does not.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from functools import lru_cache
from typing import Any, TypeAlias

import fcl
import numpy as np

from gentamp_lp.geometry.shapes import Part, Shape
from gentamp_lp.geometry.transforms import Array
from gentamp_lp.solvers.interrupts import Held

Geometry: TypeAlias = Any
"""An FCL collision geometry."""

_REQUEST = fcl.CollisionRequest(num_max_contacts=1)


def convex(vertices: Array, faces: Sequence[Sequence[int]] | np.ndarray[Any, Any]) -> Geometry:
    """Return the FCL geometry of a convex mesh: vertices (n, 3) in m, faces (m, 3).

    Raises ValueError for a mesh without volume, on which FCL would crash.
    """
    triangles = np.asarray(faces, dtype=np.int64)
    points = np.ascontiguousarray(vertices, dtype=np.float64)
    if len(points) < 4 or len(triangles) < 4 or not np.isfinite(points).all():
        raise ValueError("a convex mesh needs at least four finite vertices and four faces")
    if np.linalg.matrix_rank(points - points[0], tol=1e-9) < 3:
        raise ValueError("a convex mesh must not be flat")
    flat = np.hstack([np.full((len(triangles), 1), 3), triangles]).ravel()
    return fcl.Convex(points, len(triangles), flat)


@lru_cache(maxsize=4096)
def geometry(part: Part) -> Geometry:
    """Return the FCL geometry of a part, centred at the part's own centre."""
    if part.hull is not None:
        return convex(part.hull.vertices, part.hull.faces)
    return fcl.Box(*part.size) if part.kind == "box" else fcl.Cylinder(*part.size)


def at(solid: Geometry, frame: Array) -> fcl.CollisionObject:
    """Return a geometry at a 4×4 pose as an FCL object."""
    return fcl.CollisionObject(solid, fcl.Transform(frame[:3, :3], frame[:3, 3]))


def placed(part: Part, pose: Array) -> fcl.CollisionObject:
    """Return a part of an object at `pose` as an FCL object."""
    rotation = pose[:3, :3]
    centre = rotation @ part.xyz + pose[:3, 3]
    if part.yaw:
        rotation = rotation @ part.pose[:3, :3]
    return fcl.CollisionObject(geometry(part), fcl.Transform(rotation, centre))


def collide(shape_a: Shape, pose_a: Array, shape_b: Shape, pose_b: Array, *, envelope: bool = True) -> bool:
    """Tell whether two placed shapes overlap; with `envelope`, their envelopes count as solid too."""
    reach = shape_a.radius + shape_b.radius
    dx, dy, dz = (pose_a[:3, 3] - pose_b[:3, 3]).tolist()
    if dx * dx + dy * dy + dz * dz > reach * reach:
        return False
    others = [placed(part, pose_b) for part in shape_b.volumes(envelope=envelope)]
    for part in shape_a.volumes(envelope=envelope):
        body = placed(part, pose_a)
        for other in others:
            if fcl.collide(body, other, _REQUEST, fcl.CollisionResult()):
                return True
    return False


def hits_table(shape: Shape, pose: Array) -> bool:
    """Tell whether a placed shape reaches below the top of the fixed table, the plane z = 0."""
    frames = ((part, pose @ part.pose) for part in shape.parts)
    return any(frame[2, 3] - part.below(frame) < 0 for part, frame in frames)


def _stop_at_first(first: Any, second: Any, data: Any) -> bool:
    """Broadphase callback: true ends the query."""
    if fcl.collide(first, second, data.request, data.result):
        data.done = True
    return bool(data.done)


def _manager(objects: list[fcl.CollisionObject]) -> fcl.DynamicAABBTreeCollisionManager | None:
    """Return a broadphase manager of the objects, None when there are none."""
    if not objects:
        return None
    manager = fcl.DynamicAABBTreeCollisionManager()
    manager.registerObjects(objects)
    manager.setup()
    return manager


class Swept:
    """A fixed set of placed bodies, built once and queried often.

    `solid` are FCL objects, e.g. the links of a robot and a held object along a path; `space` are those that
    count only when envelopes do. `around` are spheres that contain all of them: centres (n, 3) and radii (n,) in m;
    what is clear of every sphere is clear of the bodies.
    """

    def __init__(
        self,
        solid: Iterable[fcl.CollisionObject],
        space: Iterable[fcl.CollisionObject] = (),
        around: tuple[Array, Array] | None = None,
    ) -> None:
        self._around = around
        if around is not None:
            self._centre = around[0].mean(axis=0)
            self._radius = float((np.linalg.norm(around[0] - self._centre, axis=1) + around[1]).max())
        self.solid = list(solid)
        self.space = list(space)
        self._managers = [m for m in (_manager(self.solid),) if m]
        self._with_space = self._managers + [m for m in (_manager(self.space),) if m]

    def hits(self, shape: Shape, pose: Array, *, envelope: bool = True) -> bool:
        """Tell whether a placed shape overlaps any body; `envelope` counts the envelopes of both sides."""
        if self._around is not None:
            x, y, z = (pose[:3, 3] - self._centre).tolist()
            if x * x + y * y + z * z > (self._radius + shape.radius) ** 2:
                return False
            apart = self._around[0] - pose[:3, 3]
            if ((apart * apart).sum(axis=1) > (self._around[1] + shape.radius) ** 2).all():
                return False
        managers = self._with_space if envelope else self._managers
        with Held():  # FCL swallows what is raised while it calls back
            for part in shape.volumes(envelope=envelope):
                body = placed(part, pose)
                for manager in managers:
                    data = fcl.CollisionData()
                    manager.collide(body, data, _stop_at_first)
                    if data.result.is_collision:
                        return True
        return False
