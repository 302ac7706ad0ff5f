"""Transport: the robot drives, the tray is what carries, and the learned policy fills it, drives it and empties it."""

import copy
import json
import math
import re
from collections.abc import Callable
from contextlib import suppress
from importlib import import_module
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
import pytest
from helpers.robots import needs_pr2
from PIL import Image

from gentamp_lp.base.shipped import resource
from gentamp_lp.errors import NoAnswer
from gentamp_lp.geometry.mobile import drive
from gentamp_lp.geometry.replay import Replay
from gentamp_lp.geometry.robots import Trajectory
from gentamp_lp.learning.learn import learn
from gentamp_lp.planning.solve import solve
from gentamp_lp.plans.plan import Plan
from gentamp_lp.plans.validate import adopt, validate
from gentamp_lp.policy.policy import Policy
from gentamp_lp.streams.incremental import sample
from gentamp_lp.streams.semantics import View, applicable, apply
from gentamp_lp.tasks.task import Instance, Task

Data = dict[str, Any]


@pytest.fixture(scope="module")
def policy() -> Policy:
    """What `gentamp-lp learn transport` finds (it takes a minute or more; see the sweeps)."""
    return Policy.load(Path(__file__).parents[1] / "policies" / "transport")


@pytest.fixture(scope="module")
def plan(policy: Policy, tmp_path_factory) -> Data:
    """A plan with a full and a part-full tray, as the JSON of its file."""
    result = solve(Task.load("transport"), "2-3", 1, policy=policy)
    assert result.valid and result.plan is not None
    path = tmp_path_factory.mktemp("plan") / "plan.json"
    result.plan.save(path)
    return json.loads(path.read_text())


def part(name: str) -> ModuleType:
    """A module of the domain's Python code."""
    return import_module(f"{Task.load('transport').folder.code.module.__name__}.{name}")


def sampled(size: str) -> Instance:
    instance = Task.load("transport").instance(size, 0)
    sample(instance.base, instance.task.file.samples, math.inf)
    return instance


def edited(tmp_path: Path, *changes: tuple[str, str]) -> Task:
    text = resource("tasks", "transport.yaml").read_text()
    for old, new in changes:
        assert old in text
        text = text.replace(old, new)
    path = tmp_path / "transport.yaml"
    path.write_text(text)
    return Task.load(path)


# ---- the room


@pytest.mark.parametrize("size", ["1-4", "2-16", "3-6"])
def test_everything_starts_on_the_source(size: str) -> None:
    capacity, things = map(int, size.split("-"))
    for seed in range(5):
        world = Task.load("transport").instance(size, seed).world
        assert len(world.start) == things + 1
        area = world.supports["source"].area
        for name, placement in world.start.items():
            x, y = placement.transform[:2, 3]
            assert area.x[0] <= x <= area.x[1] and area.y[0] <= y <= area.y[1]
            assert world.fits(name, "source", placement)
        assert world.cells["tray"][0] == capacity
        assert ("beside", "at_base", "source") in world.static


def test_a_tray_that_holds_more_or_less_than_it_should_is_refused(tmp_path: Path) -> None:
    slim = edited(tmp_path, ("[[0.060, 0.063], [0.060, 0.063]", "[0.045, 0.045"), ("[0.030, 0.0315]", "0.0225"))
    with pytest.raises(NoAnswer, match="4 things could be put on `tray`, a tray for 3"):
        slim.instance("3-4", 0)
    assert slim.instance("3-3", 0)  # nothing is left that could be too many
    wide = edited(tmp_path, ("[[0.060, 0.063], [0.060, 0.063]", "[0.071, 0.06"), ("[0.030, 0.0315]", "0.0355"))
    with pytest.raises(NoAnswer, match="wider than the cells"):
        wide.instance("3-1", 0)


