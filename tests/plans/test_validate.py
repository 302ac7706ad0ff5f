"""Plan files that say something untrue are rejected, whatever part of them is touched."""

import copy
import json
import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from gentamp_lp.errors import InputError
from gentamp_lp.planning.solve import solve
from gentamp_lp.plans.plan import Plan
from gentamp_lp.plans.validate import validate
from gentamp_lp.tasks.task import Task

Data = dict[str, Any]


@pytest.fixture(scope="module")
def files(unstack, load, tmp_path_factory) -> dict[str, Data]:
    """Good plans as the JSON of their files."""
    found = {}
    for name, learned, size, robot in (
        ("arm", unstack, 6, "panda"),
        ("hand", unstack, 6, "gripper"),
        ("tray", load, "2-4", "gripper"),
    ):
        result = solve(learned.task, size, 1, policy=learned.policy, robot=robot)
        assert result.valid and result.plan is not None and result.plan.steps
        path = tmp_path_factory.mktemp("plans") / f"{name}.json"
        result.plan.save(path)
        assert Plan.load(path) == result.plan
        found[name] = json.loads(path.read_text())
    return found


@pytest.fixture(params=["arm", "hand", "tray"])
def data(files: dict[str, Data], request) -> Data:
    return copy.deepcopy(files[request.param])


def check(data: Data, folder: Path) -> list[str]:
    path = folder / "plan.json"
    path.write_text(json.dumps(data))
    plan = Plan.load(path)
    return validate(plan, Task.load(plan.task))


def step(data: Data, action: str, which: int = 0) -> dict[str, Any]:
    return [s for s in data["steps"] if s["action"] == action][which]


def entity(data: Data, sort: str, action: str = "place", which: int = 0) -> dict[str, Any]:
    """The entity of a sort that the chosen step uses."""
    names = step(data, action, which)["args"]
    return next(data["entities"][n] for n in names if data["entities"].get(n, {}).get("sort") == sort)


def shift(data: Data, x: float, y: float, z: float) -> None:
    """Move the first placement and the reach to it (a hand without joints can follow)."""
    moved = entity(data, "placement")
    for axis, delta in enumerate((x, y, z)):
        moved["transform"][axis][3] += delta


def follow(data: Data, x: float, y: float, z: float) -> None:
    shift(data, x, y, z)
    for row in entity(data, "reach")["configurations"]:
        row[0], row[1], row[2] = row[0] + x, row[1] + y, row[2] + z


def test_a_good_plan_is_valid(data: Data, tmp_path: Path) -> None:
    assert check(data, tmp_path) == []


# ---- Mutations of any plan, and what is said about them


def drop_first(data: Data) -> None:
    del data["steps"][0]


def drop_last(data: Data) -> None:
    del data["steps"][-1]


def swap(data: Data) -> None:
    data["steps"][:2] = data["steps"][1::-1]


def nothing(data: Data) -> None:
    data["steps"], data["entities"], data["facts"] = [], {}, []


def sink(data: Data) -> None:
    shift(data, 0, 0, -0.03)


def lift(data: Data) -> None:
    shift(data, 0, 0, 0.03)


def aside(data: Data) -> None:
    shift(data, 0.03, 0, 0)


def bend(data: Data) -> None:
    entity(data, "reach")["configurations"][-1][0] += 0.05


def bend_on_the_way(data: Data) -> None:
    entity(data, "reach")["configurations"][2][0] += 0.4


def bend_beyond_limits(data: Data) -> None:
    for row in entity(data, "reach")["configurations"]:
        row[-1] += 7.0


def change_grasp(data: Data) -> None:
    entity(data, "grasp", "pick")["tool"][0][3] += 0.01


def change_opening(data: Data) -> None:
    entity(data, "reach", "pick")["opening"] += 0.01


def open_while_carrying(data: Data) -> None:
    entity(data, "reach", "place")["opening"] = 0.08


