"""The command line. Data goes to stdout, messages to stderr; exit codes are those of `gentamp_lp.errors`."""

from __future__ import annotations

import gc
import io
import json
import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from enum import StrEnum
from pathlib import Path
from typing import Annotated, Any

import typer
from rich.console import Console
from rich.table import Table

from gentamp_lp.base.version import __version__
from gentamp_lp.errors import Diagnostic, GentampError, InputError, NoAnswer
from gentamp_lp.solvers.interrupts import send_swallowed_again

app = typer.Typer(
    name="gentamp-lp",
    help="Learn a policy for a robot task from a few small problems, then plan any size with it.\n\n"
    "Start with `gentamp-lp learn unstack`, then `gentamp-lp solve unstack --size 16`.\n\n"
    "Exit codes: 0 done; 1 a true negative answer (no policy, no plan, plan invalid); 2 bad input; "
    "3 a limit was reached; 130 interrupted; 141 nobody reads the output.",
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    rich_markup_mode="markdown",
)
messages = Console(stderr=True, highlight=False, markup=False, emoji=False, soft_wrap=True)  # names are not markup


class Transitions(StrEnum):
    """Which transitions learning sees."""

    plan = "plan"
    around = "around"


class Fairness(StrEnum):
    """What a policy may assume of its nondeterministic outcomes."""

    qnp = "qnp"
    strong_cyclic = "strong-cyclic"
    strong = "strong"


class Unseen(StrEnum):
    """What to make of a falling count that no seen state shows at zero, or above zero."""

    drop = "drop"
    refuse = "refuse"


class Mode(StrEnum):
    """How an instance is planned."""

    guided = "guided"
    unguided = "unguided"
    skeleton = "skeleton"


class Encoding(StrEnum):
    """How a policy becomes a domain."""

    check = "check"
    local = "local"
    order = "order"


class Algorithm(StrEnum):
    """How sampling and search take turns in unguided planning."""

    incremental = "incremental"
    adaptive = "adaptive"


class PlanningEngine(StrEnum):
    """Who plans."""

    embedded = "embedded"
    pddlstream = "pddlstream"


TaskArg = Annotated[str, typer.Argument(metavar="TASK", help="Path of a task file, or the name of a shipped task.")]
JsonOpt = Annotated[bool, typer.Option("--json", help="Print one JSON document to stdout.")]
QuietOpt = Annotated[bool, typer.Option("--quiet", "-q", help="No progress messages.")]
SeedOpt = Annotated[int, typer.Option("--seed", min=0, help="Same seed, same result.")]
RobotOpt = Annotated[
    str | None, typer.Option("--robot", help="Robot instead of the task's: a name or a .yaml, see docs/robots.md.")
]
TransitionsOpt = Annotated[Transitions, typer.Option(help="Plans only, or plans and what is around them.")]
CacheOpt = Annotated[bool, typer.Option(help="Use demonstrations planned before.")]
GrammarOpt = Annotated[
    list[Path] | None,
    typer.Option("--grammar", help="Grammar file to add, or the name of a shipped one: paper (repeatable)."),
]
TrustOpt = Annotated[bool, typer.Option("--trust", help="Run the Python samplers of a domain that is not shipped.")]


class _Progress:
    """Messages of a long stage, unless silenced."""

    def __init__(self, quiet: bool) -> None:
        self.quiet = quiet

    def __call__(self, text: str) -> None:
        if not self.quiet:
            messages.print(f"· {text}", style="dim")


def _print_json(document: dict[str, Any]) -> None:
    sys.stdout.write(json.dumps(document, indent=2, ensure_ascii=False) + "\n")


def _say(text: str) -> None:
    sys.stdout.write(text + "\n")


