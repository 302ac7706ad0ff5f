"""What the arm does between the steps of a plan: found with FCL, checked with PyBullet, refused when tampered with."""

from __future__ import annotations

import copy
import json
import re
import time
from pathlib import Path

import numpy as np
import pytest
from jsonschema import validate as validate_schema
from typer.testing import CliRunner

from gentamp_lp.cli.main import app
from gentamp_lp.cli.schemas import schema
from gentamp_lp.errors import LimitReached, NoAnswer
from gentamp_lp.geometry import motion
from gentamp_lp.geometry.make import make_robot
from gentamp_lp.geometry.motion import Space, find_motion
from gentamp_lp.geometry.replay import SLAB, Replay
from gentamp_lp.geometry.robots import Trajectory
from gentamp_lp.geometry.shapes import GAP, Part, Shape, box
from gentamp_lp.geometry.surroundings import Surroundings
from gentamp_lp.geometry.transforms import pose
from gentamp_lp.planning.solve import solve
from gentamp_lp.plans.plan import Plan
from gentamp_lp.plans.validate import validate
from gentamp_lp.policy.policy import Policy
from gentamp_lp.tasks.task import Task

TRANSPORT = Path(__file__).parents[1] / "policies" / "transport"
POST = box(0.10, 0.10, 0.7)


@pytest.fixture(scope="module")
def panda():
    made = make_robot("panda")
    yield made
    made.close()


@pytest.fixture(scope="module")
def hand():
    return make_robot("gripper")


def replayed(robot, path, things):
    """What PyBullet finds wrong on the straight lines between waypoints."""
    rows = [path[0]]
    for after in path[1:]:
        rows += [*robot.between(rows[-1], after, 150), after]
    with Replay(robot) as replay:
        for name, (shape, where) in things.items():
            replay.add(name, shape, where)
        return replay.move(Trajectory(np.array(rows), robot.opening), apart=True)


def aside(robot, by):
    """The arm at home, turned on its base."""
    found = robot.home.copy()
    found[0] = by
    return found


def far():
    return time.monotonic() + 60


def test_the_straight_line_is_taken_where_it_is_free(panda):
    things = {"post": (POST, pose(-0.4, 0.0, GAP))}
    space = Space(Surroundings(panda, panda.opening, [SLAB], things, {}))
    found = find_motion(space, aside(panda, -1.0), aside(panda, 1.0), np.random.default_rng(0), far())
    assert found.straight and len(found.waypoints) == 2
    assert replayed(panda, found.waypoints, things) == []


@pytest.mark.parametrize("seed", range(3))
def test_the_arm_goes_round_a_post(panda, seed):
    things = {"post": (POST, pose(0.36, 0.0, GAP))}
    first, last = aside(panda, -1.0), aside(panda, 1.0)
    space = Space(Surroundings(panda, panda.opening, [SLAB], things, {}))
    rows, why = space.advance(first, last)
    assert len(rows) and why.endswith("touches post")
    assert any("inside post" in fault for fault in replayed(panda, np.array([first, last]), things))
    found = find_motion(space, first, last, np.random.default_rng(seed), far())
    assert not found.straight
    assert (found.waypoints[0] == first).all() and (found.waypoints[-1] == last).all()
    assert replayed(panda, found.waypoints, things) == []
    again = find_motion(space, first, last, np.random.default_rng(seed), far())
    assert np.array_equal(found.waypoints, again.waypoints)


def test_what_is_held_counts(panda):
    """A bar hits a low block over which the empty hand passes, and the arm that holds it when it is long."""
    things = {"block": (box(0.05, 0.05, 0.30), pose(0.31, 0.0, GAP))}
    line = np.array([aside(panda, angle) for angle in np.linspace(-1.0, 1.0, 200)])
    below = pose(0.0, 0.0, 0.0) @ np.diag([1.0, -1.0, -1.0, 1.0])
    bar = {"bar": (box(0.03, 0.03, 0.25), below @ pose(0.0, 0.0, -0.24))}
    pole = {"pole": (box(0.03, 0.03, 1.2), below @ pose(0.0, 0.0, -0.3))}
    assert Surroundings(panda, 0.04, [SLAB], things, {}).first_contact(line) is None
    assert Surroundings(panda, 0.04, [SLAB], things, bar).first_contact(line)[1] == "the held bar touches block"
    assert "the held pole touches the robot's" in Surroundings(panda, 0.04, [], {}, pole).first_contact(line)[1]


