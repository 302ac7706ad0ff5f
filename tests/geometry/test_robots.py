"""Grasps, reach and swept volumes of the robots, with the real PyBullet and FCL."""

from __future__ import annotations

import math
import time
from pathlib import Path

import numpy as np
import pytest
from helpers.robots import needs_pr2

from gentamp_lp.errors import InputError
from gentamp_lp.geometry.arm import MAX_STEP
from gentamp_lp.geometry.bullet import Bullet
from gentamp_lp.geometry.collision import Swept, collide, hits_table
from gentamp_lp.geometry.gripper import approach_poses
from gentamp_lp.geometry.make import make_robot
from gentamp_lp.geometry.models import load_model
from gentamp_lp.geometry.replay import Replay
from gentamp_lp.geometry.robots import STANDOFF, STEPS
from gentamp_lp.geometry.shapes import GAP, Part, Shape, box, cylinder, tray
from gentamp_lp.geometry.transforms import difference, inverse, pose

CUBE = box(0.05, 0.05, 0.05)
TALL = cylinder(0.033, 0.10)


@pytest.fixture(scope="module", params=["gripper", "panda"])
def robot(request):
    made = make_robot(request.param)
    yield made
    made.close()


EXAMPLE = Path(__file__).parents[2] / "docs" / "examples" / "04-own-robot" / "arm.yaml"
PR2 = pytest.param("pr2", marks=needs_pr2)


@pytest.fixture(scope="module")
def panda():
    made = make_robot("panda")
    yield made
    made.close()


def targets(count, seed):
    """Top-down tool poses over the table in front of a Panda."""
    rng = np.random.default_rng(seed)
    down = np.diag([1.0, -1.0, -1.0, 1.0])
    while count:
        x, y = rng.uniform(0.25, 0.75), rng.uniform(-0.5, 0.5)
        if math.hypot(x, y) < 0.75:
            count -= 1
            yield pose(x, y, rng.uniform(0.02, 0.10), rng.uniform(-math.pi, math.pi)) @ down


def test_unknown_robots_are_refused():
    with pytest.raises(InputError, match="mobile_panda, panda"):
        make_robot("hand")


def described(tmp_path, old="", new=""):
    """The example arm, its description changed."""
    text = EXAMPLE.read_text()
    assert old in text
    (tmp_path / "arm.urdf").write_bytes(EXAMPLE.with_name("arm.urdf").read_bytes())
    path = tmp_path / "arm.yaml"
    path.write_text(text.replace(old, new))
    return str(path)


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ("tip: hand", "tip: foot", "no link foot"),
        ("lift: -0.3, ", "", "from root to tip they are pan, lift"),
        ("opening: 0.08", "opening: wide", "opening: Input should be a valid number"),
        ("tip: hand", "tips: hand", "tips: Extra inputs"),
        ("urdf: arm.urdf", "{distribution: no-such-package, urdf: x", "not valid YAML"),
    ],
)
def test_mistakes_in_a_description_are_named(tmp_path, old, new, words):
    with pytest.raises(InputError, match=words):
        make_robot(described(tmp_path, old, new))


def test_missing_packages_are_named(tmp_path):
    with pytest.raises(InputError, match="pip install no-such-package"):
        make_robot(described(tmp_path, "urdf: arm.urdf", "distribution: no-such-package\nurdf: arm.urdf"))


def test_a_joint_that_slides_reaches_higher(tmp_path):
    """Posture folds a joint in; a chain with a prismatic joint solves like any other."""
    path = described(tmp_path, "home: {", "restarts: 48\nhome: {rise: 0.1, ")
    urdf = tmp_path / "arm.urdf"
    column = """<link name="foot"/><joint name="rise" type="prismatic"><parent link="foot"/><child link="base"/>
      <origin xyz="0 0 0"/><axis xyz="0 0 1"/><limit lower="0" upper="0.3" effort="9" velocity="1"/></joint>"""
    urdf.write_text(urdf.read_text().replace('<robot name="arm">', f'<robot name="arm">{column}'))
    arm = make_robot(path)
    assert arm.chain.joints[0] == "rise" and arm.chain.upper[0] == 0.3
    high = pose(0.35, 0.1, 0.80) @ np.diag([1.0, -1.0, -1.0, 1.0])
    rng = np.random.default_rng(0)
    trajectory = arm.reach(high, 0.05, rng)
    assert trajectory is not None and trajectory.configurations[-1, 0] > 0.05
    assert difference(arm.tool(trajectory.configurations[-1]), high)[0] < 1e-3
    text = urdf.read_text()
    path = described(tmp_path, "home: {", "restarts: 48\nposture: {rise: 0.0}\nhome: {")
    urdf.write_text(text)
    stiff = make_robot(path)
    assert stiff.chain.dof == 6 and stiff.reach(high, 0.05, rng) is None