@app.command()
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
    grammar: GrammarOpt = None,
    max_complexity: Annotated[
        int | None, typer.Option("--max-complexity", min=1, help="Highest cost of a feature [that of the task file].")
    ] = None,
    transitions: TransitionsOpt = Transitions.around,
    fairness: Annotated[Fairness, typer.Option(help="Weakest guarantee to accept.")] = Fairness.qnp,
    unseen: Annotated[
        Unseen,
        typer.Option(help="Falling counts may run out or not; what to make of outcomes that no state shows."),
    ] = Unseen.drop,
    time_limit: Annotated[float, typer.Option("--time-limit", min=1, help="Seconds for everything.")] = 600.0,
    cache: CacheOpt = True,
    robot: RobotOpt = None,
    seed: SeedOpt = 0,
    solver_seed: Annotated[
        int | None, typer.Option("--solver-seed", min=0, help="Seed of clingo's search alone [--seed].")
    ] = None,
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

    options: dict[str, Any] = {
        "seed": seed,
        "solver_seed": solver_seed,
        "robot": robot,
        "grammars": [str(path) for path in grammar or ()],
        "max_complexity": max_complexity,
        "around": transitions is Transitions.around,
        "fairness": fairness.value,
        "unseen": unseen.value,
    }
    if refine is not None:
        options = _again(context, refine, options)
        recorded = options.pop("task")
        task = task or recorded
    elif task is None:
        raise InputError(Diagnostic("no task given", hint="gentamp-lp learn TASK, or gentamp-lp learn --refine BUNDLE"))
    loaded = Task.load(task, trust=trust)
    folder = out or refine or Path("runs", loaded.name)
    require_place(folder)  # before minutes of learning, not after
    options["grammars"] = [Path(name) for name in options["grammars"]]
    learned = run(loaded, **options, time_limit=time_limit, cache=cache, progress=_Progress(quiet))
    learned.save(folder)
    if json_:
        _print_json(learned.report())
    else:
        _say(learned.policy.text())
        _timing(learned.report())
    for note in learned.notes:
        messages.print(f"note: {note}")
    messages.print(f"policy written to {folder}")
    if learned.interrupted:
        messages.print("interrupted: this is the best policy found so far")
        raise typer.Exit(130)


def _again(context: typer.Context, folder: Path, options: dict[str, Any]) -> dict[str, Any]:
    """What a bundle was learned with, except for options on the command line, and what it failed on."""
    from gentamp_lp.policy.failures import recorded, settings
    from gentamp_lp.policy.policy import Policy

    start, failures = Policy.load(folder), recorded(folder)
    if not failures:
        hint = "`gentamp-lp solve` records the problems on which it cannot follow the policy"
        raise InputError(Diagnostic("nothing to refine: the policy failed nowhere yet", folder, hint=hint))
    spelled = {"grammars": "grammar", "around": "transitions"}
    sources = {name: context.get_parameter_source(spelled.get(name, name)) for name in options}
    given = {name: options[name] for name, source in sources.items() if source and source.name != "DEFAULT"}
    return {**settings(folder), **given, "start": start, "failures": failures}


def _timing(report: dict[str, Any]) -> None:
    """Print the timing table; the paper's rows are pool, theory, solving, policy and compilation."""
    seconds = report["seconds"]
    table = Table(title="seconds", title_justify="left", box=None)
    for stage in seconds:
        table.add_column(stage, justify="right")
    table.add_row(*(f"{value:.2f}" for value in seconds.values()))
    Console(highlight=False, markup=False, width=100).print(table)
    proof = f"not proved optimal, bound {report['bound']}"
    if report["optimal"]:
        proof = f"proved optimal among features up to complexity {report['proved_complexity']}"
    _say(
        f"cost {report['cost']} ({proof}), fairness {report['fairness']}, "
        f"{report['pool_size']} features, {report['states']} states, {report['transitions']} transitions"
    )


