"""Robot descriptions: a YAML file beside a URDF that says which joints are the arm and what the gripper is."""

from __future__ import annotations

import math
import xml.etree.ElementTree as ET
from importlib.metadata import PackageNotFoundError, distribution
from pathlib import Path
from typing import Any

import numpy as np
from pydantic import BaseModel, ConfigDict, Field
from pydantic.json_schema import SkipJsonSchema

from gentamp_lp.base.reading import read_yaml, validated
from gentamp_lp.errors import Diagnostic, InputError
from gentamp_lp.geometry.chain import frame, link_of, motion, origin
from gentamp_lp.geometry.links import Link
from gentamp_lp.geometry.transforms import Array

Vector = tuple[float, float, float]
FOLDER = Path(__file__).parent / "descriptions"


class _Section(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True)


class Frame(_Section):
    """A pose: metres, and roll, pitch, yaw in rad as in a URDF."""

    xyz: Vector = (0.0, 0.0, 0.0)
    rpy: Vector = (0.0, 0.0, 0.0)

    @property
    def matrix(self) -> Array:
        """The 4×4 pose."""
        return frame(self.xyz, self.rpy)


class Finger(_Section):
    """A joint that opens the gripper: prismatic, or turning at `radius` (m) from the pad.

    `overlap` is how far (m) the pad would be beyond the middle with the joint at 0.
    """

    joint: str
    radius: float | None = Field(None, gt=0)
    overlap: float = 0.0

    def value(self, opening: float) -> float:
        """The joint's value (m, rad) at a distance (m) of the pads."""
        away = opening / 2 + self.overlap
        return away if self.radius is None else math.asin(away / self.radius)


class Workspace(_Section):
    """A ball (m, z = 0 is the table top) that the last joint cannot leave; targets outside are refused at once.

    `lift`: where the arm is on a torso that rises, the centre rises with it, by so much (m).
    """

    centre: Vector
    radius: float = Field(gt=0)
    lift: float = Field(0.0, ge=0)

    def holds(self, points: Array) -> bool:
        """Whether all points (n, 3) are inside."""
        nearest = np.repeat(np.array([self.centre]), len(points), axis=0)
        nearest[:, 2] += np.clip(points[:, 2] - nearest[:, 2], 0.0, self.lift)
        return bool((np.linalg.norm(points - nearest, axis=1) <= self.radius).all())


class Box(_Section):
    """A box between two corners (m)."""

    lower: Vector
    upper: Vector


class Drive(_Section):
    """A base that drives.

    Things should be `stance` (m) in front of it and `aside` (m) to its left; `platform` is its body, where the URDF
    has none.
    """

    stance: float = Field(gt=0)
    aside: float = 0.0
    platform: Box | None = None


class Description(_Section):
    """What a URDF does not say about a robot with an arm and a parallel gripper."""

    distribution: str | None = Field(None, description="PyPI package that ships the files; else beside this file")
    urdf: str
    packages: str | None = Field(None, description="folder that package:// stands for; the URDF's by default")
    tip: str = Field(description="link that moves with the gripper")
    tool: Frame = Field(Frame(), description="in the tip's frame: origin between the pads, z forward, y closing")
    home: dict[str, float] = Field(min_length=1, description="the arm's joints, root to tip, and where they rest")
    posture: dict[str, float] = Field(default_factory=dict, description="other joints that are not to be at 0")
    opening: float = Field(gt=0, description="largest distance (m) of the pads")
    fingers: tuple[Finger, ...] = Field(min_length=2)
    pads: tuple[str, str] = Field(description="the links that touch what is held")
    mount: Frame = Field(Frame(), description="the root link's frame; z = 0 is the table top")
    mounted: tuple[str, ...] = Field((), description="moving links that may touch the table")
    self_collisions: tuple[tuple[tuple[str, ...], tuple[str, ...]], ...] = Field(
        (), description="groups of links that are tested against each other"
    )
    workspace: Workspace | None = None
    restarts: int | None = Field(
        None, gt=0, description="random starts of damped least squares alone, instead of PyBullet's inverse kinematics"
    )
    base: Drive | None = None
    path: SkipJsonSchema[Path] = Path()

    @property
    def urdf_path(self) -> Path:
        """The URDF file. Raises InputError when its package is missing."""
        return self._file(self.urdf)

    @property
    def packages_path(self) -> Path:
        """The folder that package:// stands for."""
        return self._file(self.packages) if self.packages is not None else self.urdf_path.parent

    def _file(self, name: str) -> Path:
        if self.distribution is None:
            return self.path.parent / name
        try:
            return Path(str(distribution(self.distribution).locate_file(name)))
        except PackageNotFoundError:
            missing = Diagnostic(
                "the package with this robot's files is missing", self.path, hint=f"pip install {self.distribution}"
            )
            raise InputError(missing) from None


