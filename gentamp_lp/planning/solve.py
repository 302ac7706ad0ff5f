"""Solving one instance: guided by a policy or unguided, always validated before it is called solved."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

from gentamp_lp.constrained.encodings import constrained_domain, original_step
from gentamp_lp.errors import Diagnostic, InputError, LimitReached, NoAnswer
from gentamp_lp.features.values import situation
from gentamp_lp.planning.guided import DeadEnd, GuidedPlanner
from gentamp_lp.planning.skeleton import original_steps, skeleton_domain
from gentamp_lp.planning.unguided import choose, plan_unguided, require_pddlstream, search_unguided
from gentamp_lp.plans.plan import Plan
from gentamp_lp.plans.stream_floor import stream_floor
from gentamp_lp.plans.validate import validate
from gentamp_lp.policy.policy import Policy
from gentamp_lp.streams.formula import And, Atom
from gentamp_lp.streams.incremental import solve_incremental
from gentamp_lp.streams.interruption import interrupting
from gentamp_lp.streams.naming import Names
from gentamp_lp.streams.problem import Problem
from gentamp_lp.streams.semantics import Program, Step
from gentamp_lp.tasks.domain_folder import running
from gentamp_lp.tasks.task import Instance, Task


@dataclass
class Solved:
    """The outcome of one run; `plan` is None when nothing was found, `problems` what the validator objects to.

    `stuck` says why the policy could not be followed to the end, also when a search then found a plan.
    """

    instance: Instance
    mode: str
    planner: str
    seconds: float
    validation_seconds: float
    floor: float | None  # seconds, see `gentamp_lp.plans.stream_floor`
    plan: Plan | None
    problems: list[str]
    reason: str | None = None
    limit: LimitReached | None = None
    stuck: str | None = None
    engine: str = "embedded"
    motion: dict[str, float] | None = None

    @property
    def limited(self) -> bool:
        """Whether a limit ended the search, so that there may be a plan all the same."""
        return self.limit is not None

    @property
    def valid(self) -> bool:
        """Whether there is a plan and the validator accepts it."""
        return self.plan is not None and not self.problems

    def report(self) -> dict[str, Any]:
        """The JSON document of `gentamp-lp solve`."""
        statistics = self.instance.base.statistics
        return {
            "task": self.instance.task.name,
            "size": self.instance.size,
            "parameters": dict(self.instance.parameters),
            "seed": self.instance.seed,
            "robot": self.instance.robot,
            "mode": self.mode,
            "engine": self.engine,
            "planner": self.planner,
            "solved": self.plan is not None,
            "valid": self.valid,
            "reason": self.reason,
            "stuck": self.stuck,
            "problems": self.problems,
            "seconds": round(self.seconds, 4),
            "stream_seconds": round(sum(s.seconds for s in statistics.values()), 4),
            "stream_floor": None if self.floor is None else round(self.floor, 4),
            "floor_ratio": round(self.seconds / self.floor, 3) if self.floor else None,
            "validation_seconds": round(self.validation_seconds, 4),
            "streams": {name: {"calls": s.calls, "successes": s.successes} for name, s in statistics.items()},
            "plan_length": len(self.plan.steps) if self.plan else None,
            "plan": [[s.schema, *s.args] for s in self.plan.steps] if self.plan else None,
            "motion": self.motion,
        }


def solve(
    task: Task,
    size: int | str,
    seed: int = 0,
    *,
    policy: Policy | None = None,
    skeleton: Sequence[str] | None = None,
    robot: str | None = None,
    algorithm: str | None = None,
    engine: str = "embedded",
    time_limit: float = 120.0,
    motion: bool = False,
    progress: Callable[[str], None] = lambda _: None,
) -> Solved:
    """Plan one instance and validate the plan: guided when a policy is given, else unguided.

    With a `skeleton`, the names of the plan's actions in order, only their arguments are searched for. `time_limit`
    (seconds) covers planning; drawing the instance, validating the plan and replaying its streams come on top. Raises
    NoAnswer when the instance cannot be drawn, InputError for a bad size or an unknown action. Without a policy,
    `algorithm` and `engine` say how. `motion`: plan what the arm does between the steps, too (the domain's
    `plan_transits`), in another `time_limit`; where that fails, the steps are chosen anew within it. Without transits
    there is no plan.
    """
    if motion and not hasattr(task.folder.code, "plan_transits"):
        missing = Diagnostic(f"the domain `{task.folder.path.name}` plans no transits", hint="leave out --motion")
        raise InputError(missing)
    if policy is not None and engine != "embedded":
        raise InputError(Diagnostic("only the embedded engine follows policies", hint="add --mode unguided"))
    if engine == "pddlstream":
        require_pddlstream()
    instance = task.instance(size, seed, robot=robot)
    mode = "skeleton" if skeleton is not None else "guided" if policy else "unguided"
    start = time.perf_counter()
    steps, reason, limit, stuck = None, None, None, None
    planner = mode if policy or skeleton is not None else algorithm or choose(instance)

    def search(instance: Instance, time_limit: float) -> list[Step]:
        nonlocal stuck, planner
        start = time.perf_counter()
        with interrupting(instance.base, time_limit):
            if skeleton is not None:
                return _along(skeleton, instance, algorithm, time_limit, progress)
            if policy is None:
                return plan_unguided(instance, algorithm, engine, time_limit, progress)
            try:
                return GuidedPlanner(policy, instance).solve(time_limit=time_limit).steps
            except DeadEnd as end:
                end.reason += f"; there {situation(policy.features, instance.base, end.state)}"
                stuck, planner = str(end), "constrained domain"
                progress(f"following the policy failed ({end}); searching the constrained domain")
                return _constrained(policy, instance, end, time_limit - (time.perf_counter() - start))

    try:
        steps = search(instance, time_limit)
    except LimitReached as error:
        reason, limit = str(error), error
    except NoAnswer as error:
        reason = str(error)
    seconds = time.perf_counter() - start
    if steps is None:
        return Solved(instance, mode, planner, seconds, 0.0, None, None, [], reason, limit, stuck, engine)
    plan, moved = Plan.of(instance, steps), None
    if motion:
        instance, steps, plan, moved, failure = _moving(instance, steps, search, time_limit, progress)
        if failure is not None:
            reason, limit = str(failure), failure if isinstance(failure, LimitReached) else None
            return Solved(instance, mode, planner, seconds, 0.0, None, None, [], reason, limit, stuck, engine, moved)
    start = time.perf_counter()
    problems = validate(plan, task)
    checked, floor = time.perf_counter() - start, stream_floor(instance, steps)
    return Solved(
        instance, mode, planner, seconds, checked, floor, plan, problems, stuck=stuck, engine=engine, motion=moved
    )


def _moving(
    instance: Instance,
    steps: list[Step],
    search: Callable[[Instance, float], list[Step]],
    time_limit: float,
    progress: Callable[[str], None],
) -> tuple[Instance, list[Step], Plan, dict[str, float], NoAnswer | LimitReached | None]:
    """Return a plan with what the arm does between its steps, how that went, and why it could not be found.

    Where there is no way to a step, the problem is drawn again without what the world avoids since, and planned again.
    The failure told is the first one, the plan the last one.
    """
    start, anew = time.monotonic(), 0
    first: NoAnswer | LimitReached | None = None
    while True:
        avoided = _avoided(instance)
        plan, found, failure = _with_transits(Plan.of(instance, steps), instance, start + time_limit, progress)
        first = failure and (first or failure)
        left = start + time_limit - time.monotonic()
        if failure is None or left <= 0 or _avoided(instance) == avoided:
            break
        again = instance.task.instance(instance.size, instance.seed, robot=instance.robot)
        again.world.avoided |= _avoided(instance)
        progress(f"{failure}; choosing the steps anew")
        try:
            steps = search(again, left)
        except (NoAnswer, LimitReached):
            break
        instance, anew = again, anew + 1
    moved = {
        "transits": len(found),
        "straight": sum(move.straight for move in found),
        "anew": anew,
        "seconds": round(time.monotonic() - start, 4),
    }
    return instance, steps, plan, moved, first


def _avoided(instance: Instance) -> frozenset[Any]:
    """What the streams of a world are to give no more, in domains that know of this."""
    return frozenset(getattr(instance.world, "avoided", ()))


def _with_transits(
    plan: Plan, instance: Instance, deadline: float, progress: Callable[[str], None]
) -> tuple[Plan, list[Any], NoAnswer | LimitReached | None]:
    """Return the plan with what the arm does between its steps, these motions, and why they could not be found."""
    found: list[Any] = []
    failure: NoAnswer | LimitReached | None = None
    steps = [(step.schema, step.args) for step in plan.steps]
    plan_transits = instance.task.folder.code.plan_transits
    try:
        with running(instance.task.folder, "plan_transits"):
            for move in plan_transits(instance.world, steps, instance.base.values, instance.seed, deadline):
                found.append(move)
                if not move.straight:
                    progress(f"transit to step {len(found)} of {len(steps)}: {len(move.waypoints)} waypoints")
    except (NoAnswer, LimitReached) as error:
        failure = error
    return replace(plan, transits=tuple(move.waypoints.tolist() for move in found)), found, failure


def skeleton_of(task: Task, size: int | str, seed: int, policy: Policy, *, robot: str | None = None) -> list[str]:
    """The names of the actions of a guided plan for an instance. Raises DeadEnd when the policy finds none."""
    found = GuidedPlanner(policy, task.instance(size, seed, robot=robot)).solve(time_limit=600.0)
    return [step.schema for step in found.steps]


def _along(
    names: Sequence[str],
    instance: Instance,
    algorithm: str | None,
    time_limit: float,
    progress: Callable[[str], None],
) -> list[Step]:
    """Search for the arguments of a skeleton."""
    task = instance.task
    domain, goal, start = skeleton_domain(task.folder.domain, task.goal, names)
    problem = Problem(Program.of(domain), instance.base, instance.state | start, goal, Names())
    return original_steps(search_unguided(problem, instance, algorithm, time_limit, progress))


def _constrained(policy: Policy, instance: Instance, end: DeadEnd, time_limit: float) -> list[Step]:
    """Search the constrained domain over samples. Raises the dead end again when there is no plan."""
    task = instance.task
    sorts = {name: tuple(row) for name, row in policy.extra["sorts"].items()}
    program = Program.of(constrained_domain(policy, task.folder, sorts, "local", [instance.state]))
    goal = And((task.goal, Atom("ready", ())))
    try:
        found = solve_incremental(
            program, instance.base, instance.state, goal,
            quota=task.file.samples, time_limit=time_limit, max_levels=4,
        )  # fmt: skip
    except NoAnswer:
        raise end from None
    return [step for step in map(original_step, found) if step is not None]
