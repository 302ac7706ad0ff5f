"""What people get wrong: every mistake ends in a sentence and an exit code, never in a traceback or half a file."""

import json
import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from gentamp_lp.base.shipped import resource
from gentamp_lp.cli.main import main

UNSTACK = resource("tasks", "unstack.yaml").read_text(encoding="utf-8")
CODE = """
from pydantic import BaseModel
from gentamp_lp.streams.language import from_fn, from_gen_fn, from_test

class Scene(BaseModel):
    coins: int = 2

class Robot:
    name = "hand"

class World:
    def __init__(self, coins):
        self.values = {f"c{i}": i for i in range(coins)}
        self.static = [("coin", name) for name in self.values]
        self.fluents = [("tails", name) for name in self.values]
        self.robot = Robot()

def make_world(scene, parameters, robot, rng):
    return World(parameters["coins"])

def sample(coin):
    BODY

def stream_map(world, seed):
    return {"sample-side": from_fn(sample)}

def encode(value, names):
    return value

def decode(data, world, values):
    return data

def check_plan(world, steps, values):
    return []

def render_plan(world, steps, values, path):
    raise NotImplementedError
"""
DOMAIN = """(define (domain coins) (:requirements :strips)
 (:predicates (coin ?c) (side ?c ?s) (tails ?c) (heads ?c))
 (:action flip :parameters (?c ?s) :precondition (and (coin ?c) (side ?c ?s) (tails ?c))
  :effect (and (heads ?c) (not (tails ?c)))))
"""
STREAM = """(define (stream coins)
 (:stream sample-side :inputs (?c) :domain (coin ?c) :outputs (?s) :certified (side ?c ?s)))
"""
COINS = """name: coins
domain: coins
robot: hand
size: [coins]
scene: {}
goal: (forall (?c) (imply (coin ?c) (heads ?c)))
train: [2]
"""


class Place:
    """A folder with a task, a domain, a policy bundle and a plan, all of them right until somebody changes them."""

    def __init__(self, folder):
        self.folder = folder

    def write(self, name, content):
        path = self.folder / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(content if isinstance(content, bytes) else content.encode())
        return name

    def task(self, old, new, text=UNSTACK):
        assert old in text, old
        return self.write("task.yaml", text.replace(old, new, 1))

    def edit(self, name, old, new):
        text = (self.folder / name).read_text(encoding="utf-8")
        assert old in text, (name, old)
        self.write(name, text.replace(old, new))
        return name

    def setting(self, name, value):
        """Change a setting in the bundle's report."""
        path = self.folder / "runs/unstack/report.json"
        report = json.loads(path.read_text(encoding="utf-8"))
        report["settings"][name] = value
        path.write_text(json.dumps(report), encoding="utf-8")
        return "runs/unstack"

    def loop(self, name):
        (self.folder / name).symlink_to(name)
        return name

    def pipe(self, name):
        os.mkfifo(self.folder / name)
        return name

    def coins(self, body="return (coin + 1,)", domain=DOMAIN, stream=STREAM, code=CODE, task=COINS):
        self.write("coins/domain.pddl", domain)
        self.write("coins/stream.pddl", stream)
        self.write("coins/__init__.py", code.replace("BODY", body))
        return self.write("coins.yaml", task)


@pytest.fixture(scope="module")
def ready(tmp_path_factory):
    """A learned policy and a plan made with it, as files."""
    folder = tmp_path_factory.mktemp("ready")
    before = Path.cwd()
    os.chdir(folder)
    try:
        for arguments in (["learn", "unstack", "-q"], ["solve", "unstack", "--size", "2", "--out", "plan.json", "-q"]):
            sys.argv = ["gentamp-lp", *arguments]
            with pytest.raises(SystemExit) as done:
                main()
            assert not done.value.code
    finally:
        os.chdir(before)
    return folder


@pytest.fixture
def place(tmp_path, ready, monkeypatch):
    shutil.copytree(ready, tmp_path, dirs_exist_ok=True)
    monkeypatch.chdir(tmp_path)
    return Place(tmp_path)


def gentamp(monkeypatch, capsys, arguments):
    """Exit code of a command and all it prints; an exception that leaves it fails the test."""
    monkeypatch.setattr(sys, "argv", ["gentamp-lp", *arguments])
    with pytest.raises(SystemExit) as done:
        main()
    captured = capsys.readouterr()
    assert "Traceback" not in captured.err + captured.out
    return done.value.code or 0, captured.err + captured.out


