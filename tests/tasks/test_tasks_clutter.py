"""Clutter: as many things as said are in the way, and the policy moves those and no others."""

import json

import pytest

from gentamp_lp.base.shipped import resource
from gentamp_lp.errors import InputError, NoAnswer
from gentamp_lp.learning.learn import Learned, learn
from gentamp_lp.planning.solve import solve
from gentamp_lp.plans.plan import Plan
from gentamp_lp.plans.validate import validate
from gentamp_lp.tasks.task import Instance, Task

TEXT = resource("tasks", "clutter.yaml").read_text()
ROBOTS = ("gripper", "panda")


@pytest.fixture(scope="module")
def clutter() -> Learned:
    return learn(Task.load("clutter"), robot="gripper", cache=False)


def variant(tmp_path, *changes: tuple[str, str]) -> Task:
    text = TEXT
    for old, new in changes:
        assert old in text
        text = text.replace(old, new, 1)
    path = tmp_path / "clutter.yaml"
    path.write_text(text)
    return Task.load(path)


def ways(instance: Instance) -> list[set[str]]:
    """For each approach to the mug, found through the streams, the things in its way."""
    base = instance.base
    grasp, reach = (next(s for s in base.streams if s.name == f"sample-{name}") for name in ("grasp", "reach"))
    found = []
    while not base.exhausted(grasp, ("mug",)):
        if (outputs := base.draw(grasp, ("mug",))) is None:
            continue
        (trajectory,) = base.draw(reach, ("mug", "at_mug", "table", "at_table", *outputs, "at_base")) or ("",)
        others = [n for n in instance.world.start if n != "mug"]
        found.append({n for n in others if not base.truth("reachcfree", (trajectory, n, f"at_{n}"))})
    return found


@pytest.mark.parametrize("robot", ROBOTS)
@pytest.mark.parametrize("size", [2, 5, 8, 16])
def test_a_quarter_is_in_the_way(size: int, robot: str) -> None:
    for seed in range(3):
        instance = Task.load("clutter").instance(size, seed, robot=robot)
        (way,) = ways(instance)
        assert len(way) == size // 4
        assert instance.world.start["mug"].transform[:2, 3] == pytest.approx([0.5, 0.0])


@pytest.mark.parametrize("size", [24, 48])
def test_larger_tables_have_six_in_the_way(size: int) -> None:
    """The mug moves with the table."""
    instance = Task.load("clutter").instance(size, 1, robot="gripper")
    (way,) = ways(instance)
    assert len(way) == 6
    assert instance.world.start["mug"].transform[0, 3] == pytest.approx(0.5 * ((size + 1) / 17) ** 0.5)


def test_of_several_approaches_the_least_obstructed_counts(tmp_path) -> None:
    task = variant(tmp_path, ("approaches: 1", "approaches: 3"))
    counts = [sorted(map(len, ways(task.instance(9, seed, robot="gripper")))) for seed in range(4)]
    assert all(len(row) == 3 and row[0] == 2 for row in counts)
    assert any(row[-1] > 2 for row in counts)


def test_an_instance_repeats_and_the_mug_is_grasped_from_the_side() -> None:
    def drawn(seed: int) -> tuple[list[bytes], bytes]:
        world = Task.load("clutter").instance(8, seed, robot="gripper").world
        (grasp,) = world.grasps["mug"]
        assert grasp.tool[2, 2] > -0.25  # the hand points along the table, hardly down
        assert all(g.tool[2, 2] < -0.99 for g in world.grasps["thing1"])
        return [placement.transform.tobytes() for placement in world.start.values()], grasp.tool.tobytes()

    assert drawn(1) == drawn(1)
    assert len({drawn(seed)[1] for seed in range(8)}) > 3


def test_the_policy_speaks_of_what_is_in_the_way(clutter: Learned) -> None:
    """A count of things that stand where some approach to the mug would touch them."""
    assert clutter.solution.optimal and not clutter.notes
    texts = [feature.text for feature in clutter.policy.features]
    assert any(all(word in text for word in ("AtPose", "Reach(", "Mug", "¬∃t ReachCFree")) for text in texts)


@pytest.mark.parametrize(("robot", "size"), [("gripper", 4), ("gripper", 13), ("panda", 2), ("panda", 12)])
def test_only_what_is_in_the_way_is_moved(clutter: Learned, robot: str, size: int) -> None:
    for seed in (1, 2):
        result = solve(clutter.task, size, seed, policy=clutter.policy, robot=robot)
        assert result.valid and result.planner == "guided" and result.plan is not None
        (way,) = ways(clutter.task.instance(size, seed, robot=robot))
        steps = [(step.schema, step.args[0]) for step in result.plan.steps]
        assert sorted(steps[:-1]) == sorted((schema, name) for name in way for schema in ("pick", "place"))
        assert steps[-1] == ("pick", "mug")


def test_a_plan_that_ignores_what_is_in_the_way_is_refused(clutter: Learned, tmp_path) -> None:
    result = solve(clutter.task, 8, 1, policy=clutter.policy, robot="gripper")
    assert result.plan is not None and len(result.plan.steps) == 5
    path = tmp_path / "plan.json"
    result.plan.save(path)
    data = json.loads(path.read_text())
    data["steps"] = data["steps"][-1:]
    path.write_text(json.dumps(data))
    assert validate(Plan.load(path), clutter.task)


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ("of: mug", "of: jug", "`jug`, which is no single thing above"),
        ("of: mug", "of: thing", "`thing`, which is no single thing above"),
        ("one_in: 4", "one_in: 0", "one_in: Input should be greater than or equal to 1"),
        ("grasp: side", "grasp: below", "grasp: Input should be 'top', 'side' or 'any'"),
        ("is: [Mug, Red]", "is: [Cup, Red]", "Input should be .*'Mug'"),
    ],
)
def test_mistakes_in_the_scene_are_named(tmp_path, old: str, new: str, words: str) -> None:
    with pytest.raises(InputError, match=words):
        variant(tmp_path, (old, new))


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ("approaches: 1", "approaches: 40", "`mug` can be reached with 6 grasps, not 40"),
        ("one_in: 4, at_most: 6", "one_in: 1", "none of 2000 layouts has exactly 8 of 8 things in the way of `mug`"),
        ("scale: 0.8", "scale: 0.6", "`mug`.*cannot be grasped from the side"),
    ],
)
def test_impossible_scenes_are_refused_with_the_reason(tmp_path, old: str, new: str, words: str) -> None:
    with pytest.raises((NoAnswer, InputError), match=words):
        variant(tmp_path, (old, new)).instance(8, 0, robot="gripper")


@pytest.mark.slow
@pytest.mark.parametrize("robot", ROBOTS)
@pytest.mark.parametrize("size", Task.load("clutter").file.test)
def test_all_test_sizes(clutter: Learned, size: int, robot: str) -> None:
    for seed in (1, 2, 3):
        result = solve(clutter.task, size, seed, policy=clutter.policy, robot=robot)
        assert result.valid and result.plan is not None and len(result.plan.steps) == 2 * (size // 4) + 1
