"""Wheel and sdist carry what they should, and what is installed from them works from an empty folder."""

import os
import re
import subprocess
import sys
import tarfile
import tomllib
from email.parser import Parser
from importlib.metadata import packages_distributions
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]


@pytest.fixture(scope="module")
def built(tmp_path_factory):
    """The folder of an sdist, and of the wheel that is built from it."""
    out = tmp_path_factory.mktemp("built")
    subprocess.run(
        [sys.executable, "-m", "build", "--no-isolation", "--outdir", str(out), str(ROOT)],
        check=True,
        capture_output=True,
    )
    return out


@pytest.fixture(scope="module")
def unpacked(built):
    (wheel,) = built.glob("*.whl")
    command = [
        sys.executable,
        "-m",
        "pip",
        "install",
        "--quiet",
        "--no-deps",
        "--no-compile",
        "--target",
        built / "site",
        wheel,
    ]
    subprocess.run(command, check=True, capture_output=True)
    return built / "site"


def test_the_sdist_has_what_is_tracked(built):
    (sdist,) = built.glob("*.tar.gz")
    with tarfile.open(sdist) as archive:
        there = {name.split("/", 1)[1] for name in archive.getnames()}
    tracked = subprocess.run(["git", "ls-files"], cwd=ROOT, capture_output=True, text=True, check=True).stdout.split(
        "\n"
    )
    assert {name for name in tracked if name and not name.startswith(".ci/")} <= there
    assert not [
        name for name in there if name.startswith(("runs/", ".ci/", "build/", ".git/")) or "__pycache__" in name
    ]


def test_the_metadata_says_what_users_need(unpacked):
    (folder,) = unpacked.glob("gentamp_lp-*.dist-info")
    metadata = Parser().parsestr((folder / "METADATA").read_text(encoding="utf-8"))
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    assert metadata["License-Expression"] == "MIT" and (folder / "licenses" / "LICENSE").is_file()
    assert metadata["Requires-Python"] == ">=3.11" and metadata["Description-Content-Type"] == "text/markdown"
    assert set(metadata.get_all("Provides-Extra")) == set(project["optional-dependencies"])
    required = [name for name in metadata.get_all("Requires-Dist") if "extra ==" not in name]
    assert len(required) == len(project["dependencies"])
    assert (unpacked / "gentamp_lp" / "py.typed").is_file()


def test_help_is_there_at_once(unpacked):
    """Of all that the package requires, only what declares the command line and its options is imported for it."""
    start = (
        "import atexit, sys; atexit.register(lambda: print(*sys.modules, file=sys.stderr))\n"
        "from gentamp_lp.cli.main import main; main()"
    )
    command = [sys.executable, "-c", start, "--help"]
    environment = {**os.environ, "PYTHONPATH": str(unpacked)}
    done = subprocess.run(command, env=environment, check=True, capture_output=True, text=True)
    assert "Usage" in done.stdout
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    required = {re.match(r"[\w.-]+", line)[0] for line in project["dependencies"]}
    modules = {name for name, owners in packages_distributions().items() if required & set(owners)}
    assert {"numpy", "pybullet", "clingo", "pyswip", "ruamel"} < modules
    assert {name.partition(".")[0] for name in done.stderr.split()} & modules == {"typer", "rich", "pydantic"}


def test_all_data_files_are_in_the_wheel(unpacked):
    for folder in ("logic", "asp", "domains", "tasks"):
        here = {p.relative_to(ROOT) for p in (ROOT / folder).rglob("*") if p.is_file() and "__pycache__" not in p.parts}
        there = {
            p.relative_to(unpacked / "gentamp_lp" / "_data")
            for p in (unpacked / "gentamp_lp" / "_data" / folder).rglob("*")
            if p.is_file()
        }
        assert here and here == there
    pages = [path.name for path in (ROOT / "gentamp_lp" / "report" / "assets").iterdir()]
    assert pages and all((unpacked / "gentamp_lp" / "report" / "assets" / name).is_file() for name in pages)
    assert not [path for path in unpacked.iterdir() if path.name in ("logic", "asp", "domains", "tasks", "tests")]


def test_the_wheel_works_in_an_empty_folder(unpacked, tmp_path):
    environment = {**os.environ, "PYTHONPATH": str(unpacked)}

    def run(*args):
        command = [sys.executable, "-m", "gentamp_lp", *args]
        return subprocess.run(command, cwd=tmp_path, env=environment, capture_output=True, text=True, check=True)

    assert str(unpacked) in run("doctor").stdout
    assert "optimal" in run("learn", "unstack", "--no-cache").stdout
    assert "valid" in run("solve", "unstack", "--size", "3", "--seed", "1").stdout
    assert {path.name for path in tmp_path.iterdir()} == {"runs"}


def test_the_wheel_works_in_a_checkout(unpacked, tmp_path):
    """Its child processes import it, too, not the package in the working directory."""
    environment = {**os.environ, "PYTHONPATH": str(unpacked)}
    start = "from gentamp_lp.cli.main import main; main()"

    def run(*args):
        command = [sys.executable, "-P", "-c", start, *args]
        return subprocess.run(command, cwd=ROOT, env=environment, capture_output=True, text=True)

    learned = run("learn", "tasks/unstack.yaml", "--no-cache", "--out", str(tmp_path / "unstack"))
    assert learned.returncode == 0 and "optimal" in learned.stdout, learned.stderr
    assert str(ROOT / "logic") not in run("doctor").stdout
    bench = ("bench", "unstack", "--sizes", "2", "--seeds", "1", "--modes", "guided", "--policies", str(tmp_path))
    done = run(*bench, "--out", str(tmp_path / "bench"))
    assert done.returncode == 0, done.stderr