def bundle(place):
    return place.folder / "runs/unstack"


def coins_with(place, old, new):
    """Solve a problem of the coins with a change in their Python code."""
    assert old in CODE, old
    return ["solve", place.coins(code=CODE.replace(old, new)), "--size", "2", "--mode", "unguided", "--trust"]


def without(place, hook, body="return (coin + 1,)"):
    """Solve a problem of the coins without one of the functions of their Python code."""
    kept = [part for part in CODE.split("\n\n") if not part.startswith(f"def {hook}(")]
    task = place.coins(body, code="\n\n".join(kept))
    return ["solve", task, "--size", "2", "--mode", "unguided", "--trust"]


YAML = "task.yaml"
CASES = {
    # --- the command line
    "no such task": (lambda p: ["learn", "unstak"], "no such task", "unstack"),
    "no such file": (lambda p: ["learn", "missing.yaml"], "no such file", "hint:"),
    "a folder as task": (lambda p: ["learn", p.write("d/x", "") and "d"], "no such task", "hint:"),
    "no task": (lambda p: ["learn"], "no task given", "hint:"),
    "unknown robot": (lambda p: ["learn", "unstack", "--robot", "r2d2"], "r2d2", "panda"),
    "unknown size": (lambda p: ["solve", "unstack", "--size", "many"], "`many` is not a size", "BLOCKS"),
    "size zero": (lambda p: ["solve", "unstack", "--size", "0"], "`0` is not a size", "hint:"),
    "too many numbers": (lambda p: ["solve", "unstack", "--size", "1-2-3"], "`1-2-3` is not a size", "hint:"),
    "huge size": (lambda p: ["solve", "unstack", "--size", "9" * 30], "size", ""),
    "negative seed": (lambda p: ["solve", "unstack", "--size", "2", "--seed", "-1"], "--seed", ""),
    "no policy yet": (lambda p: ["solve", "load", "--size", "2"], "no policy in `runs/load`", "gentamp-lp learn load"),
    "policy of another task": (
        lambda p: ["solve", "load", "--size", "2", "--policy", "runs/unstack"], "is for task `unstack`", ""),
    "picture of unknown kind": (
        lambda p: ["solve", "unstack", "--size", "2", "--render", "plan.mp3"], "cannot render", ".gif"),
    "unknown option": (lambda p: ["learn", "unstack", "--sed", "1"], "--sed", "--seed"),
    "missing grammar": (lambda p: ["learn", "unstack", "--grammar", "no.lp"], "no.lp", ""),
    "formula with a typo": (
        lambda p: ["features", "unstack", "--max-complexity", "1", "--formula", "Holdin(x)"], "Holdin", ""),
    "formula of brackets": (
        lambda p: ["features", "unstack", "--max-complexity", "1", "--formula", "(" * 5000], "(((…", "hint:"),
    "formulas in a pipe": (
        lambda p: ["features", "unstack", "--max-complexity", "1", "--formula", "@" + p.pipe("f")], "f: error", "pipe"),
    "formula of negations": (
        lambda p: ["features", "unstack", "--max-complexity", "1", "--formula", "~" * 3000 + "Holding(x)"],
        "nested too deeply", ""),
    "formula cut short": (
        lambda p: ["features", "unstack", "--max-complexity", "1", "--formula", "On(x,"], "character 6", "hint:"),
    "nothing to refine": (lambda p: ["learn", "--refine", "runs/unstack"], "nothing to refine", "hint:"),
    "refine what is not there": (lambda p: ["learn", "--refine", "runs/none"], "policy.lp", ""),
    # --- task files
    "empty task": (lambda p: ["learn", p.write(YAML, "")], "task.yaml:1: error", "mapping"),
    "a list as task": (lambda p: ["learn", p.write(YAML, "- 1\n")], "task.yaml:1: error", "mapping"),
    "broken YAML": (lambda p: ["learn", p.write(YAML, "name: [1\ngoal: x")], "task.yaml:2", "not valid YAML"),
    "hostile YAML": (
        lambda p: ["learn", p.task("name: unstack", "name: !!python/object/apply:os.system [id]")], "task.yaml", ""),
    "a count that is no parameter": (
        lambda p: ["learn", p.task("count: blocks", "count: blobs")], "`blobs` is no parameter of `size`", "blocks"),
    "a list as a key": (
        lambda p: ["learn", p.task("name: unstack", "name: unstack\n[a, b]: x")], "task.yaml", ""),
    "a billion laughs": (
        lambda p: ["learn", p.write(YAML, "a: &a [x,x,x,x,x,x,x,x,x]\n" + "".join(
            f"{n}: &{n} [{', '.join(['*' + m] * 9)}]\n" for m, n in zip("abcdefgh", "bcdefghi", strict=True)))],
        "task.yaml", ""),
    "not UTF-8": (lambda p: ["learn", p.write(YAML, b"name: \xff\xfe")], "task.yaml", "cannot read"),
    "binary noise": (lambda p: ["learn", p.write(YAML, bytes(range(256)))], "task.yaml", ""),
    "unknown key": (lambda p: ["learn", p.task("robot: panda", "robot: panda\nrobots: 2")], "task.yaml:6", "robots"),
    "missing key": (lambda p: ["learn", p.task("train: [8]", "")], "train", "required"),
    "wrong type": (lambda p: ["learn", p.task("train: [8]", "train: eight")], "train", "task.yaml:"),
    "no training size": (lambda p: ["learn", p.task("train: [8]", "train: []")], "train", "task.yaml:"),
    "bad training size": (lambda p: ["learn", p.task("train: [8]", "train: [8-8-8]")], "8-8-8", "task.yaml:"),
    "robot nested too deeply": (
        lambda p: ["solve", "unstack", "--size", "2", "--robot", p.write("r.yaml", "[" * 20000)], "r.yaml", "nested"),
    "robot with a typo": (
        lambda p: ["solve", "unstack", "--size", "2", "--robot", p.write("r.yaml", "urdf: a\nreech: 2\n")],
        "r.yaml:2: error: reech", "docs/robots.md"),
    "problem in a pipe": (lambda p: ["synthesize", p.pipe("q.lp")], "q.lp: error", "pipe"),
    "unknown domain": (lambda p: ["learn", p.task("domain: tabletop", "domain: kitchen")], "kitchen", "tabletop"),
    "unknown stream": (
        lambda p: ["learn", p.task("sample-grasp: 2", "sample-grip: 2")], "sample-grip", "sample-grasp"),
    "goal without end": (lambda p: ["learn", p.task("?s) (Table ?s)))))", "?s)")], "task.yaml:", ""),
    "goal with unknown predicate": (
        lambda p: ["learn", p.task("(Table ?s)", "(Tabel ?s)")], "unknown predicate `Tabel`", "task.yaml:20"),
    "goal with wrong arity": (
        lambda p: ["learn", p.task("(Table ?s)", "(Table ?s ?s)")], "takes 1 argument", "task.yaml:20"),
    "goal with free variable": (lambda p: ["learn", p.task("(Table ?s)", "(Table ?z)")], "?z", "task.yaml:"),
    "bad name": (lambda p: ["learn", p.task("name: unstack", "name: Un stack")], "name", "task.yaml:2"),
    "complexity zero": (lambda p: ["learn", p.write(YAML, UNSTACK + "max_complexity: 0\n")], "max_complexity", ""),
    "missing grammar of a task": (
        lambda p: ["learn", p.write(YAML, UNSTACK + "grammar: [no.lp]\n")], "no.lp", ""),
    "scene with a typo": (lambda p: ["learn", p.task("shapes:", "shape:")], "shape", "task.yaml:"),
    "scene without room": (
        lambda p: ["check", p.task("x: [0.35, 0.65], y: [-0.45, 0.45]", "x: [0.50, 0.51], y: [0, 0.01]")],
        "block", ""),
    "area upside down": (lambda p: ["check", p.task("x: [0.35, 0.65]", "x: [0.65, 0.35]")], "task.yaml:", ""),
    "size of a thing is no number": (
        lambda p: ["check", p.task("0.05, 0.05, 0.05", "a, 0.05, 0.05")], "task.yaml:", ""),
    "negative size of a thing": (
        lambda p: ["check", p.task("0.05, 0.05, 0.05", "-0.05, 0.05, 0.05")], "task.yaml:", ""),
    # --- grammars
    "grammar with a syntax error": (
        lambda p: ["check", p.write("g.lp", "rule(x, :- ]\n")], "g.lp:1", "error"),
    "grammar that wants a shell": (
        lambda p: ["check", p.write("g.lp", ':- shell("touch hacked").\n')], "g.lp:1", ""),
    "grammar that wants a file": (
        lambda p: ["check", p.write("g.lp", 'law(x, A, B) :- open("hacked", write, _).\n')], "g.lp:1", ""),
    "grammar that is no text": (lambda p: ["check", p.write("g.lp", b"\xff\xfe\x00")], "g.lp", ""),
    "grammar that is a folder": (
        lambda p: ["features", "unstack", "--grammar", p.write("d.lp/x", "") and "d.lp"], "d.lp: error", "folder"),
    "grammar that is a pipe": (lambda p: ["features", "unstack", "--grammar", p.pipe("g.lp")], "g.lp: error", "pipe"),
    "grammar nested too deeply": (
        lambda p: ["check", p.write("g.lp", "law(x, " + "f(" * 50000 + "a" + ")" * 50000 + ", B).\n")],
        "g.lp: error", "nested"),
    "grammar with a line end in its name": (
        lambda p: ["check", p.write("a\nb.lp", "lwa(a).\n")], "a\\nb.lp: error", "rename"),
    "grammar with a name that is no text": (
        lambda p: ["check", p.write("\udcff.lp", "lwa(a).\n")], "error", "not Unicode"),
    "formula that is no text": (
        lambda p: ["features", "unstack", "--max-complexity", "1", "--formula", "\udcff"], "formula", "not Unicode"),
    "unknown word in a grammar": (lambda p: ["check", p.write("g.lp", "lwa(a, b, c).\n")], "g.lp:1", ""),
    # --- domains
    "stranger's domain": (lambda p: ["learn", p.coins()], "outside gentamp-lp", "--trust"),
    "domain cut short": (
        lambda p: ["check", p.coins(domain=DOMAIN[:150]), "--trust"], "domain.pddl:", ""),
    "domain with unknown predicate": (
        lambda p: ["check", p.coins(domain=DOMAIN.replace("(tails ?c))\n  :eff", "(tials ?c))\n  :eff")), "--trust"],
        "domain.pddl:3", "tials"),
    "domain with durative action": (
        lambda p: ["check", p.coins(domain=DOMAIN.replace(":action", ":durative-action")), "--trust"],
        "domain.pddl:3", ""),
    "stream with unknown predicate": (
        lambda p: ["check", p.coins(stream=STREAM.replace("(side", "(sied")), "--trust"], "stream.pddl:2", "sied"),
    "stream that asks for the state": (
        lambda p: ["check", p.coins(stream=STREAM.replace(":outputs", ":fluents (tails) :outputs")), "--trust"],
        "stream.pddl:2", "`:fluents`, which tasks do not support"),
    "stream without sampler": (
        lambda p: ["check", p.coins(code=CODE.replace('"sample-side"', '"sample"')), "--trust"],
        "has no Python sampler", "stream.pddl:2"),
    "domain code that fails": (
        lambda p: ["check", p.coins(code="1 / 0\n"), "--trust"], "fails to load", "ZeroDivisionError"),
    "domain code with a misspelt hook": (
        lambda p: ["check", p.coins(code=CODE.replace("def check_plan", "def chek_plan")), "--trust"],
        "`chek_plan` is not `check_plan`", "rename it"),
    "domain code without a world": (
        lambda p: ["check", p.coins(code=CODE.replace("def make_world", "def world")), "--trust"],
        "coins/__init__.py: error: the domain's Python code lacks make_world", "docs/domains.md"),
    "a value that no plan file holds": (
        lambda p: without(p, "encode", "return (object(),)"),
        "coins/__init__.py: error: entity `s1` cannot be written to a plan: it is or holds a value of type object",
        "`encode` and `decode`"),
    "a picture of a domain that draws none": (
        lambda p: [*without(p, "render_plan"), "--render", "x.png"], "the domain `coins` draws nothing", "--render"),
    "a robot for a domain without robots": (
        lambda p: coins_with(p, "self.robot = Robot()", "pass"), "has no robots, and no `hand`", "leave out `robot`"),
    "a robot left out": (
        lambda p: ["check", p.task("robot: panda\n", "")], "`tabletop` needs a robot", "panda"),
    "sampler that raises": (
        lambda p: ["learn", p.coins("return (1 / (coin - 1),)"), "--trust", "--no-cache"],
        "stream `sample-side` failed on (c1): ZeroDivisionError", "__init__.py:22"),
    "sampler of wrong arity": (
        lambda p: ["learn", p.coins("return (1, 2)"), "--trust", "--no-cache"], "sample-side", "c0"),
    "sampler that returns no tuple": (
        lambda p: ["learn", p.coins("return 7"), "--trust", "--no-cache"], "sample-side", "c0"),
    "a mistake in make_world": (
        lambda p: coins_with(p, 'parameters["coins"]', 'parameters["coin"]'),
        "coins/__init__.py:", "`make_world` failed: KeyError: 'coin'"),
    "a fact without a predicate": (
        lambda p: coins_with(p, '("tails", name)', '("tials", name)'),
        "coins/__init__.py: error", "`tials` is not declared in domain.pddl"),
    "a fact with an argument too many": (
        lambda p: coins_with(p, '("tails", name)', '("tails", name, name)'),
        "`fluents` of the world", "`tails` takes 1 argument(s)"),
    "a fluent that nothing changes": (
        lambda p: coins_with(p, '("tails", name)', '("coin", name)'),
        "`fluents` of the world", "no action changes `coin`"),
    "a fact about a name without a value": (
        lambda p: coins_with(p, '("tails", name)', '("tails", "c7")'),
        "`fluents` of the world", "`values` has no `c7`"),
    "a fact that is a list": (
        lambda p: coins_with(p, '("tails", name)', '["tails", name]'),
        "['tails', 'c0']", "tuples of names"),
    "a mistake in stream_map": (
        lambda p: coins_with(p, 'return {"sample-side"', 'return 0 / 0, {"sample-side"'),
        "coins/__init__.py:", "`stream_map` failed: ZeroDivisionError"),
    "a mistake in encode": (
        lambda p: coins_with(p, "return value", 'return value["x"]'),
        "coins/__init__.py:", "`encode` failed: TypeError"),
    "a mistake in check_plan": (
        lambda p: coins_with(p, "return []", "return [None][1:][0]"),
        "coins/__init__.py:", "`check_plan` failed: IndexError"),
    # --- bundles and plans
    "bundle with a cut fact": (
        lambda p: [p.edit("runs/unstack/policy.lp", "action(a1).", "action(a1"), "validate", "runs/unstack"][1:],
        "policy.lp:", ""),
    "bundle with unknown name": (
        lambda p: [p.edit("runs/unstack/policy.lp", "rule(s1, a1)", "rule(s1, a9)"), "validate", "runs/unstack"][1:],
        "policy.lp:", "a9"),
    "bundle without features": (
        lambda p: [(bundle(p) / "features.pl").unlink(), "validate", "runs/unstack"][1:], "features.pl", ""),
    "bundle with a broken formula": (
        lambda p: [p.edit("runs/unstack/features.pl", "holding(", "holdin("), "solve", "unstack", "--size", "2"][1:],
        "features.pl:4", "no predicate holdin/1"),
    "bundle with too many arguments": (
        lambda p: [p.edit("runs/unstack/features.pl", "holding(v0", "holding(v0,v0"), "validate", "runs/unstack"][1:],
        "features.pl:4", "of other arity"),
    "bundle with half a formula": (
        lambda p: [p.edit("runs/unstack/features.pl", "holding(v0)", "neg(holding(v0),x)"), "validate",
                   "runs/unstack"][1:], "features.pl:4", "not a formula"),
    "bundle that is no text": (
        lambda p: [p.write("runs/unstack/policy.lp", b"\xff\xfe"), "validate", "runs/unstack"][1:], "policy.lp", ""),
    "report that is no JSON": (
        lambda p: [p.write("runs/unstack/report.json", "{"), "explain", "runs/unstack"][1:], "report.json", ""),
    "plan that is no JSON": (lambda p: ["validate", p.write("plan.json", "{")], "plan.json:1", "JSON"),
    "plan that is a pipe": (lambda p: ["validate", p.pipe("plan2.json")], "plan2.json: error", "pipe"),
    "plan that is a folder without a policy": (lambda p: ["validate", p.write("d/x", "") and "d"], "policy.lp", ""),
    "plan of an unknown format": (
        lambda p: ["validate", p.edit("plan.json", "gentamp-lp plan 1", "plan 9")], "plan.json", "plan 9"),
    # --- hostile YAML and JSON
    "deeply nested YAML": (lambda p: ["learn", p.write("task.yaml", "[" * 20000 + "]" * 20000)], "task.yaml", "nested"),
    "YAML with a number of 5000 digits": (
        lambda p: ["learn", p.write("task.yaml", UNSTACK + "\nmax_complexity: " + "9" * 5000)], "task.yaml", "digits"),
    "YAML with an impossible date": (
        lambda p: ["learn", p.task("name: unstack", "name: 2020-99-99")], "task.yaml", "month"),
    "YAML with a tag that does not fit": (
        lambda p: ["learn", p.task("name: unstack", "name: !!bool maybe")], "task.yaml", "maybe"),
    "deeply nested plan": (lambda p: ["validate", p.write("plan.json", "[" * 100000)], "plan.json", "nested"),
    "plan with a number of 5000 digits": (
        lambda p: ["validate", p.write("plan.json", "9" * 5000)], "plan.json", "digits"),
    "deeply nested report": (
        lambda p: ["explain", p.write("runs/unstack/report.json", "[" * 100000) and "runs/unstack"],
        "report.json", "nested"),
    "report with a number of 5000 digits": (
        lambda p: ["explain", p.write("runs/unstack/report.json", "9" * 5000) and "runs/unstack"],
        "report.json", "digits"),
    "report that is a list": (
        lambda p: ["explain", p.write("runs/unstack/report.json", "[]") and "runs/unstack"], "report.json", "object"),
    **{
        f"report with wrong {name}": (
            lambda p, name=name, value=value: [
                "report", p.write("runs/unstack/report.json", json.dumps({name: value})) and "runs/unstack"],
            "report.json", name)
        for name, value in {"features": 3, "settings": "x", "notes": 3, "pruning": "abc", "seconds": [1]}.items()
    },
    **{
        f"report with settings of wrong {name}": (
            lambda p, name=name, value=value: ["report", p.setting(name, value)], "report.json", name)
        for name, value in {"seed": -5, "robot": ["panda"], "grammars": [3]}.items()
    },
    "report that is not Unicode": (
        lambda p: ["report", p.write("runs/unstack/report.json", '{"notes": ["\\ud800"]}') and "runs/unstack"],
        "report.html", "Unicode"),
    "plan without steps": (lambda p: ["validate", p.edit("plan.json", '"steps"', '"stpes"')], "plan.json", "steps"),
    "plan with a list as action": (
        lambda p: ["validate", p.edit("plan.json", '"action": "pick"', '"action": ["pick"]')], "pick", ""),
    "plan with unknown task": (
        lambda p: ["validate", p.edit("plan.json", '"task": "unstack"', '"task": "unstock"')], "unstock", ""),
    "brackets that look like markup": (lambda p: ["learn", "[bold]none[/i].yaml"], "[bold]none[/i].yaml", "no such"),
    "plan into a folder": (
        lambda p: ["solve", "unstack", "--size", "2", "-q", "--out", p.write("d/x", "") and "d"], "d: error", "folder"),
    "a file as bundle": (lambda p: ["explain", p.write("x.txt", "")], "x.txt: error: there is no policy.lp", "learn"),
    "plan as bundle": (lambda p: ["compile", "plan.json", "--out", "c"], "plan.json", ""),
    "neither plan nor bundle": (lambda p: ["validate", p.write("x.txt", "hello")], "x.txt", ""),
    # --- what no file should hold, and places that no file should be in
    **{
        f"NUL in {name}": (
            lambda p, name=name, arguments=arguments: [p.write(name, b"a\n\0b"), *arguments][1:],
            f"{name}:2: error: cannot read the file: it holds a NUL character", "hint: text has none")
        for name, arguments in {
            "task.yaml": ["learn", "task.yaml"],
            "g.lp": ["check", "g.lp"],
            "q.lp": ["synthesize", "q.lp"],
            "plan.json": ["validate", "plan.json"],
            "r.yaml": ["solve", "unstack", "--size", "2", "--robot", "r.yaml"],
            "f.txt": ["features", "unstack", "--formula", "@f.txt"],
            "runs/unstack/policy.lp": ["explain", "runs/unstack"],
            "runs/unstack/features.pl": ["explain", "runs/unstack"],
            "runs/unstack/report.json": ["explain", "runs/unstack"],
            "runs/unstack/failures.jsonl": ["learn", "--refine", "runs/unstack"],
        }.items()
    },
    "YAML with a control character": (
        lambda p: ["learn", p.write(YAML, "name: \a")], "not allowed\n", "task.yaml: error"),
    "task that is a pipe": (lambda p: ["learn", p.pipe("t.yaml")], "t.yaml: error: cannot read the file", "pipe"),
    **{
        f"name of 300 characters: {' '.join(arguments)}": (
            lambda p, arguments=arguments: [*arguments, "n" * 300 + ".lp"], "nnn.lp", "name too long")
        for arguments in (
            ["check"], ["validate"], ["features", "unstack", "--grammar"],
            ["solve", "unstack", "--size", "2", "--policy"],
            ["bench", "unstack", "--out"])
    },
    "plan that is a link to itself": (lambda p: ["validate", p.loop("p.json")], "p.json: error", "symbolic links"),
    "a name with a letter too much": (lambda p: ["validate", "plann.json"], "no such file", "did you mean `plan.json`"),
    "name with a line end and a colour": (
        lambda p: ["validate", "a\n\x1b[31mb.json"], "a\\n\\x1b[31mb.json: error: no such file", ""),
    "name like markup": (lambda p: ["validate", "[/]x[red].json"], "[/]x[red].json: error: no such file", ""),
    # --- planning problems
    "facts with unknown predicate": (
        lambda p: ["synthesize", p.write("q.lp", "state(1). stat(2).\n")], "q.lp:1", "stat"),
    "facts nested too deeply": (lambda p: ["synthesize", p.write("q.lp", "state(" * 30000)], "nested too deeply", ""),
    "facts without end": (lambda p: ["synthesize", p.write("q.lp", "state(1). goal(\n")], "q.lp:1", ""),
    "facts with a rule": (lambda p: ["synthesize", p.write("q.lp", "state(X) :- X = 1.\n")], "q.lp:1", ""),
    "no facts": (lambda p: ["synthesize", p.write("q.lp", "")], "q.lp", ""),
    "PDDL without problem": (lambda p: ["synthesize", p.write("d.pddl", DOMAIN)], "d.pddl", ""),
    # --- places
    "output is a file": (
        lambda p: ["learn", "unstack", "-q", "--out", p.write("taken", "mine")], "taken", "not replaced"),
    "output is somebody's folder": (
        lambda p: ["learn", "unstack", "-q", "--out", p.write("own/notes.txt", "mine") and "own"],
        "own", "not replaced"),
    "output is a link to nowhere": (
        lambda p: ["learn", "unstack", "-q", "--out", p.loop("loop")], "loop", "leads nowhere"),
    "output below a file": (
        lambda p: ["learn", "unstack", "-q", "--out", p.write("taken", "mine") + "/policy"], "taken", "hint: choose"),
    "output with a name of 300 characters": (
        lambda p: ["learn", "unstack", "-q", "--max-complexity", "3", "--out", "n" * 300], "name too long", "hint:"),
    "output below a link to itself": (
        lambda p: ["learn", "unstack", "-q", "--out", p.loop("l") + "/policy"], "l/policy: error", "hint: choose"),
    "task name of 5000 characters": (lambda p: ["learn", "a/" + "b" * 5000], "bbb", "no such"),
    "plan into a file's folder": (
        lambda p: ["solve", "unstack", "--size", "2", "-q", "--out", p.write("taken", "mine") + "/plan.json"],
        "taken", "cannot write"),
    "picture into a file's folder": (
        lambda p: ["solve", "unstack", "--size", "2", "-q", "--render", p.write("taken", "mine") + "/plan.png"],
        "taken", "cannot write"),
    "compile into a file": (
        lambda p: ["compile", "runs/unstack", "--out", p.write("taken", "mine")], "taken", "cannot write"),
}  # fmt: skip
OUTCOMES = {"scene without room": {1, 2}, "plan with a list as action": {1, 2}}


