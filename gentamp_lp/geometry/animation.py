"""A plan in three dimensions: a scene in trimesh's own viewer, and where everything is at each moment."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import islice
from typing import Any

import numpy as np

from gentamp_lp.geometry.bullet import Camera
from gentamp_lp.geometry.links import Link
from gentamp_lp.geometry.playback import State
from gentamp_lp.geometry.render import TABLE_TOP, WOOD, smooth
from gentamp_lp.geometry.robots import Robot
from gentamp_lp.geometry.shapes import Shape, to_trimesh
from gentamp_lp.geometry.transforms import Array, quaternion

_WHITE = (235, 235, 240, 255)


@dataclass(frozen=True)
class Animation:
    """An HTML page that shows the scene, and its frames.

    The nodes of the scene are named n0, n1, ... A frame is the number of its step (0: before the first) and the
    positions (m) and quaternions x, y, z, w of the nodes that moved since the frame before.
    """

    viewer: str
    frames: list[tuple[int, dict[int, list[float]]]]
    camera: Camera


def animate(
    robot: Robot,
    shapes: Mapping[str, Shape],
    moments: Sequence[Sequence[State]],
    camera: Camera,
    tables: Sequence[tuple[Shape, Array]] = (),
    mats: Iterable[tuple[Shape, Array]] = (),
) -> Animation:
    """Animate the states of each step (the first list: before any), with states in between for the eye.

    `tables` and `mats` do not move; without tables there is a table top in front of the robot.
    """
    import trimesh
    from trimesh.viewer.notebook import scene_to_html

    scene = trimesh.Scene()
    steps, states = zip(*_in_between(robot, moments), strict=True)
    names = [name for name in shapes if name in states[0].poses]
    places = _places(robot, names, states)
    still = [(replace(shape, rgba=WOOD), where) for shape, where in tables or (TABLE_TOP,)] + list(mats)
    meshes = [_mesh(link) for link in robot.links] + [to_trimesh(shapes[name]) for name in names]
    for number, (mesh, where) in enumerate(
        [*zip(meshes, places[0], strict=True), *((to_trimesh(shape), where) for shape, where in still)]
    ):
        scene.add_geometry(mesh, node_name=f"n{number}", geom_name=f"g{number}", transform=where)
    numbers = np.concatenate([places[..., :3, 3], quaternion(places)], axis=2).round(4) + 0.0  # no -0.0
    moved = np.ones(numbers.shape[:2], dtype=bool)
    moved[1:] = (numbers[1:] != numbers[:-1]).any(axis=2)
    frames = [
        (step, {int(node): now[node].tolist() for node in np.flatnonzero(new)})
        for step, now, new in zip(steps, numbers, moved, strict=True)
    ]
    return Animation(scene_to_html(scene), frames, camera)


def _in_between(robot: Robot, moments: Sequence[Sequence[State]]) -> Iterable[tuple[int, State]]:
    last: list[State] = []
    for number, states in enumerate(moments):
        yield from ((number, state) for state in islice(smooth(robot, [*last, *states]), len(last), None))
        last = list(states[-1:]) or last


def _places(robot: Robot, names: Sequence[str], states: Sequence[State]) -> Array:
    """The poses (n, nodes, 4, 4) of the robot's links and of the objects."""
    configurations = np.array([state.configuration for state in states])
    openings = np.array([state.opening for state in states])
    links = np.empty((len(states), len(robot.links), 4, 4))
    for opening in np.unique(openings):
        links[openings == opening] = robot.frames(configurations[openings == opening], float(opening))
    objects = np.array([[state.poses[name] for name in names] for state in states])
    return np.concatenate([links, objects.reshape(len(states), len(names), 4, 4)], axis=1)


def _mesh(link: Link) -> Any:
    """What to draw of a link: its finer mesh if there is one."""
    import trimesh

    vertices, faces = link.vertices, link.faces
    if link.look is not None:
        look: Any = trimesh.load(link.look, force="mesh")
        vertices, faces = look.vertices, look.faces
    mesh: Any = trimesh.Trimesh(vertices, faces)
    mesh.visual.face_colors = _WHITE
    return mesh
