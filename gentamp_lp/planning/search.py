"""One search for a plan, in any of the modes."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass

from gentamp_lp.constrained.encodings import constrained_domain, original_step
from gentamp_lp.errors import Diagnostic, InputError, LimitReached, NoAnswer
from gentamp_lp.features.values import situation
from gentamp_lp.planning.guided import DeadEnd, GuidedPlanner
from gentamp_lp.planning.modes import Mode
from gentamp_lp.planning.skeleton import original_steps, skeleton_domain
from gentamp_lp.planning.unguided import choose, plan_unguided, require_pddlstream, search_unguided
from gentamp_lp.policy.policy import Policy
from gentamp_lp.streams.formula import And, Atom
from gentamp_lp.streams.incremental import solve_incremental
from gentamp_lp.streams.interruption import interrupting
from gentamp_lp.streams.naming import Names
from gentamp_lp.streams.problem import PlanningProblem
from gentamp_lp.streams.semantics import Program, Step
from gentamp_lp.tasks.task import Instance

Progress = Callable[[str], None]


@dataclass(frozen=True)
class Found:
    """The steps of a plan, or the `failure` that is there instead; `planner` is what found them or ended.

    `stuck` says why the policy could not be followed to the end, also when a search then found a plan.
    """

    planner: str
    steps: Sequence[Step] | None = None
    failure: NoAnswer | LimitReached | None = None
    stuck: str | None = None


@dataclass(frozen=True)
class Search:
    """How to plan: along a `skeleton` (names of actions), following a `policy`, or else unguided.

    Without a policy `algorithm` says how sampling and search take turns, and `engine` who plans. Raises InputError for
    what does not go together.
    """

    policy: Policy | None
    skeleton: Sequence[str] | None
    algorithm: str | None
    engine: str
    progress: Progress

    def __post_init__(self) -> None:
        if self.policy is not None and self.engine != "embedded":
            raise InputError(Diagnostic("only the embedded engine follows policies", hint="add --mode unguided"))
        if self.engine == "pddlstream":
            require_pddlstream()

    @property
    def mode(self) -> Mode:
        """The mode's name."""
        return "skeleton" if self.skeleton is not None else "guided" if self.policy else "unguided"

    def run(self, instance: Instance, time_limit: float) -> Found:
        """Look for a plan for so many seconds."""
        deadline = time.perf_counter() + time_limit
        by_name = self.skeleton is not None or self.policy is not None
        planner = self.mode if by_name else self.algorithm or choose(instance)
        try:
            with interrupting(instance.base, time_limit):
                return Found(planner, self._steps(instance, time_limit))
        except DeadEnd as end:
            if self.mode == "guided" and self.policy is not None:
                return self._instead(self.policy, end, instance, deadline - time.perf_counter())
            return Found(planner, failure=end)
        except (NoAnswer, LimitReached) as error:
            return Found(planner, failure=error)

    def _instead(self, policy: Policy, end: DeadEnd, instance: Instance, time_limit: float) -> Found:
        """Search the constrained domain, where following the policy failed."""
        deadline = time.perf_counter() + time_limit
        planner = "constrained domain"
        try:
            with interrupting(instance.base, time_limit):
                end.reason += f"; there {situation(policy.features, instance.base, end.state)}"
                self.progress(f"following the policy failed ({end}); searching the constrained domain")
                steps = _constrained(policy, instance, end, deadline - time.perf_counter())
        except (NoAnswer, LimitReached) as error:
            return Found(planner, failure=error, stuck=str(end))
        return Found(planner, steps, stuck=str(end))

    def _steps(self, instance: Instance, time_limit: float) -> list[Step]:
        if self.skeleton is not None:
            return _along(self.skeleton, instance, self.algorithm, time_limit, self.progress)
        if self.policy is not None:
            return GuidedPlanner(self.policy, instance).solve(time_limit=time_limit).steps
        return plan_unguided(instance, self.algorithm, self.engine, time_limit, self.progress)


def _along(
    names: Sequence[str],
    instance: Instance,
    algorithm: str | None,
    time_limit: float,
    progress: Progress,
) -> list[Step]:
    """Search for the arguments of a skeleton."""
    task = instance.task
    domain, goal, start = skeleton_domain(task.folder.domain, task.goal, names)
    problem = PlanningProblem(Program.of(domain), instance.base, instance.state | start, goal, Names())
    return original_steps(search_unguided(problem, instance, algorithm, time_limit, progress))


def _constrained(policy: Policy, instance: Instance, end: DeadEnd, time_limit: float) -> list[Step]:
    """Search the constrained domain over samples. Raises the dead end again when there is no plan."""
    task = instance.task
    program = Program.of(constrained_domain(policy, task.folder, policy.sorts, "local", [instance.state]))
    goal = And((task.goal, Atom("ready", ())))
    try:
        found = solve_incremental(
            program, instance.base, instance.state, goal,
            quota=task.file.samples, time_limit=time_limit, max_levels=4,
        )  # fmt: skip
    except NoAnswer:
        raise end from None
    return [step for step in map(original_step, found) if step is not None]
