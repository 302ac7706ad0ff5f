"""The command line: exit codes, one JSON document on stdout, messages on stderr, nothing half-written."""

import json
import shutil
import signal
import subprocess
import sys
import time

import pytest
from helpers.commands import run
from helpers.pace import start_of_python

from gentamp_lp.base.shipped import resource


@pytest.fixture(scope="module")
def workplace(tmp_path_factory):
    """A folder in which Unstack has been learned."""
    folder = tmp_path_factory.mktemp("work")
    done = run("learn", "unstack", "--json", "--no-cache", cwd=folder)
    assert done.returncode == 0
    (folder / "learn.json").write_text(done.stdout)
    return folder


def test_learn_reports_what_it_promises(workplace):
    report = json.loads((workplace / "learn.json").read_text())
    assert report["task"] == "unstack" and report["optimal"] is True and report["fairness"] in ("qnp", "strong")
    assert {"features", "actions", "policy", "states", "transitions", "pool_size"} <= report.keys()
    assert {"demonstrations", "pool", "theory", "solving", "policy", "compilation", "total"} <= report["seconds"].keys()
    assert all({"name", "formula", "kind", "cost"} <= feature.keys() for feature in report["features"])
    bundle = workplace / "runs" / "unstack"
    names = {"policy.lp", "features.pl", "domain.pddl", "stream.pddl", "policy.svg", "report.json"}
    assert names <= {path.name for path in bundle.iterdir()}
    assert {p.name for p in workplace.joinpath("runs").iterdir()} == {"unstack"}


def test_solve_writes_a_plan_that_validates(workplace):
    done = run("solve", "unstack", "--size", "6", "--seed", "2", "--json", "--out", "plan.json", cwd=workplace)
    assert done.returncode == 0
    report = json.loads(done.stdout)
    assert report["solved"] and report["valid"] and report["plan_length"] == len(report["plan"])
    assert report["mode"] == "guided" and report["size"] == "6" and report["seed"] == 2
    done = run("validate", "plan.json", "--json", cwd=workplace)
    assert done.returncode == 0 and json.loads(done.stdout)["valid"] is True
    plan = json.loads((workplace / "plan.json").read_text())
    plan["steps"] = plan["steps"][:-1]
    (workplace / "short.json").write_text(json.dumps(plan))
    done = run("validate", "short.json", cwd=workplace)
    assert done.returncode == 1 and "no step uses" in done.stdout


def test_a_bundle_validates_and_compiles(workplace):
    assert run("validate", "runs/unstack", cwd=workplace).returncode == 0
    done = run("compile", "runs/unstack", "--out", "constrained", "--json", cwd=workplace)
    assert done.returncode == 0
    compiled = (workplace / "constrained" / "domain.pddl").read_text()
    assert compiled == (workplace / "runs" / "unstack" / "domain.pddl").read_text()


def test_the_local_encoding_says_what_it_supposes_and_what_it_leaves_to_checks(workplace):
    done = run("compile", "runs/unstack", "--out", "local", "--encoding", "local", "--json", cwd=workplace)
    report = json.loads(done.stdout)
    assert done.returncode == 0 and report["actions"] == ["pick--a1", "place--a2"] and report["checked"] == {}
    text = (workplace / "local" / "domain.pddl").read_text()
    assert len(report["supposed"]) == 3 and all(
        f"; Initial states have {words}.\n" in text for words in report["supposed"]
    )
    bundle = workplace / "above"
    shutil.copytree(workplace / "runs" / "unstack", bundle)
    features = (bundle / "features.pl").read_text()
    above = "closure(v2,v3,o,on(v2,v3),v0,v1)"
    (bundle / "features.pl").write_text(features.replace("on(v0,v1)", above))
    done = run("compile", "above", "--out", "checked", "--encoding", "local", cwd=workplace)
    assert done.returncode == 0, done.stderr
    assert "pick--a1: f2 is left to a check, for pick changes what its closure reads\n" in done.stdout


def test_pictures(workplace):
    for name, magic in (("plan.gif", b"GIF89a"), ("plan.png", b"\x89PNG")):
        done = run("solve", "unstack", "--size", "2", "--seed", "0", "--render", name, "-q", cwd=workplace)
        assert done.returncode == 0
        assert (workplace / name).read_bytes().startswith(magic)


def test_the_same_seed_gives_the_same_bytes(workplace, tmp_path):
    """Policy and plan agree byte by byte with those of another process with another hash seed."""
    done = run("learn", "unstack", "--no-cache", "-q", cwd=tmp_path, env={"PYTHONHASHSEED": "7"})
    assert done.returncode == 0
    for name in ("policy.lp", "features.pl", "domain.pddl", "stream.pddl", "policy.svg"):
        first = (workplace / "runs" / "unstack" / name).read_bytes()
        assert first == (tmp_path / "runs" / "unstack" / name).read_bytes(), name
    plans = []
    for folder, seed in ((workplace, "1"), (tmp_path, "2")):
        done = run(
            "solve", "unstack", "--size", "8", "--seed", "3", "--out", "eight.json", "-q",
            cwd=folder, env={"PYTHONHASHSEED": seed},
        )  # fmt: skip
        assert done.returncode == 0
        plans.append((folder / "eight.json").read_bytes())
    assert plans[0] == plans[1]


