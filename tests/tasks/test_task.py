"""Task files: instances that repeat, and mistakes that are located."""

import numpy as np
import pytest

from gentamp_lp.base.shipped import resource
from gentamp_lp.errors import InputError, NoAnswer
from gentamp_lp.geometry.collision import collide
from gentamp_lp.tasks.task import Task, shipped_tasks

UNSTACK = resource("tasks", "unstack.yaml").read_text()
LOAD = resource("tasks", "load.yaml").read_text()


@pytest.mark.parametrize("name", shipped_tasks())
def test_shipped_tasks_make_instances(name):
    task = Task.load(name)
    for size in (*task.file.train, *task.file.test[:2]):
        instance = task.instance(size, 3)
        start = instance.world.start
        shapes = instance.world.shapes
        names = sorted(start)
        assert names == sorted(shapes)
        for i, first in enumerate(names):
            for second in names[:i]:
                assert not collide(shapes[first], start[first].transform, shapes[second], start[second].transform)


def test_an_instance_repeats_and_seeds_differ():
    def poses(seed):
        world = Task.load("unstack").instance(6, seed).world
        return {name: placement.transform.tobytes() for name, placement in world.start.items()}

    assert poses(1) == poses(1)
    assert poses(1) != poses(2)


def test_towers_stand_as_said():
    instance = Task.load("unstack").instance(12, 0)
    supports = {fact[1]: fact[3] for fact in instance.world.static if fact[0] == "pose"}
    assert set(supports) == {f"block{i}" for i in range(1, 13)}
    assert len({s for s in supports.values() if s != "table"}) == len([s for s in supports.values() if s != "table"])
    for name, below in supports.items():
        z = instance.world.start[name].transform[2, 3]
        floor = 0.0 if below == "table" else instance.world.start[below].transform[2, 3] + 0.05
        assert z == pytest.approx(floor + 0.001)


def test_sizes():
    task = Task.load("load")
    rng = np.random.default_rng(0)
    assert task.parameters("2-4", rng) == {"capacity": 2, "things": 4}
    drawn = {task.parameters(5, np.random.default_rng(seed))["capacity"] for seed in range(50)}
    assert drawn == {1, 2, 3, 4, 5, 6}
    for bad in ("0", "x", "1-2-3", "-1", "2.5", ""):
        with pytest.raises(InputError, match="not a size"):
            task.parameters(bad, rng)


def test_policies_are_tried_one_step_above_training(tmp_path):
    assert Task.load("unstack").validation_sizes == ["9"]
    assert Task.load("load").validation_sizes == ["4-4", "3-5"]
    path = tmp_path / "unstack.yaml"
    path.write_text(UNSTACK.replace("train: [8]", "train: [8]\nvalidation: [4, 10]"))
    assert Task.load(path).validation_sizes == ["4", "10"]
    path.write_text(UNSTACK.replace("train: [8]", "train: [8]\nvalidation: []"))
    assert Task.load(path).validation_sizes == []


def test_an_impossible_scene_is_refused_with_the_reason():
    with pytest.raises(NoAnswer, match="no free reachable place"):
        Task.load("load").instance("1-60", 0, robot="panda")


@pytest.mark.parametrize(
    ("text", "old", "new", "line_of", "words"),
    [
        (UNSTACK, "robot: panda", "robots: panda", "robots:", "Extra inputs"),
        (UNSTACK, "train: [8]", "train: [eight]", "train:", "not a size"),
        (UNSTACK, "train: [8]", "train: [8]\nvalidation: [9, 9-9]", "validation:", "not a size"),
        (UNSTACK, "max_height: 8", "max_height: tall", "start:", "valid integer"),
        (UNSTACK, "goes: [table]", "goes: [shelf]", "scene:", "neither a support nor a thing"),
        (UNSTACK, "(Table ?s)", "(Tabel ?s)", "goal:", "unknown predicate `Tabel`"),
        (UNSTACK, "sample-grasp: 2", "sample-grip: 2", "samples:", "unknown stream"),
        (UNSTACK, "domain: tabletop", "domain: cellar", None, "no domain `cellar`"),
        (UNSTACK, "size: [blocks]", "size: [blocks", None, "not valid YAML"),
        (LOAD, "(Holding ?r)))", "(Holding ?x)))", "(and (exists", "variable `?x` is not declared"),
    ],
)
def test_mistakes_are_located(tmp_path, text, old, new, line_of, words):
    changed = text.replace(old, new, 1)
    assert changed != text
    path = tmp_path / "task.yaml"
    path.write_text(changed)
    with pytest.raises(InputError) as caught:
        Task.load(path)
    (diagnostic,) = [d for d in caught.value.diagnostics if words in d.message]
    if line_of:
        rows = changed.splitlines()
        expected = next(n for n, row in enumerate(rows, 1) if row.lstrip().startswith(line_of.strip()))
        assert diagnostic.line == expected
        assert str(diagnostic).startswith(f"{path}:{diagnostic.line}: error:")


