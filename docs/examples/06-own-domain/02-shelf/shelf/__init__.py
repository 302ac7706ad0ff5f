"""Boxes on a shelf: the scene, the samplers, their values in plan files, and the check of plans. Lengths in metres."""

import zlib
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np
from pydantic import PositiveFloat

from gentamp_lp.streams.language import Generator, from_gen_fn, from_test
from gentamp_lp.tasks import domain_code
from gentamp_lp.tasks.domain_code import Step


class Scene(domain_code.Scene):
    """The `scene:` section of a task file."""

    boxes: str  # the size parameter that counts them
    width: tuple[PositiveFloat, PositiveFloat]  # a range
    room: PositiveFloat = 2.0  # length of the shelf, in widths of all boxes


@dataclass(frozen=True, eq=False)
class Spot:
    """A place on the shelf, by its left end."""

    left: float


@dataclass(kw_only=True)
class World(domain_code.World):
    """Facts, widths of the boxes by name, and the length of the shelf."""

    widths: dict[str, float]
    length: float


def make_world(scene: Scene, parameters: Mapping[str, int], robot: str, rng: np.random.Generator) -> World:
    """Draw a problem."""
    widths = {f"box{i}": rng.uniform(*scene.width) for i in range(1, parameters[scene.boxes] + 1)}
    return World(
        static=[("box", name) for name in widths],
        fluents=[("handempty",), *(("waiting", name) for name in widths)],
        widths=widths,
        length=scene.room * sum(widths.values()),
    )


def stream_map(world: World, seed: int) -> dict[str, Generator]:
    """The samplers; what they draw depends on the seed and their inputs only."""

    def sample_spot(box: str) -> Iterator[tuple[Spot]]:
        rng = np.random.default_rng([seed, zlib.crc32(box.encode())])
        while True:
            yield (Spot(rng.uniform(0, world.length - world.widths[box])),)

    def apart(box: str, spot: Spot, other: str, place: Spot) -> bool:
        return spot.left + world.widths[box] <= place.left or place.left + world.widths[other] <= spot.left

    return {"sample-spot": from_gen_fn(sample_spot), "test-apart": from_test(apart)}


def encode(value: Spot, names: Mapping[int, str]) -> dict[str, Any]:
    """A spot as JSON."""
    return {"left": value.left}


def decode(data: Mapping[str, Any], world: World, values: Mapping[str, Any]) -> Spot:
    """The spot that `encode` wrote."""
    return Spot(float(data["left"]))


def check_plan(world: World, steps: Sequence[Step], values: Mapping[str, Any]) -> list[str]:
    """What is wrong with a plan: boxes beyond the shelf, or in one another."""
    stands = sorted((values[args[1]].left, world.widths[args[0]], args[0]) for name, args in steps if name == "put")
    problems = [f"{box} is beyond the shelf" for left, width, box in stands if not 0 <= left <= world.length - width]
    for (left, width, box), (next_left, _, other) in pairwise(stands):
        if left + width > next_left:
            problems.append(f"{box} and {other} overlap")
    return problems
