"""A process that is killed at any moment leaves no child behind, and nothing that the same command stumbles over."""

import csv
import json
import os
import random
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from helpers.processes import left_alive

LEARN = ("learn", "unstack", "--max-complexity", "3", "--out", "bundle", "--quiet")
BENCH = ("bench", "unstack", "--modes", "unguided", "--sizes", "2", "--seeds", "2", "--out", "table", "--quiet")


class Place:
    """A folder to work in with a cache of its own."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        folder.mkdir()

    def start(self, *args: str) -> subprocess.Popen[bytes]:
        return subprocess.Popen(
            [sys.executable, "-m", "gentamp_lp", *args],
            cwd=self.folder,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            env={**os.environ, "XDG_CACHE_HOME": str(self.folder / "cache"), "TMPDIR": str(self.folder)},
            start_new_session=True,
        )

    def run(self, *args: str) -> float:
        """Run to the end; the seconds it took."""
        started = time.monotonic()
        process = self.start(*args)
        _, errors = process.communicate(timeout=300)
        assert process.returncode == 0, errors.decode()
        return time.monotonic() - started

    def run_and_kill(self, seconds: float, *args: str) -> None:
        process = self.start(*args)
        time.sleep(seconds)
        process.kill()
        process.communicate(timeout=300)
        assert left_alive(process.pid) == []


def learned(folder: Path) -> dict[str, Any]:
    """The bundle but for what clocks say; the policy must be there whole."""
    files = {path.name: path.read_text() for path in (folder / "bundle").iterdir()}
    report = json.loads(files.pop("report.json"))
    del report["seconds"], report["pool_statistics"]["seconds"]
    return {**files, "report.json": report}


def measured(folder: Path) -> list[tuple[str, ...]]:
    """The rows of the table but for what clocks say, in any order."""
    with (folder / "table" / "results.csv").open(newline="") as file:
        return sorted((r["task"], r["size"], r["seed"], r["valid"], r["plan_length"]) for r in csv.DictReader(file))


@pytest.mark.parametrize(("command", "result"), [(LEARN, learned), (BENCH, measured)], ids=["learn", "bench"])
@pytest.mark.parametrize("times", [1, pytest.param(100, marks=pytest.mark.slow)])
def test_the_same_command_succeeds_after_kills(
    command: tuple[str, ...], result: Callable[[Path], Any], times: int, tmp_path: Path
) -> None:
    undisturbed = Place(tmp_path / "undisturbed")
    needed = undisturbed.run(*command)
    expected = result(undisturbed.folder)
    moments = random.Random(times)
    for number in range(times):
        place = Place(tmp_path / str(number))
        place.run_and_kill(moments.uniform(0.0, needed), *command)
        if number % 2:  # a second kill, of the command that finds the remains of the first
            place.run_and_kill(moments.uniform(0.0, needed), *command)
        place.run(*command)
        assert result(place.folder) == expected, f"kill {number}"
