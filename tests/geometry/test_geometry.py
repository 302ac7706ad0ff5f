"""Shapes, collisions, replay and pictures, with the real FCL and PyBullet."""

from __future__ import annotations

import contextlib
import math
import pickle
import signal
import subprocess
import sys
import time
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

from gentamp_lp.geometry.bullet import Bullet, Camera
from gentamp_lp.geometry.collision import Swept, collide, convex, hits_table, placed
from gentamp_lp.geometry.gripper import Gripper
from gentamp_lp.geometry.make import make_robot
from gentamp_lp.geometry.models import load_model
from gentamp_lp.geometry.playback import Playback
from gentamp_lp.geometry.render import MOVIE, Scene, film, save_movie, save_still, smooth
from gentamp_lp.geometry.replay import TABLE, Replay
from gentamp_lp.geometry.robots import STEPS, Trajectory
from gentamp_lp.geometry.shapes import GAP, Part, Shape, box, cylinder, to_trimesh, tray
from gentamp_lp.geometry.transforms import difference, inverse, pose, quaternion, rotation

CUBE = box(0.05, 0.05, 0.05)
CAN = cylinder(0.03, 0.09)


def random_rotation(rng):
    turn = rng.normal(size=4)
    result = np.eye(4)
    result[:3, :3] = rotation(turn / np.linalg.norm(turn))
    return result


# transforms


def test_quaternions_round_trip_also_for_half_turns():
    rng = np.random.default_rng(0)
    matrices = [random_rotation(rng) for _ in range(50)]
    matrices += [np.diag([1.0, -1.0, -1.0, 1.0]), np.diag([-1.0, 1.0, -1.0, 1.0]), np.diag([-1.0, -1, 1, 1])]
    for matrix in matrices:
        assert np.allclose(rotation(quaternion(matrix)), matrix[:3, :3], atol=1e-12)
        assert np.allclose(inverse(matrix) @ matrix, np.eye(4), atol=1e-12)


def test_difference_of_poses():
    metres, radians = difference(pose(1, 2, 3, 0.1), pose(1, 2, 3.5, 0.1 + 3.0))
    assert metres == pytest.approx(0.5)
    assert radians == pytest.approx(3.0)
    assert difference(pose(yaw=1e-7), pose())[1] == pytest.approx(1e-7, rel=1e-3)


# shapes


def test_shapes_are_values():
    assert box(0.1, 0.2, 0.3) == box(0.1, 0.2, 0.3)
    assert len({CUBE, box(0.05, 0.05, 0.05), CAN}) == 2
    assert pickle.loads(pickle.dumps(CUBE)) == CUBE
    assert CUBE.extent == pytest.approx((0.05, 0.05, 0.05))
    assert CAN.extent == pytest.approx((0.06, 0.06, 0.09))
    assert CAN.height == pytest.approx(0.09)
    turned = Shape((Part("box", (0.1, 0.1, 0.1), (0, 0, 0.05), math.pi / 4),))
    assert turned.extent == pytest.approx((0.1 * math.sqrt(2), 0.1 * math.sqrt(2), 0.1))


@pytest.mark.parametrize(("kind", "size"), [("box", (0.1, 0.1)), ("cylinder", (0.1, 0.0)), ("ball", (0.1,))])
def test_bad_parts_are_refused(kind, size):
    with pytest.raises(ValueError):
        Part(kind, size, (0, 0, 0))


def test_bad_shapes_are_refused():
    with pytest.raises(ValueError, match="at least one part"):
        Shape(())
    with pytest.raises(ValueError, match="headroom"):
        tray(0.2, 0.1, headroom=0.01)
    with pytest.raises(ValueError, match="flat"):
        convex(np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [1, 1, 0]]), [[0, 1, 2]] * 4)
    with pytest.raises(ValueError, match="four"):
        convex(np.zeros((0, 3)), [])


def test_tray_is_grasped_by_its_fin_and_keeps_its_load_space():
    shape = tray(0.25, 0.085)
    (fin,) = shape.graspable
    assert fin.xyz[0] > 0.125 + 0.03
    assert shape.interior == (0.25, 0.085, 0.01)
    above = pose(z=0.06)
    assert collide(shape, pose(), CUBE, above)
    assert not collide(shape, pose(), CUBE, above, envelope=False)
    assert not collide(shape, pose(), CUBE, pose(z=0.125))
    assert collide(shape, pose(), CUBE, pose(z=0.005), envelope=False)
    swept = Gripper().swept(Trajectory(np.array([[0.0, 0, 0.5, 1, 0, 0, 0]]), 0.02))
    assert swept.hits(shape, pose(z=0.42)) and not swept.hits(shape, pose(z=0.35))
    assert not swept.hits(shape, pose(z=0.42), envelope=False)