def short_approach(data: Data) -> None:
    reach = entity(data, "reach")
    reach["configurations"] = reach["configurations"][-2:]


def other_grasp_in_step(data: Data) -> None:
    own = step(data, "place")["args"]
    own[4] = next(n for n, v in data["entities"].items() if v["sort"] == "grasp" and n != own[4])


def other_reach_in_step(data: Data) -> None:
    own = step(data, "place")["args"]
    own[6] = next(n for n, v in data["entities"].items() if v["sort"] == "reach" and n != own[6])


def other_placement_of_reach(data: Data) -> None:
    reach, own = entity(data, "reach"), step(data, "place")["args"]
    name = own[0]
    reach["placement"] = f"at_{name}"


def other_support(data: Data) -> None:
    own = step(data, "place")["args"]
    own[2] = next(s for s in ("block1", "table", "tray") if s not in (own[0], own[2]) and _known(data, s))


def claim_other_support(data: Data) -> None:
    own = step(data, "place")["args"]
    other = next(s for s in ("block1", "table", "tray") if s not in (own[0], own[2]) and _known(data, s))
    data["facts"].append(["pose", own[0], own[1], other])


def _known(data: Data, name: str) -> bool:
    return {"block1": data["task"] == "unstack", "tray": data["task"] == "load"}.get(name, True)


def unknown_entity(data: Data) -> None:
    step(data, "place")["args"][6] = "t999"


def unknown_action(data: Data) -> None:
    data["steps"][0]["action"] = "teleport"


def wrong_arity(data: Data) -> None:
    data["steps"][0]["args"].pop()


def wrong_seed(data: Data) -> None:
    data["seed"] += 1


def spare_entity(data: Data) -> None:
    data["entities"]["w999"] = copy.deepcopy(entity(data, "placement"))


@pytest.mark.parametrize(
    ("mutate", "message"),
    [
        (drop_first, "no step uses|not applicable"),
        (drop_last, "no step uses|goal does not hold"),
        (nothing, "goal does not hold"),
        (swap, "step 1: .* is not applicable"),
        (sink, "inside|rest on|off|not applicable"),
        (lift, "off|does not rest"),
        (aside, "off|inside|not applicable|not on"),
        (bend, "off|inside|jumps"),
        (bend_on_the_way, "jumps|inside"),
        (bend_beyond_limits, "limits|quaternion"),
        (change_grasp, "off|within"),
        (change_opening, "fingers are not as far apart"),
        (open_while_carrying, "fingers are not as far apart"),
        (short_approach, "approach is shorter"),
        (other_grasp_in_step, "not applicable|no step uses"),
        (other_reach_in_step, "not applicable|no step uses"),
        (other_placement_of_reach, "another object, placement, grasp or base"),
        (other_support, "not applicable"),
        (claim_other_support, "from two calls|what the plan says|no stream certifies"),
        (unknown_entity, "unknown entity t999|no step uses"),
        (unknown_action, "no action teleport"),
        (wrong_arity, "no action pick with 6 arguments|no step uses"),
        (wrong_seed, "."),
        (spare_entity, "no call of a stream gives|no step uses"),
    ],
    ids=lambda value: getattr(value, "__name__", ""),
)
def test_mutations_are_rejected(data: Data, tmp_path: Path, mutate: Callable[[Data], None], message: str) -> None:
    mutate(data)
    problems = check(data, tmp_path)
    assert problems
    assert any(_finds(message, p) for p in problems), problems


def _finds(message: str, text: str) -> bool:
    return re.search(message, text) is not None


# ---- Geometry, with a reach that follows the moved placement


def test_a_placement_that_floats_is_seen_in_the_replay(files: dict[str, Data], tmp_path: Path) -> None:
    data = copy.deepcopy(files["hand"])
    follow(data, 0, 0, 0.03)
    assert any("does not rest on table" in p for p in check(data, tmp_path))


