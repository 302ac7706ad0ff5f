"""Demonstrations: plans of the unguided planner on the training problems, and the states around them."""

from __future__ import annotations

import gzip
import hashlib
import time
import zlib
from collections.abc import Callable, Sequence
from contextlib import suppress
from pathlib import Path

import platformdirs

from gentamp_lp.base.shipped import PACKAGE
from gentamp_lp.base.version import __version__
from gentamp_lp.base.writing import replacing
from gentamp_lp.demonstrations.canonical import canonical
from gentamp_lp.demonstrations.dataset import Dataset
from gentamp_lp.demonstrations.recorder import Recorder
from gentamp_lp.errors import InputError, LimitReached
from gentamp_lp.streams.downward import SEARCHES, search
from gentamp_lp.streams.facts import FactBase
from gentamp_lp.streams.incremental import solve_incremental
from gentamp_lp.streams.semantics import (
    State,
    Step,
)
from gentamp_lp.tasks.domain_code import files_of
from gentamp_lp.tasks.task import Task

Progress = Callable[[str], None]
_SHORT, _HALF = 0.1, 0.3  # shares of the time for a short plan with all samples, and with half of them


def short_plan(task: Task, base: FactBase, state: State, *, time_limit: float, seed: int) -> list[Step]:
    """Plan a problem as it should be shown: in few steps, in canonical order.

    Only the first of the planner's searches looks for few steps. Where all samples are too many for it, it is tried on
    half of them; any plan counts only when that fails too. The `seed` hides which of several like things comes first,
    as that must not be learned from. Raises NoAnswer or LimitReached (`time_limit` in seconds).
    """
    program, goal, quota = task.program, task.goal, task.file.samples
    deadline = time.monotonic() + time_limit
    plan: list[Step] | None = None
    with suppress(LimitReached):
        plan = solve_incremental(
            program, base, state, goal, quota=quota, time_limit=_SHORT * time_limit, searches=SEARCHES[:1], seed=seed
        )
    if plan is None:
        half = base.trimmed({name: -(-n // 2) for name, n in quota.items()}, {name for f in state for name in f[1:]})
        with suppress(LimitReached):
            left = _HALF * (deadline - time.monotonic())
            plan = search(program, half, state, goal, time_limit=left, searches=SEARCHES[:1], seed=seed)
    if plan is None:
        left = deadline - time.monotonic()
        plan = solve_incremental(program, base, state, goal, quota=quota, time_limit=left, seed=seed)
    return canonical(program, base, state, goal, plan)


def demonstrate(
    task: Task,
    *,
    sizes: Sequence[int | str] = (),
    seed: int = 0,
    robot: str | None = None,
    around: bool = True,
    time_limit: float = 600.0,
    cache: bool = True,
    progress: Progress = lambda _: None,
) -> Dataset:
    """Plan the training problems (or problems of other `sizes`) unguided and record what happens, or fetch the record
    from the cache.

    All entities sampled while planning stay in the data, not only those the plan uses: samples in a plan's preimage
    are biased (paper, appendix). Raises NoAnswer or LimitReached from the planner, naming the problem.
    """
    sizes = sizes or task.file.train
    file = cache_path(task, seed, robot, around, sizes)
    known = _cached(file, progress) if cache and file.is_file() else None
    if known is not None:
        return known
    deadline = time.monotonic() + time_limit
    instances, plans = [], []
    for index, size in enumerate(sizes):
        instance = task.instance(size, seed * 1000 + index, robot=robot)
        left = deadline - time.monotonic()
        plan = short_plan(task, instance.base, instance.state, time_limit=left, seed=instance.seed)
        progress(f"demonstration {task.name}-{size}: {len(plan)} steps")
        instances.append(instance)
        plans.append(plan)
    recorder = Recorder.start(task, instances, around=around)
    for instance, plan in zip(instances, plans, strict=True):
        recorder.record(instance, plan)
    if cache:
        with suppress(InputError), replacing(file) as beside:  # the cache saves time, nothing depends on it
            beside.write_bytes(gzip.compress(recorder.data.to_json().encode(), 6, mtime=0))
    return recorder.data


def _cached(file: Path, progress: Progress) -> Dataset | None:
    """The record in the cache; None when it is damaged (gzip has a checksum)."""
    try:
        data = Dataset.from_json(gzip.decompress(file.read_bytes()).decode())
    except (OSError, EOFError, ValueError, zlib.error) as error:
        progress(f"damaged demonstrations in the cache ({file}: {error}) are planned again")
        return None
    progress(f"demonstrations from the cache ({file.name})")
    return data


def cache_path(task: Task, seed: int, robot: str | None, around: bool, sizes: Sequence[int | str]) -> Path:
    """Where these demonstrations are cached: the name is a digest of all that determines them."""
    digest = hashlib.sha256(repr((__version__, seed, robot, around, [str(s) for s in sizes])).encode())
    sources = [p for kind in ("py", "yaml") for p in PACKAGE.rglob(f"*.{kind}")]
    given = files_of(task.scene)
    for path in [task.path, *given, *sorted(task.folder.path.glob("*.p*")), *sorted(sources)]:
        digest.update(path.read_bytes())
    return Path(
        platformdirs.user_cache_dir("gentamp-lp"),
        "demonstrations",
        f"{task.name}-{digest.hexdigest()[:16]}.json.gz",
    )