def test_meshes_have_the_size_of_the_shape():
    for shape in (CUBE, CAN, tray(0.25, 0.085)):
        mesh = to_trimesh(shape)
        assert mesh.bounds == pytest.approx(np.array(shape.bounds), abs=1e-3)


# collisions


def test_a_gap_is_no_collision_and_an_inclusion_is():
    assert not collide(CUBE, pose(), CUBE, pose(z=0.05 + GAP))
    assert collide(CUBE, pose(), CUBE, pose(z=0.0499))
    assert collide(box(0.5, 0.5, 0.5), pose(), CUBE, pose(z=0.2))
    assert not collide(CAN, pose(), CUBE, pose(z=CAN.height + GAP))
    assert not hits_table(CUBE, pose(z=GAP)) and hits_table(CUBE, pose(z=-GAP))
    lying = pose(z=0.02)
    lying[:3, :3] = [[1, 0, 0], [0, 0, -1], [0, 1, 0]]
    assert hits_table(CAN, lying)
    lying[2, 3] = 0.031
    assert not hits_table(CAN, lying)


def random_scene(rng, count):
    shapes = []
    for _ in range(count):
        if rng.random() < 0.5:
            shapes.append(box(*rng.uniform(0.03, 0.1, 3)))
        else:
            shapes.append(cylinder(rng.uniform(0.02, 0.05), rng.uniform(0.03, 0.1)))
    places = [pose(*rng.uniform(-0.09, 0.09, 3)) @ random_rotation(rng) for _ in shapes]
    return list(zip(shapes, places, strict=True))


def test_fcl_agrees_with_pybullet():
    """Pairs of random boxes and cylinders; those closer than a tenth of a millimetre are not counted."""
    rng = np.random.default_rng(1)
    hits = 0
    with Bullet() as world:
        for _ in range(300):
            (a, pose_a), (b, pose_b) = random_scene(rng, 2)
            found = world.closest(world.add(a, pose_a), world.add(b, pose_b), 1.0)
            distance = min(entry[1] for entry in found)
            if abs(distance) < 1e-4:
                continue
            assert collide(a, pose_a, b, pose_b) == (distance < 0), distance
            hits += distance < 0
    assert 60 < hits < 240


def test_swept_equals_all_pairs():
    rng = np.random.default_rng(2)
    hits = 0
    for _ in range(40):
        scene = random_scene(rng, 6)
        swept = Swept(placed(part, place) for shape, place in scene for part in shape.parts)
        for shape, place in random_scene(rng, 6):
            place[0, 3] += 0.1
            expected = any(collide(shape, place, *other) for other in scene)
            assert swept.hits(shape, place) == expected
            hits += expected
    assert 60 < hits < 220
    assert not Swept([]).hits(CUBE, pose())


# replay


@pytest.fixture
def gripper():
    return Gripper()


def reach(robot, place, grasp):
    found = robot.reach(place @ grasp.tool, grasp.opening, np.random.default_rng(0))
    assert found is not None
    return found


def test_replay_accepts_a_good_plan(gripper):
    grasp = next(gripper.grasps(CUBE))
    start, goal = pose(0.4, 0.1, GAP), pose(0.5, -0.1, 2 * GAP + 0.05, 0.4)
    with Replay(gripper) as replay:
        assert not replay.add("a", CUBE, start)
        assert not replay.add("b", CUBE, pose(0.5, -0.1, GAP), TABLE)
        assert not replay.pick("a", reach(gripper, start, grasp), grasp)
        assert replay.held == "a" and replay.support("a") is None
        assert not replay.place("a", reach(gripper, goal, grasp), "b", goal)
        assert replay.support("a") == "b" and replay.held is None
        assert difference(replay.pose("a"), goal)[0] < 1e-6
        assert replay.violations == []


