"""The scene, the world and the samplers."""

import zlib
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property, lru_cache

import numpy as np

from gentamp_lp.geometry.collision import Swept
from gentamp_lp.geometry.grasping import Grasp
from gentamp_lp.geometry.make import make_robot
from gentamp_lp.geometry.robots import Robot, Trajectory
from gentamp_lp.geometry.shapes import GAP, Shape, box, cylinder
from gentamp_lp.geometry.transforms import Array, pose
from gentamp_lp.streams.language import Generator, from_fn, from_gen_fn, from_test
from gentamp_lp.tasks import domain_code

FLOOR = np.zeros(3)  # where the robot stands: x, y, yaw
robot_of = lru_cache(make_robot)  # loading a robot takes a while


class Scene(domain_code.Scene):
    """The `scene:` section of a task file."""

    things: str  # the size parameter that counts them
    width: tuple[float, float]  # a range
    height: tuple[float, float]
    room: float  # length of the pallet for each thing


@dataclass(frozen=True, eq=False)
class Reach:
    """An approach to a thing at `target` (4x4), and back."""

    robot: Robot
    name: str
    shape: Shape
    target: Array
    grasp: Grasp
    path: Trajectory

    @cached_property
    def swept(self) -> Swept:
        """All that the hand and the thing in it pass through."""
        return self.robot.swept(self.path, self.shape, self.grasp)


@dataclass(kw_only=True)
class World(domain_code.World):
    """Facts, the robot; shapes, grasps and first poses of things by name; and the pallet's x and y."""

    robot: Robot
    shapes: dict[str, Shape]
    grasps: dict[str, Grasp]
    start: dict[str, Array]
    pallet: tuple[tuple[float, float], tuple[float, float]]


def make_world(scene: Scene, parameters: Mapping[str, int], robot: str, rng: np.random.Generator) -> World:
    """Draw a problem: boxes and cylinders in a row behind the pallet."""
    hand, count = robot_of(robot), parameters[scene.things]
    half = count * scene.room / 2
    names = [f"thing{i}" for i in range(1, count + 1)]
    shapes: dict[str, Shape] = {}
    for name in names:
        width, height = rng.uniform(*scene.width), rng.uniform(*scene.height)
        shapes[name] = box(width, width, height) if rng.random() < 0.5 else cylinder(width / 2, height)
    ys = np.linspace(-half, half, 2 * count + 1)[1::2]
    start = {name: pose(0.3, y, GAP) for name, y in zip(names, ys, strict=True)}
    return World(
        static=[("thing", name) for name in names] + [("pose", name, f"at_{name}") for name in names],
        fluents=[("handempty",), *(("atpose", name, f"at_{name}") for name in names)],
        values={name: name for name in names} | {f"at_{name}": where for name, where in start.items()},
        robot=hand,
        shapes=shapes,
        grasps={name: next(hand.grasps(shape)) for name, shape in shapes.items()},
        start=start,
        pallet=((0.45, 0.6), (-half, half)),
    )


def stream_map(world: World, seed: int) -> dict[str, Generator]:
    """The samplers; what they draw depends on the seed and their inputs only."""

    def sample_spot(name: str) -> Iterator[tuple[Array]]:
        rng = np.random.default_rng([seed, zlib.crc32(name.encode())])
        while True:
            x, y = (rng.uniform(*span) for span in world.pallet)
            yield (pose(x, y, GAP, rng.uniform(-np.pi / 4, np.pi / 4)),)

    def sample_reach(name: str, target: Array) -> tuple[Reach] | None:
        rng, grasp = np.random.default_rng([seed, zlib.crc32(target.tobytes())]), world.grasps[name]
        path = world.robot.reach_from(FLOOR, target @ grasp.tool, grasp.opening, rng)
        return (Reach(world.robot, name, world.shapes[name], target, grasp, path),) if path else None

    def clear(reach: Reach, other: str, where: Array) -> bool:
        return other == reach.name or not reach.swept.hits(world.shapes[other], where)

    return {
        "sample-spot": from_gen_fn(sample_spot),
        "sample-reach": from_fn(sample_reach),
        "test-clear": from_test(clear),
    }