@pytest.mark.parametrize("case", CASES)
def test_a_mistake_is_explained(case, place, monkeypatch, capsys):
    make, first, second = CASES[case]
    arguments = make(place)
    before = {p: p.read_bytes() for p in place.folder.rglob("*") if p.is_file()}
    code, said = gentamp(monkeypatch, capsys, arguments)
    assert code in OUTCOMES.get(case, {2}), said
    assert first in said and second in said, said
    after = {p: p.read_bytes() for p in place.folder.rglob("*") if p.is_file() and p.suffix != ".pyc"}
    assert after == before, f"left behind: {set(after) ^ set(before)}"


def test_a_folder_that_is_read_only_or_gone(place, monkeypatch, capsys):
    """Nothing is learned for a place that cannot be written (for root all can: `access` is asked)."""
    monkeypatch.setattr(os, "access", lambda path, mode: Path(path) != place.folder)
    code, said = gentamp(monkeypatch, capsys, ["learn", "unstack", "--out", "p"])
    assert code == 2 and said.startswith("p: error: cannot write the policy: no place in") and "hint: choose" in said
    (place.folder / "gone").mkdir()
    monkeypatch.chdir(place.folder / "gone")
    (place.folder / "gone").rmdir()
    code, said = gentamp(monkeypatch, capsys, ["learn", "unstack"])
    monkeypatch.chdir(place.folder)
    assert code == 2 and "the current folder is gone" in said, said


