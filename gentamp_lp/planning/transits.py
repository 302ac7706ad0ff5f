"""What the arm does between the steps of a plan, where the domain plans it."""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

from gentamp_lp.errors import Diagnostic, InputError, LimitReached, NoAnswer
from gentamp_lp.planning.search import Progress, Search
from gentamp_lp.plans.plan import Plan
from gentamp_lp.streams.semantics import Step
from gentamp_lp.tasks.domain_code import PlanTransits
from gentamp_lp.tasks.domain_folder import running
from gentamp_lp.tasks.task import Instance, Task


@dataclass(frozen=True)
class Moved:
    """A plan with its transits, or the first `failure` to find them; `statistics` is for the report."""

    instance: Instance
    plan: Plan
    statistics: dict[str, float]
    failure: NoAnswer | LimitReached | None


def require_transits(task: Task) -> PlanTransits:
    """The function of a task's domain that plans them. Raises InputError when there is none."""
    if task.folder.code.plan_transits is None:
        missing = Diagnostic(f"the domain `{task.folder.path.name}` plans no transits", hint="leave out --motion")
        raise InputError(missing)
    return task.folder.code.plan_transits


def with_transits(
    instance: Instance, steps: Sequence[Step], search: Search, time_limit: float, progress: Progress
) -> Moved:
    """Plan what the arm does between the steps, in so many seconds.

    Where there is no way to a step, the problem is planned again without what the world avoids since. The failure
    reported is the first one, the plan the last one.
    """
    start, again = time.monotonic(), 0
    first: NoAnswer | LimitReached | None = None
    while True:
        avoided = frozenset(instance.given.avoided)
        plan, found, failure = _transits(Plan.of(instance, steps), instance, start + time_limit, progress)
        first = failure and (first or failure)
        left = start + time_limit - time.monotonic()
        if failure is None or left <= 0 or instance.given.avoided == avoided:
            break
        other = instance.renewed()
        progress(f"{failure}; choosing the steps again")
        searched = search.run(other, left)
        if searched.steps is None:
            break
        instance, steps, again = other, searched.steps, again + 1
    statistics = {
        "transits": len(found),
        "straight": sum(move.straight for move in found),
        "anew": again,
        "seconds": round(time.monotonic() - start, 4),
    }
    return Moved(instance, plan, statistics, first)


def _transits(
    plan: Plan, instance: Instance, deadline: float, progress: Progress
) -> tuple[Plan, list[Any], NoAnswer | LimitReached | None]:
    """Return the plan with what the arm does between its steps, these motions, and why they could not be found."""
    found: list[Any] = []
    failure: NoAnswer | LimitReached | None = None
    steps = [(step.schema, step.args) for step in plan.steps]
    plan_transits = require_transits(instance.task)
    try:
        with running(instance.task.folder, "plan_transits"):
            for move in plan_transits(instance.world, steps, instance.base.values, instance.seed, deadline):
                found.append(move)
                if not move.straight:
                    progress(f"transit to step {len(found)} of {len(steps)}: {len(move.waypoints)} waypoints")
    except (NoAnswer, LimitReached) as error:
        failure = error
    return replace(plan, transits=tuple(move.waypoints.tolist() for move in found)), found, failure