def load_description(path: Path) -> Description:
    """Read a description. Raises InputError with the file and what is wrong."""
    data = read_yaml(path)
    value = {**data, "path": path} if isinstance(data, dict) else data
    return validated(Description, value, data, path, hint="see docs/robots.md")


class Bodies:
    """The solid links of a URDF, each rigidly behind one joint of the arm or behind none.

    `behind[i]` is how many of the arm's joints move `links[i]`; `offset(i, opening)` is its pose in the frame of the
    last of these (in the root's, for 0).
    """

    def __init__(self, description: Description, chain_links: tuple[str, ...]) -> None:
        urdf = description.urdf_path
        root = ET.parse(urdf).getroot()
        joints = {link_of(joint, "child"): joint for joint in root.iter("joint") if joint.find("child") is not None}
        fingers = {finger.joint: finger for finger in description.fingers}
        self.links: list[Link] = []
        self.names: list[str] = []
        self.behind: list[int] = []
        self._paths: list[list[tuple[Array, ET.Element, Finger | None]]] = []
        self._posture = description.posture
        meshes: dict[str, Any] = {}
        for element in root.iter("link"):
            name = element.attrib["name"]
            steps, current = [], name
            while current not in chain_links and current in joints:
                joint = joints[current]
                steps.append((origin(joint), joint, fingers.get(joint.attrib["name"])))
                current = link_of(joint, "parent")
            for collision in element.findall("collision"):
                vertices, faces = _hull(collision, description, meshes)
                self.links.append(Link(name, vertices, faces))
                self.names.append(name)
                self.behind.append(chain_links.index(current) + 1 if current in chain_links else 0)
                self._paths.append(steps[::-1])

    def offset(self, index: int, opening: float) -> Array:
        """Return the pose (4×4) of a link behind the last joint of the arm that moves it."""
        result = np.eye(4)
        for place, joint, finger in self._paths[index]:
            value = finger.value(opening) if finger else self._posture.get(joint.attrib["name"], 0.0)
            result = result @ place @ motion(joint, value)
        return result


def _hull(
    collision: ET.Element, description: Description, meshes: dict[str, Any]
) -> tuple[Array, np.ndarray[Any, Any]]:
    """Return vertices (n, 3) and faces (m, 3) of the convex hull of a collision element, in its link's frame."""
    import trimesh

    geometry = collision.find("geometry")
    shape = geometry[0] if geometry is not None and len(geometry) else None
    if shape is None:
        raise InputError(Diagnostic("a collision element has no geometry", description.urdf_path))
    match shape.tag:
        case "mesh":
            file = shape.attrib["filename"]
            folder = description.packages_path if file.startswith("package://") else description.urdf_path.parent
            if file not in meshes:
                meshes[file] = trimesh.load_mesh(folder / file.removeprefix("package://")).convex_hull
            scale = [float(v) for v in shape.get("scale", "1 1 1").split()]
            vertices, faces = np.array(meshes[file].vertices) * scale, np.array(meshes[file].faces)
        case "box":
            solid = trimesh.creation.box([float(v) for v in shape.attrib["size"].split()])
            vertices, faces = np.array(solid.vertices), np.array(solid.faces)
        case "cylinder":
            solid = trimesh.creation.cylinder(float(shape.attrib["radius"]), float(shape.attrib["length"]))
            solid = solid.convex_hull
            vertices, faces = np.array(solid.vertices), np.array(solid.faces)
        case "sphere":
            solid = trimesh.creation.icosphere(2, float(shape.attrib["radius"]))
            vertices, faces = np.array(solid.vertices), np.array(solid.faces)
        case other:
            raise InputError(Diagnostic(f"unknown collision geometry <{other}>", description.urdf_path))
    place = origin(collision)
    return vertices @ place[:3, :3].T + place[:3, 3], faces
