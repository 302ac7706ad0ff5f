"""A feature of a policy."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Feature:
    """A selected feature: `formula` is a term over `variable`, which ranges over `sort`."""

    name: str
    kind: str
    cost: int
    formula: str
    variable: str | None = None
    sort: str | None = None
    text: str = ""

    def show(self, positive: bool) -> str:
        """Return a condition on the feature as the paper prints it."""
        if self.kind == "boolean":
            return f"{self.name}={'⊤' if positive else '⊥'}"
        return f"{self.name}{'>0' if positive else '=0'}"
