"""What is installed, where it was found, and how to get what is missing."""

from __future__ import annotations

import shutil
import subprocess
import sys
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from importlib.metadata import PackageNotFoundError, distribution
from pathlib import Path

from gentamp_lp.base.shipped import resource
from gentamp_lp.errors import InputError
from gentamp_lp.solvers.processes import python
from gentamp_lp.streams.downward import binary

#: distribution name -> what it is for
PACKAGES = {
    "clingo": "abstraction and policy (ASP)",
    "pyswip": "bridge to SWI-Prolog",
    "up-fast-downward": "classical planner",
    "fast-downward-translate": "its translator",
    "pybullet": "kinematics, validation, pictures",
    "python-fcl": "collision checks",
    "trimesh": "shapes",
    "numpy": "arrays",
}


@dataclass(frozen=True)
class Finding:
    """One line of the report."""

    name: str
    ok: bool
    detail: str
    remedy: str = ""


def examine() -> list[Finding]:
    """Check everything the commands need."""
    return [_python(), _swipl(), _bridge(), *_packages(), _planner(), *_data()]


def _python() -> Finding:
    version = ".".join(map(str, sys.version_info[:3]))
    return Finding(
        "Python",
        sys.version_info >= (3, 11),
        f"{version} at {sys.executable}",
        "install Python 3.11 or newer",
    )


def _swipl() -> Finding:
    remedy = "apt-get install swi-prolog-nox (Debian, Ubuntu) or see swi-prolog.org"
    path = shutil.which("swipl")
    if path is None:
        return Finding("SWI-Prolog", False, "no `swipl` on the PATH", remedy)
    run = subprocess.run([path, "--version"], capture_output=True, text=True, check=False)
    return Finding("SWI-Prolog", run.returncode == 0, f"{run.stdout.strip()} at {path}", remedy)


def _bridge() -> Finding:
    """Load the Prolog library in a process of its own: a broken one can end the process that tries."""
    goal = "current_prolog_flag(version, V), write(V)"
    code = f"from gentamp_lp.solvers.prolog import Prolog; print(Prolog().text({goal!r}))"
    run = subprocess.run(python(code), capture_output=True, text=True, check=False)
    last = (run.stdout if run.returncode == 0 else run.stderr).strip().splitlines()[-1:] or ["no answer"]
    remedy = "set LIBSWIPL_PATH and SWI_HOME_DIR to the library and home that `swipl --dump-runtime-variables` prints"
    return Finding("libswipl through pyswip", run.returncode == 0, last[0].strip(), remedy)


def _packages() -> Iterator[Finding]:
    for name, purpose in PACKAGES.items():
        try:
            found = distribution(name)
            yield Finding(name, True, f"{found.version}, {purpose}")
        except PackageNotFoundError:
            yield Finding(name, False, f"not installed ({purpose})", f"pip install {name}")


def _planner() -> Finding:
    return _try("Fast Downward", lambda: str(binary()), "pip install up-fast-downward")


def _try(name: str, find: Callable[[], str], remedy: str) -> Finding:
    try:
        return Finding(name, True, find())
    except InputError as error:
        return Finding(name, False, error.diagnostics[0].message, remedy)


def _data() -> Iterator[Finding]:
    for folder in ("logic", "asp", "domains", "tasks"):
        path: Path = resource(folder)
        yield Finding(f"{folder}/", path.is_dir(), str(path), "reinstall gentamp-lp")
