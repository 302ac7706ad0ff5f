"""`gentamp-lp bench`."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer
from rich.console import Console
from rich.table import Table

from gentamp_lp.cli.options import JsonOpt, QuietOpt, RobotOpt
from gentamp_lp.cli.output import Progress, messages, print_json

if TYPE_CHECKING:
    from gentamp_lp.bench.runs import Cell, LearningTime


def bench(
    tasks: Annotated[list[str], typer.Argument(metavar="TASK...", help="Tasks, by path or by name.")],
    modes: Annotated[
        str,
        typer.Option(
            help="Modes to compare, separated by commas: guided, unguided (as `solve` does it), adaptive or "
            "incremental (unguided, by this algorithm), skeleton, skeleton-incremental, original or "
            "original-incremental (PDDLStream itself)."
        ),
    ] = "guided,unguided,skeleton",
    sizes: Annotated[
        str | None, typer.Option(help="Sizes, separated by commas [the `test` sizes of each task].")
    ] = None,
    seeds: Annotated[int, typer.Option(min=1, help="Problems of each size: seeds 0, 1, ...")] = 6,
    timeout: Annotated[float, typer.Option("--timeout", min=0.1, help="Seconds for planning.")] = 120.0,
    out: Annotated[Path, typer.Option("--out", help="Folder of results.csv and the figure.")] = Path("runs", "bench"),
    policies: Annotated[Path, typer.Option(help="Folder of the policy bundles, one a task.")] = Path("runs"),
    workers: Annotated[int, typer.Option(min=1, help="Runs at a time on this machine.")] = 1,
    scheduler: Annotated[
        str | None, typer.Option(help="Address of a Dask scheduler whose workers see the same files.")
    ] = None,
    robot: RobotOpt = None,
    json_: JsonOpt = False,
    quiet: QuietOpt = False,
) -> None:
    """Compare planning modes: a row for each run in results.csv, a figure, and the time of learning.

    Each run is a process of its own with one thread and 4 GB. A table that is there is continued; Ctrl-C leaves one
    that can be. Example: `gentamp-lp bench unstack sort --seeds 3 --sizes 2,4,8 --workers 2`
    """
    from concurrent.futures import ThreadPoolExecutor

    from gentamp_lp.bench import runs
    from gentamp_lp.bench.figure import draw, require_matplotlib
    from gentamp_lp.planning.unguided import require_pddlstream
    from gentamp_lp.tasks.task import Task

    require_matplotlib()
    loaded = [Task.load(name) for name in tasks]
    jobs = runs.jobs_of(loaded, modes.split(","), sizes.split(",") if sizes else (), seeds, robot, timeout, policies)
    if "original" in modes:
        require_pddlstream()
    table = out / "results.csv"
    with runs.cluster(scheduler) if scheduler else ThreadPoolExecutor(workers) as executor:
        rows = runs.run(jobs, table, executor, Progress(quiet))
    cells = runs.summary(rows)
    draw(cells, timeout, out / "comparison.svg")
    learning = runs.learning_times({task.name: (policies / task.name).resolve() for task in loaded})
    if json_:
        figure = str(out / "comparison.svg")
        print_json(runs.BenchReport(results=str(table), figure=figure, summary=cells, learning=learning).dump())
    else:
        _comparison(cells, learning)
    messages.print(f"{len(rows)} runs in {table}, figure in {out / 'comparison.svg'}")


def _comparison(cells: list[Cell], learning: list[LearningTime]) -> None:
    """Print the summary of a benchmark, and the time of learning beside the paper's."""
    table = Table(title="planning", title_justify="left", box=None)
    for name in ("task", "mode", "size", "solved", "median s", "95 % of mean", "over floor", "steps"):
        table.add_column(name, justify="left" if name in ("task", "mode", "size") else "right")
    for c in cells:
        ratio = "" if c.ratio is None else f"{c.ratio:.2f}"
        interval = f"{c.low:.2f} to {c.high:.2f}"
        steps = "" if c.plan_length is None else f"{c.plan_length:g}"
        table.add_row(c.task, c.mode, c.size, f"{c.solved}/{c.runs}", f"{c.median:.2f}", interval, ratio, steps)
    times = Table(title="learning, seconds without demonstrations", title_justify="left", box=None)
    for name in ("task", "here", "paper"):
        times.add_column(name, justify="left" if name == "task" else "right")
    for row in learning:
        times.add_row(row.task, f"{row.seconds:.2f}", "" if row.paper is None else f"{row.paper:.1f}")
    console = Console(highlight=False, markup=False, width=100)
    console.print(table)
    console.print(times)