def test_a_placement_on_another_block_is_no_placement_on_the_table(files: dict[str, Data], tmp_path: Path) -> None:
    """The hand puts the block where another one stands."""
    data = copy.deepcopy(files["hand"])
    own = step(data, "place")["args"][0]
    instance = Task.load("unstack").instance(data["size"], data["seed"], robot="gripper")
    placement = entity(data, "placement")
    here = np.array(placement["transform"])
    other = next(p for n, p in instance.world.start.items() if n != own and p.transform[2, 3] < 0.01)
    follow(data, *(other.transform[:3, 3] - here[:3, 3]))
    assert any("not applicable" in p for p in check(data, tmp_path))
    follow(data, 0, 0, instance.world.shapes[own].height + 0.001)  # on top of it
    assert any("not applicable" in p or "does not rest on table" in p for p in check(data, tmp_path))


def test_a_placement_outside_the_support_is_seen(files: dict[str, Data], tmp_path: Path) -> None:
    data = copy.deepcopy(files["hand"])
    x = entity(data, "placement")["transform"][0][3]
    follow(data, 0.66 - x, 0, 0)
    assert any("is not on table" in p for p in check(data, tmp_path))


def test_a_path_through_a_block_is_seen_even_between_its_configurations(files: dict[str, Data], tmp_path: Path) -> None:
    """A hop over 5 cm would pass the replay's check of single configurations."""
    data = copy.deepcopy(files["hand"])
    instance = Task.load("unstack").instance(data["size"], data["seed"], robot="gripper")
    placed = data["steps"][-1]
    assert placed["action"] == "place"
    reach = data["entities"][placed["args"][6]]
    final = np.array(reach["configurations"][-1])
    others = [p.transform[:3, 3] for n, p in instance.world.start.items() if not _moves(data, n)]
    other = min(others, key=lambda p: float(np.linalg.norm(p[:2] - final[:2])))
    # come in low: from beyond the other block, along the table, through it
    away = (other - final[:3])[:2]
    away /= np.linalg.norm(away)
    length = np.linalg.norm((other - final[:3])[:2]) + 0.12
    path = [final]
    while np.linalg.norm(path[-1][:2] - final[:2]) < length:
        path.append(path[-1] + [*(0.049 * away), 0, 0, 0, 0, 0])
    reach["configurations"] = [row.tolist() for row in reversed(path)]
    problems = check(data, tmp_path)
    assert any("inside" in p or "not applicable" in p for p in problems), problems


def _moves(data: Data, name: str) -> bool:
    return any(s["args"][0] == name for s in data["steps"])


def test_the_arm_may_not_jump_while_its_tool_stays(files: dict[str, Data]) -> None:
    """Between two configurations with the same tool pose, the replay looks at the way."""
    code = Task.load("unstack").folder.code
    data = files["arm"]
    instance = Task.load("unstack").instance(data["size"], data["seed"], robot="panda")
    rows = np.array(entity(data, "reach")["configurations"])
    plans = __import__(code.module.__name__ + ".plans", fromlist=["plans"])
    far = rows[0] + 0.5
    dense = plans._dense(instance.world, plans.Trajectory(np.array([rows[0], far]), 0.05)).configurations
    assert np.abs(np.diff(dense, axis=0)).max() <= 0.1 + 1e-9
    assert np.array_equal(dense[[0, -1]], [rows[0], far])


# ---- What a plan may claim


@pytest.mark.parametrize(
    ("fact", "message"),
    [
        (["fixed", "table", "{w}"], "may not state `fixed`"),
        (["stackable", "block1", "{w}"], "may not state `stackable`"),
        (["cfree", "block1", "{w}", "block2", "at_block2"], "may not state `cfree`"),
        (["reachcfree", "{t}", "block2", "at_block2"], "may not state `reachcfree`"),
        (["atpose", "block1", "{w}"], "may not state `atpose`"),
        (["on", "block1", "table"], "may not state `on`"),
        (["pose", "block1", "at_block1", "table"], "not about an entity of the plan"),
        (["pose", "block1", "{w}"], "wrong number of arguments"),
        (["pose", "block1", "{w}", "shelf"], "unknown entity shelf"),
        ([], "may not state"),
    ],
)
def test_forbidden_facts(files: dict[str, Data], tmp_path: Path, fact: list[str], message: str) -> None:
    data = copy.deepcopy(files["hand"])
    _, w, _, _, _, _, t = step(data, "place")["args"]
    data["facts"].append([a.format(w=w, t=t) for a in fact])
    with pytest.raises(InputError, match=message):
        check(data, tmp_path)


