"""Boxes on a shelf: the scene, the samplers, the check of plans, and a picture. Lengths in metres."""

import zlib
from dataclasses import dataclass
from itertools import pairwise
from types import SimpleNamespace

import numpy as np
from PIL import Image, ImageDraw
from pydantic import BaseModel, ConfigDict, PositiveFloat

from gentamp_lp.streams.language import from_gen_fn, from_test


class Scene(BaseModel):
    """The `scene:` section of a task file."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    boxes: str  # the size parameter that counts them
    width: tuple[PositiveFloat, PositiveFloat]  # a range
    room: PositiveFloat = 2.0  # length of the shelf, in widths of all boxes


@dataclass(frozen=True, eq=False)
class Spot:
    """A place on the shelf, by its left end."""

    left: float


@dataclass
class World:
    """One problem: widths of the boxes by name, and the length of the shelf."""

    widths: dict[str, float]
    length: float
    robot: SimpleNamespace

    @property
    def values(self):
        """What samplers get for each name."""
        return {name: name for name in self.widths}

    @property
    def static(self):
        """Facts that never change."""
        return [("box", name) for name in self.widths]

    @property
    def fluents(self):
        """Facts of the initial state."""
        return [("handempty",), *(("waiting", name) for name in self.widths)]


def make_world(scene, parameters, robot, rng):
    """Draw a problem."""
    widths = {f"box{i}": rng.uniform(*scene.width) for i in range(1, parameters[scene.boxes] + 1)}
    return World(widths, scene.room * sum(widths.values()), SimpleNamespace(name=robot))


def stream_map(world, seed):
    """The samplers; what they draw depends on the seed and their inputs only."""

    def sample_spot(box):
        rng = np.random.default_rng([seed, zlib.crc32(box.encode())])
        while True:
            yield (Spot(rng.uniform(0, world.length - world.widths[box])),)

    def apart(box, spot, other, place):
        return spot.left + world.widths[box] <= place.left or place.left + world.widths[other] <= spot.left

    return {"sample-spot": from_gen_fn(sample_spot), "test-apart": from_test(apart)}


def encode(value, names):
    """A spot as JSON."""
    return {"left": value.left}


def decode(data, world, values):
    """The spot that `encode` wrote."""
    return Spot(float(data["left"]))


def check_plan(world, steps, values):
    """What is wrong with a plan: boxes beyond the shelf, or in one another."""
    stands = [(values[args[1]].left, world.widths[args[0]], args[0]) for name, args in steps if name == "put"]
    stands.sort()
    problems = [f"{box} is beyond the shelf" for left, width, box in stands if not 0 <= left <= world.length - width]
    for (left, width, box), (next_left, _, other) in pairwise(stands):
        if left + width > next_left:
            problems.append(f"{box} and {other} overlap")
    return problems


def render_plan(world, steps, values, path):
    """The shelf at the end of a plan."""
    scale = 760 / world.length
    image = Image.new("RGB", (800, 140), "white")
    draw = ImageDraw.Draw(image)
    draw.rectangle((20, 110, 20 + world.length * scale, 118), fill="#44546a")
    for name, args in steps:
        if name == "put":
            left = 20 + values[args[1]].left * scale
            draw.rectangle((left, 50, left + world.widths[args[0]] * scale, 109), fill="#9fc5e8", outline="#0b5394")
            draw.text((left + 4, 74), args[0], fill="#1b2733")
    image.save(path)
