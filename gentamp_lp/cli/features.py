"""`gentamp-lp features`."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from gentamp_lp.cli.options import (
    CacheOpt,
    GrammarOpt,
    JsonOpt,
    QuietOpt,
    RobotOpt,
    SeedOpt,
    TaskArg,
    TransitionsOpt,
    TrustOpt,
)
from gentamp_lp.cli.output import Progress, messages, print_json, say

if TYPE_CHECKING:
    from gentamp_lp.features.listing import Listing


def features(
    task: TaskArg,
    match: Annotated[str | None, typer.Option("--match", help="Only features whose text contains this.")] = None,
    formula: Annotated[
        list[str] | None,
        typer.Option("--formula", help="Evaluate a formula and look it up (repeatable); @FILE has one a line."),
    ] = None,
    state: Annotated[
        int | None, typer.Option("--state", min=0, help="Show what satisfies the features in this training state.")
    ] = None,
    max_complexity: Annotated[int, typer.Option("--max-complexity", min=1, help="Highest cost of a feature.")] = 3,
    size: Annotated[
        list[str] | None, typer.Option("--size", help="Problems to see, instead of the training sizes (repeatable).")
    ] = None,
    grammar: GrammarOpt = None,
    transitions: TransitionsOpt = "around",
    time_limit: Annotated[float, typer.Option("--time-limit", min=1, help="Seconds for each stage.")] = 600.0,
    cache: CacheOpt = True,
    robot: RobotOpt = None,
    seed: SeedOpt = 0,
    json_: JsonOpt = False,
    quiet: QuietOpt = False,
    trust: TrustOpt = False,
) -> None:
    """List the feature pool: number, cost, kind, whether open (depends on sampling), range of values, formula.

    Examples: `gentamp-lp features load --match "On(x"`, and to ask about a formula of your own in a state,
    `gentamp-lp features load --state 0 --formula "exists r: On(x,r) & ~Tray(r)"`.
    """
    from gentamp_lp.features.listing import formula_file, list_features
    from gentamp_lp.tasks.task import Task

    formulas: list[str] = []
    for text in formula or ():
        formulas += formula_file(Path(text[1:])) if text.startswith("@") else [text]
    listing = list_features(
        Task.load(task, trust=trust),
        complexity=max_complexity,
        match=match,
        formulas=formulas,
        state=state,
        sizes=tuple(size or ()),
        grammars=[Path(name) for name in grammar or ()],
        around=transitions == "around",
        seed=seed,
        robot=robot,
        time_limit=time_limit,
        cache=cache,
        progress=Progress(quiet),
    )
    if json_:
        print_json(listing.report())
        return
    _say_listing(listing, everything=not formulas or match is not None)
    messages.print(_pruning(listing.report()))


def _say_listing(listing: Listing, *, everything: bool) -> None:
    """Print the pool, if everything is asked for, and the formulas that were asked about."""
    if listing.state is not None:
        say(listing.state)
    if everything:
        for row in listing.features:
            say(f"{row.id:5}  cost {row.cost}  {_qualities(row)}  {row.formula}{_holds(row.satisfying)}")
    for asked in listing.formulas:
        found = "not in the pool" if asked.match is None else f"#{asked.match}"
        label = f"{asked.name} = " if asked.name else ""
        say(f"{label}{asked.formula}{_holds(asked.satisfying)}")
        say(f"       cost {asked.cost}  {_qualities(asked)}  {found}, {asked.how.replace('_', ' ')}")
        matched = next((row for row in listing.features if row.id == asked.match), None)
        if matched is not None and matched.formula != asked.formula:
            say(f"       #{matched.id}, cost {matched.cost}: {matched.formula}")


def _qualities(row: Any) -> str:
    kind = f"{row.kind:7}  " if hasattr(row, "kind") else ""
    return f"{kind}{'open  ' if row.open else 'closed'}  {min(row.values)}..{max(row.values)}"


def _holds(entities: list[str] | None) -> str:
    return "" if entities is None else f"   [{len(entities)}: {', '.join(entities)}]"


def _pruning(report: dict[str, Any]) -> str:
    """What was pruned, in one sentence."""
    total = dict.fromkeys(("equivalent", "constant", "same", "better", "new"), 0)
    for row in report["pruning"]:
        if row["rule"] != "features":
            for what in total:
                total[what] += row.get(what, 0)
    return (
        f"{report['pool_size']} features up to complexity {report['complexity']} in {report['seconds']:.2f} s, from "
        f"{sum(total.values())} formulas: {total['equivalent']} pruned by laws, {total['constant']} always true or "
        f"false, {total['same'] + total['better']} said nothing new, {total['new']} kept (--json: per rule and level)"
    )