def test_one_placement_cannot_be_on_table_and_tray(files: dict[str, Data], tmp_path: Path) -> None:
    """Else `On` would hold of both, and things put on the table would count as loaded."""
    data = copy.deepcopy(files["tray"])
    own = next(s["args"] for s in data["steps"] if s["action"] == "place")
    data["facts"].append(["pose", own[0], own[1], "table"])
    assert any("two calls" in p for p in check(data, tmp_path))


def test_a_table_placement_cannot_be_called_a_tray_placement(files: dict[str, Data], tmp_path: Path) -> None:
    data = copy.deepcopy(files["tray"])
    entity(data, "placement").update(frame="world")
    assert any("not relative to tray" in p for p in check(data, tmp_path))


def test_streams_conditions_bind_the_claims(files: dict[str, Data], tmp_path: Path) -> None:
    """Blocks are not stackable on blocks here, so no stream certifies such a placement."""
    data = copy.deepcopy(files["hand"])
    own = step(data, "place")["args"]
    other = next(f"block{i}" for i in range(1, 7) if f"block{i}" != own[0])
    for fact in data["facts"]:
        if fact[0] == "pose" and fact[2] == own[1]:
            fact[3] = other
    own[2] = other
    assert any("no call of a stream gives" in p for p in check(data, tmp_path))


def test_values_of_the_wrong_sort_are_reported(files: dict[str, Data], tmp_path: Path) -> None:
    data = copy.deepcopy(files["hand"])
    own = step(data, "place")["args"]
    data["entities"][own[1]] = copy.deepcopy(data["entities"][own[4]])
    with pytest.raises(InputError, match="cannot be read"):  # the reach refers to it
        check(data, tmp_path)
    data = copy.deepcopy(files["hand"])
    data["entities"][own[6]] = copy.deepcopy(data["entities"][own[4]])
    assert any("not of the right sort" in p for p in check(data, tmp_path))


# ---- Values that are no values


def nan_pose(data: Data) -> None:
    entity(data, "placement")["transform"][0][3] = float("nan")


def scaled_pose(data: Data) -> None:
    entity(data, "placement")["transform"][0][0] *= 2


def mirrored_pose(data: Data) -> None:
    for row in entity(data, "placement")["transform"][:3]:
        row[1] = -row[1]


def huge_pose(data: Data) -> None:
    entity(data, "placement")["transform"][0][3] = 10**400


def nan_joint(data: Data) -> None:
    entity(data, "reach")["configurations"][1][0] = float("nan")


def huge_joint(data: Data) -> None:
    """Not too much for a float, but for the arithmetic of collision checkers (FCL crashed on it)."""
    for row in entity(data, "reach")["configurations"]:
        row[0] = 1e308


def missing_joint(data: Data) -> None:
    for row in entity(data, "reach")["configurations"]:
        row.pop()


def ragged(data: Data) -> None:
    entity(data, "reach")["configurations"][0].pop()


def no_configurations(data: Data) -> None:
    entity(data, "reach")["configurations"] = []


def negative_opening(data: Data) -> None:
    entity(data, "grasp")["opening"] = -0.01


def nan_opening(data: Data) -> None:
    entity(data, "reach")["opening"] = float("nan")


def frame_that_is_no_tray(data: Data) -> None:
    entity(data, "placement")["frame"] = "block1"


def unknown_sort(data: Data) -> None:
    entity(data, "placement")["sort"] = "wish"