def test_the_replay_looks_at_what_is_held_and_the_arm(panda):
    pole = box(0.03, 0.03, 0.6)
    with Replay(panda) as replay:
        replay.add("pole", pole, panda.tool(panda.home) @ pose(0.0, 0.0, -0.3))
        replay.grasp("pole")
        still = Trajectory(panda.home[None], panda.opening)
        assert not any("pole is" in fault for fault in replay.move(still))
        assert any(re.search("pole is .* inside the panda_link", fault) for fault in replay.move(still, apart=True))


def test_pybullet_finds_no_contact_that_fcl_misses(panda):
    rng = np.random.default_rng(3)
    things = {"post": (POST, pose(0.4, 0.2, GAP)), "block": (box(0.3, 0.2, 0.3), pose(0.3, -0.4, GAP, 0.3))}
    around = Surroundings(panda, panda.opening, [SLAB], things, {})
    said = []
    with Replay(panda) as replay:
        for name, (shape, where) in things.items():
            replay.add(name, shape, where)
        for _ in range(150):
            row = panda.anywhere(panda.home, panda.home, rng)
            faults = replay.move(Trajectory(row[None], panda.opening))
            said.append((bool(faults), around.first_contact(row[None]) is not None))
    assert (True, False) not in said
    assert {(True, True), (False, False)} <= set(said)


def test_no_way_out_of_a_cage(hand):
    walls = [((0.5, 0.02, 0.6), (0.0, y, 0.3)) for y in (-0.24, 0.24)]
    walls += [((0.02, 0.5, 0.6), (x, 0.0, 0.3)) for x in (-0.24, 0.24)] + [((0.5, 0.5, 0.02), (0.0, 0.0, 0.61))]
    cage = {"cage": (Shape(tuple(Part("box", size, xyz) for size, xyz in walls)), pose(0.4, 0.0, GAP))}
    space = Space(Surroundings(hand, hand.opening, [SLAB], cage, {}))
    inside, outside = hand.home.copy(), hand.home.copy()
    inside[:3], outside[:3] = (0.4, 0.0, 0.2), (0.4, 0.8, 0.2)
    with pytest.raises(LimitReached, match=rf"touches cage; no way round was found in {motion.ROUNDS} tries"):
        find_motion(space, inside, outside, np.random.default_rng(0), far())
    with pytest.raises(LimitReached, match="time limit"):
        find_motion(space, inside, outside, np.random.default_rng(0), time.monotonic())
    outside[1] = 0.24
    with pytest.raises(NoAnswer, match="touches cage where it ends"):
        find_motion(space, inside, outside, np.random.default_rng(0), far())


@pytest.fixture(scope="module")
def arm_plan(unstack, tmp_path_factory):
    """The file of a plan with transits, some of them not straight."""
    result = solve(unstack.task, 8, 0, policy=unstack.policy, robot="panda", motion=True)
    assert result.valid and result.motion["transits"] == len(result.plan.steps) > result.motion["straight"]
    path = tmp_path_factory.mktemp("plans") / "arm.json"
    result.plan.save(path)
    assert Plan.load(path) == result.plan
    again = solve(unstack.task, 8, 0, policy=unstack.policy, robot="panda", motion=True)
    assert again.plan.to_json() == result.plan.to_json()
    return json.loads(path.read_text())


@pytest.fixture(scope="module")
def tray_plan(tmp_path_factory):
    """The file of a plan in which a tray is carried with its load."""
    task = Task.load("transport")
    result = solve(task, "2-2", 0, policy=Policy.load(TRANSPORT), robot="mobile_panda", motion=True)
    assert result.valid, result.problems or result.reason
    path = tmp_path_factory.mktemp("plans") / "tray.json"
    result.plan.save(path)
    return json.loads(path.read_text())


