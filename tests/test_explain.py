"""Explanations: the reasons for features hold on the data, and the account of a plan is what happens in it."""

from __future__ import annotations

import json
import re
from pathlib import Path

import pytest
from test_cli import run

from gentamp_lp import solve
from gentamp_lp.errors import InputError
from gentamp_lp.evidence import parse_evidence
from gentamp_lp.explain import explain, trace
from gentamp_lp.learning import Learned
from gentamp_lp.plan import Plan
from gentamp_lp.policy import Policy
from gentamp_lp.task import Task


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
    evidence = parse_evidence(learned.facts)
    for feature, number in zip(learned.policy.features, learned.solution.features, strict=True):
        why = learned.reasons[feature.name]
        first, second = (int(n) for n in re.findall(r"\bstate (\d+) \(size", why)[:2])
        difference = evidence.states[first] ^ evidence.states[second]
        others = [evidence.bit(f) for f in learned.solution.features if f != number]
        assert not any(difference >> bit & 1 for bit in others), why
        if "looks like" in why:
            assert first in evidence.goals and second not in evidence.goals
            assert difference >> evidence.bit(number) & 1
            assert int(re.search(r"cost of (\d+) or more", why)[1]) >= 1  # type: ignore[index]


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
