"""The comparison of planning modes: one process a run, one row a run, resumed where it stopped."""

from __future__ import annotations

import csv
import io
import json
import os
import platform
import resource
import socket
import subprocess
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from concurrent.futures import Executor, as_completed
from contextlib import contextmanager
from dataclasses import asdict, dataclass, fields
from pathlib import Path
from statistics import mean, median, stdev

import numpy as np

from gentamp_lp.base.documents import Document
from gentamp_lp.base.reading import read_text
from gentamp_lp.base.version import __version__
from gentamp_lp.base.writing import write_text, writing
from gentamp_lp.errors import Diagnostic, InputError
from gentamp_lp.policy.learn_report import read_report
from gentamp_lp.solvers.processes import module, start
from gentamp_lp.tasks.task import Task

MODES = {  # name -> options of `solve`
    "guided": ("--mode", "guided"),
    "unguided": ("--mode", "unguided"),
    "adaptive": ("--mode", "unguided", "--algorithm", "adaptive"),
    "incremental": ("--mode", "unguided", "--algorithm", "incremental"),
    "skeleton": ("--mode", "skeleton"),
    "skeleton-incremental": ("--mode", "skeleton", "--algorithm", "incremental"),
    "original": ("--mode", "unguided", "--engine", "pddlstream"),
    "original-incremental": ("--mode", "unguided", "--engine", "pddlstream", "--algorithm", "incremental"),
}
MEMORY = 4 * 1024**3  # bytes of address space for a run, as in the paper
GRACE = 300.0  # seconds for drawing the instance and validating the plan, which the time limit does not cover
PAPER_LEARNING = {"unstack": 119.7, "sort": 1042.8, "clutter": 211.3, "transport": 69.9}  # seconds, its Table 1
_THREADS = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")  # one CPU a run

_running: set[subprocess.Popen[str]] = set()


@dataclass(frozen=True)
class Job:
    """One run to make; `policy` is the folder of a bundle."""

    task: str
    size: str
    seed: int
    mode: str
    robot: str
    timeout: float
    policy: str


@dataclass(frozen=True)
class Row:
    """One run, as `results.csv` has it. Times in seconds; None where there is no plan."""

    task: str
    size: str
    seed: int
    mode: str
    robot: str
    timeout: float
    solved: bool
    valid: bool
    seconds: float
    stream_seconds: float | None
    stream_floor: float | None
    plan_length: int | None
    planner: str
    reason: str
    version: str
    commit: str
    machine: str

    @property
    def key(self) -> tuple[str, str, int, str, str, float]:
        """What makes a run the same run."""
        return self.task, self.size, self.seed, self.mode, self.robot, self.timeout

    @classmethod
    def read(cls, texts: Mapping[str, str]) -> Row:
        """Read a line of the table. Raises KeyError or ValueError when it is not one."""

        def number(name: str) -> float | None:
            return float(texts[name]) if texts[name] else None

        length = int(texts["plan_length"]) if texts["plan_length"] else None
        return cls(
            texts["task"], texts["size"], int(texts["seed"]), texts["mode"], texts["robot"], float(texts["timeout"]),
            texts["solved"] == "True", texts["valid"] == "True", float(texts["seconds"]),
            number("stream_seconds"), number("stream_floor"), length,
            texts["planner"], texts["reason"], texts["version"], texts["commit"], texts["machine"],
        )  # fmt: skip


NAMES = [field.name for field in fields(Row)]


def jobs_of(
    tasks: Iterable[Task], modes: Sequence[str], sizes: Sequence[str], seeds: int, robot: str | None, timeout: float,
    policies: Path,
) -> list[Job]:  # fmt: skip
    """The runs of a comparison: every task, size (those that its file calls `test`, if none are given), seed and mode.

    Raises InputError for an unknown mode, a bad size, or a policy that is missing.
    """
    for mode in modes:
        if mode not in MODES:
            raise InputError(Diagnostic(f"unknown mode `{mode}`", hint=f"known: {', '.join(MODES)}"))
    follows = any("unguided" not in MODES[mode] for mode in modes)
    jobs = []
    for task in tasks:
        folder = (policies / task.name).resolve()
        if follows and not folder.is_dir():
            hint = f"run `gentamp-lp learn {task.reference}` first"
            raise InputError(Diagnostic(f"no policy in `{folder}`", hint=hint))
        for size in sizes or [str(size) for size in task.file.test]:
            task.parameters(size, np.random.default_rng(0))  # refuses what is no size
            jobs += [
                Job(task.reference, size, seed, mode, robot or "", timeout, str(folder))
                for seed in range(seeds)
                for mode in modes
            ]
    return jobs


