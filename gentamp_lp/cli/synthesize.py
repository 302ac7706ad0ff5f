"""`gentamp-lp synthesize`."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Annotated

import typer

from gentamp_lp.base.fairness import Fairness
from gentamp_lp.cli.options import JsonOpt
from gentamp_lp.cli.output import messages, print_json, say


def synthesize(
    files: Annotated[
        list[Path],
        typer.Argument(metavar="FILE...", help="Graph or QNP facts (.lp), or PDDL with oneof (domain and problem)."),
    ],
    fairness: Annotated[Fairness | None, typer.Option(help="Level to reach [the strongest that exists].")] = None,
    minimize: Annotated[bool, typer.Option("--minimize", help="Fewest policy states, with proof.")] = False,
    time_limit: Annotated[float | None, typer.Option("--time-limit", min=0.01, help="Seconds for solving.")] = None,
    out: Annotated[Path | None, typer.Option("--out", help="Write policy and certificate to this JSON file.")] = None,
    json_: JsonOpt = False,
) -> None:
    """Find a policy for a QNP or FOND problem, or prove that there is none and say why.

    Example: `gentamp-lp synthesize docs/examples/08-qnp/clear.lp --minimize --out clear.json`
    """
    from gentamp_lp.base.writing import write_text
    from gentamp_lp.synthesis import show
    from gentamp_lp.synthesis.certificate import certificate
    from gentamp_lp.synthesis.explaining import explain
    from gentamp_lp.synthesis.reading import parse_problem, read_sources
    from gentamp_lp.synthesis.solving import synthesize as run

    sources = read_sources(files)
    found = run(parse_problem(sources), fairness=fairness, minimize=minimize, time_limit=time_limit)
    reason = explain(found.problem, found.fairness) if found.solvable is False else None
    if found.solvable and out is not None:
        write_text(out, json.dumps(certificate(found, sources), indent=1, ensure_ascii=False) + "\n")
        messages.print(f"certificate written to {out}")
    if json_:
        print_json(show.report(found, reason))
    elif found.solvable:
        say(show.text(found))
    if found.limited:
        messages.print("limit reached" + (": this is the best policy found so far" if found.solvable else ""))
        raise typer.Exit(130 if found.by_user else 3)
    if reason is not None:
        if not json_:
            say(reason)
        raise typer.Exit(1)
