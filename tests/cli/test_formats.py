"""The JSON Schemas that are shipped describe what users write and what the commands print."""

import json
import subprocess
import sys
from pathlib import Path

import pytest
import typer
from jsonschema import Draft202012Validator, ValidationError
from ruamel.yaml import YAML
from typer.testing import CliRunner

from gentamp_lp.bench.runs import NAMES
from gentamp_lp.cli.main import app
from gentamp_lp.cli.schemas import FORMATS, schema
from gentamp_lp.planning.solve import solve
from gentamp_lp.policy.failures import record
from gentamp_lp.policy.learn_report import Failure
from gentamp_lp.synthesis import read_problem, synthesize
from gentamp_lp.synthesis.explaining import explain
from gentamp_lp.synthesis.show import report
from gentamp_lp.tasks.task import Task

ROOT = Path(__file__).parents[2]


def validator(name):
    document = schema(name)
    Draft202012Validator.check_schema(document)
    return Draft202012Validator(document)


def read(path):
    return json.loads(json.dumps(YAML(typ="safe", pure=True).load(path.read_text(encoding="utf-8"))))


def test_the_command_prints_the_schema():
    run = subprocess.run([sys.executable, "-m", "gentamp_lp", "schema", "task"], capture_output=True, check=True)
    assert json.loads(run.stdout) == schema("task")


def test_unknown_formats_are_refused():
    run = subprocess.run([sys.executable, "-m", "gentamp_lp", "schema", "plan?"], capture_output=True, text=True)
    assert run.returncode == 2 and "hint: one of task, robot" in run.stderr


@pytest.mark.parametrize("path", [*(ROOT / "tasks").glob("*.yaml"), *(ROOT / "docs").rglob("half.yaml")], ids=str)
def test_task_files(path):
    document = read(path)
    validator("task").validate(document)
    with pytest.raises(ValidationError):
        validator("task").validate({**document, "trian": [1]})


@pytest.mark.parametrize(
    "path", [*(ROOT / "gentamp_lp").rglob("descriptions/*.yaml"), *(ROOT / "docs").rglob("arm.yaml")]
)
def test_robots(path):
    document = read(path)
    validator("robot").validate(document)
    with pytest.raises(ValidationError):
        validator("robot").validate({**document, "opening": -1})


def test_learn_and_its_bundle(learned, tmp_path):
    learned.save(tmp_path / "bundle")
    document = json.loads((tmp_path / "bundle" / "report.json").read_text(encoding="utf-8"))
    validator("learn").validate(document)
    with pytest.raises(ValidationError):
        validator("learn").validate({key: value for key, value in document.items() if key != "optimal"})


def test_a_plan_with_transits(unstack, tmp_path):
    result = solve(unstack.task, 3, policy=unstack.policy, motion=True)
    assert result.plan is not None
    result.plan.save(tmp_path / "plan.json")
    written = json.loads((tmp_path / "plan.json").read_text(encoding="utf-8"))
    assert len(written["transits"]) == len(written["steps"])
    validator("plan").validate(written)


def test_solve_with_and_without_a_plan(unstack):
    task = Task.load("unstack")
    for size, limit in ((4, 60), (30, 0.1)):
        result = solve(task, size, seed=1, policy=unstack.policy if size == 4 else None, time_limit=limit)
        assert result.valid == (size == 4)
        validator("solve").validate(json.loads(json.dumps(result.report())))


@pytest.mark.parametrize("file", ["clear.lp", "unsolvable.lp", "swing.lp"])
def test_synthesize(file):
    found = synthesize(read_problem([ROOT / "docs" / "examples" / "08-qnp" / file]), minimize=True)
    reason = explain(found.problem, found.fairness) if not found.solvable else None
    document = json.loads(json.dumps(report(found, reason)))
    validator("synthesize").validate(document)
    assert document["solvable"] is (file != "unsolvable.lp")


@pytest.fixture(scope="module")
def folder(unstack, tmp_path_factory):
    """A folder with a bundle, a plan, a certificate and a table of runs, as the commands write them."""
    place = tmp_path_factory.mktemp("formats")
    unstack.save(place / "unstack")
    qnp = str(ROOT / "docs" / "examples" / "08-qnp" / "clear.lp")
    solve = ["solve", "unstack", "--size", "3", "--seed", "1", "--policy", str(place / "unstack")]
    assert not CliRunner().invoke(app, [*solve, "--out", str(place / "plan.json")]).exit_code
    assert not CliRunner().invoke(app, ["synthesize", qnp, "--out", str(place / "clear.json")]).exit_code
    return place


COMMANDS = {
    "validate": ["validate", "plan.json"],
    "explain": ["explain", "unstack", "--state", "plan.json"],
    "report": ["report", "unstack", "--plan", "plan.json", "--out", "page.html"],
    "compile": ["compile", "unstack", "--out", "constrained"],
    "check": ["check", "unstack/policy.lp"],
    "doctor": ["doctor"],
    "features": ["features", "unstack", "--state", "0", "--formula", "exists y: On(x,y)", "--max-complexity", "2"],
    "bench": ["bench", "unstack", "--sizes", "2", "--seeds", "1", "--modes", "guided", "--policies", ".", "--out", "."],
}


@pytest.mark.parametrize("name", COMMANDS)
def test_what_commands_print(folder, monkeypatch, name):
    """Each document fits its schema, and does not without any one of its members."""
    monkeypatch.chdir(folder)
    run = CliRunner().invoke(app, [*COMMANDS[name], "--json"])
    document = json.loads(run.stdout)
    validator(name).validate(document)
    assert run.exit_code == (2 if name == "check" else 0) and (name != "check" or document["errors"])
    for key in document:
        assert not validator(name).is_valid({k: v for k, v in document.items() if k != key})
    assert not validator(name).is_valid({**document, "more": 1})


@pytest.mark.parametrize("name, file", [("plan", "plan.json"), ("certificate", "clear.json")])
def test_written_files(folder, name, file):
    document = json.loads((folder / file).read_text(encoding="utf-8"))
    validator(name).validate(document)
    assert not validator(name).is_valid({**document, "format": "another"})


def test_lines(folder):
    """The columns of results.csv, and a failure as `solve` keeps it."""
    assert list(schema("results")["properties"]) == NAMES
    record(folder / "unstack", Failure("9", 1, "panda", "no sample is left"))
    line = (folder / "unstack" / "failures.jsonl").read_text(encoding="utf-8")
    validator("failures").validate(json.loads(line))


def test_every_json_option_has_a_schema():
    commands = typer.main.get_command(app).commands
    printing = {name for name, command in commands.items() if any(p.name == "json_" for p in command.params)}
    assert printing <= FORMATS.keys()
