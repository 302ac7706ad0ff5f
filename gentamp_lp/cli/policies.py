"""The commands about a policy bundle: `explain`, `report`, `compile`."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Annotated

import typer

from gentamp_lp.cli.options import CacheOpt, JsonOpt, QuietOpt, TrustOpt
from gentamp_lp.cli.output import Progress, messages, print_json, say
from gentamp_lp.constrained import Encoding


def explain(
    folder: Annotated[Path, typer.Argument(metavar="DIR", help="Policy bundle.")],
    feature: Annotated[str | None, typer.Option("--feature", help="Only this feature, e.g. f2.")] = None,
    state: Annotated[
        Path | None, typer.Option("--state", help="Plan file (solve --out): say what the policy does in its states.")
    ] = None,
    json_: JsonOpt = False,
    trust: TrustOpt = False,
) -> None:
    """Say what the features of a policy mean, why they were chosen, and what the policy does along a plan.

    Example: `gentamp-lp explain runs/load --state plan.json`
    """
    from gentamp_lp.cli.documents import ExplainReport
    from gentamp_lp.explaining.what_it_does import explain as run
    from gentamp_lp.explaining.what_it_does import trace
    from gentamp_lp.plans.plan import Plan
    from gentamp_lp.policy.policy import Policy
    from gentamp_lp.tasks.task import Task

    policy = Policy.load(folder)
    explained = run(policy, folder, feature)
    names = [row.name for row in explained]
    states = []
    if state is not None:
        plan = Plan.load(state)
        states = trace(policy, plan, Task.load(plan.task, trust=trust))
    if json_:
        print_json(ExplainReport(features=explained, states=states).dump())
        return
    for row in explained:
        mark = "" if row.open is None else "  open" if row.open else "  closed"
        say(f"{row.name}  {row.kind}  cost {row.cost}{mark}  {row.formula}")
        for use in row.used:
            say(f"    {use}")
        if row.why:
            say(f"    why: {row.why}")
    for number, seen in enumerate(states):
        shown = ", ".join(f"{n}={seen.values[n]}{_some(seen.holds.get(n))}" for n in names)
        say(f"state {number}: {shown}")
        say(f"    {seen.abstract}; the policy does {seen.does}")
        if seen.step:
            say(f"    next: {seen.step}")


def _some(entities: list[str] | None, most: int = 4) -> str:
    if not entities:
        return ""
    return f" ({', '.join(entities[:most])}{', …' if len(entities) > most else ''})"


def report(
    folder: Annotated[Path, typer.Argument(metavar="DIR", help="Policy bundle.")],
    plan: Annotated[
        Path | None, typer.Option("--plan", help="Plan file (solve --out) to play back in three dimensions.")
    ] = None,
    out: Annotated[Path | None, typer.Option("--out", help="The HTML file [DIR-report.html beside DIR].")] = None,
    task: Annotated[
        str | None, typer.Option("--task", help="Task of the policy, when it was moved since learning.")
    ] = None,
    time_limit: Annotated[
        float, typer.Option("--time-limit", min=1, help="Seconds for demonstrations that are not in the cache.")
    ] = 600.0,
    cache: CacheOpt = True,
    json_: JsonOpt = False,
    quiet: QuietOpt = False,
    trust: TrustOpt = False,
) -> None:
    """Write a policy, its demonstrations and perhaps a plan as one HTML page that needs no network.

    The page has the policy graph (click a state), the features with the entities that satisfy them, every
    demonstration and the plan step by step, and how learning went. `--json` prints what the page shows.

    Example: `gentamp-lp report runs/load --plan plan.json --out load.html`
    """
    from gentamp_lp.base.writing import write_text
    from gentamp_lp.plans.plan import Plan
    from gentamp_lp.policy.learn_report import read_report
    from gentamp_lp.policy.policy import Policy
    from gentamp_lp.report.document import PageReport
    from gentamp_lp.report.page import page
    from gentamp_lp.report.page import report as collect
    from gentamp_lp.tasks.task import Task

    policy = Policy.load(folder)
    known = None if plan is None else Plan.load(plan)
    learned_from = str(read_report(folder).get("settings", {}).get("task", ""))
    own = learned_from if os.path.isfile(learned_from) else policy.task
    loaded = Task.load(task or (known.task if known else own), trust=trust)
    data = collect(policy, folder, loaded, known, cache=cache, time_limit=time_limit, progress=Progress(quiet))
    path = out or folder.absolute().with_name(f"{folder.absolute().name}-report.html")
    text = page(data.dump())
    write_text(path, text)
    if json_:
        print_json(PageReport(file=str(path), bytes=len(text.encode()), **dict(data)).dump())
    messages.print(f"report written to {path}")


def compile_(
    folder: Annotated[Path, typer.Argument(metavar="DIR", help="Policy bundle.")],
    out: Annotated[Path, typer.Option("--out", help="Folder for domain.pddl and stream.pddl.")],
    encoding: Annotated[Encoding, typer.Option(help="How the policy constrains the actions.")] = "check",
    task: Annotated[
        str | None, typer.Option("--task", help="Task of the policy, when it is not a shipped one.")
    ] = None,
    json_: JsonOpt = False,
    trust: TrustOpt = False,
) -> None:
    """Compile a (perhaps edited) policy bundle into a constrained PDDL domain.

    Plans for it are to reach the task's goal and (ready). `check` tests every qualitative effect after the step;
    `local` requires it of the step's arguments where that can be told beforehand, and supposes what is true of the
    training problems' initial states and stays so; `order` is the paper's Algorithm 2 as it stands.
    Example: `gentamp-lp compile runs/unstack --out constrained`
    """
    from gentamp_lp.base.writing import write_text
    from gentamp_lp.cli.documents import CompileReport
    from gentamp_lp.constrained.encodings import constrained_domain, doubtful, invariants, left_to_checks, to_text
    from gentamp_lp.policy.policy import Policy
    from gentamp_lp.tasks.task import Task

    policy = Policy.load(folder)
    loaded = Task.load(task or policy.task, trust=trust)
    sizes = loaded.file.train if encoding == "local" else ()
    initial = [loaded.instance(size, seed).state for seed, size in enumerate(sizes)]
    domain = constrained_domain(policy, loaded.folder, policy.sorts, encoding, initial)
    marks = doubtful(policy, loaded.folder)
    supposed = invariants(loaded.folder.domain, initial)
    checked = left_to_checks(policy, loaded.folder, policy.sorts, initial) if encoding == "local" else {}
    write_text(out / "domain.pddl", to_text(domain, policy, marks, supposed))
    write_text(out / "stream.pddl", (loaded.folder.path / "stream.pddl").read_text(encoding="utf-8"))
    if json_:
        document = CompileReport(
            domain=str(out / "domain.pddl"),
            stream=str(out / "stream.pddl"),
            actions=[schema.name for schema in domain.actions],
            doubtful=marks,
            supposed=supposed,
            checked=checked,
        )
        print_json(document.dump())
    else:
        say(f"{out / 'domain.pddl'}: {len(domain.actions)} actions, {len(domain.axioms)} axioms")
        for name, reasons in checked.items():
            for feature, why in reasons.items():
                say(f"{name}: {feature} is left to a check, for {why}")