def test_a_missing_task_names_the_shipped_ones():
    with pytest.raises(InputError, match="clutter, load, sort, transport, transport-paper, unstack"):
        Task.load("unstak")


def test_foreign_samplers_need_trust(tmp_path):
    domain = tmp_path / "mine"
    domain.mkdir()
    for name in ("domain.pddl", "stream.pddl"):
        (domain / name).write_text(resource("domains", "tabletop", name).read_text())
    (domain / "__init__.py").write_text("raise RuntimeError('ran')\n")
    path = tmp_path / "task.yaml"
    path.write_text(UNSTACK.replace("domain: tabletop", "domain: mine"))
    with pytest.raises(InputError, match="--trust"):
        Task.load(path)
    with pytest.raises(InputError, match="fails to load"):
        Task.load(path, trust=True)


def test_streams_and_samplers_must_agree(tmp_path):
    folder = tmp_path / "other"
    folder.mkdir()
    stream = resource("domains", "tabletop", "stream.pddl").read_text()
    (folder / "domain.pddl").write_text(resource("domains", "tabletop", "domain.pddl").read_text())
    (folder / "stream.pddl").write_text(stream.replace("test-cfree", "test-free"))
    (folder / "__init__.py").write_text("from gentamp_domain_tabletop import *\n")
    path = tmp_path / "task.yaml"
    path.write_text(UNSTACK.replace("domain: tabletop", "domain: other"))
    Task.load("unstack")
    with pytest.raises(InputError) as caught:
        Task.load(path, trust=True).instance(2, 0)
    messages = [d.message for d in caught.value.diagnostics]
    assert messages == ["stream `test-free` has no Python sampler", "sampler `test-cfree` is not declared"]
    assert caught.value.diagnostics[0].line


@pytest.mark.parametrize(
    ("task", "size", "stretch"), [("unstack", "64", 2.0), ("sort", "32-32", 2.0), ("sort", "4-4", 1)]
)
def test_a_robot_that_flies_gets_a_larger_table_for_more_things(task, size, stretch):
    loaded = Task.load(task)
    flying = loaded.instance(size, 0, robot="gripper").world.supports
    for name, support in loaded.scene.supports.items():
        assert np.allclose(
            [flying[name].area.x, flying[name].area.y], np.array([support.area.x, support.area.y]) * stretch
        )
    assert (
        loaded.instance("2" if task == "unstack" else "2-2", 0, robot="panda").world.supports == loaded.scene.supports
    )


def test_places_and_parts_of_a_table_stretch_with_it():
    """The tray, and the part of the table where things lie."""
    load = Task.load("load")
    small, large = (load.instance(size, 0, robot="gripper").world for size in ("8-12", "8-38"))
    stretch = (39 / 13) ** 0.5
    assert np.allclose(small.start["tray"].transform[:2, 3], [0.45, -0.25])
    assert np.allclose(large.start["tray"].transform[:2, 3], np.array([0.45, -0.25]) * stretch)
    for name, placement in large.start.items():
        assert name == "tray" or (placement.transform[:2, 3] >= np.array([0.28, 0.08]) * stretch).all()


def test_a_flying_hand_on_a_platform_reaches_farther_in_a_larger_room():
    """Else it could not reach the far side of its tables."""
    transport = Task.load("transport")
    small, large = (transport.instance(size, 0).world for size in ("2-16", "2-67"))
    assert large.robot.arm.furthest == pytest.approx(2 * small.robot.arm.furthest)
    assert large.robot.name == small.robot.name
    assert np.allclose(large.supports["source"].area.x, np.array(small.supports["source"].area.x) * 2)
