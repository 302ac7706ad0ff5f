"""PyBullet, the only module that imports it: loading, inverse kinematics, distances and pictures.

PyBullet writes greetings and warnings straight to the file descriptors of the process. They are held back
while a call runs; known chatter is dropped and the rest goes to stderr, so that stdout stays clean.
"""

from __future__ import annotations

import math
import os
import re
import sys
import tempfile
from abc import ABC, abstractmethod
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from types import TracebackType
from typing import Any, Self

import numpy as np

from gentamp_lp.geometry.shapes import Hull, Rgba, Shape
from gentamp_lp.geometry.transforms import Array, quaternion, rotation

_NO_INERTIA = re.compile(r"b3Warning\[[^]]*BulletUrdfImporter[^]]*\]:\n\w[^\n]*?(?=b3Warning|\n|\Z)")  # of mere frames
_CHATTER = ("pybullet build time", "argv[0]=", "startThreads", "started thread")


@contextmanager
def _quiet(*, wholly: bool = False) -> Iterator[None]:
    """Hold back what the process writes meanwhile; afterwards pass all but known chatter to stderr, unless `wholly`."""
    sys.stdout.flush()
    sys.stderr.flush()
    saved = os.dup(1), os.dup(2)
    with tempfile.TemporaryFile() as held:
        try:
            os.dup2(held.fileno(), 1)
            os.dup2(held.fileno(), 2)
            yield
        finally:
            sys.stdout.flush()
            sys.stderr.flush()
            for descriptor, copy in zip((1, 2), saved, strict=True):
                os.dup2(copy, descriptor)
                os.close(copy)
            held.seek(0, os.SEEK_END if wholly else os.SEEK_SET)
            for line in _NO_INERTIA.sub("", held.read().decode(errors="replace")).splitlines():
                if line.strip() and not line.startswith(_CHATTER):
                    print(line, file=sys.stderr)  # noqa: T201


with _quiet():
    import pybullet

_CONCAVITY, _VOXELS = 0.005, 100_000  # of a convex decomposition: how deep a piece may be hollow, share of the whole


@dataclass(frozen=True)
class Camera:
    """Where a picture is taken from, in metres, pixels and degrees; light coefficients are from 0 to 1."""

    eye: tuple[float, float, float] = (1.50, -0.90, 0.82)
    target: tuple[float, float, float] = (0.28, 0.0, 0.27)
    angle: float = 34.0
    width: int = 800
    height: int = 600
    light: tuple[float, float, float] = (0.6, -1.0, 1.6)
    background: tuple[int, int, int] = (226, 233, 239)
    ambient: float = 0.55
    diffuse: float = 0.50
    specular: float = 0.10

    def framing(self, centres: Array, radii: Array) -> Camera:
        """Return a camera that looks the same way and has all spheres (n, 3) and (n,), in m, in its picture.

        It is as near as can be. In coordinates along its axes, a sphere must be on the inner side of each of the four
        planes that bound what it sees; the left and the right one leave an interval for where it can be, and so do the
        upper and the lower one.
        """
        ahead = np.subtract(self.target, self.eye)
        ahead /= np.linalg.norm(ahead)
        right = np.cross(ahead, (0.0, 0.0, 1.0))
        right /= np.linalg.norm(right)
        axes = np.stack([right, np.cross(right, ahead), ahead])
        *across, depth = axes @ centres.T
        slopes = math.tan(math.radians(self.angle) / 2) * np.array([self.width / self.height, 1.0])
        least, most = np.array([
            (np.max(place - slope * depth + radii * math.hypot(1.0, slope)),
             np.min(place + slope * depth - radii * math.hypot(1.0, slope)))
            for place, slope in zip(across, slopes, strict=True)
        ]).T  # fmt: skip
        eye = np.array([*(least + most) / 2, np.min((most - least) / (2 * slopes))]) @ axes
        target = eye + ahead * float((centres - eye).mean(axis=0) @ ahead)
        return replace(self, eye=tuple(eye.tolist()), target=tuple(target.tolist()))


class Closing(ABC):
    """Something that must be closed, and is at the end of a `with` block."""

    @abstractmethod
    def close(self) -> None:
        """Free what is held."""

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()


