"""Learning again from the problems on which a policy could not be followed."""

import json
import subprocess
import sys

import pytest

from gentamp_lp.base.shipped import resource
from gentamp_lp.errors import InputError
from gentamp_lp.policy.failures import known_failures, record, settings
from gentamp_lp.policy.learn_report import Failure

FAILURE = Failure("5", 0, "panda", "no rule")


def gentamp(folder, *args):
    code = "import sys; from gentamp_lp.cli.main import main; sys.argv[0] = 'gentamp-lp'; main()"
    return subprocess.run([sys.executable, "-c", code, *args], cwd=folder, capture_output=True, text=True, timeout=300)


@pytest.fixture(scope="module")
def refined(tmp_path_factory):
    """One tower of two blocks teaches "put away what blocks"; five blocks show that this is not it."""
    folder = tmp_path_factory.mktemp("refine")
    text = resource("tasks", "unstack.yaml").read_text().splitlines()
    text = [{"train": "train: [2]\nvalidation: []"}.get(line.partition(":")[0], line) for line in text]
    (folder / "one.yaml").write_text("\n".join(text))
    assert gentamp(folder, "learn", "one.yaml", "--seed", "0", "--out", "b").returncode == 0
    first = json.loads((folder / "b/report.json").read_text())
    failed = gentamp(folder, "solve", "one.yaml", "--size", "5", "--policy", "b", "--timeout", "3", "--json")
    kept = known_failures(folder / "b")
    again = gentamp(folder, "learn", "--refine", "b", "--json")
    return folder, first, failed, kept, again


def test_solve_keeps_the_problem_and_says_what_to_do(refined):
    _, first, failed, kept, _ = refined
    assert first["refined_on"] == []
    assert "learn from it: gentamp-lp learn --refine b" in failed.stderr
    assert [(f.size, f.seed, f.robot) for f in kept] == [("5", 0, "panda")]
    assert kept[0].reason == json.loads(failed.stdout)["stuck"]


def test_refining_learns_a_policy_that_goes_on_to_solve(refined):
    folder, first, _, kept, again = refined
    assert again.returncode == 0, again.stderr
    report = json.loads(again.stdout)
    assert report["refined_on"] == [vars(f) for f in kept]
    assert report["settings"] == first["settings"]
    assert report["states"] > first["states"]
    assert [f["formula"] for f in report["features"]] != [f["formula"] for f in first["features"]]
    for size in ("5", "9"):
        solved = gentamp(folder, "solve", "one.yaml", "--size", size, "--policy", "b", "--json", "-q")
        assert json.loads(solved.stdout)["valid"] and json.loads(solved.stdout)["planner"] == "guided"
    assert not (folder / "b/failures.jsonl").exists()


def test_a_policy_that_failed_nowhere_is_not_refined(refined):
    folder, *_ = refined
    assert gentamp(folder, "learn", "one.yaml", "--out", "fresh", "-q").returncode == 0
    answer = gentamp(folder, "learn", "--refine", "fresh")
    assert answer.returncode == 2 and "nothing to refine" in answer.stderr and "hint:" in answer.stderr


def test_a_problem_is_kept_once(tmp_path):
    record(tmp_path, FAILURE)
    record(tmp_path, FAILURE)
    record(tmp_path, Failure("5", 1, "panda", "no rule"))
    assert [f.seed for f in known_failures(tmp_path)] == [0, 1]


@pytest.mark.parametrize(
    "line, complaint",
    [
        ('{"size": "5"', "failures.jsonl:2: error: not JSON"),
        ('{"size": "5", "seed": "0", "robot": "panda", "reason": ""}', "failures.jsonl:2: error: not a failure"),
        ("[]", "failures.jsonl:2: error: not a failure"),
    ],
)
def test_a_damaged_file_is_refused_with_its_line(tmp_path, line, complaint):
    record(tmp_path, FAILURE)
    with (tmp_path / "failures.jsonl").open("a") as file:
        file.write(line + "\n")
    with pytest.raises(InputError) as error:
        known_failures(tmp_path)
    assert complaint in str(error.value)


def test_a_report_without_settings_is_refused(tmp_path):
    (tmp_path / "report.json").write_text("{}")
    with pytest.raises(InputError, match="how the policy was learned"):
        settings(tmp_path)