# grasps


def test_grasps_fit_the_gripper(robot):
    assert len(list(robot.grasps(CUBE))) == 4
    assert len(list(robot.grasps(box(0.05, 0.12, 0.05)))) == 2
    assert list(robot.grasps(box(0.09, 0.09, 0.05))) == []
    assert len(list(robot.grasps(TALL))) >= 8
    assert list(robot.grasps(Shape((*CUBE.parts, *TALL.parts)))) == []  # no handle
    for shape in (CUBE, TALL, tray(0.25, 0.085)):
        first, second = list(robot.grasps(shape, "any")), list(robot.grasps(shape, "any"))
        assert all(np.array_equal(a.tool, b.tool) for a, b in zip(first, second, strict=True))
        for grasp in first:
            turn = grasp.tool[:3, :3]
            assert np.allclose(turn.T @ turn, np.eye(3)) and np.linalg.det(turn) == pytest.approx(1)
            assert 0 < grasp.opening <= robot.opening


def test_fingers_enclose_without_touching(robot):
    """At the grasp the fingers are closer than 1.5 mm to the object on both sides, and nothing touches it."""
    yawed = Shape((Part("box", (0.03, 0.06, 0.05), (0.0, 0.0, 0.025), 0.3),))
    for shape in (CUBE, TALL, yawed, tray(0.25, 0.085)):
        for grasp in robot.grasps(shape, "any"):
            place = pose(0.45, 0.1, GAP, 0.3)
            trajectory = robot.reach(place @ grasp.tool, grasp.opening, np.random.default_rng(0))
            if trajectory is None:
                assert robot.name == "panda"
                continue
            assert not robot.swept(trajectory).hits(shape, place, envelope=False)
            narrow = type(trajectory)(trajectory.configurations, grasp.opening - 0.003)
            assert robot.swept(narrow).hits(shape, place, envelope=False)


def test_side_grasps_are_for_tall_things(robot):
    assert list(robot.grasps(CUBE, "side")) == []
    sides = list(robot.grasps(TALL, "side"))
    assert sides and all(abs(g.tool[2, 2]) < 0.25 for g in sides)
    place = pose(0.5, 0.0, GAP)
    found = [robot.reach(place @ g.tool, g.opening, np.random.default_rng(0)) for g in sides]
    assert sum(t is not None for t in found) >= 2


# reach


def test_reach_is_exact_straight_and_within_limits(robot):
    rng = np.random.default_rng(0)
    reached = 0
    for target in targets(40, seed=3):
        trajectory = robot.reach(target, 0.05, rng)
        if trajectory is None:
            continue
        reached += 1
        path = trajectory.configurations
        assert path.shape == (STEPS + 1, len(robot.home))
        for configuration, expected in zip(path, approach_poses(target), strict=True):
            metres, radians = difference(robot.tool(configuration), expected)
            assert metres < 1e-3 and radians < math.radians(1)
        assert np.linalg.norm(robot.tool(path[0])[:3, 3] - target[:3, 3]) == pytest.approx(STANDOFF, abs=1e-3)
        if robot.name == "panda":
            assert robot.chain.within(path).all()
            assert np.abs(np.diff(path, axis=0)).max() <= MAX_STEP
    assert reached >= 36


def test_reach_is_deterministic(robot):
    target = next(targets(1, seed=4))
    first = robot.reach(target, 0.05, np.random.default_rng(5))
    robot.reach(next(targets(1, seed=6)), 0.05, np.random.default_rng(7))  # must leave no trace
    second = robot.reach(target, 0.05, np.random.default_rng(5))
    assert np.array_equal(first.configurations, second.configurations)


