"""Parcels on a belt, and bins for them: the world and its one test. Lengths in metres."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from gentamp_lp.streams.language import Generator, from_test
from gentamp_lp.tasks import domain_code


class Scene(domain_code.Scene):
    """The `scene:` section of a task file."""

    bins: tuple[tuple[float, float], ...]  # how wide parcels for each are, from and to
    parcels: tuple[float, float]  # how wide parcels are


@dataclass(kw_only=True)
class World(domain_code.World):
    """Facts, the widths of parcels, and the ranges of bins."""

    widths: dict[str, float]
    ranges: dict[str, tuple[float, float]]


def make_world(scene: Scene, parameters: Mapping[str, int], robot: str, rng: np.random.Generator) -> World:
    """Draw a problem."""
    ranges = {f"bin{i}": span for i, span in enumerate(scene.bins, 1)}
    widths = {f"parcel{i}": rng.uniform(*scene.parcels) for i in range(1, parameters["parcels"] + 1)}
    return World(
        static=[("bin", name) for name in ranges] + [("parcel", name) for name in widths],
        fluents=[("waiting", name) for name in widths] + [("under", "bin1")],
        widths=widths,
        ranges=ranges,
    )


def stream_map(world: World, seed: int) -> dict[str, Generator]:
    """The test; names stand for themselves, as the world has no other values."""

    def fits(parcel: str, bin_: str) -> bool:
        least, most = world.ranges[bin_]
        return least <= world.widths[parcel] < most

    return {"test-fits": from_test(fits)}
