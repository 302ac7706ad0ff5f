"""`gentamp-lp solve`."""

from __future__ import annotations

import gc
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from gentamp_lp.cli.options import JsonOpt, QuietOpt, RobotOpt, SeedOpt, TaskArg, TrustOpt
from gentamp_lp.cli.output import Progress, messages, print_json, say
from gentamp_lp.errors import Diagnostic, InputError
from gentamp_lp.planning.modes import Algorithm, Engine, Mode

if TYPE_CHECKING:
    from gentamp_lp.planning.solved import Solved
    from gentamp_lp.plans.plan import Plan
    from gentamp_lp.policy.policy import Policy
    from gentamp_lp.tasks.task import Task

ModeOpt = Annotated[
    Mode, typer.Option(help="Follow a policy, plan without one, or plan along the action names of a known plan.")
]
SkeletonOpt = Annotated[
    Path | None,
    typer.Option("--skeleton", help="Plan file whose action names to follow [a guided plan of the instance]."),
]
AlgorithmOpt = Annotated[
    Algorithm | None,
    typer.Option(help="Unguided: sample what a plan needs, or everything [the latter if the goal is about it]."),
]
MotionOpt = Annotated[
    bool, typer.Option("--motion", help="Plan what the arm does between the steps, too, clear of collisions.")
]
FloorOpt = Annotated[
    bool, typer.Option("--floor", help="Report how long the plan's own stream calls take, replayed alone.")
]


def solve(
    task: TaskArg,
    size: Annotated[str, typer.Option("--size", help="Size as the paper writes it: 16, or 2-8.")],
    policy: Annotated[Path | None, typer.Option("--policy", help="Policy bundle [runs/TASK].")] = None,
    mode: ModeOpt = "guided",
    skeleton: SkeletonOpt = None,
    algorithm: AlgorithmOpt = None,
    engine: Annotated[Engine, typer.Option(help="Unguided: this tool, or the original PDDLStream.")] = "embedded",
    timeout: Annotated[float, typer.Option("--timeout", min=0.1, help="Seconds for planning.")] = 120.0,
    motion: MotionOpt = False,
    floor: FloorOpt = False,
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
    from gentamp_lp.planning.solve import solve as run
    from gentamp_lp.tasks.task import Task

    loaded = Task.load(task, trust=trust)
    if render is not None:
        _require_drawable(loaded, render)
    folder = policy or Path("runs", loaded.name)
    guide, names = _guide(loaded, folder, mode, skeleton, size, seed, robot)
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
        floor=floor,
        progress=Progress(quiet),
        algorithm=algorithm,
        engine=engine,
    )
    if result.plan is not None:
        _write(result, result.plan, out, render)
    if result.stuck is not None:
        _record(folder, result)
    if json_:
        print_json(result.report())
    elif result.plan is None:
        _say_why_not(result, task, guided=guide is not None)
    else:
        _say_plan(result, result.plan)
    if not result.valid:
        raise typer.Exit(3 if result.limited else 1)


def _require_drawable(task: Task, render: Path) -> None:
    """Refuse, before planning, what cannot be drawn after it."""
    if render.suffix not in (".gif", ".png"):
        raise InputError(Diagnostic(f"cannot render to `{render}`", hint="end the name in .gif or .png"))
    if not task.folder.code.draws:
        raise InputError(Diagnostic(f"the domain `{task.folder.path.name}` draws nothing", hint="leave out --render"))


def _guide(
    task: Task, folder: Path, mode: Mode, skeleton: Path | None, size: str, seed: int, robot: str | None
) -> tuple[Policy | None, list[str] | None]:
    """The policy to follow, or the names of the actions of a skeleton."""
    from gentamp_lp.planning.solve import skeleton_of
    from gentamp_lp.plans.plan import Plan
    from gentamp_lp.policy.policy import Policy

    if skeleton is not None and mode != "skeleton":
        raise InputError(Diagnostic("a skeleton says nothing in this mode", hint="add --mode skeleton"))
    if skeleton is not None:
        return None, [step.schema for step in Plan.load(skeleton).steps]
    if mode == "unguided":
        return None, None
    if not folder.is_dir():
        hint = f"run `gentamp-lp learn {task.reference}` first, or plan with --mode unguided"
        raise InputError(Diagnostic(f"no policy in `{folder}`", hint=hint))
    guide = Policy.load(folder)
    if guide.task != task.name:
        raise InputError(Diagnostic(f"the policy in `{folder}` is for task `{guide.task}`, not `{task.name}`"))
    if mode == "skeleton":
        return None, skeleton_of(task, size, seed, guide, robot=robot)
    return guide, None


def _write(result: Solved, plan: Plan, out: Path | None, render: Path | None) -> None:
    """Write the plan and its picture, as far as they were asked for."""
    from gentamp_lp.tasks.domain_folder import running

    if out is not None:
        plan.save(out)
        messages.print(f"plan written to {out}")
    if render is not None:
        folder, instance = result.instance.task.folder, result.instance
        steps = [(s.schema, s.args) for s in plan.steps]
        with running(folder, "render_plan"):
            folder.code.render_plan(instance.world, steps, instance.base.values, render, *plan.transit_args)
        messages.print(f"picture written to {render}")


def _record(folder: Path, result: Solved) -> None:
    """Keep a problem on which the policy could not be followed."""
    from gentamp_lp.policy.failures import record
    from gentamp_lp.policy.learn_report import Failure

    instance = result.instance
    record(folder, Failure(instance.size, instance.seed, instance.robot, result.stuck or ""))
    messages.print(f"the policy could not be followed; learn from it: gentamp-lp learn --refine {folder}")


def _say_why_not(result: Solved, task: str, *, guided: bool) -> None:
    say(f"no plan: {result.reason}")
    if result.limit is not None:
        learned = "" if guided else f", or a policy: gentamp-lp learn {task}"
        hint = f"this does not show that there is none; {result.limit.remedy} may find one{learned}"
        messages.print(f"hint: {hint}")


def _say_plan(result: Solved, plan: Plan) -> None:
    for number, step in enumerate(plan.steps, 1):
        say(f"{number:3}. {step}")
    report = result.document
    verdict = "valid" if result.valid else "INVALID: " + "; ".join(result.problems)
    say(
        f"{len(plan.steps)} steps, {verdict}; {report.seconds:.2f} s, "
        f"{report.stream_seconds:.2f} s of it in streams ({report.planner})"
    )
    if result.motion is not None:
        say("transits: {transits}, {straight} of them straight; {seconds:.2f} s".format(**result.motion))