def test_names_are_not_markup(place, monkeypatch, capsys):
    """Messages that end well show brackets and colons in names as they are."""
    for arguments, name in (
        (["solve", "unstack", "--size", "2", "-q", "--out"], "[/]:smile:.json"),
        (["compile", "runs/unstack", "--out"], "[/b]"),
        (["report", "runs/unstack", "-q", "--out"], "[/red]x.html"),
    ):
        code, said = gentamp(monkeypatch, capsys, [*arguments, name])
        assert code == 0 and name in said, said


def rewritten(place, change):
    """Change every text file of a task, a domain, a grammar, a bundle and a plan; the commands that read them."""
    place.coins()
    place.write("g.lp", "% nothing\ncap(pool, 1000).\n")
    place.write("q.lp", "state(1). state(2). initialState(1). goal(2).\naction(go). transition(1, go, 2).\n")
    place.write("task.yaml", UNSTACK)
    for path in place.folder.rglob("*"):
        if path.is_file() and path.suffix in (".lp", ".pl", ".pddl", ".yaml", ".json"):
            path.write_bytes(change(path.read_bytes()))
    return [
        ["check", "task.yaml", "coins.yaml", "g.lp", "--trust"],
        ["validate", "runs/unstack"],
        ["validate", "plan.json"],
        ["explain", "runs/unstack"],
        ["synthesize", "q.lp"],
        ["features", "task.yaml", "--max-complexity", "1", "--grammar", "g.lp"],
    ]


