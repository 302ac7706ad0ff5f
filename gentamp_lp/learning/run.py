"""What the stages of one call of `learn` share."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

from gentamp_lp.base.fairness import ProgramName
from gentamp_lp.learning.clock import Clock
from gentamp_lp.policy.learn_settings import LearnSettings
from gentamp_lp.tasks.task import Task

Progress = Callable[[str], None]


@dataclass(frozen=True)
class Run:
    """A task and how a policy for it is learned; the result does not depend on `program`, if there is one."""

    task: Task
    settings: LearnSettings
    clock: Clock
    progress: Progress
    program: ProgramName = "lazy"

    @cached_property
    def grammars(self) -> list[Path]:
        """The grammar files of the task and of the settings."""
        return self.task.grammars([Path(name) for name in self.settings.grammars])

    @cached_property
    def highest(self) -> int:
        """The highest complexity of a feature."""
        return self.settings.max_complexity or self.task.file.max_complexity
