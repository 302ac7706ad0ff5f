"""Benchmarks: every run is a row, tables are continued, and the figures in the summary are right."""

import csv
import json
import os
import signal
import subprocess
import sys
import time
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from pathlib import Path

import pytest
from helpers.stand_in import write_stand_in

from gentamp_lp.bench.figure import draw
from gentamp_lp.bench.runs import GRACE, NAMES, Job, Row, append, cluster, learning_times, read_rows, run, summary
from gentamp_lp.cli.main import bench as command
from gentamp_lp.errors import InputError
from gentamp_lp.learning.learn import Learned

ROW = Row("unstack", "2", 0, "guided", "", 10.0, True, True, 1.0, 0.5, 0.4, 2, "guided", "", "0", "abc", "here")
LOST = replace(
    ROW, size="4", solved=False, valid=False, seconds=10.0, stream_seconds=None, stream_floor=None, plan_length=None,
    planner="", reason='no plan: "a, b"\nnone',
)  # fmt: skip


@pytest.fixture(scope="module")
def policies(unstack: Learned, tmp_path_factory) -> Path:
    folder = tmp_path_factory.mktemp("policies")
    unstack.save(folder / "unstack")
    return folder


def bench(*args: str, cwd: Path) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [sys.executable, "-m", "gentamp_lp", "bench", *args], cwd=cwd, capture_output=True, text=True, timeout=600
    )


def test_rows_are_read_back_and_a_torn_one_is_cut_off(tmp_path: Path) -> None:
    table = tmp_path / "results.csv"
    assert read_rows(table) == []
    for row in (ROW, LOST):
        append(table, row)
    assert read_rows(table) == [ROW, LOST]
    whole = table.read_bytes()
    table.write_bytes(whole + b"unstack,2,1,gui")
    assert read_rows(table) == [ROW, LOST]
    assert table.read_bytes() == whole


def test_another_table_is_refused(tmp_path: Path) -> None:
    table = tmp_path / "results.csv"
    table.write_text("a,b\n1,2\n")
    with pytest.raises(InputError, match="not a table of `bench`"):
        read_rows(table)
    assert table.read_text() == "a,b\n1,2\n"


def test_the_original_is_asked_for_before_any_run(tmp_path: Path) -> None:
    result = bench("unstack", "--modes", "original", "--sizes", "2", "--seeds", "1", "--out", "b", cwd=tmp_path)
    assert result.returncode == 2 and "PDDLStream cannot be imported" in result.stderr
    assert not (tmp_path / "b").exists()