def test_replay_finds_faults(gripper):
    grasp = next(gripper.grasps(CUBE))
    places = {"a": pose(0.4, 0.1, GAP), "b": pose(0.4, 0.1, 2 * GAP + 0.05), "c": pose(0.4, 0.16, GAP)}
    with Replay(gripper) as replay:
        assert not [v for name, place in places.items() for v in replay.add(name, CUBE, place)]
        with pytest.raises(ValueError, match="already"):
            replay.add("a", CUBE, places["a"])
        path = reach(gripper, places["a"], grasp)
        assert any("hand is" in v and "inside b" in v for v in replay.move(path))
        assert any("finger is" in v and "inside c" in v for v in replay.violations)
        assert any("has b on it" in v for v in replay.grasp("a", grasp))
        assert any("already holds a" in v for v in replay.grasp("c", grasp))
        assert any("holds a, not c" in v for v in replay.release("c"))
        assert any("off" in v for v in replay.release("a", TABLE, pose(0.42, 0.1, GAP)))
        assert any("no object" in v for v in replay.grasp("d"))
        away = reach(gripper, pose(0.45, 0.3, GAP), grasp)
        replay.move(away)
        assert any("not within 4 mm" in v for v in replay.grasp("a"))
        assert any("does not rest on c" in v for v in replay.release("a", "c"))
        low = Trajectory(away.configurations - [0, 0, 0.03, 0, 0, 0, 0], grasp.opening)
        assert any("inside table" in v for v in replay.move(low))
        jump = Trajectory(away.configurations[[0, -1]], 0.2)
        assert any("jumps" in v for v in replay.move(jump))
        assert any("cannot open" in v for v in replay.violations)
        assert any("does not rest on anything" in v for v in replay.add("e", CUBE, pose(0.8, 0, 0.2)))
        assert any("inside e" in v for v in replay.add("f", CUBE, pose(0.8, 0, 0.21)))
        assert any("no object g" in v for v in replay.add("h", CUBE, pose(0.8, 0.5, 0.21), "g"))


def test_replay_carries_what_is_on_a_tray(gripper):
    shape = tray(0.20, 0.085)
    start, goal = pose(0.4, 0.0, GAP), pose(0.5, 0.3, GAP, 0.5)
    load = pose(0.33, 0.0, 2 * GAP + 0.01)
    with Replay(gripper) as replay:
        assert not replay.add("tray", shape, start)
        assert not replay.add("can", CAN, load)
        assert replay.support("can") == "tray"
        grasp = next(gripper.grasps(shape))
        assert not replay.pick("tray", reach(gripper, start, grasp), grasp)
        assert difference(replay.pose("can"), pose(0.33, 0.0, 2 * GAP + 0.11))[0] < 1e-6
        assert not replay.place("tray", reach(gripper, goal, grasp), TABLE, goal)
        assert difference(replay.pose("can"), goal @ inverse(start) @ load)[0] < 1e-6
        assert replay.support("can") == "tray"


def test_replay_does_not_drift(gripper):
    """Carrying an object about a hundred times leaves it upright and where it was claimed to be."""
    grasp = next(gripper.grasps(CUBE))
    places = [pose(0.4, 0.1, GAP, 0.3), pose(0.5, -0.1, GAP, 2.0)]
    with Replay(gripper) as replay:
        replay.add("a", CUBE, places[0])
        for turn in range(100):
            start, goal = places[turn % 2], places[(turn + 1) % 2]
            replay.pick("a", reach(gripper, start, grasp), grasp)
            replay.place("a", reach(gripper, goal, grasp), TABLE, goal)
        assert replay.violations == []
        assert difference(replay.pose("a"), places[0])[0] < 1e-6


# pictures


def test_pictures(gripper, tmp_path):
    with Scene(gripper) as scene:
        scene.add("a", CUBE, pose(0.5, 0.0, GAP))
        before = scene.picture(MOVIE, samples=1)
        scene.move("a", pose(0.5, 0.2, GAP))
        scene.set_robot(gripper.home + np.array([0.1, 0, 0, 0, 0, 0, 0]), 0.04)
        after = scene.picture(MOVIE, samples=1)
    assert before.size == (480, 360)
    assert len(before.getcolors(480 * 360)) > 30
    blue = np.array(before).astype(int)
    assert ((blue[:, :, 2] - blue[:, :, 0]) > 60).sum() > 50  # the cube can be seen
    assert before.tobytes() != after.tobytes()
    save_still(before, tmp_path / "still.png")
    save_movie([before, after], tmp_path / "movie.gif")
    assert (tmp_path / "still.png").read_bytes().startswith(b"\x89PNG")
    assert (tmp_path / "movie.gif").read_bytes().startswith(b"GIF")
    with pytest.raises(ValueError, match="at least one"):
        save_movie([], tmp_path / "none.gif")


@pytest.mark.parametrize("name", ["gripper", "panda"])
def test_boxes_leave_out_no_overlap(name):
    """The boxes by which pairs are left out hold all that PyBullet finds to touch, wherever the robot moves."""
    with contextlib.closing(make_robot(name)) as robot, Bullet() as world:
        model = load_model(world, robot)
        rng = np.random.default_rng(0)
        cubes = [world.add(CUBE, np.eye(4)) for _ in range(6)]
        touching = 0
        for _ in range(60):
            turned = robot.home + (rng.uniform(-0.4, 0.4, len(robot.home)) if name == "panda" else 0.0)
            model.set(turned, robot.opening)
            for cube in cubes:
                world.move(cube, pose(*(model.tool()[:3, 3] + rng.uniform(-0.2, 0.2, 3)), rng.uniform(-3, 3)))
            near = set(world.near(model.pieces, cubes))
            touch = {(p, c) for p in model.pieces for c in cubes if world.closest(p, c, 0.0)}
            touching += len(touch)
            assert touch <= near
    assert touching > 20 and len(near) < len(model.pieces) * len(cubes)