def test_reach_refuses_the_table_and_the_distance(robot):
    rng = np.random.default_rng(0)
    down = np.diag([1.0, -1.0, -1.0, 1.0])
    assert robot.reach(pose(0.5, 0, 0.002) @ down, 0.05, rng) is None
    if robot.name == "panda":
        assert robot.reach(pose(1.2, 0, 0.05) @ down, 0.05, rng) is None


def test_panda_reaches_what_is_feasible(panda):
    """Against plain numpy inverse kinematics from many random starts, 300 targets."""
    rng = np.random.default_rng(8)
    feasible = reached = 0
    seconds, plain = [], []
    for target in targets(300, seed=9):
        starts = rng.uniform(panda.chain.lower, panda.chain.upper, (24, 7))
        goals = np.broadcast_to(target, (24, 4, 4))
        begin = time.perf_counter()
        values, solved = panda.chain.solve(goals, starts, iterations=40)
        plain.append(time.perf_counter() - begin)
        if not (solved & panda.chain.within(values)).any():
            continue
        feasible += 1
        begin = time.perf_counter()
        reached += panda.reach(target, 0.05, rng) is not None
        seconds.append(time.perf_counter() - begin)
    assert feasible > 270
    assert reached / feasible >= 0.9
    assert np.median(seconds) < 5 * np.median(plain)  # as long as it was when this was written


@pytest.mark.parametrize("name", ["panda", "mobile_panda", PR2, str(EXAMPLE)])
def test_kinematics_agree_with_pybullet(name):
    """Every link, the fingers too, is where PyBullet's own reading of the URDF puts it."""
    robot = make_robot(name)
    rng = np.random.default_rng(10)
    chain = robot.arm.chain if robot.mobile else robot.chain
    with Bullet() as world:
        model = load_model(world, robot)
        links = world.links(model.pieces[0])
        arms = rng.uniform(np.maximum(chain.lower, -3), np.minimum(chain.upper, 3), (30, chain.dof))
        bases = rng.uniform(-2, 2, (30, 3 if robot.mobile else 0))
        for configuration in np.hstack([bases, arms]):
            model.set(configuration, 0.03)
            assert model.beyond_limits(configuration) == []
            assert difference(model.tool(), robot.tool(configuration))[0] < 1e-6
            for body in robot.bodies(configuration, 0.03):
                if body.link.name not in links:  # the base, which PyBullet counts apart, and platforms
                    continue
                metres, radians = difference(world.pose(model.pieces[0], links[body.link.name]), body.pose)
                assert metres < 1e-6 and radians < 1e-3


# swept volumes


def test_a_block_on_top_prevents_the_grasp_below(robot):
    below, above = pose(0.45, 0.1, GAP), pose(0.45, 0.1, 2 * GAP + 0.05)
    beside = pose(0.45, 0.35, GAP)
    for grasp in robot.grasps(CUBE):
        trajectory = robot.reach(below @ grasp.tool, grasp.opening, np.random.default_rng(0))
        swept = robot.swept(trajectory, CUBE, grasp)
        assert swept.hits(CUBE, above)
        assert not swept.hits(CUBE, beside)
        high = robot.reach(above @ grasp.tool, grasp.opening, np.random.default_rng(0))
        assert not robot.swept(high, CUBE, grasp).hits(CUBE, below)


def test_swept_equals_all_pairs(robot):
    """The links are compared one by one through PyBullet."""
    rng = np.random.default_rng(11)
    target = next(targets(1, seed=12))
    trajectory = robot.reach(target, 0.05, rng)
    swept = robot.swept(trajectory)
    compared = hits = 0
    with Bullet() as world:
        links = [
            world.add_hull(body.link.vertices, (1, 1, 1, 1), body.pose)
            for configuration in trajectory.configurations
            for body in robot.bodies(configuration, 0.05)
        ]
        for _ in range(60):
            place = pose(*(target[:3, 3] + rng.uniform(-0.15, 0.15, 3)), rng.uniform(-3, 3))
            obstacle = world.add(CUBE, place)
            near = [entry[1] for link in links for entry in world.closest(link, obstacle, 0.01)]
            distance = min(near, default=0.01)
            if abs(distance) < 2.5e-3:  # PyBullet keeps a margin round meshes
                continue
            compared += 1
            hits += distance < 0
            assert swept.hits(CUBE, place) == (distance < 0), distance
    assert compared > 40 and 5 < hits < 50