class Bullet(Closing):
    """A private PyBullet world without a window; use it as a context manager or call `close`."""

    def __init__(self) -> None:
        self.client: int = pybullet.connect(pybullet.DIRECT)
        if self.client < 0:
            raise RuntimeError("PyBullet gave no connection")
        self._centres: dict[int, Array] = {}  # of mass, in the base's URDF frame: what PyBullet moves
        self._solid: dict[int, list[int]] = {}  # the links of a body with a collision shape
        self._boxes: dict[int, Array] = {}  # around them, until they move

    def close(self) -> None:
        """End the world; calling it again does nothing."""
        if self.client >= 0:
            pybullet.disconnect(physicsClientId=self.client)
            self.client = -1

    # bodies

    def load(self, urdf: Path) -> int:
        """Load a URDF with its base fixed at the origin and return the body. Raises pybullet.error."""
        with _quiet():
            body = int(pybullet.loadURDF(str(urdf), useFixedBase=True, physicsClientId=self.client))
        centre, turn = pybullet.getDynamicsInfo(body, -1, physicsClientId=self.client)[3:5]
        self._centres[body] = np.eye(4)
        self._centres[body][:3, :3], self._centres[body][:3, 3] = rotation(np.array(turn)), centre
        return body

    def add(self, shape: Shape, pose: Array) -> int:
        """Add the solid parts of a shape as one movable, massless body and return it."""
        kinds = {"box": pybullet.GEOM_BOX, "cylinder": pybullet.GEOM_CYLINDER, "hull": pybullet.GEOM_MESH}
        rounds = [(p.size[0], p.size[1]) if p.kind == "cylinder" else (0.0, 0.0) for p in shape.parts]
        positions = [p.pose[:3, 3].tolist() for p in shape.parts]
        turns = [quaternion(p.pose).tolist() for p in shape.parts]
        with tempfile.TemporaryDirectory() as folder, _quiet():
            pieces: dict[str, Any] = {
                "shapeTypes": [kinds[p.kind] for p in shape.parts],
                "halfExtents": [[s / 2 for s in p.size] if p.kind == "box" else [0.0] * 3 for p in shape.parts],
                "radii": [radius for radius, _ in rounds],
                "lengths": [height for _, height in rounds],
                "fileNames": [_write(p.hull, Path(folder)) if p.hull else "" for p in shape.parts],
                "meshScales": [[1.0] * 3] * len(shape.parts),
            }
            collision = pybullet.createCollisionShapeArray(
                **pieces,
                collisionFramePositions=positions,
                collisionFrameOrientations=turns,
                physicsClientId=self.client,
            )
            if shape.look is not None:
                visual = pybullet.createVisualShape(
                    pybullet.GEOM_MESH,
                    fileName=str(shape.look.file),
                    meshScale=[shape.look.scale] * 3,
                    rgbaColor=shape.rgba,
                    visualFramePosition=shape.look.pose[:3, 3].tolist(),
                    visualFrameOrientation=quaternion(shape.look.pose).tolist(),
                    physicsClientId=self.client,
                )
            else:
                visual = pybullet.createVisualShapeArray(
                    **pieces,
                    rgbaColors=[shape.rgba] * len(shape.parts),
                    visualFramePositions=positions,
                    visualFrameOrientations=turns,
                    physicsClientId=self.client,
                )
        body = self._body(collision, visual, pose)
        if any(p.hull for p in shape.parts):  # PyBullet makes hulls thicker by 1 mm unless asked not to
            pybullet.changeDynamics(body, -1, collisionMargin=0.0, physicsClientId=self.client)
        return body

    def add_hull(self, vertices: Array, rgba: Rgba, pose: Array, look: Path | None = None) -> int:
        """Add the convex hull of vertices (n, 3) as a movable, massless body and return it.

        `look` is a mesh file that is drawn in its place.
        """
        corners = vertices.tolist()
        with _quiet():
            collision = pybullet.createCollisionShape(pybullet.GEOM_MESH, vertices=corners, physicsClientId=self.client)
            visual = -1
            if look is not None:
                visual = pybullet.createVisualShape(
                    pybullet.GEOM_MESH, fileName=str(look), rgbaColor=rgba, physicsClientId=self.client
                )
        return self._body(collision, visual, pose)

    def _body(self, collision: int, visual: int, pose: Array) -> int:
        """Make a massless body. Raises RuntimeError when PyBullet refuses."""
        body = pybullet.createMultiBody(
            baseMass=0,
            baseCollisionShapeIndex=collision,
            baseVisualShapeIndex=visual,
            basePosition=pose[:3, 3].tolist(),
            baseOrientation=quaternion(pose).tolist(),
            physicsClientId=self.client,
        )
        if min(collision, body) < 0:
            raise RuntimeError("PyBullet could not make the body")
        return int(body)

    def move(self, body: int, pose: Array) -> None:
        """Put the base of a body (its URDF frame, if it has one) at a pose."""
        self._boxes.pop(body, None)
        pose = pose @ self._centres[body] if body in self._centres else pose
        pybullet.resetBasePositionAndOrientation(
            body, pose[:3, 3].tolist(), quaternion(pose).tolist(), physicsClientId=self.client
        )

    def pose(self, body: int, link: int = -1) -> Array:
        """Return the 4×4 pose of the base (-1) or of the URDF frame of a link."""
        if link < 0:
            position, turn = pybullet.getBasePositionAndOrientation(body, physicsClientId=self.client)
        else:
            state = pybullet.getLinkState(body, link, computeForwardKinematics=True, physicsClientId=self.client)
            position, turn = state[4], state[5]
        result = np.eye(4)
        values = np.array(turn)
        result[:3, :3] = rotation(values / np.linalg.norm(values))
        result[:3, 3] = position
        return result

    # robots

    def links(self, body: int) -> dict[str, int]:
        """Return the link names of a body and their indices."""
        count = pybullet.getNumJoints(body, physicsClientId=self.client)
        infos = [pybullet.getJointInfo(body, i, physicsClientId=self.client) for i in range(count)]
        return {info[12].decode(): info[0] for info in infos}

    def joints(self, body: int) -> dict[str, int]:
        """Return the joint names of a body and their indices."""
        count = pybullet.getNumJoints(body, physicsClientId=self.client)
        infos = [pybullet.getJointInfo(body, i, physicsClientId=self.client) for i in range(count)]
        return {info[1].decode(): info[0] for info in infos}

    def set_joints(self, body: int, joints: Sequence[int], values: Sequence[float] | Array) -> None:
        """Set joint positions (rad or m)."""
        self._boxes.pop(body, None)
        for joint, value in zip(joints, values, strict=True):
            pybullet.resetJointState(body, joint, float(value), physicsClientId=self.client)

    def inverse_kinematics(
        self, body: int, link: int, target: Array, joints: Sequence[int], start: Array, iterations: int
    ) -> Array:
        """Return joint values near `target` (4×4, for the URDF frame of `link`), iterated from `start`.

        Limits are not considered and nothing is promised about the residual: the caller checks both.
        (With limit arguments PyBullet practically never converges to 1 mm.)
        """
        self.set_joints(body, joints, start)
        values = pybullet.calculateInverseKinematics(
            body,
            link,
            target[:3, 3].tolist(),
            quaternion(target).tolist(),
            maxNumIterations=iterations,
            residualThreshold=1e-5,
            physicsClientId=self.client,
        )
        count = pybullet.getNumJoints(body, physicsClientId=self.client)
        places = [pybullet.getJointInfo(body, i, physicsClientId=self.client)[3] for i in range(count)]
        moving = sorted(place for place in places if place >= 0)
        return np.array([values[moving.index(places[joint])] for joint in joints])

    def limits(self, body: int, joints: Sequence[int]) -> tuple[Array, Array]:
        """Return the lower and upper (hard) limits that the URDF gives for joints."""
        infos = [pybullet.getJointInfo(body, j, physicsClientId=self.client) for j in joints]
        return np.array([i[8] for i in infos]), np.array([i[9] for i in infos])

    # distances

    def boxes(self, body: int) -> Array:
        """Return the axis-aligned boxes (n, 2, 3) around the solid links of a body: lower and upper corners (m)."""
        if body not in self._solid:
            count = pybullet.getNumJoints(body, physicsClientId=self.client)
            self._solid[body] = [
                link
                for link in range(-1, count)
                if pybullet.getCollisionShapeData(body, link, physicsClientId=self.client)
            ]
        if body not in self._boxes:
            found = [pybullet.getAABB(body, link, physicsClientId=self.client) for link in self._solid[body]]
            self._boxes[body] = np.array(found).reshape(-1, 2, 3)
        return self._boxes[body]

    def near(self, first: Sequence[int], second: Sequence[int]) -> list[tuple[int, int]]:
        """Return the pairs of a body of the first and one of the second whose boxes meet: no others can overlap."""
        if not first or not second:
            return []
        (one, a), (other, b) = self._all_boxes(first), self._all_boxes(second)
        meet = ((a[:, None, 0] <= b[:, 1]) & (b[:, 0] <= a[:, None, 1])).all(axis=2)
        return list(dict.fromkeys((one[i], other[j]) for i, j in np.argwhere(meet)))

    def _all_boxes(self, bodies: Sequence[int]) -> tuple[list[int], Array]:
        found = [self.boxes(body) for body in bodies]
        return [body for body, boxes in zip(bodies, found, strict=True) for _ in boxes], np.concatenate(found)

    def closest(
        self, first: int, second: int, within: float, link: int | None = None
    ) -> list[tuple[int, float, Array]]:
        """Return where two bodies are at most `within` (m) apart, only at `link` of the first if given.

        Each entry is the link of the first body, the distance (negative: penetration depth) and the
        point (3,) on the second body.
        """
        options = {} if link is None else {"linkIndexA": link}
        points = pybullet.getClosestPoints(first, second, within, physicsClientId=self.client, **options)
        return [(point[3], point[8], np.array(point[6])) for point in points or ()]

    # pictures

    def picture(self, view: Camera) -> np.ndarray[Any, np.dtype[np.uint8]]:
        """Return what a camera sees, rendered in software with shadows: (height, width, 3), 0 to 255."""
        look = pybullet.computeViewMatrix(view.eye, view.target, (0.0, 0.0, 1.0))
        lens = pybullet.computeProjectionMatrixFOV(view.angle, view.width / view.height, 0.05, 10.0)
        image = pybullet.getCameraImage(
            view.width,
            view.height,
            look,
            lens,
            lightDirection=view.light,
            lightColor=(1.0, 1.0, 1.0),
            lightDistance=4.0,
            lightAmbientCoeff=view.ambient,
            lightDiffuseCoeff=view.diffuse,
            lightSpecularCoeff=view.specular,
            shadow=1,
            renderer=pybullet.ER_TINY_RENDERER,
            physicsClientId=self.client,
        )
        pixels = np.reshape(np.asarray(image[2], dtype=np.uint8), (view.height, view.width, 4))[:, :, :3]
        nothing = np.reshape(np.asarray(image[4]), (view.height, view.width)) < 0
        return np.where(nothing[:, :, None], np.array(view.background, dtype=np.uint8), pixels)


