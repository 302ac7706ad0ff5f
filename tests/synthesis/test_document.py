"""docs/synthesis.md says what the program does."""

import os
import re
import subprocess
import sys
from pathlib import Path

from gentamp_lp.synthesis import read_problem, synthesize

ROOT = Path(__file__).parents[2]
TEXT = (ROOT / "docs" / "synthesis.md").read_text()


def test_the_session(tmp_path):
    block = re.search(r"```console\n(.*?)```", TEXT, re.DOTALL)[1]
    (tmp_path / "docs").symlink_to(ROOT / "docs")
    for part in block.split("$ gentamp-lp ")[1:]:
        command, wanted = part.split("\n", 1)
        done = subprocess.run(
            [sys.executable, "-m", "gentamp_lp", *command.split()],
            capture_output=True,
            text=True,
            cwd=tmp_path,
            env={**os.environ, "NO_COLOR": "1", "PYTHONPATH": str(ROOT)},
        )
        assert mask(done.stdout) == mask(wanted)


def mask(text):
    return re.sub(r"\d+\.\d\d s", "0 s", text)


def test_the_table():
    rows = re.findall(r"^\| `([\w.-]+)`: [^|]*\| ([\d,]+) \| ([\w-]+) \| (\d+|–) \|", TEXT, re.MULTILINE)
    files = {path.name for path in (ROOT / "docs" / "examples" / "08-qnp").iterdir()}
    assert {row[0] for row in rows} == files
    for name, states, level, size in rows:
        problem = read_problem([ROOT / "docs" / "examples" / "08-qnp" / name])
        found = synthesize(problem, minimize=True)
        assert f"{len(problem.states):,}" == states
        assert (
            (found.fairness, str(len(found.policy))) == (level, size)
            if found.solvable
            else (level, size)
            == (
                "none",
                "–",
            )
        )
