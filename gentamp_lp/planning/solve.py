"""Solving one instance: guided by a policy or unguided, always validated before it is called solved."""

from __future__ import annotations

import time
from collections.abc import Sequence

from gentamp_lp.errors import LimitReached
from gentamp_lp.planning.guided import GuidedPlanner
from gentamp_lp.planning.search import Progress, Search
from gentamp_lp.planning.solved import Solved
from gentamp_lp.planning.transits import require_transits, with_transits
from gentamp_lp.plans.plan import Plan
from gentamp_lp.plans.stream_floor import stream_floor
from gentamp_lp.plans.validate import validate
from gentamp_lp.policy.policy import Policy
from gentamp_lp.tasks.task import Task

__all__ = ["Solved", "skeleton_of", "solve"]


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
    floor: bool = False,
    progress: Progress = lambda _: None,
) -> Solved:
    """Plan one instance and validate the plan: guided when a policy is given, else unguided.

    With a `skeleton`, the names of the plan's actions in order, only their arguments are searched for. `time_limit`
    (seconds) covers planning; drawing the instance and validating the plan come on top. Raises NoAnswer when the
    instance cannot be drawn, InputError for a bad size or an unknown action. Without a policy, `algorithm` and
    `engine` say how. `motion`: plan what the arm does between the steps, too (the domain's `plan_transits`), in another
    `time_limit`; where that fails, the steps are chosen again within it. Without transits there is no plan. `floor`:
    replay the plan's own stream calls, to know how much of the time they take alone.
    """
    if motion:
        require_transits(task)
    search = Search(policy, skeleton, algorithm, engine, progress)
    instance = task.instance(size, seed, robot=robot)

    start = time.perf_counter()
    found = search.run(instance, time_limit)
    seconds = time.perf_counter() - start

    plan, steps, failure, moved = None, found.steps, found.failure, None
    if steps is not None and motion:
        moved = with_transits(instance, steps, search, time_limit, progress)
        instance, failure = moved.instance, moved.failure
        plan = moved.plan if failure is None else None
    elif steps is not None:
        plan = Plan.of(instance, steps)

    start = time.perf_counter()
    problems = [] if plan is None else validate(plan, task, instance.renewed())
    checked = time.perf_counter() - start
    return Solved(
        instance=instance,
        mode=search.mode,
        engine=engine,
        planner=found.planner,
        seconds=seconds,
        plan=plan,
        problems=tuple(problems),
        validation_seconds=checked if plan else 0.0,
        floor=stream_floor(instance, plan.steps) if plan and floor else None,
        reason=None if failure is None else str(failure),
        limit=failure if isinstance(failure, LimitReached) else None,
        stuck=found.stuck,
        motion=moved.statistics if moved else None,
    )


def skeleton_of(task: Task, size: int | str, seed: int, policy: Policy, *, robot: str | None = None) -> list[str]:
    """The names of the actions of a guided plan for an instance. Raises DeadEnd when the policy finds none."""
    found = GuidedPlanner(policy, task.instance(size, seed, robot=robot)).solve(time_limit=600.0)
    return [step.schema for step in found.steps]
