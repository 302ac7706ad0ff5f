"""Meshes as shapes: convex solids for collisions, the face they stand on, and the file to draw.

A mesh need not be closed: what collides is its convex hull, or the hulls of its pieces.
"""

from __future__ import annotations

import hashlib
import math
import zipfile
from contextlib import suppress
from functools import lru_cache
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
import platformdirs

from gentamp_lp.base.writing import replacing
from gentamp_lp.errors import InputError
from gentamp_lp.geometry.shapes import BLUE, Look, Rgba, Shape, hull, tray
from gentamp_lp.geometry.transforms import Array

if TYPE_CHECKING:
    import trimesh

Collision = Literal["hull", "pieces"]
"""What a mesh collides as: one convex hull, or the hulls of convex pieces (slower, and open where the mesh is)."""

Vector = tuple[float, float, float]

LEANING = math.radians(15.0)
"""How far a mesh may lean from the direction that is said to be up, when it stands."""

RIM = 0.010
"""Height (m) of the walls of a tray that is a mesh."""

_CONVEX = 0.98  # a piece that fills so much of its hull is taken for convex
_FLAT = 1e-6  # of the mesh's size: a thinner piece has no volume


def mesh(
    path: Path, scale: float = 1.0, up: Vector = (0.0, 0.0, 1.0), collision: Collision = "hull", rgba: Rgba = BLUE
) -> Shape:
    """Return the shape of a mesh file, its lengths multiplied by `scale` to be in m.

    It stands on the face on which it is stable with `up`, a direction in the file's frame, nearest to upwards; the
    frame of the shape is below its centre of mass. Raises ValueError, with a remedy, for a file that is no mesh, is
    empty or flat, or does not stand that way.
    """
    standing, solids = _standing(path, up, collision)
    parts = tuple(hull(points * scale) for points in solids)
    place = standing.copy()
    place[:3, 3] *= scale
    return Shape(parts, rgba, look=Look(path, scale, place))


def tray_mesh(path: Path, length: float, width: float) -> Shape:
    """Return a tray with a mesh for its body, stretched so that `length` and `width` (m) are free between its walls.

    Its walls are `RIM` high, low enough for fingers to reach between them. Raises ValueError for a mesh that does not
    consist of a floor and walls round it.
    """
    _, solids = _standing(path, (0.0, 0.0, 1.0), "pieces")
    lower, upper = (np.array([edge(points, axis=0) for points in solids]) for edge in (np.min, np.max))
    away = np.maximum(lower, -upper)[:, :2]  # how far a piece is from the middle, along x and y
    walls = (away > 0).any(axis=1)
    if walls.all() or not (away[walls] > 0).any(axis=0).all():
        raise ValueError(f"the mesh `{path.name}` is no tray: it needs a floor, and walls of their own on all sides")
    inner = 2 * np.where(away > 0, away, np.inf).min(axis=0)
    scale = np.array([length / inner[0], width / inner[1], RIM / upper[:, 2].max()])
    floor = float(upper[~walls, 2].max() * scale[2])
    return tray(length, width, body=tuple(hull(points * scale) for points in solids), floor=floor)


@lru_cache
def _standing(path: Path, up: Vector, collision: Collision) -> tuple[Array, list[Array]]:
    """Return the pose (4×4) in which a mesh of scale 1 stands, and the vertices (n, 3) of its solids in that pose."""
    import trimesh

    solids = _pieces(path) if collision == "pieces" else [np.asarray(_read(path).convex_hull.vertices)]
    hulls = [trimesh.convex.convex_hull(points) for points in solids]
    volumes = np.array([solid.volume for solid in hulls])
    centre = volumes @ [solid.center_mass for solid in hulls] / volumes.sum()
    ups = _stable(trimesh.convex.convex_hull(np.vstack(solids)), centre)
    wanted = np.array(up) / max(float(np.linalg.norm(up)), 1e-12)
    best = ups[int(np.argmax(ups @ wanted))] if len(ups) else -wanted
    if best @ wanted < math.cos(LEANING):
        choices = "; ".join(str(other) for other in np.unique(ups.round(2), axis=0)[:6].tolist())
        raise ValueError(f"the mesh `{path.name}` does not stand with {list(up)} up: choose `up` among {choices}")
    place = np.eye(4)
    place[:3, :3] = _upright(best)
    turned = [points @ place[:3, :3].T for points in solids]
    bottom = min(float(points[:, 2].min()) for points in turned)
    x, y, _ = place[:3, :3] @ centre
    place[:3, 3] = -x, -y, -bottom
    return place, [points + place[:3, 3] for points in turned]