def run_job(job: Job) -> Row:
    """Make one run in a process of its own, with 4 GB of memory and one thread."""
    words = [
        "solve", job.task, "--size", job.size, "--seed", str(job.seed),
        *MODES[job.mode], "--policy", job.policy, "--timeout", str(job.timeout), "--json", "--quiet",
    ]  # fmt: skip
    words += ["--floor"] + (["--robot", job.robot] if job.robot else [])
    process = start(
        module("gentamp_lp", *words),
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        env={**os.environ, **dict.fromkeys(_THREADS, "1"), "NO_COLOR": "1"},
    )
    resource.prlimit(process.pid, resource.RLIMIT_AS, (MEMORY, MEMORY))
    _running.add(process)
    try:
        output, errors = process.communicate(timeout=job.timeout + GRACE)
    except subprocess.TimeoutExpired:
        process.kill()
        output, errors = "", f"killed {GRACE:.0f} s after the time limit: {process.communicate()[1]}"
    finally:
        process.kill()
        _running.discard(process)
    if process.returncode == InputError.exit_code:
        raise InputError(Diagnostic(f"`gentamp-lp {' '.join(words)}` failed: {errors.strip()}"))
    report = json.loads(output) if output else {}
    problems = "; ".join(report.get("problems", ()))
    reason = report.get("reason") or problems or ("" if report else " ".join(errors.split())[-300:])
    return Row(
        job.task, job.size, job.seed, job.mode, job.robot, job.timeout,
        report.get("solved", False), report.get("valid", False), report.get("seconds", job.timeout),
        report.get("stream_seconds"), report.get("stream_floor"), report.get("plan_length"),
        report.get("planner", ""), reason, __version__, commit(), machine(),
    )  # fmt: skip


def commit() -> str:
    """The commit of the source tree that runs, with `+` when it was changed; empty outside a repository."""
    here = Path(__file__).parent
    answers = [
        subprocess.run(["git", *command], cwd=here, capture_output=True, text=True, check=False)
        for command in (("rev-parse", "--short=12", "HEAD"), ("status", "--porcelain", "--untracked-files=no"))
    ]
    if any(done.returncode for done in answers):
        return ""
    return answers[0].stdout.strip() + "+" * bool(answers[1].stdout.strip())


def machine() -> str:
    """Processor, number of processors, system, Python."""
    info = Path("/proc/cpuinfo")
    lines = info.read_text(encoding="utf-8").splitlines() if info.exists() else []
    model = next((line.split(":", 1)[1].strip() for line in lines if line.startswith("model name")), "")
    name = model or platform.machine()
    return f"{name}, {os.cpu_count()} CPUs, {platform.system()}, Python {platform.python_version()}"


def read_rows(path: Path) -> list[Row]:
    """The runs made so far; a line that was not written to its end is cut off. Raises InputError for another table."""
    if not path.exists():
        write_text(path, ",".join(NAMES) + "\n")
        return []
    text = read_text(path)
    whole = text[: text.rfind("\n") + 1]
    if whole != text:
        write_text(path, whole)
    try:
        return [Row.read(texts) for texts in csv.DictReader(io.StringIO(whole))]
    except (KeyError, ValueError, TypeError) as error:
        hint = "give another --out, or remove the file"
        raise InputError(Diagnostic(f"not a table of `bench`: {error!r}", path, hint=hint)) from None


def append(path: Path, row: Row) -> None:
    """Add a row in one write."""
    line = io.StringIO()
    csv.DictWriter(line, NAMES, lineterminator="\n").writerow(asdict(row))
    with writing(path), path.open("ab", buffering=0) as file:
        file.write(line.getvalue().encode())


