"""Tasks, grammars, bundles, plans, robots and QNPs at random: a diagnosis or a result, never a traceback."""

import json
import math
import random
import re
import signal
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any

import pytest

from gentamp_lp import Policy, Task
from gentamp_lp.base.shipped import resource
from gentamp_lp.errors import GentampError
from gentamp_lp.features.pool import check_grammars
from gentamp_lp.geometry.description import load_description
from gentamp_lp.planning.solve import solve
from gentamp_lp.plans.plan import Plan
from gentamp_lp.plans.validate import validate
from gentamp_lp.synthesis.reading import read_problem

BUNDLE = Path(__file__).parents[1] / "policies" / "transport"
QNP = Path(__file__).parents[2] / "docs" / "examples" / "08-qnp"
TOKENS = re.compile(r"[\w.-]+|\s+|.", re.DOTALL)
ODD = ("", "0", "-1", "1e308", "9" * 30, ".nan", "null", "{}", "[]", "~", "\0", "é", "'", '"', "(", ")", "?x", ":-",
       "%*", "a" * 3000, "[[", "- ", "&a", "*a", "!!python/object:os.system")  # fmt: skip
VALUES: tuple[Any, ...] = (None, True, 0, -1, 1e308, math.nan, 10**30, "", "x", [], {}, [[]], {"x": 1}, ["x", 3])


def mangled(text: str, rng: random.Random) -> str:
    """A text with some of its words deleted, replaced, doubled or swapped, or cut short."""
    words = TOKENS.findall(text)
    for _ in range(rng.randint(1, 4)):
        here, there = rng.randrange(len(words)), rng.randrange(len(words))
        match rng.randrange(6):
            case 0:
                del words[here : here + rng.randint(1, 6)]
            case 1:
                words[here] = rng.choice(ODD)
            case 2:
                words.insert(here, words[there])
            case 3:
                words[here], words[there] = words[there], words[here]
            case 4:
                words[here] = words[there]
            case _:
                if rng.random() < 0.2:
                    words = words[: here + 1]
        words = words or [" "]
    return "".join(words)


def replaced(data: Any, rng: random.Random) -> Any:
    """A document with one of its parts replaced or left out."""
    if isinstance(data, dict) and data and rng.random() < 0.85:
        key = rng.choice(list(data))
        if rng.random() < 0.1:
            return {k: v for k, v in data.items() if k != key}
        return {**data, key: replaced(data[key], rng)}
    if isinstance(data, list) and data and rng.random() < 0.85:
        here = rng.randrange(len(data))
        if rng.random() < 0.1:
            return data[:here] + data[here + 1 :]
        return [*data[:here], replaced(data[here], rng), *data[here + 1 :]]
    return rng.choice(VALUES)


def task(folder: Path, rng: random.Random) -> None:
    name = rng.choice(["unstack", "sort", "load", "transport"])
    path = folder / "task.yaml"
    path.write_text(mangled(resource("tasks", f"{name}.yaml").read_text(encoding="utf-8"), rng), encoding="utf-8")
    loaded = Task.load(path)
    loaded.instance(loaded.file.train[0], seed=0)


def grammar(folder: Path, rng: random.Random) -> None:
    path = folder / "rules.lp"
    path.write_text(mangled(resource("logic", "grammar.lp").read_text(encoding="utf-8"), rng), encoding="utf-8")
    check_grammars([path])


def bundle(folder: Path, rng: random.Random) -> None:
    for name in ("policy.lp", "features.pl", "report.json"):
        text = (BUNDLE / name).read_text(encoding="utf-8")
        (folder / name).write_text(mangled(text, rng) if rng.random() < 0.5 else text, encoding="utf-8")
    policy = Policy.load(folder)
    policy.check()
    policy.text()


@cache
def plan_text() -> str:
    found = solve(Task.load("unstack"), 2, 0, robot="gripper").plan
    assert found is not None
    return json.dumps(found.to_json())


def plan(folder: Path, rng: random.Random) -> None:
    data = json.loads(plan_text())
    for _ in range(rng.randint(1, 3)):
        data = replaced(data, rng)
    path = folder / "plan.json"
    path.write_text(json.dumps(data) if rng.random() < 0.9 else mangled(plan_text(), rng), encoding="utf-8")
    loaded = Plan.load(path)
    validate(loaded, Task.load(loaded.task))


def robot(folder: Path, rng: random.Random) -> None:
    text = resource("gentamp_lp", "geometry", "descriptions", "panda.yaml").read_text(encoding="utf-8")
    path = folder / "panda.yaml"
    path.write_text(mangled(text, rng), encoding="utf-8")
    load_description(path)


def qnp(folder: Path, rng: random.Random) -> None:
    source = rng.choice(sorted(QNP.glob("*.lp")))
    path = folder / "problem.lp"
    path.write_text(mangled(source.read_text(encoding="utf-8"), rng), encoding="utf-8")
    read_problem([path])


KINDS: dict[Callable[[Path, random.Random], None], tuple[int, int]] = {  # how many by default, and in a sweep
    task: (40, 3000),
    grammar: (4, 300),
    bundle: (60, 3000),
    plan: (40, 2000),
    robot: (60, 3000),
    qnp: (60, 3000),
}
_SECONDS = 60  # for one file


@pytest.mark.parametrize(
    ("kind", "seeds"),
    [
        *(pytest.param(kind, range(few), id=kind.__name__) for kind, (few, _) in KINDS.items()),
        *(pytest.param(k, range(n), id=f"{k.__name__}-many", marks=pytest.mark.slow) for k, (_, n) in KINDS.items()),
    ],
)
def test_damaged_files_are_diagnosed(
    kind: Callable[[Path, random.Random], None], seeds: range, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)

    def too_long(*_: object) -> None:
        raise TimeoutError

    before = signal.signal(signal.SIGALRM, too_long)
    failed: dict[int, str] = {}
    for seed in seeds:
        signal.alarm(_SECONDS)
        try:
            kind(tmp_path, random.Random(seed))
        except GentampError as error:
            assert str(error)
        except Exception as error:
            failed[seed] = repr(error)
        finally:
            signal.alarm(0)
    signal.signal(signal.SIGALRM, before)
    assert failed == {}