@pytest.mark.parametrize(
    "change",
    [lambda text: b"\xef\xbb\xbf" + text, lambda text: text.replace(b"\n", b"\r\n")],
    ids=["byte order mark", "carriage returns"],
)
def test_files_of_other_systems_are_read(change, place, monkeypatch, capsys):
    for arguments in rewritten(place, change):
        code, said = gentamp(monkeypatch, capsys, arguments)
        assert code == 0, (arguments, said)


@pytest.mark.parametrize(
    ("arguments", "redirect", "environment"),
    [
        ("explain runs/unstack", ">&-", {}),
        ("features unstack --max-complexity 1", ">&-", {}),
        ("explain runs/unstack", "2>&- <&-", {}),
        ("explain runs/unstack", "", {"PYTHONIOENCODING": "ascii"}),
        ("features unstack --max-complexity 1", "", {"PYTHONIOENCODING": "latin-1"}),
        ("features unstack --max-complexity 1", "", {"LC_ALL": "C"}),
        ("features unstack --max-complexity 1", "", {"LC_ALL": "C", "PYTHONUTF8": "0", "PYTHONCOERCECLOCALE": "0"}),
        ("features unstack --max-complexity 1 --time-limit inf", "", {}),
    ],
)
def test_a_poor_terminal_is_no_mistake(arguments, redirect, environment, place):
    """Closed streams and locales without the signs of logic change what is seen, not whether it works."""
    command = f'"{sys.executable}" -m gentamp_lp {arguments} {redirect}'
    done = subprocess.run(["sh", "-c", command], env={**os.environ, **environment}, capture_output=True, timeout=300)
    said = done.stdout + done.stderr
    assert done.returncode == 0 and b"Traceback" not in said, said.decode(errors="replace")
    assert ">&-" in redirect or said


@pytest.mark.parametrize("unbuffered", ["", "1"])
@pytest.mark.parametrize(
    ("command", "code", "words"),
    [
        ("set -o pipefail; {} --help | true", 141, ""),
        ("set -o pipefail; {} schema task | true", 141, ""),
        ("set -o pipefail; {} check no.yaml 2>&1 | true", 141, ""),
        ("ulimit -f 0; {} schema task > out", 2, "error: cannot write the output: File too large\n  hint:"),
    ],
)
def test_output_that_is_lost_is_no_answer(command, code, words, unbuffered, place):
    """Not 0, and not the 1 of a negative answer: 141 as after SIGPIPE where nobody reads, 2 on a full disk."""
    done = subprocess.run(
        ["bash", "-c", command.format(f'"{sys.executable}" -m gentamp_lp')],
        env={**os.environ, "PYTHONUNBUFFERED": unbuffered},
        capture_output=True,
        text=True,
        timeout=300,
    )
    assert done.returncode == code and words in done.stderr and "Traceback" not in done.stderr, done
    assert words or not done.stderr