def test_the_capacity_bound_is_sound() -> None:
    """Circles packed at random into a strip are never shorter than the bound allows."""
    zigzag = part("generator")._zigzag
    rng = np.random.default_rng(0)
    for _ in range(2000):
        diameters, width = rng.uniform(0.04, 0.07, 4), 0.07
        placed: list[tuple[float, float, float]] = []
        for d in diameters:  # each as far left as it goes, at one edge, the other, or in between
            y = rng.choice([d / 2, width - d / 2, rng.uniform(d / 2, width - d / 2)])
            gaps = [px + math.sqrt(max(0.0, ((d + pd) / 2) ** 2 - (y - py) ** 2)) for px, py, pd in placed]
            placed.append((max([d / 2, *gaps]), y, d))
        assert zigzag(diameters, width) <= max(x + d / 2 for x, _, d in placed) + 1e-9


def test_nothing_loose_is_driven() -> None:
    """With a thing in the hand no drive is applicable, with the tray or nothing there is one."""
    instance = sampled("2-2")
    program, base = instance.task.program, instance.base
    view = View(program, base, instance.state)
    steps = list(applicable(view))
    assert any(step.schema == "move" for step in steps)
    for held in ("thing1", "tray"):
        pick = next(s for s in steps if s.schema == "pick" and s.args[0] == held)
        drives = {s.schema for s in applicable(View(program, base, apply(view, pick)))} & {"move", "carry"}
        assert drives == ({"carry"} if held == "tray" else set())


def test_drives_keep_clear_of_tables() -> None:
    """Straight through the table is refused; backing off, crossing and turning is not."""
    world = Task.load("transport").instance("2-2", 0).world
    rooms = part("rooms")
    there = next(base for base in world.parkings("destination", np.random.default_rng(0)) if base)
    good = rooms.Way(drive(world.base.place, there.place), world.robot.opening)
    beyond = rooms.Way(drive(world.base.place, np.array([2.3, 0.0, math.pi])), world.robot.opening)
    assert rooms.clear(world.robot, good, world.obstacles)
    assert not rooms.clear(world.robot, beyond, world.obstacles)
    steps = np.abs(np.diff(good.path, axis=0))
    assert steps[:, :2].max() < 0.03 and steps[:, 2].max() < 0.04
    with Replay(world.robot, tables=world.tables, base=world.base.place) as replay:
        assert replay.move(good.trajectory(world.robot)) == []
    with Replay(world.robot, tables=world.tables, base=world.base.place) as replay:
        assert any(
            "platform" in fault and "inside table" in fault for fault in replay.move(beyond.trajectory(world.robot))
        )


def test_a_load_that_stands_too_high_is_seen_while_driving() -> None:
    """The replay carries what stands on the tray and compares it with everything else."""
    world = Task.load("transport").instance("2-2", 0).world
    grasp = world.grasps["tray"][0]
    start = world.robot.tool(np.concatenate([world.base.place, world.robot.home[3:]])) @ np.linalg.inv(grasp.tool)
    path = drive(world.base.place, world.base.place - np.array([0.3, 0.0, 0.0]))
    arm = np.broadcast_to(world.robot.home[3:], (len(path), len(world.robot.home) - 3))
    with Replay(world.robot, tables=world.tables, base=world.base.place) as replay:
        replay.add("tray", world.shapes["tray"], start)
        load = start.copy()
        load[2, 3] += world.shapes["tray"].interior[2] + 0.001
        assert replay.add("thing", world.shapes["thing1"], load, "tray") == []
        wall = load.copy()
        wall[0, 3] -= 0.15
        replay.add("wall", world.shapes["thing2"], wall)
        replay.violations.clear()
        replay.configuration[:] = [*world.base.place, *world.robot.home[3:]]
        replay.move(Trajectory(np.hstack([path[:1], arm[:1]]), grasp.opening))
        replay.grasp("tray", grasp)
        assert not any("off" in fault for fault in replay.violations), replay.violations
        faults = replay.move(Trajectory(np.hstack([path, arm]), grasp.opening))
    assert any("thing is" in fault and "inside wall" in fault for fault in faults)


