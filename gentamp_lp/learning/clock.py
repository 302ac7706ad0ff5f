"""The time that learning takes, stage by stage."""

from __future__ import annotations

import time
from collections.abc import Iterator
from contextlib import contextmanager

STAGES = ("demonstrations", "pool", "theory", "solving", "policy", "rollouts", "compilation")


class Clock:
    """Seconds spent in each stage, and what is left of the time limit (seconds)."""

    def __init__(self, time_limit: float) -> None:
        self._deadline = time.monotonic() + time_limit
        self._seconds = dict.fromkeys(STAGES, 0.0)

    @contextmanager
    def stage(self, name: str) -> Iterator[None]:
        """Count the time of the block."""
        start = time.perf_counter()
        try:
            yield
        finally:
            self._seconds[name] += time.perf_counter() - start

    def move(self, source: str, target: str, seconds: float) -> None:
        """Count seconds that passed in one stage for another."""
        self._seconds[source] -= seconds
        self._seconds[target] += seconds

    def left(self) -> float:
        """Seconds until the deadline, below zero when it has passed."""
        return self._deadline - time.monotonic()

    def seconds(self) -> dict[str, float]:
        """Seconds of each stage so far."""
        return dict(self._seconds)
