"""Meshes as things: the same solid in FCL and PyBullet, stable, graspable, refused with the reason where unusable."""

from __future__ import annotations

import math
import pickle
import sys
from pathlib import Path

import numpy as np
import pytest
import trimesh
from scipy.spatial import Delaunay

from gentamp_lp.cli.main import main
from gentamp_lp.errors import InputError, NoAnswer
from gentamp_lp.geometry import bullet, meshes
from gentamp_lp.geometry.assets import data_path, find_mesh
from gentamp_lp.geometry.bullet import Bullet
from gentamp_lp.geometry.collision import collide, hits_table
from gentamp_lp.geometry.gripper import approach_poses
from gentamp_lp.geometry.make import make_robot
from gentamp_lp.geometry.meshes import mesh, tray_mesh
from gentamp_lp.geometry.models import load_model
from gentamp_lp.geometry.render import MOVIE, Scene
from gentamp_lp.geometry.replay import TABLE, Replay
from gentamp_lp.geometry.shapes import GAP, Part, Shape, box, hull, to_trimesh
from gentamp_lp.geometry.transforms import inverse, pose, rotation
from gentamp_lp.learning.learn import Learned
from gentamp_lp.planning.solve import solve
from gentamp_lp.tasks.task import Task

EXAMPLE = Path(__file__).parents[2] / "docs" / "examples" / "09-meshes" / "toys.yaml"
SERVE = EXAMPLE.with_name("serve.yaml")
TRAY = data_path("tray", "tray_textured.obj")
MUG, DUCK, BRICK = (data_path(*name.split("/")) for name in ("objects/mug.obj", "duck_vhacd.obj", "lego/lego.obj"))


@pytest.fixture(scope="module")
def shapes() -> dict[str, Shape]:
    return {
        "mug": mesh(MUG, 0.8),
        "hollow mug": mesh(MUG, 0.8, collision="pieces"),
        "duck": mesh(DUCK, 0.04, (0, 1, 0)),
        "teddy": mesh(data_path("teddy2_VHACD_CHs.obj"), 0.1, collision="pieces"),
        "brick": mesh(BRICK, 0.15, (0, 1, 0)),
        "bunny": mesh(data_path("bunny.obj"), 0.04),
    }


def turned(rng: np.random.Generator) -> np.ndarray:
    result = pose(*rng.uniform(-0.06, 0.06, 3))
    turn = rng.normal(size=4)
    result[:3, :3] = rotation(turn / np.linalg.norm(turn))
    return result


# ---- solids


def test_both_checkers_see_the_same(shapes: dict[str, Shape]) -> None:
    """Pairs at random places; those closer than a tenth of a millimetre are not counted."""
    rng = np.random.default_rng(0)
    probes = [*shapes.values(), box(0.05, 0.04, 0.06)]
    hits = counted = 0
    with Bullet() as world:
        for shape in shapes.values():
            for _ in range(40):
                other = probes[int(rng.integers(len(probes)))]
                here, there = turned(rng), turned(rng)
                first, second = world.add(shape, here), world.add(other, there)
                distance = min(entry[1] for entry in world.closest(first, second, 1.0))
                if abs(distance) < 1e-4:
                    continue
                assert collide(shape, here, other, there) == (distance < 0), distance
                hits, counted = hits + (distance < 0), counted + 1
    assert counted > 200 and 40 < hits < 0.9 * counted


def test_pieces_are_open_where_the_mesh_is(shapes: dict[str, Shape]) -> None:
    coin = box(0.02, 0.02, 0.01)
    inside = pose(z=0.05)
    assert collide(shapes["mug"], pose(), coin, inside)
    assert not collide(shapes["hollow mug"], pose(), coin, inside)
    with Bullet() as world:
        assert not world.closest(world.add(shapes["hollow mug"], pose()), world.add(coin, inside), 0.0)
    for name in ("mug", "hollow mug"):
        solid = to_trimesh(shapes[name])
        assert solid.extents == pytest.approx(0.8 * trimesh.load_mesh(MUG).extents, abs=0.004)


