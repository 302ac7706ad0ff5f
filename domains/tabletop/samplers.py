"""The streams of `stream.pddl` in Python."""

from __future__ import annotations

import zlib
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from gentamp_lp.geometry import mobile
from gentamp_lp.geometry.collision import Swept, collide
from gentamp_lp.geometry.grasping import Grasp
from gentamp_lp.geometry.robots import Robot, Trajectory
from gentamp_lp.geometry.shapes import Shape
from gentamp_lp.geometry.transforms import Array
from gentamp_lp.streams.language import Generator, from_gen_fn, from_test

from . import rooms
from .world import Placement, World, cell_placements, serves, uniform_placements

_REACH_ATTEMPTS = 3  # restarts of inverse kinematics before a placement and grasp are given up


@dataclass(eq=False)
class Reach:
    """How, from `base`, the hand gets to `name`, placed at `placement` (in the world, `target`)."""

    robot: Robot
    name: str
    shape: Shape
    placement: Placement
    support_place: Placement
    grasp: Grasp
    base: rooms.Base
    target: Array
    trajectory: Trajectory

    @property
    def digest(self) -> int:
        """What tells it from other reaches, also in the same world drawn again."""
        return _digest(self.trajectory.configurations)

    @cached_property
    def swept(self) -> Swept:
        """Everything the hand, the arm and the held thing pass through."""
        return self.robot.swept(self.trajectory, self.shape, self.grasp)

    @cached_property
    def swept_robot(self) -> Swept:
        """Everything the hand and the arm pass through."""
        return self.robot.swept(self.trajectory)


def stream_map(world: World, seed: int) -> dict[str, Generator]:
    """The Python side of every stream; randomness depends on the seed and the inputs only."""

    def rng(*key: object) -> np.random.Generator:
        return np.random.default_rng([seed, zlib.crc32(repr(key).encode())])

    def sample_grasp(name: str) -> Iterator[tuple[Grasp]]:
        yield from ((grasp,) for grasp in world.grasps[name])

    def sample_placement(name: str, support: str) -> Iterator[tuple[Placement]]:
        generator = rng("placement", name, support)
        while True:
            for placement in uniform_placements(world.supports[support].area, generator):
                if world.fits(name, support, placement) and serves(world, name, support, placement, generator):
                    yield (placement,)

    def sample_cell(_: str, support: str) -> Iterator[tuple[Placement]]:
        yield from ((placement,) for placement in cell_placements(world, support))

    def sample_reach(
        name: str, placement: Placement, support: str, place: Placement, grasp: Grasp, base: rooms.Base
    ) -> Iterator[tuple[Reach] | None]:
        if placement.base is not None and placement.base is not place:
            return  # the placement rests on this support where it stood, and only there
        target = place.transform @ placement.transform if placement.frame == support else placement.transform

        def reach(trajectory: Trajectory) -> tuple[Reach] | None:
            made = Reach(world.robot, name, world.shapes[name], placement, place, grasp, base, target, trajectory)
            return None if made.digest in world.avoided else (made,)

        if grasp in world.approaches and placement is world.start[name] and base is world.base:
            yield reach(world.approaches[grasp])
        key = [_digest(matrix) for matrix in (placement.transform, place.transform, grasp.tool)]
        generator, found = rng("reach", name, *key, *_known(base)), False
        for _ in range(_REACH_ATTEMPTS):
            trajectory = world.robot.reach_from(base.place, target @ grasp.tool, grasp.opening, generator)
            if trajectory is not None:
                found = True
                yield reach(trajectory)
        if not found and (placement, grasp, base) in world.reached:
            yield reach(world.reached[placement, grasp, base])

    def sample_base(support: str) -> Iterator[tuple[rooms.Base] | None]:
        for base in world.parkings(support, rng("base", support)):
            yield (base,) if base else None

    def sample_drive(first: rooms.Base, last: rooms.Base) -> Iterator[tuple[rooms.Way]]:
        way = rooms.Way(mobile.drive(first.place, last.place), world.robot.opening)
        if first is not last and rooms.clear(world.robot, way, world.obstacles):
            yield (way,)

    def sample_carry(name: str, grasp: Grasp, first: rooms.Base, last: rooms.Base) -> Iterator[tuple[rooms.Way]]:
        way = rooms.Way(mobile.drive(first.place, last.place), grasp.opening)
        if first is not last and rooms.clear(world.robot, way, world.obstacles, world.shapes[name], grasp):
            yield (way,)

    def cfree(name: str, placement: Placement, other: str, there: Placement) -> bool:
        """Whether two placements do not overlap; a thing's own place is taken while it stands there.

        What stands on a tray stays inside the tray's envelope, so frames need not be mixed.
        """
        if placement.frame != there.frame:
            return True
        return not collide(world.shapes[name], placement.transform, world.shapes[other], there.transform)

    def reach_cfree(reach: Reach, other: str, there: Placement) -> bool:
        """Whether the hand, the arm and the held thing stay clear of `other`."""
        if other == reach.name:
            return True
        if there.frame == reach.name:  # loads of the tray in hand travel with it
            return not reach.swept_robot.hits(world.shapes[other], reach.target @ there.transform)
        if there.frame != "world":
            if there.frame != reach.placement.frame:
                return True  # inside the envelope of a tray that is itself checked
            return not reach.swept.hits(world.shapes[other], reach.support_place.transform @ there.transform)
        if other == reach.placement.frame:
            if there is not reach.support_place:
                return True  # the tray stands elsewhere while this reach is used
            return not reach.swept.hits(world.shapes[other], there.transform, envelope=False)
        return not reach.swept.hits(world.shapes[other], there.transform)

    return {
        "sample-grasp": from_gen_fn(sample_grasp),
        "sample-placement": from_gen_fn(sample_placement),
        "sample-cell": from_gen_fn(sample_cell),
        "sample-base": from_gen_fn(sample_base),
        "sample-drive": from_gen_fn(sample_drive),
        "sample-carry": from_gen_fn(sample_carry),
        "sample-reach": from_gen_fn(sample_reach),
        "test-cfree": from_test(cfree),
        "test-reach-cfree": from_test(reach_cfree),
    }


def _known(base: rooms.Base) -> tuple[int, ...]:
    """What tells a base from the origin."""
    return (_digest(base.place),) if base.place.any() else ()


def _digest(matrix: Array) -> int:
    return zlib.crc32(np.ascontiguousarray(matrix).tobytes())