def _stable(solid: trimesh.Trimesh, centre: Array) -> Array:
    """Return the directions (n, 3) that may be up: those of faces with the centre of mass over them, as they lie."""
    import trimesh

    normals = solid.face_normals
    below = centre + normals * ((solid.triangles[:, 0] - centre) * normals).sum(axis=1)[:, None]
    barycentric: Any = trimesh.triangles.points_to_barycentric
    inside = (barycentric(solid.triangles, below) >= -1e-9).all(axis=1)
    return np.asarray(-normals[inside])


def _upright(direction: Array) -> Array:
    """Return the smallest rotation (3×3) that turns a unit vector upwards."""
    x, y, z = direction
    if z < -1 + 1e-9:
        return np.diag([1.0, -1.0, -1.0])
    skew = np.array([[0.0, 0.0, -x], [0.0, 0.0, -y], [x, y, 0.0]])
    return np.asarray(np.eye(3) + skew + skew @ skew / (1 + z))


def _read(path: Path) -> trimesh.Trimesh:
    """Read a mesh and see that it has volume. Raises ValueError."""
    import trimesh

    try:
        found = trimesh.load_mesh(path, process=False)
        result = trimesh.Trimesh(found.vertices, found.faces)
    except Exception as error:
        raise ValueError(f"cannot read the mesh `{path.name}` ({error}): export it again as .obj or .stl") from None
    if not len(result.faces) or not np.isfinite(result.vertices).all():
        raise ValueError(f"the mesh `{path.name}` is empty: give a file with faces")
    if _flat(result):
        raise ValueError(f"the mesh `{path.name}` is flat: give one with volume")
    return result


def _flat(piece: trimesh.Trimesh) -> bool:
    points = np.asarray(piece.vertices)
    spread = np.linalg.svd(points - points.mean(axis=0), compute_uv=False)
    return len(points) < 4 or bool(spread[-1] < _FLAT * max(float(spread[0]), 1e-12))


def _pieces(path: Path) -> list[Array]:
    """Return the vertices of convex pieces of a mesh: its separate parts if these are convex, else V-HACD's.

    The latter takes seconds, so that it is cached on disk; sheets without volume are left out.
    """
    from gentamp_lp.geometry.bullet import decompose

    whole = _read(path)
    parts = [part for part in whole.split(only_watertight=False) if not _flat(part)]
    if parts and all(part.is_watertight and part.volume > _CONVEX * part.convex_hull.volume for part in parts):
        return [np.asarray(part.convex_hull.vertices) for part in parts]
    vertices, faces = np.asarray(whole.vertices), np.asarray(whole.faces)
    digest = hashlib.sha256(vertices.tobytes() + faces.tobytes()).hexdigest()
    cache = Path(platformdirs.user_cache_dir("gentamp-lp"), "pieces", f"{digest[:24]}.npz")
    with suppress(OSError, ValueError, zipfile.BadZipFile), np.load(cache) as stored:  # missing or damaged
        return [stored[name] for name in stored.files]
    found = decompose(vertices, faces)
    with suppress(InputError), replacing(cache) as beside, beside.open("wb") as file:  # it only saves time
        np.savez(file, *found)
    return found
