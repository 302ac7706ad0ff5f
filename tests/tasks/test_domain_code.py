"""What a domain's Python package may leave out, and what is done then."""

import json
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from pydantic import BaseModel

from gentamp_lp.errors import InputError
from gentamp_lp.planning.solve import solve
from gentamp_lp.plans.plan import Plan
from gentamp_lp.plans.validate import validate
from gentamp_lp.tasks.domain_code import Scene, World, files_of, read_world
from gentamp_lp.tasks.json_values import from_json, to_json
from gentamp_lp.tasks.task import Task

DOMAIN = """(define (domain dials) (:requirements :strips)
 (:constants zero)
 (:predicates (dial ?d) (mark ?d ?s) (fine ?d ?s) (off ?d) (at ?d ?s) (near ?d ?e))
 (:action turn :parameters (?d ?s) :precondition (and (dial ?d) (mark ?d ?s) (fine ?d ?s) (off ?d) (near ?d zero))
  :effect (and (at ?d ?s) (not (off ?d)))))
"""
STREAM = """(define (stream dials)
 (:stream sample-mark :inputs (?d) :domain (dial ?d) :outputs (?s) :certified (mark ?d ?s))
 (:stream test-fine :inputs (?d ?s) :domain (mark ?d ?s) :certified (fine ?d ?s)))
"""
TASK = """name: dials
domain: dials
size: [dials]
scene: {}
goal: (forall (?d) (imply (dial ?d) (not (off ?d))))
train: [2]
"""
LEAST = """
from gentamp_lp.streams.language import from_fn, from_test
from gentamp_lp.tasks.domain_code import Scene, World
import numpy as np

def make_world(scene, parameters, robot, rng):
    dials = [f"d{i}" for i in range(parameters["dials"])]
    static = [("dial", d) for d in dials] + [("near", d, "zero") for d in dials]
    return World(static=static, fluents=[("off", d) for d in dials])

def stream_map(world, seed):
    return {"sample-mark": from_fn(lambda d: (VALUE,)), "test-fine": from_test(lambda d, s: s is not None)}
"""
OLD = """
from types import SimpleNamespace
from pydantic import BaseModel
from gentamp_lp.streams.language import from_fn, from_test

class Scene(BaseModel):
    pass

class World:
    def __init__(self, dials, robot):
        self.robot = SimpleNamespace(name=robot)
        self.dials = dials

    values = property(lambda self: {d: int(d[1:]) for d in self.dials} | {"zero": 0})
    static = property(lambda self: [("dial", d) for d in self.dials] + [("near", d, "zero") for d in self.dials])
    fluents = property(lambda self: [("off", d) for d in self.dials])

def make_world(scene, parameters, robot, rng):
    return World([f"d{i}" for i in range(parameters["dials"])], robot)

def stream_map(world, seed):
    return {"sample-mark": from_fn(lambda d: ({d},)), "test-fine": from_test(lambda d, s: s == {d})}

def encode(value, names):
    return {"mark": sorted(value)}

def decode(data, world, values):
    return set(data["mark"])

def check_plan(world, steps, values):
    return [f"{args[0]} is at {min(values[args[1]])}" for _, args in steps if values[args[1]] != {values[args[0]]}]

def render_plan(world, steps, values, path):
    path.write_text(str(len(steps)))
"""


def task_of(folder: Path, code: str, task: str = TASK) -> Task:
    (folder / "dials").mkdir()
    for name, text in {"domain.pddl": DOMAIN, "stream.pddl": STREAM, "__init__.py": code}.items():
        (folder / "dials" / name).write_text(text)
    (folder / "dials.yaml").write_text(task)
    return Task.load(folder / "dials.yaml", trust=True)


def solved(task: Task) -> Plan:
    result = solve(task, 3, 1)
    assert result.valid, result.problems or result.reason
    assert result.plan is not None and len(result.plan.steps) == 3
    return result.plan


def saved(plan: Plan, path: Path, **changes: Any) -> Plan:
    """The plan as its file gives it back, with changes in the file."""
    path.write_text(json.dumps(plan.to_json() | changes))
    return Plan.load(path)