def test_a_decomposition_repeats_and_is_cached(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(meshes.platformdirs, "user_cache_dir", lambda _: str(tmp_path))
    first = meshes._pieces(MUG)
    (cached,) = (tmp_path / "pieces").iterdir()
    cached.write_bytes(cached.read_bytes()[:100])  # damaged: done again
    again = meshes._pieces(MUG)
    monkeypatch.setattr(bullet, "decompose", None)  # from now on the cache has it
    stored = meshes._pieces(MUG)
    assert len(first) == len(again) == len(stored) > 3
    for a, b, c in zip(first, again, stored, strict=True):
        assert a.tobytes() == b.tobytes() == c.tobytes()


def test_hulls_are_values() -> None:
    points = np.random.default_rng(0).uniform(0, 0.1, (30, 3))
    part = hull(points)
    assert part == hull(points) == pickle.loads(pickle.dumps(part)) and hash(part) == hash(hull(points))
    assert part != hull(points * 1.1)
    assert part.bounds == pytest.approx(np.array([points.min(axis=0), points.max(axis=0)]))
    with pytest.raises(ValueError, match="plane"):
        hull(points * [1, 1, 0])
    with pytest.raises(ValueError, match="nothing else"):
        Part("hull", (0.1, 0.1, 0.1), (0, 0, 0))


# ---- standing


def test_they_stand_stably_on_a_face(shapes: dict[str, Shape]) -> None:
    """The centre of mass of the solid is over what touches the table, and the frame is below it."""
    for name, shape in shapes.items():
        solid = to_trimesh(shape)
        assert solid.bounds[0][2] == pytest.approx(0.0, abs=1e-9), name
        assert hits_table(shape, pose(z=-1e-4)) and not hits_table(shape, pose(z=1e-4))
        touching = np.asarray(solid.vertices)[solid.vertices[:, 2] < 2e-4, :2]
        assert Delaunay(touching).find_simplex((0.0, 0.0)) >= 0, name
        pieces = [trimesh.convex.convex_hull(part.hull.vertices + part.xyz) for part in shape.parts if part.hull]
        centre = np.average([p.center_mass for p in pieces], axis=0, weights=[p.volume for p in pieces])
        assert centre[:2] == pytest.approx([0.0, 0.0], abs=1e-6), name
        with Replay(make_robot("gripper")) as replay:
            assert replay.add("thing", shape, pose(0.4, 0.1, GAP, 0.7), TABLE) == []


def test_only_flat_tops_carry(shapes: dict[str, Shape], tmp_path: Path) -> None:
    assert shapes["mug"].carries and shapes["brick"].carries and box(0.1, 0.1, 0.1).carries
    assert not shapes["duck"].carries and not shapes["hollow mug"].carries
    with Replay(make_robot("gripper")) as replay:
        replay.add("brick", shapes["brick"], pose(0.4, 0.0, GAP))
        replay.add("duck", shapes["duck"], pose(0.4, 0.3, GAP))
        for below in ("brick", "duck"):
            height = shapes[below].height + 2 * GAP
            where = replay.pose(below)[:2, 3]
            faults = replay.add(f"on {below}", box(0.02, 0.02, 0.02), pose(*where, height), below)
            assert bool(faults) == (below == "duck")


@pytest.mark.parametrize(("option", "stacked"), [(0, False), (2, True)])
def test_towers_are_built_of_what_carries(tmp_path: Path, option: int, stacked: bool) -> None:
    """Ducks never stand on each other, bricks do."""
    text = EXAMPLE.read_text().replace("{scatter: {on: table, gap: 0.03}}", "{towers: {on: table}}")
    for index, line in enumerate([line for line in text.splitlines() if "- {mesh" in line]):
        text = text if index == option else text.replace(line + "\n", "")
    path = tmp_path / "towers.yaml"
    path.write_text(text)
    worlds = [Task.load(path).instance(6, seed, robot="gripper").world for seed in range(3)]
    on_toys = [p.base for world in worlds for name, p in world.start.items() if name.startswith("toy") and p.base]
    assert bool(on_toys) == stacked


# ---- grasps


@pytest.mark.parametrize("name", ["gripper", "panda"])
def test_grasps_close_on_the_mesh_and_the_hand_is_clear_of_it(name: str, shapes: dict[str, Shape]) -> None:
    """PyBullet finds no overlap on the way there, and both fingers beside the thing at the end."""
    robot = make_robot(name)
    at = pose(0.45, 0.05, GAP, 0.3)
    tried = 0
    for thing, shape in shapes.items():
        for grasp in list(robot.grasps(shape, "any")):
            assert grasp.opening <= robot.opening
            way = robot.reach(at @ grasp.tool, grasp.opening, np.random.default_rng(0))
            if way is None:
                continue
            with Replay(robot) as replay:
                replay.add(thing, shape, at)
                assert replay.pick(thing, way, grasp) == [], thing
            tried += 1
    assert tried > 20
    robot.close()


def test_a_mug_is_grasped_past_its_handle(shapes: dict[str, Shape]) -> None:
    """The handle is along y: no finger there, and no palm either when coming from the side."""
    robot = make_robot("gripper")
    found = list(robot.grasps(shapes["mug"], "side"))
    assert len(found) >= 4
    assert all(abs(grasp.tool[1, 1]) < 0.95 for grasp in found)
    with Bullet() as world:
        body = world.add(shapes["mug"], pose())
        model = load_model(world, robot)
        for grasp in found:
            for tool in approach_poses(grasp.tool):
                way = np.concatenate([tool[:3, 3], bullet.quaternion(tool)])
                model.set(way, grasp.opening)
                near = [d for piece in model.pieces for _, d, _ in world.closest(piece, body, 0.0)]
                assert not near or min(near) > -0.0011  # PyBullet makes fingers 1 mm thicker
    assert not list(robot.grasps(mesh(MUG, 1.0), "side"))  # 8.2 cm are too wide
    assert inverse(found[0].tool) @ found[0].tool == pytest.approx(np.eye(4), abs=1e-9)


# ---- trays


@pytest.mark.parametrize("length", [0.07, 0.14, 0.42])
def test_a_tray_that_is_a_mesh_holds_what_it_says(length: float) -> None:
    """A slab almost as large as the floor fits between the walls, a larger one does not."""
    shape = tray_mesh(TRAY, length, 0.07)
    assert shape.interior is not None and shape.interior[:2] == (length, 0.07)
    on_it = pose(z=shape.interior[2] + GAP)
    assert not collide(shape, pose(), box(length - 0.001, 0.069, 0.01), on_it, envelope=False)
    assert collide(shape, pose(), box(length + 0.008, 0.07, 0.01), on_it, envelope=False)
    assert collide(shape, pose(), box(length, 0.078, 0.01), on_it, envelope=False)
    robot = make_robot("gripper")
    start, goal = pose(0.4, 0.0, GAP), pose(0.5, 0.1, GAP, 0.5)
    with Replay(robot) as replay:
        assert replay.add("tray", shape, start, TABLE) == []
        assert replay.add("can", box(0.05, 0.05, 0.08), start @ on_it, "tray") == []
        grasp = next(robot.grasps(shape))
        for place, act in ((start, replay.pick), (goal, replay.place)):
            way = robot.reach(place @ grasp.tool, grasp.opening, np.random.default_rng(0))
            assert way is not None and act("tray", way) == []
        assert replay.support("can") == "tray"


@pytest.mark.parametrize("robot", ["gripper", "panda"])
def test_the_policy_of_load_fills_it(load: Learned, robot: str) -> None:
    for size in ("2-4", "3-3", "4-2"):
        result = solve(Task.load(SERVE), size, 1, policy=load.policy, robot=robot)
        assert result.valid and result.planner == "guided" and result.plan is not None
        assert len(result.plan.steps) == 1 + 2 * min(map(int, size.split("-")))


def test_what_has_no_walls_is_no_tray(tmp_path: Path) -> None:
    path = tmp_path / "serve.yaml"
    path.write_text(SERVE.read_text().replace("tray/tray_textured.obj", "domino/domino.obj"))
    with pytest.raises(InputError, match=r"`domino\.obj` is no tray: it needs a floor") as caught:
        Task.load(path)
    assert caught.value.diagnostics[0].line == line_of(path, "cell: 0.075")


# ---- task files


def test_the_example_task_works_and_shows_the_meshes(tmp_path: Path) -> None:
    task = Task.load(EXAMPLE)
    result = solve(task, 2, 1, robot="gripper")
    assert result.valid and result.plan is not None
    assert Task.load(EXAMPLE).instance(4, 1, robot="panda").world.grasps["mug"]
    duck = mesh(DUCK, 0.08, (0, 1, 0))
    plain = Shape(duck.parts, duck.rgba)
    pictures = []
    for shape in (duck, plain):
        with Scene(make_robot("gripper")) as scene:
            scene.add("duck", shape, pose(0.5, 0.0, GAP))
            pictures.append(np.array(scene.picture(MOVIE, samples=1)).astype(int))
    blue = [((p[:, :, 2] - p[:, :, 0]) > 60).sum() for p in pictures]
    assert blue[0] > 300 and blue[0] < 0.98 * blue[1]  # the beak and the neck are thinner than the hull


def write(folder: Path, old: str, new: str) -> Path:
    text = EXAMPLE.read_text()
    assert old in text
    path = folder / "toys.yaml"
    path.write_text(text.replace(old, new, 1))
    return path


def line_of(path: Path, words: str) -> int:
    return next(number for number, line in enumerate(path.read_text().splitlines(), 1) if words in line)


@pytest.mark.parametrize(
    ("content", "words"),
    [
        (None, "no mesh `thing.obj`: give a file beside the task file"),
        ("", "empty|cannot read"),
        ("v 0 0 0\nv 1 0 0\nv 0 1 0\n", "empty|cannot read"),
        ("v 0 0 0\nv 1 0 0\nv 0 1 0\nv 1 1 0\nf 1 2 3\nf 2 3 4\n", "flat: give one with volume"),
        ("v 0 0 0\nv 1 0\nf 1 2 9\n", "cannot read the mesh|empty|flat"),
        (
            "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 9 9 9\nf 1 2 3\nf 1 2 4\nf 2 3 4\nf 1 3 4\n",
            "does not stand with .* choose `up`",
        ),
    ],
)
def test_unusable_files_are_named(tmp_path: Path, content: str | None, words: str) -> None:
    if content is not None:
        (tmp_path / "thing.obj").write_text(content)
    path = write(tmp_path, "pybullet_data/lego/lego.obj, scale: 0.15, up: [0, 1, 0]", "thing.obj")
    with pytest.raises(InputError, match=words) as caught:
        Task.load(path)
    (diagnostic,) = caught.value.diagnostics
    assert diagnostic.path == path and diagnostic.line == line_of(path, "thing.obj")


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ("up: [0, 1, 0]", "up: [0, 0, 0]", "does not stand with .* choose"),
        ("up: [0, 1, 0]", "up: [0, 1]", "Field required"),
        ("scale: [0.032, 0.036]", "scale: [0.0000001, 0.036]", "make them larger"),
        ("scale: [0.032, 0.036]", "scale: -1", "greater than 0"),
        ("collision: pieces", "collision: boxes", "'hull' or 'pieces'"),
    ],
)
def test_mistakes_in_a_mesh_are_named(tmp_path: Path, old: str, new: str, words: str) -> None:
    with pytest.raises(InputError, match=words) as caught:
        Task.load(write(tmp_path, old, new))
    assert all(diagnostic.line for diagnostic in caught.value.diagnostics)