@app.command()
def solve(
    task: TaskArg,
    size: Annotated[str, typer.Option("--size", help="Size as the paper writes it: 16, or 2-8.")],
    policy: Annotated[Path | None, typer.Option("--policy", help="Policy bundle [runs/TASK].")] = None,
    mode: Annotated[
        Mode, typer.Option(help="Follow a policy, plan without one, or plan along the action names of a known plan.")
    ] = Mode.guided,
    skeleton: Annotated[
        Path | None,
        typer.Option("--skeleton", help="Plan file whose action names to follow [a guided plan of the instance]."),
    ] = None,
    algorithm: Annotated[
        Algorithm | None,
        typer.Option(help="Unguided: sample what a plan needs, or everything [the latter if the goal is about it]."),
    ] = None,
    engine: Annotated[
        PlanningEngine, typer.Option(help="Unguided: this tool, or the original PDDLStream.")
    ] = PlanningEngine.embedded,
    timeout: Annotated[float, typer.Option("--timeout", min=0.1, help="Seconds for planning.")] = 120.0,
    motion: Annotated[
        bool, typer.Option("--motion", help="Plan what the arm does between the steps, too, clear of collisions.")
    ] = False,
    out: Annotated[Path | None, typer.Option("--out", help="Write the plan to this JSON file.")] = None,
    render: Annotated[Path | None, typer.Option("--render", help="Write a .gif of the plan, or a .png.")] = None,
    robot: RobotOpt = None,
    seed: SeedOpt = 0,
    json_: JsonOpt = False,
    quiet: QuietOpt = False,
    trust: TrustOpt = False,
) -> None:
    """Plan one instance, guided by a learned policy, and validate the plan.

    Example: `gentamp-lp solve unstack --size 16 --seed 1 --out plan.json --render plan.gif`
    """
    from gentamp_lp.planning.solve import skeleton_of
    from gentamp_lp.planning.solve import solve as run
    from gentamp_lp.plans.plan import Plan
    from gentamp_lp.policy.failures import record
    from gentamp_lp.policy.learn_report import Failure
    from gentamp_lp.policy.policy import Policy
    from gentamp_lp.tasks.domain_folder import running
    from gentamp_lp.tasks.task import Task

    loaded = Task.load(task, trust=trust)
    if render is not None and render.suffix not in (".gif", ".png"):
        raise InputError(Diagnostic(f"cannot render to `{render}`", hint="end the name in .gif or .png"))
    guide, names, folder = None, None, policy or Path("runs", loaded.name)
    if skeleton is not None and mode is not Mode.skeleton:
        raise InputError(Diagnostic("a skeleton says nothing in this mode", hint="add --mode skeleton"))
    if skeleton is not None:
        names = [step.schema for step in Plan.load(skeleton).steps]
    elif mode is not Mode.unguided:
        if not folder.is_dir():
            raise InputError(
                Diagnostic(
                    f"no policy in `{folder}`",
                    hint=f"run `gentamp-lp learn {task}` first, or plan with --mode unguided",
                )
            )
        guide = Policy.load(folder)
        if guide.task != loaded.name:
            raise InputError(Diagnostic(f"the policy in `{folder}` is for task `{guide.task}`, not `{loaded.name}`"))
    if mode is Mode.skeleton and guide is not None:
        names, guide = skeleton_of(loaded, size, seed, guide, robot=robot), None
    gc.freeze()  # collections during planning need not look at what the libraries keep for good
    result = run(
        loaded,
        size,
        seed,
        policy=guide,
        skeleton=names,
        robot=robot,
        time_limit=timeout,
        motion=motion,
        progress=_Progress(quiet),
        algorithm=algorithm and algorithm.value,
        engine=engine.value,
    )
    if result.plan is not None and out is not None:
        result.plan.save(out)
        messages.print(f"plan written to {out}")
    if result.plan is not None and render is not None:
        code, base = loaded.folder.code, result.instance.base
        steps = [(s.schema, s.args) for s in result.plan.steps]
        with running(loaded.folder, "render_plan"):
            code.render_plan(result.instance.world, steps, base.values, render, *result.plan.transit_args)
        messages.print(f"picture written to {render}")
    if result.stuck is not None:
        record(folder, Failure(result.instance.size, seed, result.instance.robot, result.stuck))
        messages.print(f"the policy could not be followed; learn from it: gentamp-lp learn --refine {folder}")
    report = result.report()
    if json_:
        _print_json(report)
    elif result.plan is None:
        _say(f"no plan: {result.reason}")
        if result.limit is not None:
            learned = "" if guide else f", or a policy: gentamp-lp learn {task}"
            hint = f"this does not show that there is none; {result.limit.remedy} may find one{learned}"
            messages.print(f"hint: {hint}")
    else:
        for number, step in enumerate(result.plan.steps, 1):
            _say(f"{number:3}. {step}")
        verdict = "valid" if result.valid else "INVALID: " + "; ".join(result.problems)
        _say(
            f"{len(result.plan.steps)} steps, {verdict}; {report['seconds']:.2f} s, "
            f"{report['stream_seconds']:.2f} s of it in streams ({report['planner']})"
        )
        if result.motion is not None:
            _say("transits: {transits}, {straight} of them straight; {seconds:.2f} s".format(**result.motion))
    if not result.valid:
        raise typer.Exit(3 if result.limited else 1)