def test_the_original_is_a_baseline(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    write_stand_in(tmp_path / "site")
    monkeypatch.setenv("PYTHONPATH", f"{tmp_path / 'site'}{os.pathsep}{os.environ.get('PYTHONPATH', '')}")
    common = (
        "unstack",
        "--modes",
        "original,original-incremental",
        "--sizes",
        "2",
        "--seeds",
        "1",
        "--robot",
        "gripper",
    )
    result = bench(*common, "--out", "b", "--json", cwd=tmp_path)
    assert result.returncode == 0, result.stderr
    rows = read_rows(tmp_path / "b" / "results.csv")
    assert [(row.mode, row.planner, row.valid) for row in rows] == [
        ("original", "adaptive", True), ("original-incremental", "incremental", True),
    ]  # fmt: skip


def test_summary(tmp_path: Path) -> None:
    """By hand: 1, 2, 6 have mean 3, standard deviation sqrt 7, and t(0.975, 2) = 4.3027."""
    rows = [replace(ROW, seed=i, seconds=s, stream_floor=0.5) for i, s in enumerate((1.0, 2.0, 6.0))]
    cell, lost = summary([*rows, LOST])
    assert (cell.runs, cell.solved, cell.median, cell.mean, cell.plan_length) == (3, 3, 2.0, 3.0, 2)
    assert cell.ratio == 4.0 and cell.low == 0.0
    assert cell.high == pytest.approx(3 + 4.3027 * 7**0.5 / 3**0.5, abs=1e-3)
    assert (lost.solved, lost.mean, lost.low, lost.high, lost.ratio) == (0, 10.0, 10.0, 10.0, None)
    draw([cell, lost], 10.0, tmp_path / "figure.svg")
    assert "<svg" in (tmp_path / "figure.svg").read_text()
    elsewhere = replace(lost, task="zoo", mode="skeleton-incremental")
    draw([cell, elsewhere], 10.0, tmp_path / "figure.svg")
    legend = (tmp_path / "figure.svg").read_text().split('id="legend_1"')[1]
    assert f"<!-- {cell.mode} -->" in legend and "<!-- skeleton-incremental -->" in legend


def test_a_benchmark_is_continued(policies: Path, tmp_path: Path) -> None:
    common = ("unstack", "--modes", "guided", "--policies", str(policies), "--out", "b", "--robot", "gripper")
    first = bench(*common, "--sizes", "2", "--seeds", "1", "--json", cwd=tmp_path)
    assert first.returncode == 0, first.stderr
    table = tmp_path / "b" / "results.csv"
    before = table.read_text()
    second = bench(*common, "--sizes", "2,3", "--seeds", "1", "--timeout", "120", "--json", cwd=tmp_path)
    assert second.returncode == 0 and table.read_text().startswith(before)
    rows = list(csv.DictReader(table.open()))
    assert list(rows[0]) == NAMES
    assert [(r["size"], r["mode"]) for r in rows] == [("2", "guided"), ("3", "guided")]
    assert all(r["valid"] == "True" and float(r["stream_floor"]) >= 0 for r in rows)
    document = json.loads(second.stdout)
    assert [(c["size"], c["solved"]) for c in document["summary"]] == [("2", 1), ("3", 1)]
    assert document["learning"][0]["paper"] == 119.7 and document["learning"][0]["seconds"] > 0
    assert (tmp_path / "b" / "comparison.svg").exists()


def test_ctrl_c_leaves_a_table(policies: Path, tmp_path: Path) -> None:
    words = ["bench", "unstack", "--modes", "unguided", "--seeds", "50", "--sizes", "2", "--out", "b"]
    process = subprocess.Popen([sys.executable, "-m", "gentamp_lp", *words], cwd=tmp_path, stderr=subprocess.PIPE)
    table = tmp_path / "b" / "results.csv"
    while not table.exists() or table.read_text().count("\n") < 2:
        assert process.poll() is None
        time.sleep(0.1)
    os.kill(process.pid, signal.SIGINT)
    _, errors = process.communicate(timeout=60)  # 50 runs take longer
    assert process.returncode == 130 and b"Traceback" not in errors
    assert 1 <= len(read_rows(table)) < 50


def test_runs_that_fail_are_rows(policies: Path, tmp_path: Path) -> None:
    jobs = [
        Job("unstack", "16", 1, "unguided", "gripper", 0.1, ""),
        Job("unstack", "900", 0, "guided", "panda", 5.0, str(policies / "unstack")),  # no room on the table
    ]
    with ThreadPoolExecutor(2) as executor:
        rows = {row.size: row for row in run(jobs, tmp_path / "results.csv", executor)}
    assert not rows["16"].solved and "time limit" in rows["16"].reason
    assert not rows["900"].solved and "no free reachable place" in rows["900"].reason
    assert GRACE > 0 and rows["900"].seconds == 5.0


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"modes": "guided,lucky"}, "unknown mode `lucky`"),
        ({"modes": "unguided", "sizes": "2-2"}, "is not a size"),
        ({}, "gentamp-lp learn unstack"),
        ({"modes": "skeleton-incremental"}, "gentamp-lp learn unstack"),
        ({"modes": "unguided", "scheduler": "tcp://127.0.0.1:9"}, "no Dask scheduler"),
    ],
)
def test_mistakes_are_named(options: dict[str, str], message: str, tmp_path: Path, monkeypatch) -> None:
    monkeypatch.chdir(tmp_path)
    with pytest.raises(InputError, match=message):
        command(["unstack"], **options)
    assert list(tmp_path.iterdir()) == []


def test_a_cluster_makes_the_runs(tmp_path: Path) -> None:
    distributed = pytest.importorskip("distributed", reason="the extra `bench` is not installed")
    job = Job("unstack", "2", 0, "unguided", "gripper", 60.0, "")
    with (
        distributed.LocalCluster(n_workers=1, threads_per_worker=1, dashboard_address=None) as local,
        cluster(local.scheduler_address) as executor,
    ):
        rows = run([job], tmp_path / "results.csv", executor)
    assert [row.valid for row in rows] == [True]


def test_skeletons_are_followed_by_both_algorithms(policies: Path, tmp_path: Path) -> None:
    modes = ("skeleton", "skeleton-incremental")
    jobs = [Job("unstack", "4", 0, mode, "gripper", 60.0, str(policies / "unstack")) for mode in modes]
    with ThreadPoolExecutor(2) as executor:
        rows = run(jobs, tmp_path / "results.csv", executor)
    assert {row.mode for row in rows if row.valid} == set(modes)
    draw(summary(rows), 60.0, tmp_path / "figure.svg")
    assert (tmp_path / "figure.svg").stat().st_size > 0


def test_learning_times_need_a_report(policies: Path, tmp_path: Path) -> None:
    assert learning_times({"sort": tmp_path}) == []
    (row,) = learning_times({"unstack": policies / "unstack"})
    assert row.task == "unstack" and row.paper == 119.7
