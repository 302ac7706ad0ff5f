"""Pictures: a still PNG of a scene and an animated GIF of a plan, rendered in software."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
from PIL import Image

from gentamp_lp.base.writing import replacing
from gentamp_lp.geometry.bullet import Bullet, Camera, Closing
from gentamp_lp.geometry.models import load_model
from gentamp_lp.geometry.playback import State
from gentamp_lp.geometry.robots import Robot
from gentamp_lp.geometry.shapes import Rgba, Shape, box
from gentamp_lp.geometry.transforms import Array, difference, inverse, pose

STILL = Camera()
"""View of a still picture."""

MOVIE = replace(STILL, width=480, height=360)
"""View of an animation."""

WOOD: Rgba = (0.80, 0.72, 0.62, 1.0)
TABLE_TOP = box(1.10, 1.30, 0.04), pose(0.30, 0.0, -0.04)


class Scene(Closing):
    """A robot at tables with objects, to be looked at. Use it as a context manager or call `close`.

    `tables` are their shapes and poses; the default is a table top in front of a robot at the origin.
    """

    def __init__(self, robot: Robot, tables: Sequence[tuple[Shape, Array]] = (TABLE_TOP,)) -> None:
        self._world = Bullet()
        self._model = load_model(self._world, robot)
        self._bodies: dict[str, int] = {}
        for shape, where in tables:
            self._world.add(replace(shape, rgba=WOOD), where)

    def close(self) -> None:
        """Free the PyBullet world."""
        self._world.close()

    def add(self, name: str, shape: Shape, pose: Array) -> None:
        """Add an object; its colour is that of the shape."""
        self._bodies[name] = self._world.add(shape, pose)

    def move(self, name: str, pose: Array) -> None:
        """Put an object elsewhere. Raises KeyError for an unknown name."""
        self._world.move(self._bodies[name], pose)

    def show(self, name: str, shape: Shape, pose: Array) -> None:
        """Add an object or, when it is there already, move it."""
        if name in self._bodies:
            self.move(name, pose)
        else:
            self.add(name, shape, pose)

    def set_robot(self, configuration: Array, opening: float) -> None:
        """Let the robot take on a configuration (dof,) with a finger distance (m)."""
        self._model.set(configuration, opening)

    def picture(self, camera: Camera = STILL, samples: int = 2) -> Image.Image:
        """Return what the camera sees; each pixel is averaged over `samples`² to smooth the edges."""
        fine = replace(camera, width=camera.width * samples, height=camera.height * samples)
        image = Image.fromarray(self._world.picture(fine))
        return image.resize((camera.width, camera.height), Image.Resampling.LANCZOS)


def smooth(robot: Robot, states: Iterable[State], longest: float = 0.08) -> Iterator[State]:
    """Yield the states with more between those whose tools are farther apart than `longest` (m).

    Large turns of a joint are divided too. This is for the eye: nothing is checked on these ways. Objects
    that moved from one state to the next go with the tool.
    """
    given = list(states)
    tools = robot.tools(np.array([state.configuration for state in given])) if given else ()
    before: State | None = None
    for index, state in enumerate(given):
        if before is not None:
            first, last = tools[index - 1], tools[index]
            metres, radians = difference(first, last)
            turn = max(radians, float(np.abs(state.configuration - before.configuration).max()))
            count = math.ceil(max(metres / longest, turn / (6 * longest))) - 1
            if count > 0:
                moved = [n for n, p in state.poses.items() if not np.allclose(p, before.poses.get(n, p))]
                for middle in robot.between(before.configuration, state.configuration, count):
                    change = robot.tool(middle) @ inverse(first)
                    poses = before.poses | {name: change @ before.poses[name] for name in moved}
                    yield State(middle, before.opening, poses, before.held)
        yield state
        before = state


def film(
    robot: Robot,
    shapes: Mapping[str, Shape],
    states: Iterable[State],
    camera: Camera = MOVIE,
    tables: Sequence[tuple[Shape, Array]] = (),
) -> Iterator[Image.Image]:
    """Yield a picture of each state; `shapes` gives the objects to draw, `tables` the tables of a room."""
    with Scene(robot, tables or (TABLE_TOP,)) as scene:
        for state in states:
            for name, shape in shapes.items():
                if name in state.poses:
                    scene.show(name, shape, state.poses[name])
            scene.set_robot(state.configuration, state.opening)
            yield scene.picture(camera)


def save_still(image: Image.Image, path: Path) -> None:
    """Write a picture as PNG."""
    with replacing(path) as file:
        image.save(file, format="PNG", optimize=True)


def save_movie(images: Iterable[Image.Image], path: Path, *, seconds: float = 0.1, pause: float = 1.0) -> None:
    """Write pictures as a GIF that repeats; each shows for `seconds`, the last one for `pause` longer.

    All share one palette, made from some of them, so that the background does not flicker. Raises ValueError
    when there is no picture.
    """
    frames = list(images)
    if not frames:
        raise ValueError("a movie needs at least one picture")
    sample = frames[:: max(1, len(frames) // 4)]
    strip = Image.new("RGB", (frames[0].width, frames[0].height * len(sample)))
    for index, frame in enumerate(sample):
        strip.paste(frame, (0, index * frame.height))
    palette = strip.quantize(192, method=Image.Quantize.FASTOCTREE)
    reduced = [frame.quantize(palette=palette, dither=Image.Dither.NONE) for frame in frames]
    times = [round(1000 * seconds)] * (len(reduced) - 1) + [round(1000 * (seconds + pause))]
    first, *others = reduced
    with replacing(path) as file:
        first.save(file, format="GIF", save_all=True, append_images=others, duration=times, loop=0, optimize=True)