@app.command()
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

    import numpy as np

    from gentamp_lp.bench import runs as benchmark
    from gentamp_lp.bench.figure import draw, require_matplotlib
    from gentamp_lp.planning.unguided import require_pddlstream
    from gentamp_lp.tasks.task import Task

    require_matplotlib()
    chosen = modes.split(",")
    for mode in chosen:
        if mode not in benchmark.MODES:
            raise InputError(Diagnostic(f"unknown mode `{mode}`", hint=f"known: {', '.join(benchmark.MODES)}"))
    if any(mode.startswith("original") for mode in chosen):
        require_pddlstream()
    jobs = []
    loaded = [Task.load(name) for name in tasks]
    folders = {task.name: (policies / task.name).resolve() for task in loaded}
    for task in loaded:
        if any("unguided" not in benchmark.MODES[mode] for mode in chosen) and not folders[task.name].is_dir():
            hint = f"run `gentamp-lp learn {task.reference}` first"
            raise InputError(Diagnostic(f"no policy in `{folders[task.name]}`", hint=hint))
        for size in sizes.split(",") if sizes else map(str, task.file.test):
            task.parameters(size, np.random.default_rng(0))
            jobs += [
                benchmark.Job(task.reference, size, seed, mode, robot or "", timeout, str(folders[task.name]))
                for seed in range(seeds)
                for mode in chosen
            ]
    table = out / "results.csv"
    with benchmark.cluster(scheduler) if scheduler else ThreadPoolExecutor(workers) as executor:
        rows = benchmark.run(jobs, table, executor, _Progress(quiet))
    cells = benchmark.summary(rows)
    draw(cells, timeout, out / "comparison.svg")
    learning = benchmark.learning_times(folders)
    if json_:
        document = {"results": str(table), "figure": str(out / "comparison.svg")}
        _print_json({**document, "summary": [vars(cell) for cell in cells], "learning": learning})
    else:
        _comparison(cells, learning)
    messages.print(f"{len(rows)} runs in {table}, figure in {out / 'comparison.svg'}")


def _comparison(cells: list[Any], learning: list[dict[str, Any]]) -> None:
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
        times.add_row(row["task"], f"{row['seconds']:.2f}", "" if row["paper"] is None else f"{row['paper']:.1f}")
    console = Console(highlight=False, markup=False, width=100)
    console.print(table)
    console.print(times)


@app.command()
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
    level = None if fairness is None else fairness.value
    found = run(parse_problem(sources), fairness=level, minimize=minimize, time_limit=time_limit)
    reason = explain(found.problem, found.fairness) if found.solvable is False else None
    if found.solvable and out is not None:
        write_text(out, json.dumps(certificate(found, sources), indent=1, ensure_ascii=False) + "\n")
        messages.print(f"certificate written to {out}")
    if json_:
        _print_json(show.report(found, reason))
    elif found.solvable:
        _say(show.text(found))
    if found.limited:
        messages.print("limit reached" + (": this is the best policy found so far" if found.solvable else ""))
        raise typer.Exit(130 if found.by_user else 3)
    if reason is not None:
        if not json_:
            _say(reason)
        raise typer.Exit(1)


