"""Plans as values and files: enough numbers to check a plan without the planner that made it."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

from pydantic import Field

from gentamp_lp.base.documents import Document
from gentamp_lp.base.reading import read_json
from gentamp_lp.base.writing import write_text
from gentamp_lp.errors import Diagnostic, InputError
from gentamp_lp.streams.facts import Fact
from gentamp_lp.streams.semantics import Step
from gentamp_lp.tasks.domain_folder import running
from gentamp_lp.tasks.task import Instance

FORMAT: Literal["gentamp-lp plan 1"] = "gentamp-lp plan 1"


class PlanStep(Document):
    """A step of a plan."""

    action: str
    args: list[str]


class PlanFile(Document):
    """A plan with all that its check needs: the sampled values of its steps and what streams certified of them."""

    format: Literal["gentamp-lp plan 1"]
    task: str
    """name of a shipped task, or path of the task file"""
    size: str
    seed: int = Field(ge=0)
    robot: str
    steps: list[PlanStep]
    entities: dict[str, dict[str, Any]]
    """sampled values by name, written by the domain's own `encode`; lengths in metres, angles in radians"""
    facts: list[list[str]]
    """predicate and arguments"""
    transits: list[list[list[float]]] | None = None
    """with `--motion`: the way to the beginning of each step, as waypoints in the robot's configuration"""


@dataclass(frozen=True)
class Plan:
    """A plan for one instance: its steps, the sampled values they use, and the facts certified of these.

    `transits` are the motions that lead to the beginning of each step, if they were planned: waypoints as lists of
    numbers, which the domain's `check_plan` understands.
    """

    task: str
    size: str
    seed: int
    robot: str
    steps: tuple[Step, ...]
    entities: dict[str, dict[str, Any]]
    facts: tuple[Fact, ...]
    transits: tuple[Any, ...] | None = None

    @property
    def transit_args(self) -> tuple[tuple[Any, ...], ...]:
        """The last argument of a domain's functions on plans: left out without transits, of which it need not know."""
        return () if self.transits is None else (self.transits,)

    @classmethod
    def of(cls, instance: Instance, steps: Sequence[Step]) -> Plan:
        """Collect what a plan needs from the instance it was found in."""
        base, code = instance.base, instance.task.folder.code
        used = by_dependency([a for s in steps for a in s.args], instance)
        names = {id(value): name for name, value in base.values.items()}
        known = set(instance.given.values) | set(used)
        facts = [
            (predicate, *row)
            for predicate in sorted(base.makers)
            for row in base.relation(predicate).rows
            if set(row) <= known and set(row) & set(used)
        ]
        with running(instance.task.folder, "encode"):
            entities = {name: code.encode(base.values[name], names) for name in used}
        return cls(
            instance.task.reference,
            instance.size,
            instance.seed,
            instance.robot,
            tuple(steps),
            entities,
            tuple(facts),
        )

    def to_json(self) -> dict[str, Any]:
        """The plan as JSON data."""
        document = PlanFile.model_validate(
            {
                "format": FORMAT,
                "task": self.task,
                "size": self.size,
                "seed": self.seed,
                "robot": self.robot,
                "steps": [{"action": s.schema, "args": s.args} for s in self.steps],
                "entities": self.entities,
                "facts": self.facts,
                **({} if self.transits is None else {"transits": self.transits}),
            }
        )
        return document.model_dump(mode="json", exclude_unset=True)

    def save(self, path: Path) -> None:
        """Write the plan file, whole or not at all."""
        write_text(path, json.dumps(self.to_json(), indent=1) + "\n")

    @classmethod
    def load(cls, path: Path) -> Plan:
        """Read a plan file. Raises InputError when it is not one."""
        data = read_json(path)
        try:
            if data["format"] != FORMAT:
                raise InputError(Diagnostic(f"unknown format `{data['format']}`", path, 1))
            return cls(
                str(data["task"]),
                str(data["size"]),
                _seed(data["seed"]),
                str(data["robot"]),
                tuple(Step(str(s["action"]), tuple(map(str, s["args"]))) for s in data["steps"]),
                dict(data["entities"]),
                tuple(tuple(map(str, fact)) for fact in data["facts"]),
                tuple(data["transits"]) if "transits" in data else None,
            )
        except (KeyError, TypeError, ValueError) as error:
            hint = "write plans with `gentamp-lp solve --out`"
            raise InputError(Diagnostic(f"not a plan file: {error!r}", path, hint=hint)) from None


def _seed(value: Any) -> int:
    if type(value) is not int or value < 0:
        raise ValueError(f"a seed is a whole number from 0, not {value!r}")
    return value


def by_dependency(used: list[str], instance: Instance) -> list[str]:
    """Sampled entities after the ones their streams took as inputs, beside the ones made by the same call."""
    made = instance.base.made_by
    together: dict[object, list[str]] = {}
    for name, call in made.items():
        together.setdefault(call, []).append(name)
    ordered: dict[str, None] = {}

    def visit(name: str) -> None:
        if name in made and name not in ordered:
            for other in made[name][1]:
                visit(other)
            ordered.update(dict.fromkeys(together[made[name]]))

    for name in used:
        visit(name)
    return list(ordered)
