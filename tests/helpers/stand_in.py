"""A stand-in for the original PDDLStream: its names, our engine."""

from pathlib import Path

#: A package with the names that the adapter uses; what `solve` does is filled in.
STAND_IN = {
    "pddlstream/__init__.py": "",
    "pddlstream/algorithms/__init__.py": "",
    "pddlstream/language/__init__.py": "",
    "pddlstream/language/constants.py": "from gentamp_lp.streams import PDDLProblem",
    "pddlstream/language/generator.py": "from gentamp_lp.streams import from_gen_fn, from_test",
    "pddlstream/algorithms/meta.py": """
import pathlib
from gentamp_lp import streams
def solve(problem, algorithm, max_time, verbose):
    pathlib.Path("temp").mkdir()  # as the original does, in the current folder
    print("Summary: {}")
    plan, cost, certificate = streams.solve(problem, algorithm, max_time=max_time)
    return CHANGE
""",
}


def write_stand_in(folder: Path, change: str = "(plan, cost, certificate)") -> None:
    """Write the package; `change` is what its `solve` returns."""
    for name, text in STAND_IN.items():
        path = folder / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text.replace("CHANGE", change))