@app.command()
def validate(
    file: Annotated[Path, typer.Argument(help="File of `solve --out` or `synthesize --out`, or a policy bundle.")],
    json_: JsonOpt = False,
    trust: TrustOpt = False,
) -> None:
    """Check a plan (symbolically and by replaying its motions in PyBullet) or the certificate of a policy.

    A certificate is a policy bundle of `learn`, or the file that `synthesize --out` writes.

    Example: `gentamp-lp validate plan.json`
    """
    from gentamp_lp.plans.plan import Plan
    from gentamp_lp.plans.validate import validate as check
    from gentamp_lp.policy.policy import Policy
    from gentamp_lp.synthesis.certificate import check as check_certificate
    from gentamp_lp.synthesis.certificate import load_certificate
    from gentamp_lp.tasks.task import Task

    if file.is_dir():
        problems = Policy.load(file).check()
    elif (document := load_certificate(file)) is not None:
        problems = check_certificate(document)
    else:
        plan = Plan.load(file)
        problems = check(plan, Task.load(plan.task, trust=trust))
    if json_:
        _print_json({"file": str(file), "valid": not problems, "problems": problems})
    else:
        _say("\n".join(problems) if problems else f"{file}: valid")
    if problems:
        raise typer.Exit(1)


@app.command()
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
    transitions: TransitionsOpt = Transitions.around,
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
        grammars=tuple(grammar or ()),
        around=transitions is Transitions.around,
        seed=seed,
        robot=robot,
        time_limit=time_limit,
        cache=cache,
        progress=_Progress(quiet),
    )
    if json_:
        _print_json(listing.report())
        return
    if listing.state is not None:
        _say(listing.state)
    if not formulas or match is not None:
        for row in listing.features:
            _say(f"{row.id:5}  cost {row.cost}  {_qualities(row)}  {row.formula}{_holds(row.satisfying)}")
    for asked in listing.formulas:
        found = "not in the pool" if asked.match is None else f"#{asked.match}"
        label = f"{asked.name} = " if asked.name else ""
        _say(f"{label}{asked.formula}{_holds(asked.satisfying)}")
        _say(f"       cost {asked.cost}  {_qualities(asked)}  {found}, {asked.how.replace('_', ' ')}")
        matched = next((row for row in listing.features if row.id == asked.match), None)
        if matched is not None and matched.formula != asked.formula:
            _say(f"       #{matched.id}, cost {matched.cost}: {matched.formula}")
    messages.print(_pruning(listing.report()))


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


@app.command()
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
        _print_json({"features": [vars(row) for row in explained], "states": [vars(row) for row in states]})
        return
    for row in explained:
        mark = "" if row.open is None else "  open" if row.open else "  closed"
        _say(f"{row.name}  {row.kind}  cost {row.cost}{mark}  {row.formula}")
        for use in row.used:
            _say(f"    {use}")
        if row.why:
            _say(f"    why: {row.why}")
    for number, seen in enumerate(states):
        shown = ", ".join(f"{n}={seen.values[n]}{_some(seen.holds.get(n))}" for n in names)
        _say(f"state {number}: {shown}")
        _say(f"    {seen.abstract}; the policy does {seen.does}")
        if seen.step:
            _say(f"    next: {seen.step}")


def _some(entities: list[str] | None, most: int = 4) -> str:
    if not entities:
        return ""
    return f" ({', '.join(entities[:most])}{', …' if len(entities) > most else ''})"


@app.command()
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
    from gentamp_lp.report.page import page
    from gentamp_lp.report.page import report as collect
    from gentamp_lp.tasks.task import Task

    policy = Policy.load(folder)
    known = None if plan is None else Plan.load(plan)
    learned_from = str(read_report(folder).get("settings", {}).get("task", ""))
    own = learned_from if os.path.isfile(learned_from) else policy.task
    loaded = Task.load(task or (known.task if known else own), trust=trust)
    document = collect(policy, folder, loaded, known, cache=cache, time_limit=time_limit, progress=_Progress(quiet))
    path = out or folder.absolute().with_name(f"{folder.absolute().name}-report.html")
    text = page(document)
    write_text(path, text)
    if json_:
        _print_json({"file": str(path), "bytes": len(text.encode()), **document})
    messages.print(f"report written to {path}")


