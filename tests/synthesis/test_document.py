"""The table of docs/synthesis.md says what the program finds (its commands: tests/test_documentation.py)."""

import re
from pathlib import Path

from gentamp_lp.synthesis import read_problem, synthesize

ROOT = Path(__file__).parents[2]
TEXT = (ROOT / "docs" / "synthesis.md").read_text()


def test_the_table():
    rows = re.findall(r"^\| `([\w.-]+)`: [^|]*\| ([\d,]+) \| ([\w-]+) \| (\d+|–) \|", TEXT, re.MULTILINE)
    files = {path.name for path in (ROOT / "docs" / "examples" / "08-qnp").glob("*.[lp]*")}
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
