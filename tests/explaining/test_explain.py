"""Explanations: the reasons for features hold on the data, and the account of a plan is what happens in it."""

from __future__ import annotations

import json
import re
from dataclasses import replace
from pathlib import Path

import pytest
from helpers.commands import run

from gentamp_lp import solve
from gentamp_lp.errors import InputError, NoAnswer
from gentamp_lp.explaining.what_it_does import explain, trace
from gentamp_lp.learning.learn import Learned, learn
from gentamp_lp.plans.plan import Plan
from gentamp_lp.policy.policy import Policy
from gentamp_lp.tasks.task import Task


@pytest.fixture(scope="module")
def bundle(load: Learned, tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("explain") / "load"
    load.save(folder)
    return folder


@pytest.fixture(scope="module")
def plan(load: Learned) -> Plan:
    found = solve(load.task, "2-3", 1, policy=load.policy).plan
    assert found is not None
    return found


def test_the_reasons_are_true(learned: Learned) -> None:
    """The two states named look alike to the other features, and must not."""
    observations = learned.solution.theory.observations
    for feature, number in zip(learned.policy.features, learned.solution.features, strict=True):
        why = learned.reasons[feature.name]
        first, second = (int(n) for n in re.findall(r"\bstate (\d+) \(size", why)[:2])
        difference = observations.states[first] ^ observations.states[second]
        others = [observations.bit(f) for f in learned.solution.features if f != number]
        assert not any(difference >> bit & 1 for bit in others), why
        if "looks like" in why:
            assert first in observations.goals and second not in observations.goals
            assert difference >> observations.bit(number) & 1
            assert int(re.search(r"cost of (\d+) or more", why)[1]) >= 1  # type: ignore[index]


def test_reasons_name_objects(unstack: Learned) -> None:
    """The blocks that stand on a block in state 0 are those that its facts say so of."""
    why = unstack.reasons["f2"]
    assert "where it counts nothing, looks like state 0 (size 8, seed 0), where it counts block" in why
    blocks = re.search(r"state 0 \(.*?counts ([\w, ]+);", why)[1].split(", ")  # type: ignore[index]
    facts = unstack.dataset.states[0].facts
    assert blocks == sorted(f[1] for f in facts if f[0] == "on" and f[2].startswith("block"))


def test_an_absent_policy_is_explained_by_what_differs(unstack: Learned) -> None:
    with pytest.raises(NoAnswer, match="try: deeper features") as caught:
        learn(unstack.task, max_complexity=1)
    lines = str(caught.value).splitlines()
    numbers = [int(n) for n in re.findall(r"state (\d+) \(size", lines[1])]
    states = [unstack.dataset.states[n] for n in numbers]
    assert states[0].goal and not states[1].goal
    for number, state, other, shown in zip(numbers, states, reversed(states), lines[2].split("; "), strict=True):
        facts = re.findall(r"AtPose\((\w+), (\w+)\)", shown)
        assert f"only in state {number}: " in shown
        assert facts and all(("atpose", *f) in state.facts and ("atpose", *f) not in other.facts for f in facts)


def test_where_a_state_is_told_by_its_distance_from_the_start(unstack: Learned) -> None:
    """Along the demonstration the steps count up; beside it they are one more than on it."""
    data = unstack.dataset
    step = {t.source: t.target for t in data.transitions if t.demonstrated}
    state = next(n for n, seen in enumerate(data.states) if seen.initial)
    assert data.where(state) == "the start"
    for count in range(1, 4):
        beside = {t.target for t in data.transitions if t.source == state} - {*step, *step.values()}
        state = step[state]
        assert data.where(state) == f"after {count} step{'s' * (count > 1)} of the demonstration"
        assert beside
        assert {data.where(n) for n in beside} <= {
            f"after {away} step{'s' * (away > 1)} from the start, off the demonstration" for away in range(1, count + 1)
        }


def test_an_absent_plan_is_explained_by_objects(unstack: Learned) -> None:
    """The policy has no rule for the initial state: its features there are told with the blocks they count."""
    policy = replace(unstack.policy, rules=unstack.policy.rules[1:])
    result = solve(unstack.task, 6, 1, policy=policy, robot="gripper")
    assert result.plan is None and result.reason == result.stuck
    assert re.search(r"; there f1 is true of nothing, f2 counts block\d(, block\d)*$", str(result.reason))


def test_a_time_limit_is_no_answer(bundle: Path) -> None:
    options = ("--size", "9-96", "--timeout", "0.1", "--robot", "gripper")
    done = run("solve", "load", *options, "--policy", str(bundle))
    assert done.returncode == 3 and "a longer --timeout may find one\n" in done.stderr
    done = run("solve", "load", *options, "--mode", "unguided")
    assert done.returncode == 3 and "or a policy: gentamp-lp learn load" in done.stderr


def test_a_plan_is_told_as_it_happens(load: Learned, plan: Plan) -> None:
    states = trace(load.policy, plan, load.task)
    assert len(states) == len(plan.steps) + 1
    for before, after, step in zip(states, states[1:], plan.steps, strict=False):
        assert before.step == f"{step.schema}({', '.join(step.args)})"
        assert f"({step.schema})" in before.does
        for name, word in re.findall(r"(f\d) (\w+)", before.does):
            change = after.values[name] - before.values[name]
            assert change > 0 if word == "rises" else change < 0 if word == "falls" else change != 0
    assert states[-1].does == "nothing: this is a goal"
    held = next(f.name for f in load.policy.features if f.text == "Holding(x)")
    assert [s.holds[held] for s in states[:3]] == [[], [plan.steps[0].args[0]], []]


def test_features_are_explained_from_the_bundle(bundle: Path) -> None:
    rows = explain(Policy.load(bundle), bundle)
    assert all(row.why.startswith("without it") and row.used for row in rows)
    assert {row.open for row in rows} == {True, False}
    assert any("the policy ends because of it" in use for row in rows for use in row.used)
    with pytest.raises(InputError, match="no feature `f9`"):
        explain(Policy.load(bundle), bundle, "f9")
    (bundle / "report.json").rename(bundle / "report.txt")
    assert [row.why for row in explain(Policy.load(bundle), bundle)] == [""] * len(rows)  # not all bundles have one
    (bundle / "report.txt").rename(bundle / "report.json")


def test_a_plan_for_another_task_is_refused(unstack: Learned, plan: Plan) -> None:
    with pytest.raises(InputError, match="for task `load`"):
        trace(unstack.policy, plan, Task.load("load"))


def test_the_command(bundle: Path, plan: Plan, tmp_path: Path) -> None:
    plan.save(tmp_path / "plan.json")
    done = run("explain", str(bundle), "--state", str(tmp_path / "plan.json"))
    assert done.returncode == 0, done.stderr
    assert "f1  boolean  cost 1  closed  Holding(x)" in done.stdout
    assert "state 0: f1=0" in done.stdout and "the policy does nothing: this is a goal" in done.stdout
    done = run("explain", str(bundle), "--feature", "f1", "--json")
    document = json.loads(done.stdout)
    assert [row["name"] for row in document["features"]] == ["f1"] and document["states"] == []
    done = run("explain", str(bundle), "--feature", "g")
    assert done.returncode == 2 and "it has f1" in done.stderr