@app.command("compile")
def compile_(
    folder: Annotated[Path, typer.Argument(metavar="DIR", help="Policy bundle.")],
    out: Annotated[Path, typer.Option("--out", help="Folder for domain.pddl and stream.pddl.")],
    encoding: Annotated[Encoding, typer.Option(help="How the policy constrains the actions.")] = Encoding.check,
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
    from gentamp_lp.constrained.encodings import constrained_domain, doubtful, invariants, left_to_checks, to_text
    from gentamp_lp.policy.policy import Policy
    from gentamp_lp.tasks.task import Task

    policy = Policy.load(folder)
    loaded = Task.load(task or policy.task, trust=trust)
    sorts = {name: tuple(row) for name, row in policy.extra["sorts"].items()}
    sizes = loaded.file.train if encoding == Encoding.local else ()
    initial = [loaded.instance(size, seed).state for seed, size in enumerate(sizes)]
    domain = constrained_domain(policy, loaded.folder, sorts, encoding.value, initial)
    marks = doubtful(policy, loaded.folder)
    supposed = invariants(loaded.folder.domain, initial)
    checked = left_to_checks(policy, loaded.folder, sorts, initial) if encoding == Encoding.local else {}
    write_text(out / "domain.pddl", to_text(domain, policy, marks, supposed))
    write_text(out / "stream.pddl", (loaded.folder.path / "stream.pddl").read_text(encoding="utf-8"))
    if json_:
        names = [schema.name for schema in domain.actions]
        document = {"domain": str(out / "domain.pddl"), "stream": str(out / "stream.pddl"), "actions": names}
        _print_json({**document, "doubtful": marks, "supposed": supposed, "checked": checked})
    else:
        _say(f"{out / 'domain.pddl'}: {len(domain.actions)} actions, {len(domain.axioms)} axioms")
        for name, reasons in checked.items():
            for feature, why in reasons.items():
                _say(f"{name}: {feature} is left to a check, for {why}")


@app.command()
def check(
    files: Annotated[
        list[Path],
        typer.Argument(metavar="FILE...", help="Task files (.yaml), domains (folder), grammars (.lp)."),
    ],
    json_: JsonOpt = False,
    trust: TrustOpt = False,
) -> None:
    """Look for mistakes in tasks, domains and grammar files; prints `file:line: message`.

    Example: `gentamp-lp check tasks/*.yaml my_rules.lp`
    """
    from gentamp_lp.features.pool import check_grammars
    from gentamp_lp.tasks.domain_folder import load_domain
    from gentamp_lp.tasks.task import Task

    found: list[Diagnostic] = []
    for file in files:
        try:
            if file.is_dir():
                load_domain(str(file), trust=trust)
            elif file.suffix == ".lp":
                check_grammars([file])
            else:
                loaded = Task.load(file, trust=trust)
                loaded.instance(loaded.file.train[0], seed=0)  # the scene can be drawn, the samplers fit the streams
        except InputError as error:
            found += error.diagnostics
        except NoAnswer as error:
            found.append(Diagnostic(str(error), file))
    if json_:
        _print_json({"files": [str(f) for f in files], "errors": [str(d) for d in found]})
    for diagnostic in found:
        messages.print(str(diagnostic))
    if found:
        raise typer.Exit(2)
    if not json_:
        _say(f"{len(files)} file(s): no mistakes found")


@app.command()
def schema(
    name: Annotated[
        str | None, typer.Argument(metavar="NAME", help="Format; without it, their names.", show_default=False)
    ] = None,
) -> None:
    """Print the JSON Schema of a file format or of what a command prints with `--json`.

    Example: `gentamp-lp schema task > task.schema.json`
    """
    from gentamp_lp.cli.schemas import FORMATS
    from gentamp_lp.cli.schemas import schema as of

    if name is None:
        for known, (_, about) in FORMATS.items():
            _say(f"{known:11}  {about}")
    elif name in FORMATS:
        _print_json(of(name))
    else:
        raise InputError(Diagnostic(f"unknown format `{name}`", hint=f"one of {', '.join(FORMATS)}"))


@app.command()
def doctor(json_: JsonOpt = False) -> None:
    """Say what is installed, where it was found, and how to get what is missing."""
    from gentamp_lp.cli.doctor import examine

    findings = examine()
    if json_:
        _print_json(
            {
                "ok": all(f.ok for f in findings),
                "version": __version__,
                "findings": [vars(f) for f in findings],
            }
        )
    else:
        _say(f"gentamp-lp {__version__}")
        for finding in findings:
            _say(f"{'ok     ' if finding.ok else 'MISSING'} {finding.name}: {finding.detail}")
            if not finding.ok:
                _say(f"        hint: {finding.remedy}")
    if not all(f.ok for f in findings):
        raise typer.Exit(2)


def _version(show: bool) -> None:
    if show:
        _say(f"gentamp-lp {__version__}")
        raise typer.Exit


@app.callback()
def _options(
    version: Annotated[
        bool, typer.Option("--version", callback=_version, is_eager=True, help="Print the version.")
    ] = False,
) -> None:
    try:
        os.getcwd()
    except FileNotFoundError:
        raise InputError(Diagnostic("the current folder is gone", hint="go to one that is there: cd")) from None


class _Output(io.TextIOWrapper):
    """A stream whose failure ends the program: as SIGPIPE does where nobody reads, else (full disk) as bad input."""

    lost = False

    def write(self, text: str) -> int:
        with self._ending():
            return len(text) if self.lost else super().write(text)

    def flush(self) -> None:
        with self._ending():
            if not self.lost:
                super().flush()

    @contextmanager
    def _ending(self) -> Iterator[None]:
        try:
            yield
        except OSError as error:
            self.lost = True  # also for the flush when Python ends
            if isinstance(error, BrokenPipeError):
                raise SystemExit(141) from None
            raise InputError(
                Diagnostic(f"cannot write the output: {error.strerror}", hint="send it elsewhere")
            ) from None


def _open_streams() -> None:
    """Let closed streams lead nowhere, and show what the locale has no signs for as escapes."""
    while (number := os.open(os.devnull, os.O_RDWR)) <= 2:
        pass
    os.close(number)
    for name in ("stdin", "stdout", "stderr"):
        if getattr(sys, name) is None:
            setattr(sys, name, open(os.devnull, "r" if name == "stdin" else "w", encoding="utf-8"))  # noqa: SIM115
    for name in ("stdout", "stderr"):
        stream = getattr(sys, name)
        if isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors="backslashreplace")
        if type(stream) is io.TextIOWrapper:  # nobody replaced it
            encoding, buffering, through = stream.encoding, stream.line_buffering, stream.write_through
            setattr(sys, name, _Output(stream.detach(), encoding, "backslashreplace", None, buffering, through))


def main() -> None:
    """Entry point of the `gentamp-lp` command."""
    _open_streams()
    send_swallowed_again()
    try:
        try:
            app()
        finally:
            sys.stdout.flush()  # while its failure can be told
    except GentampError as error:
        messages.print(str(error) if isinstance(error, InputError) else f"error: {error}")
        sys.exit(error.exit_code)
    except RecursionError:
        messages.print("error: something in what was given is nested too deeply")
        sys.exit(InputError.exit_code)
    except OSError as error:
        if error.filename is None:
            raise
        messages.print(str(Diagnostic(str(error.strerror), error.filename, hint="check its name and permissions")))
        sys.exit(InputError.exit_code)
    except KeyboardInterrupt:
        messages.print("interrupted")
        sys.exit(130)