def run(
    jobs: Iterable[Job], path: Path, executor: Executor, progress: Callable[[str], None] = lambda _: None
) -> list[Row]:
    """Make the runs that the table does not have yet, and return all its rows.

    After Ctrl-C, the running processes are ended and the table holds the finished runs.
    """
    rows = read_rows(path)
    done = {row.key for row in rows}
    wanted = [j for j in jobs if (j.task, j.size, j.seed, j.mode, j.robot, j.timeout) not in done]
    futures = [executor.submit(run_job, job) for job in wanted]
    try:
        for number, future in enumerate(as_completed(futures), 1):
            row = future.result()
            append(path, row)
            rows.append(row)
            outcome = f"{row.seconds:.2f} s" if row.valid else row.reason or "invalid"
            progress(f"{number}/{len(wanted)} {row.task} {row.size} seed {row.seed} {row.mode}: {outcome}")
    finally:
        for future in futures:
            future.cancel()
        for process in list(_running):
            process.kill()
    return rows


@contextmanager
def cluster(address: str) -> Iterator[Executor]:
    """The workers of a Dask cluster, which must see the same files. Raises InputError when it cannot be reached."""
    try:
        from distributed import Client
    except ImportError:
        hint = "pip install 'gentamp-lp[bench]'"
        raise InputError(Diagnostic("dask.distributed is not installed", hint=hint)) from None
    try:
        host, port = address.removeprefix("tcp://").rsplit(":", 1)
        socket.create_connection((host, int(port)), timeout=10).close()  # a client would go on trying in vain
    except (OSError, ValueError) as error:
        raise InputError(Diagnostic(f"no Dask scheduler at `{address}`: {error}")) from None
    with Client(address) as client:  # type: ignore[no-untyped-call]
        yield client.get_executor()


@dataclass(frozen=True)
class Cell:
    """All runs of one task, size and mode. An unsolved run counts with the time limit.

    `low` and `high` bound the mean of `seconds` with 95 % confidence (Student's t).
    """

    task: str
    size: str
    mode: str
    runs: int
    solved: int
    median: float
    mean: float
    low: float
    high: float
    ratio: float | None  # median of seconds over stream floor
    plan_length: float | None  # median


def summary(rows: Iterable[Row]) -> list[Cell]:
    """One cell for each task, size and mode, in the order of the rows."""
    groups: dict[tuple[str, str, str], list[Row]] = {}
    for row in rows:
        groups.setdefault((row.task, row.size, row.mode), []).append(row)
    cells = []
    for key, group in groups.items():
        seconds = [row.seconds if row.valid else row.timeout for row in group]
        centre, spread = mean(seconds), _spread(seconds)
        ratios = [row.seconds / row.stream_floor for row in group if row.valid and row.stream_floor]
        lengths = [row.plan_length for row in group if row.valid and row.plan_length is not None]
        cells.append(
            Cell(
                *key, len(group), sum(row.valid for row in group), median(seconds),
                centre, max(0.0, centre - spread), centre + spread,
                median(ratios) if ratios else None, median(lengths) if lengths else None,
            )
        )  # fmt: skip
    return sorted(cells, key=lambda c: (c.task, c.mode, size_key(c.size)))


def size_key(size: str) -> tuple[int, ...]:
    """Sizes in the order of their numbers."""
    return tuple(map(int, size.split("-")))


def _spread(values: Sequence[float]) -> float:
    """Half the width of the 95 % confidence interval of the mean."""
    from scipy.stats import t as student  # slow to import, and the module is read for its tables, too

    if len(values) < 2:
        return 0.0
    return float(student.ppf(0.975, len(values) - 1) * stdev(values) / len(values) ** 0.5)


class LearningTime(Document):
    """Seconds of learning without demonstrations, and the paper's."""

    task: str
    seconds: float
    paper: float | None


class BenchReport(Document):
    """What `bench --json` prints."""

    results: str
    """path of the table"""
    figure: str
    summary: list[Cell]
    learning: list[LearningTime]


def learning_times(folders: Mapping[str, Path]) -> list[LearningTime]:
    """For each task, the seconds of learning without demonstrations, as the paper counts, beside the paper's."""
    table = []
    for task, folder in folders.items():
        if (folder / "report.json").exists():
            seconds = read_report(folder)["seconds"]
            ours = seconds["total"] - seconds["demonstrations"]
            table.append(LearningTime(task=task, seconds=round(ours, 2), paper=PAPER_LEARNING.get(task)))
    return table
