"""Roll-outs: a policy is followed on problems; where it fails, the planner's way from there becomes training data."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace

from gentamp_lp.demonstrations.dataset import Dataset
from gentamp_lp.demonstrations.demonstrate import short_plan
from gentamp_lp.demonstrations.recorder import Recorder
from gentamp_lp.errors import LimitReached
from gentamp_lp.learning.run import Run
from gentamp_lp.planning.guided import DeadEnd, GuidedPlanner
from gentamp_lp.policy.learn_report import Failure
from gentamp_lp.policy.policy import Policy
from gentamp_lp.tasks.task import Instance

VALIDATION_SEEDS = 500  # added to the index of a validation problem, to keep it apart from training problems
_SECONDS = 60.0  # for one problem
_TRIES = 2  # rounds of guided planning before a roll-out counts as failed


@dataclass(frozen=True)
class Trial:
    """A problem to follow a policy on."""

    size: int | str
    seed: int
    robot: str | None


@dataclass(frozen=True)
class Trials:
    """The problems that a policy must solve: training problems, others, and those on which one failed before."""

    training: tuple[Trial, ...]
    validation: tuple[Trial, ...]
    failed: tuple[Trial, ...]

    @classmethod
    def of(cls, run: Run, failures: Iterable[Failure]) -> Trials:
        """The trials of a task: the same for the same seed."""
        first, robot = run.settings.seed * 1000, run.settings.robot
        return cls(
            tuple(Trial(size, first + i, robot) for i, size in enumerate(run.task.file.train)),
            tuple(Trial(size, first + VALIDATION_SEEDS + i, robot) for i, size in enumerate(run.task.validation_sizes)),
            tuple(Trial(failure.size, failure.seed, failure.robot) for failure in failures),
        )


@dataclass(frozen=True)
class Tried:
    """Where a policy failed, and which roll-outs took too long to show anything: a sentence for each."""

    failures: tuple[str, ...] = ()
    unfinished: tuple[str, ...] = ()

    @property
    def notes(self) -> tuple[str, ...]:
        """Both."""
        return self.unfinished + self.failures


def try_out(policy: Policy, stages: Iterable[Sequence[Trial]], data: Dataset, run: Run) -> Tried:
    """Follow a policy on the trials of each stage, until a stage has failures; `data` gets a demonstration of each."""
    unfinished: list[str] = []
    failures: list[str] = []
    with run.clock.stage("rollouts"):
        for trials in stages:
            for trial in trials:
                _roll_out(policy, trial, data, run, failures, unfinished)
            if failures:
                break
    return Tried(tuple(failures), tuple(unfinished))


def _roll_out(
    policy: Policy, trial: Trial, data: Dataset, run: Run, failures: list[str], unfinished: list[str]
) -> None:
    instance = run.task.instance(trial.size, trial.seed, robot=trial.robot)
    left = max(1.0, min(_SECONDS, run.clock.left()))
    name = f"{run.task.name}-{trial.size}"
    try:
        GuidedPlanner(policy, instance).solve(time_limit=left, max_rounds=_TRIES)
    except LimitReached:
        unfinished.append(f"{name}: the roll-out was not finished within {left:.0f} s")
        run.progress(unfinished[-1])
    except DeadEnd as end:
        failures.append(f"{name}: {end}")
        run.progress(f"roll-out failed on {failures[-1]}")
        _learn_from(end, instance, data, run)


def _learn_from(end: DeadEnd, instance: Instance, data: Dataset, run: Run) -> None:
    """Record what the planner does from where the policy failed, as a problem of its own.

    What the roll-out sampled in vain is forgotten: features should see as many samples there as elsewhere.
    """
    task, state = run.task, end.state
    base = instance.base.trimmed(task.file.samples, {name for fact in state for name in fact[1:]})
    plan = short_plan(task, base, state, time_limit=max(1.0, run.clock.left()), seed=instance.seed)
    Recorder(task, data, around=run.settings.around).record(replace(instance, base=base), plan, state)