# ---- values in plan files

NUMBERS = st.none() | st.booleans() | st.integers() | st.floats(allow_nan=False, allow_infinity=False)
ARRAYS = st.sampled_from(["<f8", "<f4", "<i4", "<u8", "|b1"]).flatmap(
    lambda kind: arrays(
        kind,
        st.lists(st.integers(0, 3), min_size=0, max_size=3).map(tuple),
        elements={"allow_nan": False, "allow_infinity": False} if "f" in kind else None,
    )
)
VALUES = st.recursive(
    NUMBERS | st.text() | ARRAYS, lambda part: st.lists(part, max_size=3) | st.lists(part, max_size=3).map(tuple)
)


def same(first: Any, second: Any) -> bool:
    if isinstance(first, np.ndarray):
        return first.dtype == second.dtype and first.shape == second.shape and bool((first == second).all())
    if isinstance(first, (list, tuple)):
        return type(first) is type(second) and len(first) == len(second) and all(map(same, first, second))
    return type(first) is type(second) and first == second


@given(VALUES)
def test_what_is_written_is_read_again(value: Any) -> None:
    assert same(from_json(json.loads(json.dumps(to_json(value)))), value)


def test_numbers_of_numpy_become_numbers() -> None:
    assert to_json([np.float32(0.5), np.int64(3), np.bool_(True)]) == [0.5, 3, True]


@pytest.mark.parametrize(
    ("value", "words"),
    [
        (object(), "type object"),
        ((1, {"a": 2}), "type dict"),
        (float("nan"), "nan, which is not finite"),
        (np.array([1.0, np.inf]), "not finite"),
        (np.array([1j]), "array of complex128"),
        (np.array([{}]), "array of object"),
        (np.array(["a"]), "array of str"),
    ],
)
def test_what_cannot_be_written_is_refused(value: Any, words: str) -> None:
    with pytest.raises((TypeError, ValueError), match=words):
        to_json(value)


@pytest.mark.parametrize(
    "data",
    [
        {"tuple": "abc"},
        {"map": [1]},
        {"array": [[1.0], [1.0, 2.0]], "shape": [2, 1], "dtype": "float64"},
        {"array": [1.0, 2.0], "shape": [3], "dtype": "float64"},
        {"array": [1.0], "shape": [1], "dtype": "object"},
        {"array": [1.0], "shape": [1], "dtype": "nonsense"},
        {"array": [1.0]},
        float("inf"),
    ],
)
def test_what_is_never_written_is_refused(data: Any) -> None:
    with pytest.raises((ValueError, KeyError, TypeError)):
        from_json(data)


# ---- worlds


def test_names_without_values_stand_for_themselves() -> None:
    facts = [("on", "b", "a"), ("clear", "b")]
    read = read_world(SimpleNamespace(static=facts, fluents=[("held", "c")]), ["zero"])
    assert list(read.values.items()) == [(name, name) for name in ("b", "a", "c", "zero")]
    assert read.robot.name == "none" and read.avoided == set()


def test_what_a_world_gives_is_taken() -> None:
    avoided = {7}
    hand = SimpleNamespace(name="hand")
    world = SimpleNamespace(static=[("on", "b")], fluents=[], values={"b": 3}, robot=hand, avoided=avoided)
    read = read_world(world)
    assert read.values == {"b": 3} and read.robot is hand and read.avoided is avoided
    assert read_world(World(static=[("on", "b")], values={"b": 3})).values == {"b": 3}


def test_files_of_a_scene_are_found_in_any_class() -> None:
    class Bare(BaseModel):
        pass

    class Given(Bare):
        @property
        def files(self) -> list[Path]:
            return [Path("a.obj")]

    assert [list(files_of(scene)) for scene in (Scene(), Bare(), Given())] == [[], [], [Path("a.obj")]]


# ---- domains


