"""The rigid bodies of a robot."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from gentamp_lp.geometry.collision import Geometry, convex
from gentamp_lp.geometry.transforms import Array


class Link:
    """A convex rigid body of a robot: a mesh in its own frame, vertices (n, 3) in m and triangles (m, 3).

    `look` is a finer mesh file to draw.
    """

    def __init__(self, name: str, vertices: Array, faces: Array, look: Path | None = None) -> None:
        self.name = name
        self.look = look
        self.vertices = vertices
        self.faces = faces
        self.geometry: Geometry = convex(vertices, faces)
        self.centre = (vertices.min(axis=0) + vertices.max(axis=0)) / 2
        self.radius = float(np.linalg.norm(vertices - self.centre, axis=1).max())


@dataclass(frozen=True, eq=False)
class Body:
    """A link and its 4×4 pose in the world."""

    link: Link
    pose: Array