def test_a_film_has_no_gaps(gripper):
    grasp = next(gripper.grasps(CUBE))
    start, goal = pose(0.4, 0.1, GAP), pose(0.5, -0.2, GAP, 0.4)
    playback = Playback(gripper)
    playback.add("a", CUBE, start, TABLE)
    assert [state.poses["a"].tolist() for state in playback.take()] == [start.tolist()]
    playback.pick("a", reach(gripper, start, grasp), grasp)
    playback.place("a", reach(gripper, goal, grasp), TABLE, goal)
    states = playback.take()
    assert np.allclose(states[-1].poses["a"], goal, atol=1e-9)
    assert len(states) == 4 * (STEPS + 1) and states[-1].held is None
    whole = list(smooth(gripper, states, 0.05))
    tools = [gripper.tool(state.configuration) for state in whole]
    assert len(whole) > len(states)
    assert max(difference(a, b)[0] for a, b in pairwise(tools)) <= 0.05 + 1e-9
    ways = [difference(a.poses["a"], b.poses["a"])[0] for a, b in pairwise(whole)]
    assert max(ways) <= 0.06  # the object goes with the tool
    small = replace(MOVIE, width=64, height=48)
    pictures = list(film(gripper, {"a": CUBE}, whole[:3], small))
    assert len(pictures) == 3 and pictures[0].size == (64, 48)


def test_a_camera_comes_as_near_as_it_can():
    """Every sphere is within the four planes through the eye, and one on each of two opposite sides is at a plane."""
    rng = np.random.default_rng(5)
    for _ in range(50):
        centres, radii = rng.normal(size=(9, 3)), rng.uniform(0.0, 0.4, 9)
        before = Camera(eye=tuple(rng.normal(size=3) + 3.0), angle=float(rng.uniform(20.0, 90.0)), width=900)
        camera = before.framing(centres, radii)
        ways = [np.subtract(c.target, c.eye) for c in (before, camera)]
        ahead, again = (way / np.linalg.norm(way) for way in ways)
        assert np.allclose(ahead, again)
        right = np.cross(ahead, (0.0, 0.0, 1.0)) / np.linalg.norm(np.cross(ahead, (0.0, 0.0, 1.0)))
        high = math.radians(camera.angle) / 2
        wide = math.atan(math.tan(high) * camera.width / camera.height)
        gaps = []
        for side, half in (
            (right, wide),
            (-right, wide),
            (np.cross(right, ahead), high),
            (np.cross(ahead, right), high),
        ):
            normal = math.sin(half) * ahead + math.cos(half) * side  # of the opposite plane, inwards
            gaps.append(((centres - camera.eye) @ normal - radii).min())
        assert min(gaps) > -1e-9
        assert max(gaps[:2]) < 1e-9 or max(gaps[2:]) < 1e-9


def test_nothing_is_printed():
    code = (
        "from gentamp_lp.geometry.make import make_robot; from gentamp_lp.geometry.replay import Replay;"
        "robot = make_robot('panda'); Replay(robot).close(); robot.close();"
        "Replay(make_robot('gripper')).close()"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout == "" and done.stderr == ""


def test_ctrl_c_is_not_lost_in_a_collision_query() -> None:
    """FCL swallows what a callback in Python raises, and a busy loop spends most of its time there."""
    program = (
        "import numpy as np\n"
        "from gentamp_lp.geometry.collision import Swept, placed\n"
        "from gentamp_lp.geometry.shapes import box\n"
        "shape, here = box(1, 1, 1), np.eye(4)\n"
        "swept = Swept([placed(part, here) for part in shape.parts] * 200)\n"
        "print('ready', flush=True)\n"
        "while True: swept.hits(shape, here)\n"
    )
    for _ in range(4):
        child = subprocess.Popen([sys.executable, "-c", program], stdout=subprocess.PIPE, stderr=subprocess.PIPE)
        assert child.stdout is not None and child.stdout.readline() == b"ready\n"
        time.sleep(0.1)
        child.send_signal(signal.SIGINT)
        try:
            _, errors = child.communicate(timeout=60)
        finally:
            child.kill()
        assert b"KeyboardInterrupt" in errors