def problems(data, folder):
    path = folder / "plan.json"
    path.write_text(json.dumps(data))
    plan = Plan.load(path)
    return validate(plan, Task.load(plan.task))


def shortcut(data):
    """All transits straight, also those that went round something."""
    data["transits"] = [[rows[0], rows[-1]] for rows in data["transits"]]


def elsewhere(data):
    data["transits"][1][0][2] += 0.01


def too_far(data):
    data["transits"][0].insert(1, [9.0] * 7)


def one_less(data):
    del data["transits"][3]


def not_numbers(data):
    data["transits"][2] = [["a"] * 7] * 2


def too_short(data):
    data["transits"][2] = [[0.0] * 6] * 2


def nothing(data):
    data["transits"][2] = None


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (shortcut, "transit to step .*: .* inside"),
        (elsewhere, "transit to step 2: it does not lead from the end of the last motion to the next"),
        (too_far, "transit to step 1, step .* is beyond its limits"),
        (one_less, "transits for"),
        (not_numbers, "transit to step 3: could not convert"),
        (too_short, "transit to step 3: a path is rows of 7 numbers"),
        (nothing, "transit to step 3: a path is rows of 7 numbers"),
    ],
)
def test_a_changed_transit_is_refused(arm_plan, tmp_path, change, message):
    data = copy.deepcopy(arm_plan)
    change(data)
    found = problems(data, tmp_path)
    assert found and re.search(message, found[0]), found


def test_a_tray_with_its_load_is_kept_level(tray_plan, tmp_path):
    assert problems(tray_plan, tmp_path) == []
    data = copy.deepcopy(tray_plan)
    shortcut(data)
    assert any("thing" in fault and "tips" in fault for fault in problems(data, tmp_path))


def test_the_base_stands_still_meanwhile(tray_plan, tmp_path):
    data = copy.deepcopy(tray_plan)
    for row in data["transits"][1][1:-1] or data["transits"][1][:1]:
        row[0] += 0.02
    assert any("does not lead" in fault for fault in problems(data, tmp_path))


def test_the_command_says_where_no_way_was_found(unstack, tmp_path, monkeypatch):
    bundle = tmp_path / "unstack"
    unstack.save(bundle)
    command = ["solve", "unstack", "--size", "8", "--robot", "panda", "--policy", str(bundle), "--motion", "--json"]
    picture = tmp_path / "plan.png"
    good = CliRunner().invoke(app, [*command, "--render", str(picture)])
    assert good.exit_code == 0 and picture.exists()
    report = json.loads(good.stdout)
    validate_schema(report, schema("solve"))
    assert report["motion"]["transits"] == report["plan_length"] > report["motion"]["straight"]
    monkeypatch.setattr(motion, "ROUNDS", 0)
    monkeypatch.setattr(Space, "advance", lambda _, first, __: (first[:0], "the held block1 touches block2"))
    bad = CliRunner().invoke(app, [*command, "--timeout", "2"])
    assert bad.exit_code == 3
    report = json.loads(bad.stdout)
    validate_schema(report, schema("solve"))
    assert not report["solved"] and report["plan"] is None
    assert report["reason"].startswith("the arm cannot go from home to step 1, pick(")
    assert "touches block2; no way round" in report["reason"] and report["motion"]["anew"] > 0


@pytest.mark.parametrize("robot", ["panda", "gripper"])
def test_steps_without_a_way_to_them_are_chosen_anew(unstack, monkeypatch, robot):
    """Where the arm knows straight lines only, some steps need another reach."""
    monkeypatch.setattr(motion, "ROUNDS", 0)
    result = solve(unstack.task, 8, 0, policy=unstack.policy, robot=robot, motion=True)
    assert result.valid, result.reason
    assert result.motion["anew"] > 0
    assert result.motion["straight"] == result.motion["transits"] == len(result.plan.steps)
    again = solve(unstack.task, 8, 0, policy=unstack.policy, robot=robot, motion=True)
    assert again.plan.to_json() == result.plan.to_json()