def test_the_held_object_moves_with_the_tool(robot):
    place = pose(0.45, 0.1, GAP)
    grasp = next(robot.grasps(CUBE))
    trajectory = robot.reach(place @ grasp.tool, grasp.opening, np.random.default_rng(0))
    held = [robot.tool(c) @ inverse(grasp.tool) for c in trajectory.configurations]
    assert not any(hits_table(CUBE, where) for where in held)
    stick = box(0.004, 0.004, 0.02)
    probe = pose(0.45 + 0.0236, 0.1 + 0.0236, 0.02)  # in the corner of the cube, beside the fingers
    assert collide(CUBE, place, stick, probe)
    assert robot.swept(trajectory, CUBE, grasp).hits(stick, probe)
    assert not robot.swept(trajectory).hits(stick, probe)
    with pytest.raises(ValueError, match="grasp"):
        robot.swept(trajectory, CUBE)


def test_a_held_tray_keeps_its_load_space(robot):
    shape, place = tray(0.2, 0.085), pose(0.45, 0.1, GAP, 2.0)
    grasp = next(robot.grasps(shape))
    trajectory = robot.reach(place @ grasp.tool, grasp.opening, np.random.default_rng(1))
    swept = robot.swept(trajectory, shape, grasp)
    above = pose(0.45, 0.1, 0.18, 2.0)
    assert swept.hits(box(0.02, 0.02, 0.02), above)
    loaded = [place @ pose(x, 0, GAP + 0.01) for x in (-0.06, 0.06)]
    assert not any(robot.swept(trajectory).hits(TALL, where) for where in loaded)


def test_panda_plan_survives_replay(panda):
    rng = np.random.default_rng(13)
    start, goal = pose(0.5, 0.1, GAP, 0.2), pose(0.4, -0.2, 2 * GAP + 0.05, 1.0)
    other = pose(0.4, -0.2, GAP)
    grasp, pick, place = next(
        (g, first, second)
        for g in panda.grasps(CUBE)
        if (first := panda.reach(start @ g.tool, g.opening, rng))
        and (second := panda.reach(goal @ g.tool, g.opening, rng))
    )
    with Replay(panda) as replay:
        assert not replay.add("a", CUBE, start) and not replay.add("b", CUBE, other)
        assert not replay.pick("a", pick, grasp)
        assert not replay.place("a", place, "b", goal)
        assert replay.support("a") == "b"
        bad = type(pick)(pick.configurations + np.array([0, 0, 0, 3.2, 0, 0, 0]), pick.opening)
        assert any("beyond its limits" in fault for fault in replay.move(bad))


def test_gripper_is_fast(panda):
    """At least five times as fast as an arm; it was fifty times when this was written."""

    def seconds(robot):
        grasp = next(robot.grasps(CUBE))
        rng = np.random.default_rng(0)
        begin = time.perf_counter()
        trajectory = robot.reach(pose(0.4, 0.1, GAP) @ grasp.tool, grasp.opening, rng)
        robot.swept(trajectory, CUBE, grasp)
        return time.perf_counter() - begin

    gripper = make_robot("gripper")
    times = [(seconds(gripper), seconds(panda)) for _ in range(20)]
    assert 5 * np.median([one for one, _ in times]) < np.median([other for _, other in times])


def test_spheres_around_what_is_swept_change_no_answer(robot):
    rng = np.random.default_rng(4)
    held = box(0.05, 0.05, 0.06)
    grasp = next(iter(robot.grasps(held)))
    place = pose(0.5, 0.1, 0.031)
    trajectory = robot.reach(place @ grasp.tool, grasp.opening, rng)
    assert trajectory is not None
    for swept in (robot.swept(trajectory), robot.swept(trajectory, held, grasp)):
        bare = Swept(swept.solid, swept.space)
        answers = []
        for _ in range(300):
            there = pose(*rng.uniform((0.1, -0.5, 0.0), (0.9, 0.7, 0.5)), rng.uniform(-3, 3))
            answers.append(bare.hits(CUBE, there))
            assert swept.hits(CUBE, there) == answers[-1]
        assert 0 < sum(answers) < 300
