"""Plans along a skeleton have its action names in its order, with arguments of their own."""

import pytest

from gentamp_lp.errors import InputError
from gentamp_lp.learning.learn import Learned
from gentamp_lp.planning.solve import skeleton_of, solve
from gentamp_lp.plans.stream_floor import stream_floor
from gentamp_lp.streams.incremental import run_tests, sample, simulate
from gentamp_lp.streams.semantics import Step
from gentamp_lp.tasks.task import Task

SIZES = {"unstack": "5", "load": "2-2"}


def test_a_skeleton_is_followed(learned: Learned) -> None:
    size = SIZES[learned.task.name]
    names = skeleton_of(learned.task, size, 1, learned.policy, robot="gripper")
    result = solve(learned.task, size, 1, skeleton=names, robot="gripper", time_limit=60)
    assert result.valid and result.plan is not None
    assert result.mode == result.planner == "skeleton"
    assert [step.schema for step in result.plan.steps] == names


@pytest.mark.parametrize("names", [["pick"], ["place", "pick"], []])
def test_what_no_plan_has_is_not_found(names: list[str]) -> None:
    result = solve(Task.load("unstack"), "6", 1, skeleton=names, robot="gripper", time_limit=2)
    assert result.plan is None and result.reason


def test_an_unknown_action_is_named() -> None:
    with pytest.raises(InputError, match=r"unknown action `push`\n  hint: .*: carry, move, pick, place"):
        solve(Task.load("unstack"), "4", 1, skeleton=["pick", "push"], robot="gripper")


def test_the_floor_is_below_the_time_in_streams(learned: Learned) -> None:
    """It replays a part of the calls that planning made, and finds the same entities."""
    result = solve(learned.task, SIZES[learned.task.name], 1, policy=learned.policy, floor=True)
    report = result.report()
    assert result.plan is not None
    replays = [stream_floor(result.instance, result.plan.steps) for _ in range(3)]  # one may be interrupted
    assert 0 < min(filter(None, replays)) < 2 * report["stream_seconds"]
    assert report["floor_ratio"] == pytest.approx(report["seconds"] / report["stream_floor"], rel=0.05)


def test_a_plan_may_use_two_draws_of_one_stream() -> None:
    """An earlier draw may be asked for after a later one."""
    task = Task.load("unstack")
    first = task.instance("1", 0, robot="gripper")
    draw = {s.name: s for s in first.base.streams}
    grasps = [grasp for (grasp,) in iter(lambda: first.base.draw(draw["sample-grasp"], ("block1",)), None)]
    assert len(grasps) > 1
    placed = first.base.draw(draw["sample-placement"], ("block1", "table"))[0]
    steps = []
    for grasp, start, end in ((grasps[-1], "at_block1", placed), (grasps[0], placed, "at_block1")):
        for name, at in (("pick", start), ("place", end)):
            inputs = ("block1", at, "table", "at_table", grasp, "at_base")
            (reach,) = first.base.draw(draw["sample-reach"], inputs)
            steps.append(Step(name, ("block1", at, "table", "at_table", grasp, "at_base", reach)))
    assert simulate(first.task.program, first.base, first.state, steps)
    floor = stream_floor(first, steps)
    assert floor is not None and floor > 0


def test_the_floor_counts_only_what_the_plan_needs(unstack: Learned) -> None:
    """More samples in the problem do not raise it: the number of calls replayed is that of the plan's own."""
    instance = unstack.task.instance("6", 1, robot="gripper")
    result = solve(unstack.task, "6", 1, policy=unstack.policy, robot="gripper")
    assert result.plan is not None and result.plan.steps
    before = stream_floor(result.instance, result.plan.steps)
    sample(instance.base, {"sample-placement": 20}, float("inf"))
    run_tests(instance.base, float("inf"))
    spent = sum(s.seconds for s in instance.base.statistics.values())
    assert before is not None and before < spent
