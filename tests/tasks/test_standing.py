"""Where robots that drive stand: all supports are in reach from there, and what has a given place."""

from typing import Any

import numpy as np
import pytest
from helpers.robots import needs_pr2

from gentamp_lp.base.shipped import resource
from gentamp_lp.errors import NoAnswer
from gentamp_lp.tasks.task import Instance, Task


def areas(instance: Instance, field: str) -> list[object]:
    """The areas of the world, and those that the task file gives in a field."""
    supports = instance.task.scene.supports
    return [
        {name: support.area for name, support in instance.world.supports.items()},
        {name: getattr(support, field) for name, support in supports.items()},
    ]


def reached(world: Any, name: str, placement: Any) -> bool:
    """Whether an approach is found, in three tries, for some grasp of a thing at a placement."""
    rng = np.random.default_rng(1)
    targets = [(placement.transform @ grasp.tool, grasp.opening) for grasp in world.grasps[name]] * 3
    return any(world.robot.reach_from(world.base.place, *target, rng) for target in targets)


@pytest.mark.parametrize("robot", ["panda", "mobile_panda"])
def test_robots_with_room_keep_the_areas(robot: str) -> None:
    world, given = areas(Task.load("sort").instance("2-2", 0, robot=robot), "area")
    assert world == given


@needs_pr2
def test_a_broad_robot_takes_the_nearer_areas() -> None:
    instance = Task.load("sort").instance("8-8", 0, robot="pr2")
    world, given = areas(instance, "nearer")
    assert world == given
    base = instance.base
    stream = next(stream for stream in base.streams if stream.name == "sample-placement")
    for thing, region in (("red_thing1", "red_region"), ("green_thing1", "green_region")):
        places = [base.values[base.draw(stream, (thing, region))[0]] for _ in range(20)]
        assert sum(reached(instance.world, thing, place) for place in places) >= 10


@needs_pr2
def test_areas_out_of_reach_are_refused(tmp_path) -> None:
    lines = resource("tasks", "sort.yaml").read_text().splitlines()
    path = tmp_path / "sort.yaml"
    path.write_text("\n".join(line for line in lines if "nearer:" not in line))
    with pytest.raises(NoAnswer, match=r"`pr2` does not reach .*`green_region` from one place: give them areas"):
        Task.load(path).instance("1-1", 0, robot="pr2")
    assert Task.load(path).instance("1-1", 0, robot="mobile_panda")


@needs_pr2
@pytest.mark.parametrize("seed", range(3))
def test_the_handle_of_a_long_tray_is_in_reach(seed: int) -> None:
    """From the middle of the table it is not."""
    small, large = (Task.load("load").instance(size, seed, robot="pr2").world for size in ("1-2", "6-8"))
    assert np.allclose(small.base.place, [-0.12, -0.16, 0.0])
    assert large.base.place[1] < -0.18


@needs_pr2
def test_crowded_clutter_is_in_reach() -> None:
    """Whole layouts in reach are hardly ever drawn."""
    world = Task.load("clutter").instance(16, 0, robot="pr2").world
    assert len(world.start) == 17
    for name, placement in world.start.items():
        assert reached(world, name, placement), name