@pytest.mark.parametrize("value", ["0.5", "(1, 'a')", "np.eye(2)", "[np.zeros((0, 3)), d]"])
def test_a_world_and_streams_are_enough(tmp_path: Path, value: str) -> None:
    task = task_of(tmp_path, LEAST.replace("VALUE", value))
    plan = solved(task)
    assert plan.robot == "none"
    assert validate(saved(plan, tmp_path / "plan.json"), task) == []
    first = next(iter(plan.entities))
    for changed, words in ((None, "not applicable"), ({"map": 1}, None)):
        broken = saved(plan, tmp_path / "broken.json", entities=plan.entities | {first: {"value": changed}})
        if words:
            assert words in validate(broken, task)[0]
        else:
            with pytest.raises(InputError, match=f"entity `{first}` of the plan cannot be read"):
                validate(broken, task)
    with pytest.raises(InputError, match="plans no transits"):
        solve(task, 3, 1, motion=True)
    with pytest.raises(InputError, match="draws nothing"):
        task.folder.code.render_plan(None, [], {}, tmp_path / "plan.png")
    assert validate(saved(plan, tmp_path / "plan.json", transits=[[], [], []]), task) == [
        "the domain `dials` has no transits"
    ]


def test_domains_that_define_everything_work_as_they_are(tmp_path: Path) -> None:
    """Worlds of a class of their own, a robot that is only a name, values that only the domain can write."""
    task = task_of(tmp_path, OLD.replace("({d},)", "({d}, )"), TASK.replace("size:", "robot: arm\nsize:"))
    result = solve(task, 3, 1)
    assert result.valid and result.plan is not None and result.plan.robot == "arm"
    assert sorted(e["mark"] for e in result.plan.entities.values()) == [[0], [1], [2]]
    other = saved(result.plan, tmp_path / "plan.json", robot="leg")
    assert validate(other, task) == [] and task.instance(2, 0, robot="leg").robot == "leg"
    steps = [(step.schema, step.args) for step in result.plan.steps]
    values = result.instance.base.values
    assert task.folder.code.check_plan(result.instance.world, steps[:1], values | {steps[0][1][1]: {9}}) == [
        f"{steps[0][1][0]} is at 9"
    ]
    assert task.folder.code.draws
    task.folder.code.render_plan(result.instance.world, steps, values, tmp_path / "picture")
    assert (tmp_path / "picture").read_text() == "3"


def test_a_world_that_avoids_nothing_is_enough_for_transits(tmp_path: Path) -> None:
    """`avoided` is optional for those who write `plan_transits`: what they raise is said at once."""
    transits = """
from gentamp_lp.errors import NoAnswer

def plan_transits(world, steps, values, seed, deadline):
    raise NoAnswer("no way")
    yield
"""
    task = task_of(tmp_path, OLD + transits, TASK.replace("size:", "robot: arm\nsize:"))
    result = solve(task, 2, 0, motion=True)
    assert result.plan is None and result.reason == "no way"


@pytest.mark.parametrize("hook", ["Scene", "make_world", "stream_map"])
def test_what_is_compulsory_is_missed(tmp_path: Path, hook: str) -> None:
    with pytest.raises(InputError, match=f"the domain's Python code lacks {hook}") as caught:
        task_of(tmp_path, OLD.replace(hook, "other"))
    assert caught.value.diagnostics[0].path == tmp_path / "dials" / "__init__.py"


@pytest.mark.parametrize(("hook", "typed"), [("encode", "encodes"), ("render_plan", "render_plans")])
def test_a_misspelt_function_is_not_taken_for_left_out(tmp_path: Path, hook: str, typed: str) -> None:
    with pytest.raises(InputError, match=f"`{typed}` is not `{hook}`"):
        task_of(tmp_path, OLD.replace(f"def {hook}", f"def {typed}"))


def test_a_robot_that_the_domain_does_not_have_is_refused(tmp_path: Path) -> None:
    task = task_of(tmp_path, LEAST.replace("VALUE", "1"))
    assert task.instance(1, 0).robot == task.instance(1, 0, robot="none").robot == "none"
    with pytest.raises(InputError, match="has no robots, and no `panda`"):
        task.instance(1, 0, robot="panda")