@pytest.mark.parametrize(
    ("args", "words"),
    [
        (("learn", "tasks/none.yaml"), "no such file"),
        (("learn", "unstak"), "clutter, load, sort, transport, transport-paper, unstack"),
        (("learn", "broken.yaml"), "broken.yaml:4: error"),
        (("learn", "unknown.yaml"), "unknown predicate `Shelf`"),
        (("learn", "unstack", "--grammar", "bad.lp"), "bad.lp:1:"),
        (("learn", "unstack", "--robot", "hal"), "hal"),
        (("solve", "unstack", "--size", "many"), "not a size"),
        (("solve", "load", "--size", "2"), "no policy in"),
        (("solve", "load", "--size", "2", "--policy", "runs/unstack"), "is for task `unstack`"),
        (("solve", "unstack", "--size", "2", "--render", "plan.mp4"), "end the name in"),
        (("validate", "bad.lp"), "not valid JSON"),
        (("validate", "none.json"), "no such file"),
        (("check", "broken.yaml", "bad.lp"), "bad.lp:1:"),
        (("lern",), "Did you mean 'learn'"),
    ],
)
def test_bad_input_is_one_message_and_exit_code_2(workplace, args, words):
    (workplace / "broken.yaml").write_text("name: broken\ndomain: tabletop\nrobot: panda\nsizes: [n]\n")
    text = resource("tasks", "unstack.yaml").read_text().replace("(Table ?s)", "(Shelf ?s)")
    (workplace / "unknown.yaml").write_text(text)
    (workplace / "bad.lp").write_text("rule(twice, [con(X)], con(X), 0.\n")
    before = {path.name for path in workplace.iterdir()}
    done = run(*args, cwd=workplace)
    assert done.returncode == 2
    assert words in done.stderr.replace("\n", " ")
    assert done.stdout == ""
    assert {path.name for path in workplace.iterdir()} == before


def test_a_missing_prolog_is_said_before_anything_is_planned(workplace, tmp_path):
    hidden = {"LIBSWIPL_PATH": "/nonexistent", "SWI_HOME_DIR": "/nonexistent"}
    done = run("learn", "unstack", "--no-cache", cwd=tmp_path, env=hidden)
    assert done.returncode == 2 and "apt-get install swi-prolog-nox" in done.stderr
    assert "demonstration" not in done.stderr and not list(tmp_path.iterdir())
    done = run("doctor", "--json", cwd=tmp_path, env=hidden)
    assert done.returncode == 2 and json.loads(done.stdout)["ok"] is False


def test_doctor_and_check_find_nothing_wrong(tmp_path):
    done = run("doctor", "--json", cwd=tmp_path)
    assert done.returncode == 0 and json.loads(done.stdout)["ok"] is True
    tasks = [str(path) for path in resource("tasks").glob("*.yaml")]
    assert run("check", *tasks, str(resource("domains", "tabletop")), cwd=tmp_path).returncode == 0


def test_limits_give_exit_code_3(workplace):
    done = run("solve", "unstack", "--size", "16", "--mode", "unguided", "--timeout", "0.1", "--json", cwd=workplace)
    assert done.returncode == 3 and json.loads(done.stdout)["solved"] is False


def test_an_impossible_request_gives_exit_code_1(workplace):
    done = run("solve", "unstack", "--size", "400", cwd=workplace)
    assert done.returncode == 1 and "ask for fewer" in done.stderr


@pytest.mark.parametrize("moment", [None, "demonstration", "a policy of cost"])
def test_interrupting_leaves_nothing_half_written(tmp_path, moment):
    """Ctrl-C gives exit code 130 and either nothing or a whole bundle, when a policy had been found by then."""
    command = [sys.executable, "-m", "gentamp_lp", "learn", "load", "--no-cache"]
    process = subprocess.Popen(command, cwd=tmp_path, stderr=subprocess.PIPE, stdout=subprocess.PIPE, text=True)
    if moment is None:
        time.sleep(5 * start_of_python())  # while it imports
    else:
        assert any(moment in line for line in process.stderr)
    process.send_signal(signal.SIGINT)
    _, errors = process.communicate(timeout=60)
    assert process.returncode in (130, -signal.SIGINT)  # the same to a shell; CPython's own while it imports
    assert "Traceback" not in errors
    if list(tmp_path.iterdir()):
        assert [path.name for path in (tmp_path / "runs").iterdir()] == ["load"]
        assert run("validate", "runs/load", cwd=tmp_path).returncode == 0
