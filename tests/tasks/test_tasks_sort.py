"""Sort: things start between the regions, and the policy learned from small problems sorts larger ones."""

from dataclasses import replace

import numpy as np
import pytest
from helpers.robots import needs_pr2
from PIL import Image

from gentamp_lp.base.shipped import resource
from gentamp_lp.errors import InputError
from gentamp_lp.learning.learn import Learned, learn
from gentamp_lp.planning.solve import solve
from gentamp_lp.plans.validate import validate
from gentamp_lp.streams.semantics import Step, View
from gentamp_lp.tasks.task import Task

ROBOTS = ("gripper", "panda")
OTHER = {"red": "green", "green": "red"}


@pytest.fixture(scope="module")
def sort() -> Learned:
    return learn(Task.load("sort"), robot="gripper", max_complexity=3, cache=False)


@pytest.mark.parametrize("size", ["1-1", "2-3", "8-8"])
def test_things_start_between_the_regions(size: str) -> None:
    task = Task.load("sort")
    red, green = (task.scene.supports[f"{c}_region"].area for c in ("red", "green"))
    for seed in range(5):
        world = task.instance(size, seed, robot="gripper").world
        assert sorted(len([n for n in world.start if n.startswith(c)]) for c in ("red", "green")) == sorted(
            map(int, size.split("-"))
        )
        for placement in world.start.values():
            assert red.y[1] < placement.transform[1, 3] < green.y[0]
    static = set(world.static)
    assert {("region", "red_region"), ("red", "red_region"), ("surface", "red_region")} <= static
    assert ("table", "red_region") not in static and ("green", "red_region") not in static


@pytest.mark.parametrize("robot", ROBOTS)
def test_sampled_placements_lie_on_their_region(robot: str) -> None:
    instance = Task.load("sort").instance("1-1", 0, robot=robot)
    base = instance.base
    stream = next(s for s in base.streams if s.name == "sample-placement")
    for support, region in instance.world.supports.items():
        for _ in range(20):
            outputs = base.draw(stream, ("red_thing1", support))
            assert outputs is not None
            (name,) = outputs
            x, y = base.values[name].transform[:2, 3]
            assert region.area.x[0] <= x <= region.area.x[1] and region.area.y[0] <= y <= region.area.y[1]
            assert base.truth("pose", ("red_thing1", name, support))


@pytest.mark.parametrize("wrong", ["red", "green"])
def test_the_goal_is_the_right_region_for_every_thing(wrong: str) -> None:
    """A thing on the other colour's region, or on the table, is not sorted."""
    task = Task.load("sort")
    instance = task.instance("1-1", 0, robot="gripper")
    base = instance.base
    stream = next(s for s in base.streams if s.name == "sample-placement")

    def reached(*supports: str) -> bool:
        places = [base.draw(stream, (f"{c}_thing1", s))[0] for c, s in zip(("red", "green"), supports, strict=True)]
        facts = {("handempty",), *(("atpose", f"{c}_thing1", p) for c, p in zip(("red", "green"), places, strict=True))}
        return View(task.program, base, frozenset(facts)).holds(task.goal)

    assert reached("red_region", "green_region")
    assert not reached("green_region", "red_region")
    assert not reached(*(f"{OTHER[c] if c == wrong else c}_region" for c in ("red", "green")))
    assert not reached(*("table" if c == wrong else f"{c}_region" for c in ("red", "green")))


def test_the_policy_sorts_directly(sort: Learned) -> None:
    """One pick and one place for each thing, with more things than were learned from; the plans are valid."""
    assert sort.solution.optimal and not any("still fails" in note for note in sort.notes)
    for robot, size in (("gripper", "6-6"), ("panda", "5-5")):
        for seed in (1, 2):
            result = solve(sort.task, size, seed, policy=sort.policy, robot=robot)
            assert result.valid and result.planner == "guided" and result.plan is not None
            assert len(result.plan.steps) == 4 * int(size[0])


@needs_pr2
def test_a_pr2_sorts(sort: Learned) -> None:
    for seed in range(2):
        result = solve(sort.task, "4-4", seed, policy=sort.policy, robot="pr2", time_limit=60)
        assert result.valid, result.reason


def test_a_plan_that_names_the_wrong_region_is_refused(sort: Learned) -> None:
    """The validator compares where a thing is put with the area of the region it is said to be on."""
    result = solve(sort.task, "1-1", 1, policy=sort.policy, robot="gripper")
    assert result.plan is not None
    swap = {"red_region": "green_region", "green_region": "red_region"}
    swap |= {f"at_{name}": f"at_{other}" for name, other in swap.items()}
    steps = tuple(Step(step.schema, tuple(swap.get(arg, arg) for arg in step.args)) for step in result.plan.steps)
    facts = tuple(tuple(swap.get(arg, arg) for arg in fact) for fact in result.plan.facts)
    problems = validate(replace(result.plan, steps=steps, facts=facts), sort.task)
    assert any("is not on green_region" in problem for problem in problems)


def test_regions_are_drawn(sort: Learned, tmp_path) -> None:
    result = solve(sort.task, "1-1", 1, policy=sort.policy, robot="gripper")
    assert result.plan is not None
    path = tmp_path / "plan.png"
    steps = [(step.schema, step.args) for step in result.plan.steps]
    values = result.instance.base.values
    sort.task.folder.code.render_plan(result.instance.world, steps, values, path)
    pixels = np.asarray(Image.open(path).convert("RGB"), dtype=int)
    red, green, blue = np.moveaxis(pixels, 2, 0)
    assert ((red > green + 60) & (red > blue + 60)).sum() > 5000
    assert ((green > red + 30) & (green > blue + 30)).sum() > 5000


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ("is: [Region, Red]", "is: [Regoin, Red]", "'Region', 'Red'"),
        ("is: [Green]", "is: [Holding]", "'Region', 'Red'"),
        ("goes: &goes [table, red_region, green_region]", "goes: &goes [table, rde_region]", "rde_region"),
        ("y: [-0.60, -0.34]", "y: [-0.34, -0.60]", "first bound"),
    ],
)
def test_mistakes_in_the_scene_are_named(tmp_path, old: str, new: str, words: str) -> None:
    text = resource("tasks", "sort.yaml").read_text()
    assert old in text
    path = tmp_path / "sort.yaml"
    path.write_text(text.replace(old, new, 1))
    with pytest.raises(InputError, match=words):
        Task.load(path)


@pytest.mark.slow
@pytest.mark.parametrize("robot", ROBOTS)
@pytest.mark.parametrize("size", Task.load("sort").file.test)
def test_all_test_sizes(sort: Learned, size: str, robot: str) -> None:
    for seed in (1, 2, 3):
        assert solve(sort.task, size, seed, policy=sort.policy, robot=robot).valid
