"""Planning without a policy: the choice of the algorithm, and the adapter to the original PDDLStream."""

import json
import subprocess
import sys
import time
from pathlib import Path

import pytest
from helpers.pace import at_most
from helpers.stand_in import write_stand_in
from typer.testing import CliRunner

from gentamp_lp.cli.main import app
from gentamp_lp.errors import InputError, NoAnswer, SolverError
from gentamp_lp.planning.solve import solve
from gentamp_lp.planning.unguided import choose, plan_unguided
from gentamp_lp.plans.plan import Plan
from gentamp_lp.plans.validate import validate
from gentamp_lp.streams.incremental import quota_for, sample
from gentamp_lp.streams.semantics import reads
from gentamp_lp.tasks.task import Task


@pytest.fixture
def stand_in(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    def install(change: str) -> None:
        write_stand_in(tmp_path / "site", change)
        monkeypatch.syspath_prepend(str(tmp_path / "site"))
        monkeypatch.chdir(tmp_path)

    for name in [n for n in sys.modules if n.split(".")[0] == "pddlstream"]:
        monkeypatch.delitem(sys.modules, name)
    yield install
    for name in [n for n in sys.modules if n.split(".")[0] == "pddlstream"]:
        del sys.modules[name]


@pytest.mark.parametrize("algorithm", ["incremental", "adaptive"])
def test_the_original_gets_the_same_problem(stand_in, tmp_path: Path, algorithm: str) -> None:
    stand_in("(plan, cost, certificate)")
    result = solve(Task.load("unstack"), 4, 0, engine="pddlstream", algorithm=algorithm)
    assert result.valid and result.report()["engine"] == "pddlstream"
    assert not (tmp_path / "temp").exists()


def test_what_it_prints_is_no_part_of_the_document(stand_in, tmp_path: Path) -> None:
    stand_in("(plan, cost, certificate)")
    run = ["solve", "unstack", "--size", "2", "--mode", "unguided", "--engine", "pddlstream", "--json"]
    result = CliRunner().invoke(app, run)
    assert json.loads(result.stdout)["valid"] and "Summary" in result.stderr


def test_a_planner_that_is_not_compiled_is_told(stand_in, tmp_path: Path) -> None:
    stand_in("(plan, cost, certificate)")
    (tmp_path / "site/pddlstream/algorithms/meta.py").write_text('raise RuntimeError("Please compile FastDownward")')
    with pytest.raises(InputError, match=r"Please compile.*\n.*PYTHONPATH"):
        solve(Task.load("unstack"), 2, 0, engine="pddlstream")


def test_its_plans_are_not_believed(stand_in) -> None:
    stand_in("(plan[:-1], cost, certificate)")
    result = solve(Task.load("unstack"), 4, 0, engine="pddlstream")
    assert result.plan is not None and not result.valid and result.problems


@pytest.mark.parametrize(("change", "error"), [("(None, float('inf'), None)", NoAnswer), ("exit(3)", SolverError)])
def test_its_failures_are_told(stand_in, change: str, error: type[Exception]) -> None:
    stand_in(change)
    if error is NoAnswer:
        result = solve(Task.load("unstack"), 4, 0, engine="pddlstream")
        assert result.plan is None and "PDDLStream found no plan" in str(result.reason)
    else:
        with pytest.raises(error):
            solve(Task.load("unstack"), 4, 0, engine="pddlstream")


def test_without_the_package() -> None:
    with pytest.raises(InputError, match="PYTHONPATH"):
        solve(Task.load("unstack"), 4, 0, engine="pddlstream")


def test_policies_need_the_embedded_engine(unstack) -> None:
    with pytest.raises(InputError, match="unguided"):
        solve(Task.load("unstack"), 4, 0, policy=unstack.policy, engine="pddlstream")


def test_goals_about_all_samples_are_planned_over_all_samples() -> None:
    sizes = {"load": "2-3", "sort": "2-2", "unstack": 4, "clutter": 3}
    chosen = {name: choose(Task.load(name).instance(size, 0)) for name, size in sizes.items()}
    assert chosen == {"load": "incremental", "sort": "adaptive", "unstack": "adaptive", "clutter": "adaptive"}


@pytest.mark.parametrize(("size", "seed"), [("1-2", 0), ("2-4", 0)])
def test_adaptive_plans_for_goals_about_all_samples_see_those_of_the_validator(size: str, seed: int) -> None:
    task = Task.load("load")
    instance = task.instance(size, seed)
    steps = plan_unguided(instance, "adaptive", "embedded", 60, lambda _: None)
    quota = quota_for(instance.base, reads(task.goal, task.program), task.file.samples)
    assert not sample(instance.base, quota, float("inf")), "there were samples left to draw"
    assert validate(Plan.of(instance, steps), task) == []


def test_the_adaptive_algorithm_asks_less_of_the_streams() -> None:
    calls = {}
    for algorithm in ("adaptive", "incremental"):
        result = solve(Task.load("sort"), "2-2", 0, algorithm=algorithm)
        assert result.valid
        calls[algorithm] = sum(s["calls"] for s in result.report()["streams"].values())
    assert calls["adaptive"] < calls["incremental"] / 10


@pytest.mark.parametrize("guided", [True, False])
def test_a_stream_that_never_returns_is_ended_and_named(monkeypatch, unstack, guided: bool) -> None:
    draw = Task.instance

    def instance(*args, **options):
        drawn = draw(*args, **options)
        drawn.base.generators = {**drawn.base.generators, "sample-grasp": lambda *_: iter(lambda: time.sleep(600), 1)}
        return drawn

    monkeypatch.setattr(Task, "instance", instance)
    with at_most(1.05 * 1.0, starts=100):
        result = solve(Task.load("unstack"), 4, 0, policy=unstack.policy if guided else None, time_limit=1.0)
    assert result.limited and "stream `sample-grasp` was still running on (" in str(result.reason)


def test_the_command_line() -> None:
    run = ["solve", "clutter", "--size", "3", "--mode", "unguided", "--json", "-q", "--algorithm", "adaptive"]
    result = CliRunner().invoke(app, run)
    assert result.exit_code == 0, result.output
    report = json.loads(result.stdout)
    assert report["valid"] and report["planner"] == "adaptive" and report["engine"] == "embedded"
    missing = subprocess.run(
        [sys.executable, "-m", "gentamp_lp", *run, "--engine", "pddlstream"], capture_output=True, text=True
    )
    assert missing.returncode == 2 and "PYTHONPATH" in missing.stderr
