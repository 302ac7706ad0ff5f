"""The comparison as a figure: planning time over problem size, one panel a task, one line a mode."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from gentamp_lp.base.writing import replacing
from gentamp_lp.bench.runs import Cell, size_key
from gentamp_lp.errors import Diagnostic, InputError

_COLOURS = {
    "guided": "tab:blue",
    "unguided": "tab:orange",
    "adaptive": "tab:orange",
    "incremental": "tab:red",
    "skeleton": "tab:green",
    "skeleton-incremental": "tab:olive",
    "original": "tab:purple",
    "original-incremental": "tab:pink",
}


def require_matplotlib() -> None:
    """Raise InputError when matplotlib is missing."""
    try:
        import matplotlib  # noqa: F401
    except ImportError:
        hint = "pip install 'gentamp-lp[bench]'"
        raise InputError(Diagnostic("matplotlib is not installed", hint=hint)) from None


def draw(cells: Sequence[Cell], timeout: float, path: Path) -> None:
    """Write the figure (format by the name): means with 95 % confidence intervals, and the time limit in seconds."""
    from matplotlib.figure import Figure

    tasks = sorted({cell.task for cell in cells})
    figure = Figure(figsize=(3.2 * len(tasks), 3.2), layout="constrained")
    for axes, task in zip(figure.subplots(1, len(tasks), sharey=True, squeeze=False)[0], tasks, strict=True):
        own = [cell for cell in cells if cell.task == task]
        sizes = sorted({cell.size for cell in own}, key=size_key)
        for mode in dict.fromkeys(cell.mode for cell in own):
            line = sorted((c for c in own if c.mode == mode), key=lambda c: size_key(c.size))
            places = [sizes.index(cell.size) for cell in line]
            colour = _COLOURS[mode]
            axes.plot(places, [c.mean for c in line], marker="o", markersize=3, color=colour, label=mode)
            low = [max(c.low, c.mean / 10) for c in line]  # an interval may reach zero, which no logarithm shows
            axes.fill_between(places, low, [c.high for c in line], color=colour, alpha=0.2, linewidth=0)
        axes.axhline(timeout, color="grey", linestyle="--", linewidth=1)
        axes.set(title=task, xlabel="size", yscale="log", xticks=range(len(sizes)))
        axes.set_xticklabels(sizes, fontsize=7)
        axes.grid(True, axis="y", alpha=0.3)
    first = figure.axes[0]
    first.set_ylabel("seconds (mean, 95 % interval)")
    shown = [axes.get_legend_handles_labels() for axes in figure.axes]
    lines = {label: line for drawn in shown for line, label in zip(*drawn, strict=True)}
    first.legend(lines.values(), lines.keys(), fontsize=7)
    with replacing(path) as file:
        figure.savefig(file, format=path.suffix[1:])