def no_record(data: Data) -> None:
    data["entities"][step(data, "place")["args"][1]] = 3


def later_reference(data: Data) -> None:
    data["entities"] = dict(reversed(data["entities"].items()))


def reach_of_things_that_are_none(data: Data) -> None:
    entity(data, "reach")["grasp"] = "block1"


def reach_of_unknown_object(data: Data) -> None:
    entity(data, "reach")["object"] = "ghost"


def existing_name(data: Data) -> None:
    data["entities"]["block1"] = copy.deepcopy(entity(data, "placement"))


def variable_as_name(data: Data) -> None:
    data["entities"]["?o"] = copy.deepcopy(entity(data, "placement"))


@pytest.mark.parametrize(
    "mutate",
    [
        nan_pose, scaled_pose, mirrored_pose, huge_pose, nan_joint, huge_joint, missing_joint, ragged,
        no_configurations, negative_opening, nan_opening, frame_that_is_no_tray, unknown_sort, no_record,
        later_reference, reach_of_things_that_are_none, reach_of_unknown_object, existing_name, variable_as_name,
    ],
    ids=lambda value: value.__name__,
)  # fmt: skip
def test_unreadable_values_are_named(files: dict[str, Data], tmp_path: Path, mutate: Callable[[Data], None]) -> None:
    data = copy.deepcopy(files["hand"])
    mutate(data)
    with pytest.raises(InputError, match=r"entity|name"):
        check(data, tmp_path)


# ---- Files that are no plans


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"seed": -1}, "not a plan file"),
        ({"seed": "one"}, "not a plan file"),
        ({"seed": 1.5}, "not a plan file"),
        ({"seed": True}, "not a plan file"),
        ({"steps": None}, "not a plan file"),
        ({"steps": [["pick"]]}, "not a plan file"),
        ({"facts": 3}, "not a plan file"),
        ({"entities": [1]}, "not a plan file"),
        ({"format": "gentamp-lp plan 99"}, "unknown format"),
        ({"size": "many"}, "is not a size"),
        ({"robot": "octopus"}, "unknown robot"),
        ({"task": "knitting"}, "no such task"),
    ],
)
def test_bad_headers(files: dict[str, Data], tmp_path: Path, change: Data, message: str) -> None:
    with pytest.raises(InputError, match=message):
        check({**files["hand"], **change}, tmp_path)


@pytest.mark.parametrize("key", ["format", "task", "size", "seed", "robot", "steps", "entities", "facts"])
def test_missing_keys(files: dict[str, Data], tmp_path: Path, key: str) -> None:
    with pytest.raises(InputError, match=f"not a plan file: KeyError\\('{key}'\\)"):
        check({k: v for k, v in files["hand"].items() if k != key}, tmp_path)


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (b"", "not valid JSON"),
        (b"steps: []", "not valid JSON"),
        (b"[]", "not a plan file"),
        (b'"plan"', "not a plan file"),
        (b"{}", "not a plan file"),
        (b"\xff\xfe\x00", "cannot read the file: .utf-8. codec"),
    ],
)
def test_other_files(tmp_path: Path, content: bytes, message: str) -> None:
    path = tmp_path / "plan.json"
    path.write_bytes(content)
    with pytest.raises(InputError, match=message):
        Plan.load(path)


def test_missing_file(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="no such file"):
        Plan.load(tmp_path / "none.json")


def test_saving_leaves_nothing_half_done(files: dict[str, Data], tmp_path: Path) -> None:
    path = tmp_path / "deep" / "plan.json"
    (tmp_path / "first.json").write_text(json.dumps(files["hand"]))
    plan = Plan.load(tmp_path / "first.json")
    plan.save(path)
    plan.save(path)
    assert [p.name for p in path.parent.iterdir()] == ["plan.json"]
    (tmp_path / "file").write_text("")
    with pytest.raises(InputError, match="cannot write"):
        plan.save(tmp_path / "file" / "plan.json")
