"""The wheel carries everything and works from an empty folder."""

import os
import subprocess
import sys
import zipfile
from pathlib import Path

import pytest

ROOT = Path(__file__).parent.parent


@pytest.fixture(scope="module")
def unpacked(tmp_path_factory):
    out = tmp_path_factory.mktemp("wheel")
    command = [sys.executable, "-m", "build", "--wheel", "--no-isolation", "--outdir", str(out), str(ROOT)]
    subprocess.run(command, check=True, capture_output=True)
    (wheel,) = out.glob("*.whl")
    with zipfile.ZipFile(wheel) as archive:
        archive.extractall(out / "site")
    return out / "site"


def test_all_data_files_are_in_the_wheel(unpacked):
    for folder in ("logic", "asp", "domains", "tasks"):
        here = {p.relative_to(ROOT) for p in (ROOT / folder).rglob("*") if p.is_file() and "__pycache__" not in p.parts}
        there = {
            p.relative_to(unpacked / "gentamp_lp" / "_data")
            for p in (unpacked / "gentamp_lp" / "_data" / folder).rglob("*")
            if p.is_file()
        }
        assert here and here == there
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