def _write(hull: Hull, folder: Path) -> str:
    """Write a hull for PyBullet to read; its name is its own, as PyBullet remembers files by their names."""
    path = folder / f"{hull.digest}.obj"
    _write_obj(path, hull.vertices, hull.faces)
    return str(path)


def _write_obj(path: Path, vertices: Array, faces: np.ndarray[Any, Any]) -> None:
    lines = [*(f"v {x!r} {y!r} {z!r}" for x, y, z in vertices.tolist())]
    lines += [f"f {a} {b} {c}" for a, b, c in (faces + 1).tolist()]
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")


def decompose(vertices: Array, faces: np.ndarray[Any, Any]) -> list[Array]:
    """Return the vertices (n, 3) of convex pieces that together make up a mesh, by V-HACD, which uses no chance."""
    with tempfile.TemporaryDirectory() as folder:
        given, found, log = (Path(folder, name) for name in ("given.obj", "found.obj", "log.txt"))
        _write_obj(given, vertices, faces)
        with _quiet(wholly=True):
            pybullet.vhacd(str(given), str(found), str(log), concavity=_CONCAVITY, resolution=_VOXELS)
        pieces: list[list[list[float]]] = []
        for line in found.read_text(encoding="utf-8").splitlines():
            kind, *numbers = line.split()
            if kind == "o":
                pieces.append([])
            elif kind == "v":
                pieces[-1].append([float(n) for n in numbers])
    return [np.array(piece) for piece in pieces]