@needs_pr2
def test_places_for_trays_are_those_from_which_an_arm_can_unload() -> None:
    """The PR2 reaches both cells of every tray that it puts down; without that, many places strand its load."""
    world = Task.load("transport").instance("2-2", 0, robot="pr2").world
    world_module = part("world")
    rng = np.random.default_rng(0)
    drawn = list(world_module.uniform_placements(world.supports["destination"].area, rng, 12))
    good = [world_module.serves(world, "tray", "destination", placement, rng) for placement in drawn]
    assert 2 <= sum(good) <= 10
    base = next(base for base in world.parkings("destination", rng) if base)
    for placement in (p for p, g in zip(drawn, good, strict=True) if g):
        for cell in world_module.cell_placements(world, "tray"):
            target = placement.transform @ cell.transform
            tools = ((target @ g.tool, g.opening) for g in world.grasps["thing1"])
            assert any(world.robot.reach_from(base.place, tool, opening, rng) for tool, opening in tools)
    assert world_module.serves(world, "thing1", "destination", drawn[0], rng)


def test_a_group_that_gets_stuck_is_drawn_again(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """In a small area the first things often leave no place for the last."""
    small = edited(tmp_path, ("y: [-0.40, 0.40], things: 17}}\n    destination", "y: [-0.16, 0.40]}}\n    destination"))
    arrange = part("arrange")

    def drawn() -> int:
        made = 0
        for seed in range(8):
            with suppress(NoAnswer):
                made += bool(small.instance("2-14", seed))
        return made

    often = drawn()
    monkeypatch.setattr(arrange, "_AGAIN", 1)
    assert drawn() < often


# ---- the policy


def test_the_policy_fills_carries_and_empties(policy: Policy) -> None:
    """As few drives as the tray allows; four steps for each thing and three for each drive, less the last return."""
    assert {a.schemas for a in policy.actions} == {("pick",), ("place",), ("carry",)}
    for size in ("2-4", "4-2"):
        capacity, things = map(int, size.split("-"))
        trips = math.ceil(things / capacity)
        for seed in (1,):
            result = solve(Task.load("transport"), size, seed, policy=policy)
            assert result.valid and result.planner == "guided" and result.plan is not None
            carried = [step for step in result.plan.steps if step.schema == "carry"]
            assert len(carried) == 2 * trips - 1
            assert len(result.plan.steps) == 4 * things + 3 * len(carried)


def test_an_arm_drives_too(policy: Policy) -> None:
    result = solve(Task.load("transport"), "2-3", 1, policy=policy, robot="mobile_panda")
    assert result.valid and result.planner == "guided"


def first(data: Data, action: str) -> list[str]:
    return next(s["args"] for s in data["steps"] if s["action"] == action)


def shortcut(data: Data) -> None:
    """Leave out the middle of a drive."""
    path = data["entities"][first(data, "carry")[-1]]["path"]
    del path[len(path) // 3 : -len(path) // 3]


def through_the_table(data: Data) -> None:
    path = np.array(data["entities"][first(data, "carry")[-1]]["path"])
    out = np.linspace(path[0], path[0] + [0.5, 0.0, 0.0], 26)
    data["entities"][first(data, "carry")[-1]]["path"] = [*out.tolist(), *out[::-1].tolist(), *path.tolist()]


def elsewhere(data: Data) -> None:
    data["entities"][first(data, "carry")[-1]]["path"][-1][0] += 0.1


def far_away(data: Data) -> None:
    data["entities"][first(data, "carry")[3]]["place"][0] += 0.2


def reach_from_elsewhere(data: Data) -> None:
    for row in data["entities"][first(data, "pick")[-1]]["configurations"]:
        row[0] += 0.05


def stay(data: Data) -> None:
    data["steps"] = [s for s in data["steps"] if s["action"] != "carry"]


@pytest.mark.parametrize(
    ("mutate", "message"),
    [
        (shortcut, "base jumps"),
        (through_the_table, "inside table"),
        (elsewhere, "does not lead from"),
        (far_away, "is not in front of|does not lead|not from its base"),
        (reach_from_elsewhere, "not from its base"),
        (stay, "not applicable|no step uses"),
    ],
)
def test_wrong_drives_are_refused(plan: Data, tmp_path: Path, mutate: Callable[[Data], None], message: str) -> None:
    data = copy.deepcopy(plan)
    path = tmp_path / "plan.json"
    path.write_text(json.dumps(data))
    assert validate(Plan.load(path), Task.load("transport")) == []
    mutate(data)
    path.write_text(json.dumps(data))
    problems = validate(Plan.load(path), Task.load("transport"))
    assert any(re.search(message, problem) for problem in problems), problems


def test_both_tables_are_drawn(plan: Data, tmp_path: Path) -> None:
    task = Task.load("transport")
    path = tmp_path / "plan.json"
    path.write_text(json.dumps(plan))
    loaded = Plan.load(path)
    instance = task.instance(loaded.size, loaded.seed)
    adopt(loaded, instance)
    picture = tmp_path / "plan.png"
    steps = [(step.schema, step.args) for step in loaded.steps]
    task.folder.code.render_plan(instance.world, steps, instance.base.values, picture)
    pixels = np.asarray(Image.open(picture).convert("RGB"), dtype=int)
    red, green, blue = np.moveaxis(pixels[:, : pixels.shape[1] // 2], 2, 0)
    assert ((green > red + 20) & (green > blue + 20)).sum() > 500  # the destination's mat
    assert ((red > blue + 20) & (red > green)).sum() > 2000  # wood


# ---- sweeps


@pytest.mark.slow
@pytest.mark.parametrize("seed", [0, 1, 2])
def test_the_policy_is_learned(seed: int) -> None:
    learned = learn(Task.load("transport"), seed=seed, cache=False)
    assert learned.solution.optimal and learned.solution.cost == 13
    assert not any("still fails" in note for note in learned.notes)
    for size in ("2-4", "3-8", "4-6"):
        assert solve(learned.task, size, 1, policy=learned.policy).valid


@pytest.mark.slow
def test_the_papers_problems_teach_the_same() -> None:
    """3-6 is planned with half of the samples, and validation on 4-6 and 3-7 adds part-full trays."""
    learned = learn(Task.load("transport-paper"), cache=False)
    assert learned.solution.optimal and learned.solution.cost == 13
    assert not any("still fails" in note for note in learned.notes)
    for size in ("2-16", "3-8", "4-10"):
        assert solve(learned.task, size, 1, policy=learned.policy).valid


@pytest.mark.slow
@pytest.mark.parametrize("size", Task.load("transport").file.test)
def test_all_test_sizes(policy: Policy, size: str) -> None:
    for seed in (1, 2, 3):
        assert solve(Task.load("transport"), size, seed, policy=policy).valid


@pytest.mark.slow
@pytest.mark.parametrize("robot", ["mobile_panda", "pr2"])
@pytest.mark.parametrize("size", Task.load("transport").file.test)
def test_robots(policy: Policy, size: str, robot: str) -> None:
    for seed in (1, 2, 3):
        assert solve(Task.load("transport"), size, seed, policy=policy, robot=robot).valid


TASKS = ("unstack", "sort", "clutter", "load", "transport")


@pytest.mark.slow
@pytest.mark.parametrize(
    ("task", "size"),
    [
        *((name, size) for name in TASKS for size in Task.load(name).file.test),
        ("transport", "3-6"),
        ("transport", "1-4"),
    ],
)
@pytest.mark.parametrize("robot", ["hand", "panda", "pr2"])
def test_nearly_every_seed_gives_an_instance(task: str, size: str, robot: str) -> None:
    """At least 95 % of 50 seeds, of all shipped robots that can do the task."""
    drives = task == "transport"
    names = {"hand": "mobile_gripper" if drives else "gripper", "panda": "mobile_panda" if drives else "panda"}
    made = 0
    for seed in range(50):
        try:
            Task.load(task).instance(size, seed, robot=names.get(robot, robot))
            made += 1
        except NoAnswer:
            continue
    assert made >= 48
