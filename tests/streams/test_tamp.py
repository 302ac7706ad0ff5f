"""Continuous pick and place: packed and loose regions, distractors, blocks in the way; small by default."""

import statistics
import time

import pytest
from helpers.tamp import Tamp, line, plane

from gentamp_lp.streams import from_test, solve

SMALL = {
    "packed": lambda n, seed: line(n, slack=2.5, seed=seed),
    "loose": lambda n, seed: line(n, slack=5, seed=seed),
    "two goals among distractors": lambda n, seed: line(n, slack=2.5, goals=2, seed=seed),
    "blocks in the way": lambda n, seed: line(n, slack=5, shadows=n // 2, seed=seed),
    "plane, half full": lambda n, seed: plane(n, fill=0.5, seed=seed),
}


def seconds(tamp: Tamp, algorithm: str = "adaptive", limit: float = 60.0) -> float:
    start = time.monotonic()
    result = solve(tamp.problem(), algorithm, max_time=limit, seed=tamp.seed)
    assert result.status == "solved", str(result.report)
    tamp.check(result.plan)
    assert result.cost == pytest.approx(len(result.plan))
    return time.monotonic() - start


@pytest.mark.parametrize("name", SMALL)
def test_small_scenes(name: str) -> None:
    seconds(SMALL[name](4, 0))


def test_a_small_scene_incrementally() -> None:
    seconds(line(1, slack=5), "incremental")


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "sizes"),
    [
        ("packed", (4, 8, 10)),
        ("loose", (8, 16)),
        ("two goals among distractors", (8, 16)),
        ("blocks in the way", (4, 8)),
        ("plane, half full", (6, 10)),
    ],
)
def test_six_seeds_within_a_minute(name: str, sizes: tuple[int, ...]) -> None:
    for size in sizes:
        times = [seconds(SMALL[name](size, seed)) for seed in range(6)]
        print(f"{name}, n={size}: median {statistics.median(times):.2f} s, largest {max(times):.2f} s")


def test_several_vain_hopes_are_found_in_one_round() -> None:
    """A spot on the table is hoped to be in the region, of each block; no sample ever is."""
    scene = line(6, slack=5, seed=0)
    problem = scene.problem()
    into = """(:stream t-contain :inputs (?b ?p ?r) :domain (and (Pose ?b ?p) (Placeable ?b ?r))
      :certified (Contain ?b ?p ?r)))"""
    tests = {**problem.stream_map, "t-contain": from_test(lambda b, p, r: inside(p.where, scene.regions[r]))}
    result = solve(problem._replace(stream_pddl=problem.stream_pddl[:-1] + into, stream_map=tests), max_time=60)
    scene.check([(a.name, a.args) for a in result.plan])
    assert result.report.iterations < 4


def inside(place, region) -> bool:
    return all(low + 1 <= x <= high - 1 for x, low, high in zip(place, *region, strict=True))
