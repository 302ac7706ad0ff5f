"""`gentamp-lp synthesize` and `validate`: exit codes, JSON, files."""

import json
import os
import subprocess
import sys
from pathlib import Path

from helpers.problem_examples import detours

FOLDER = Path(__file__).parents[2] / "docs" / "examples" / "08-qnp"


def run(*args):
    done = subprocess.run(
        [sys.executable, "-m", "gentamp_lp", *map(str, args)],
        capture_output=True,
        text=True,
        env={**os.environ, "NO_COLOR": "1"},
        timeout=300,
    )
    assert "Traceback" not in done.stderr, done.stderr
    return done


def test_a_policy_and_its_certificate(tmp_path):
    file = tmp_path / "clear.json"
    done = run("synthesize", FOLDER / "clear.lp", "--minimize", "--json", "--out", file)
    assert done.returncode == 0
    report = json.loads(done.stdout)
    assert report["solvable"] is True and report["fairness"] == "qnp"
    assert report["policy"] == [
        {"state": "n>0, -holding", "action": "pick"},
        {"state": "n>0, holding", "action": "put_away"},
    ]
    assert report["states"] == 2 and report["optimal"] is True and report["statistics"]["choices"] < 100
    assert run("validate", file).returncode == 0
    document = json.loads(file.read_text())
    document["rules"][1]["action"] = "put_back"
    file.write_text(json.dumps(document))
    done = run("validate", file, "--json")
    assert done.returncode == 1
    assert "the fairness of put_back in n>0, holding" in json.loads(done.stdout)["problems"][0]


def test_no_policy(tmp_path):
    done = run("synthesize", FOLDER / "clutter.lp", "--fairness", "qnp", "--json", "--out", tmp_path / "no.json")
    assert done.returncode == 1 and not (tmp_path / "no.json").exists()
    report = json.loads(done.stdout)
    assert report["solvable"] is False and report["policy"] == [] and "f2 is lowered and raised" in report["reason"]
    done = run("synthesize", FOLDER / "unsolvable.lp")
    assert done.returncode == 1 and "`bank`: no closed policy" in done.stdout


def test_bad_input(tmp_path):
    file = tmp_path / "bad.lp"
    file.write_text("state(a).\nnode(b).\n")
    done = run("synthesize", file)
    assert done.returncode == 2 and f"{file}:2: error: unknown predicate node/1" in done.stderr and not done.stdout
    done = run("synthesize", tmp_path / "none.lp")
    assert done.returncode == 2 and "no such file" in done.stderr


def test_a_limit(tmp_path):
    file = tmp_path / "detours.lp"
    file.write_text(detours(16))
    done = run("synthesize", file, "--fairness", "qnp", "--time-limit", "0.3", "--json")
    assert done.returncode == 3 and json.loads(done.stdout)["solvable"] is None
    assert "limit reached" in done.stderr
