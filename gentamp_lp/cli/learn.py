"""`gentamp-lp learn`."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer
from rich.console import Console
from rich.table import Table

from gentamp_lp.base.fairness import ProgramName
from gentamp_lp.cli.options import CacheOpt, JsonOpt, QuietOpt, TrustOpt, options_of
from gentamp_lp.cli.output import Progress, messages, print_json, say
from gentamp_lp.errors import Diagnostic, InputError
from gentamp_lp.policy.learn_settings import LearnSettings

if TYPE_CHECKING:
    from gentamp_lp.policy.learn_report import LearnReport

ProgramOpt = Annotated[
    ProgramName,
    typer.Option(help="ASP program: `reference` is complete without clauses added on the way; for few data."),
]


@options_of(LearnSettings)
def learn(
    context: typer.Context,
    task: Annotated[
        str | None, typer.Argument(metavar="TASK", help="Task file, or the name of a shipped one.", show_default=False)
    ] = None,
    out: Annotated[Path | None, typer.Option("--out", help="Folder of the policy bundle [runs/TASK].")] = None,
    refine: Annotated[
        Path | None,
        typer.Option("--refine", help="Bundle to learn again, also from the problems on which `solve` failed with it."),
    ] = None,
    settings: Any = None,
    program: ProgramOpt = "lazy",
    time_limit: Annotated[float, typer.Option("--time-limit", min=1, help="Seconds for everything.")] = 600.0,
    cache: CacheOpt = True,
    json_: JsonOpt = False,
    quiet: QuietOpt = False,
    trust: TrustOpt = False,
) -> None:
    """Learn a policy: demonstrations, feature pool, abstraction and policy, compiled domain.

    Example: `gentamp-lp learn tasks/unstack.yaml` writes runs/unstack with the policy as ASP facts (policy.lp), its
    features (features.pl), the constrained PDDL domain, a picture (policy.svg) and a report.

    Where `solve` cannot follow a policy it keeps the problem in the bundle; `gentamp-lp learn --refine runs/unstack`
    learns again as before, from these problems too. Options that you repeat replace those of the bundle.
    """
    from gentamp_lp.learning.learn import learn as run
    from gentamp_lp.policy.bundle import require_place
    from gentamp_lp.tasks.task import Task

    again: dict[str, Any] = {}
    if refine is not None:
        recorded, again = _again(refine)
        task, settings = task or recorded.pop("task"), {**recorded, **settings}
    elif task is None:
        raise InputError(Diagnostic("no task given", hint="gentamp-lp learn TASK, or gentamp-lp learn --refine BUNDLE"))
    loaded = Task.load(task, trust=trust)
    folder = out or refine or Path("runs", loaded.name)
    require_place(folder)  # before minutes of learning, not after
    learned = run(
        loaded,
        LearnSettings().changed(settings),
        program=program,
        time_limit=time_limit,
        cache=cache,
        progress=Progress(quiet),
        **again,
    )
    learned.save(folder)
    if json_:
        print_json(learned.report())
    else:
        say(learned.policy.text())
        _timing(learned.document)
    for note in learned.notes:
        messages.print(f"note: {note}")
    messages.print(f"policy written to {folder}")
    if learned.interrupted:
        messages.print("interrupted: this is the best policy found so far")
        raise typer.Exit(130)


def _again(folder: Path) -> tuple[dict[str, Any], dict[str, Any]]:
    """How a bundle was learned, and what to begin with: its policy and the problems that this failed on."""
    from gentamp_lp.policy.failures import known_failures, settings
    from gentamp_lp.policy.policy import Policy

    start, failures = Policy.load(folder), known_failures(folder)
    if not failures:
        hint = "`gentamp-lp solve` records the problems on which it cannot follow the policy"
        raise InputError(Diagnostic("nothing to refine: the policy failed nowhere yet", folder, hint=hint))
    return settings(folder), {"start": start, "failures": failures}


def _timing(report: LearnReport) -> None:
    """Print the timing table; the paper's rows are pool, theory, solving, policy and compilation."""
    table = Table(title="seconds", title_justify="left", box=None)
    seconds = report.seconds.dump()
    for stage in seconds:
        table.add_column(stage, justify="right")
    table.add_row(*(f"{value:.2f}" for value in seconds.values()))
    Console(highlight=False, markup=False, width=100).print(table)
    proof = f"not proved optimal, bound {report.bound}"
    if report.optimal:
        proof = f"proved optimal among features up to complexity {report.proved_complexity}"
    say(
        f"cost {report.cost} ({proof}), fairness {report.fairness}, "
        f"{report.pool_size} features, {report.states} states, {report.transitions} transitions"
    )
