"""The outcome of planning one instance, and its report."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

from gentamp_lp.base.documents import Document
from gentamp_lp.errors import LimitReached
from gentamp_lp.planning.modes import Engine, Mode
from gentamp_lp.plans.plan import Plan
from gentamp_lp.tasks.task import Instance


class StreamCalls(Document):
    """How often a stream was called, and how often it gave something."""

    calls: int
    successes: int


class Motion(Document):
    """How the transits were found."""

    transits: int
    straight: int
    """how many of them are"""
    anew: int
    """how often steps were chosen again for want of a transit"""
    seconds: float


class SolveReport(Document):
    """What `solve --json` prints."""

    task: str
    size: str
    parameters: dict[str, int]
    seed: int
    robot: str
    mode: Mode
    engine: Engine
    planner: str
    """who found the plan"""
    solved: bool
    valid: bool
    """the plan passed the independent validator"""
    reason: str | None
    """why there is no plan"""
    stuck: str | None
    """where the policy could not be followed"""
    problems: list[str]
    """what the validator found wrong"""
    seconds: float
    stream_seconds: float
    stream_floor: float | None
    """with `--floor`: seconds of the plan's own stream calls, replayed alone"""
    floor_ratio: float | None
    validation_seconds: float
    streams: dict[str, StreamCalls]
    plan_length: int | None
    plan: list[list[str]] | None
    """one list a step: the action and its arguments"""
    motion: Motion | None
    """with `--motion`"""


@dataclass(frozen=True)
class Solved:
    """The outcome of one run; `plan` is None when nothing was found, `problems` what the validator objects to.

    `stuck` says why the policy could not be followed to the end, also when a search then found a plan. `floor` is the
    plan's stream floor in seconds, if it was asked for.
    """

    instance: Instance
    mode: str
    engine: str
    planner: str
    seconds: float
    plan: Plan | None = None
    problems: tuple[str, ...] = ()
    validation_seconds: float = 0.0
    floor: float | None = None
    reason: str | None = None
    limit: LimitReached | None = None
    stuck: str | None = None
    motion: dict[str, float] | None = None

    @property
    def limited(self) -> bool:
        """Whether a limit ended the search, so that there may be a plan all the same."""
        return self.limit is not None

    @property
    def valid(self) -> bool:
        """Whether there is a plan and the validator accepts it."""
        return self.plan is not None and not self.problems

    @cached_property
    def document(self) -> SolveReport:
        """What `gentamp-lp solve` reports."""
        statistics = self.instance.base.statistics
        return SolveReport.model_validate(
            {
                "task": self.instance.task.name,
                "size": self.instance.size,
                "parameters": self.instance.parameters,
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
        )

    def report(self) -> dict[str, Any]:
        """The JSON document of `gentamp-lp solve`."""
        return self.document.dump()