def test_other_formats_and_packages_are_refused(tmp_path: Path) -> None:
    (tmp_path / "thing.ply").write_text("ply")
    with pytest.raises(ValueError, match=r"neither an \.obj nor an \.stl"):
        find_mesh("thing.ply", tmp_path)
    for name in ("no_such_package/thing.obj", "os.path/thing.obj", "pybullet_data/none.obj", "pybullet_data"):
        with pytest.raises(ValueError, match="no mesh"):
            find_mesh(name, tmp_path)


def test_an_open_mesh_beside_the_task_file_is_used_by_its_hull(tmp_path: Path) -> None:
    solid = trimesh.creation.box((0.05, 0.05, 0.05))
    solid.update_faces(np.arange(len(solid.faces)) > 1)  # without two of its triangles
    assert not solid.is_watertight
    solid.export(tmp_path / "open.stl")
    path = write(tmp_path, "pybullet_data/lego/lego.obj, scale: 0.15, up: [0, 1, 0]", "open.stl")
    task = Task.load(path)
    (shape,) = (option.mesh.shape(1.0) for option in task.scene.things[0].shapes if option.mesh.file.name == "open.stl")
    assert len(shape.parts) == 1 and shape.extent == pytest.approx((0.05, 0.05, 0.05))


def test_what_is_too_wide_for_the_gripper_is_named_with_its_line(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    path = write(tmp_path, "objects/mug.obj, scale: 0.7", "objects/mug.obj, scale: 1.6")
    with pytest.raises(InputError, match=r"`mug`.*cannot be grasped from the top.*opens to 0\.080 m") as caught:
        Task.load(path).instance(2, 0, robot="panda")
    (diagnostic,) = caught.value.diagnostics
    assert diagnostic.line == line_of(path, "scale: 1.6") and "scale" in str(diagnostic.hint)
    monkeypatch.setattr(sys, "argv", ["gentamp-lp", "solve", str(path), "--size", "2", "--mode", "unguided"])
    with pytest.raises(SystemExit) as ended:
        main()
    assert ended.value.code == 2
    assert f"toys.yaml:{line_of(path, 'scale: 1.6')}" in capsys.readouterr().err


def test_an_exact_tray_is_not_promised_for_meshes(tmp_path: Path) -> None:
    text = EXAMPLE.read_text().replace(
        "    - name: mug\n",
        "    - name: tray\n      shapes: [{tray: {cells: 2, cell: 0.10, exact: true}}]\n"
        "      start: {at: {on: table, x: 0.45, y: 0.3}}\n      goes: []\n    - name: mug\n",
    )
    path = tmp_path / "toys.yaml"
    path.write_text(text.replace("goes: &goes [table, corner]", "goes: &goes [table, corner, tray]"))
    with pytest.raises(NoAnswer, match="not proved"):
        Task.load(path).instance(1, 0, robot="gripper")


def test_the_cache_of_demonstrations_knows_the_files() -> None:
    assert [path.name for path in Task.load(EXAMPLE).scene.files][-1] == "mug.obj"
    assert math.isclose(mesh(MUG, 0.5).height, mesh(MUG, 1.0).height / 2)
