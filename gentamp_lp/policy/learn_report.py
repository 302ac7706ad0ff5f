"""What `learn` reports: `report.json` of a policy bundle."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import BaseModel, BeforeValidator, ConfigDict, Field, TypeAdapter, ValidationError

from gentamp_lp.abstraction.theory import Unseen
from gentamp_lp.base.documents import Document
from gentamp_lp.base.reading import read_json
from gentamp_lp.errors import Diagnostic, InputError
from gentamp_lp.synthesis.fairness import Fairness


@dataclass(frozen=True)
class Failure:
    """A problem, and why a policy could not be followed on it."""

    size: str
    seed: int
    robot: str
    reason: str


class FeatureEntry(Document):
    """A selected feature."""

    name: str
    formula: str
    """first-order formula in logical notation"""
    term: str
    """the same as a Prolog term, as in features.pl"""
    kind: Literal["boolean", "numeric"]
    cost: int
    open: bool
    """whether its value depends on how much was sampled"""
    why: str
    """what goes wrong without it"""


class ActionEntry(Document):
    """An abstract action."""

    name: str
    schemas: list[str]
    """the concrete actions with which it was seen"""
    preconditions: dict[str, bool]
    """feature: true or positive"""
    effects: dict[str, Literal["increase", "decrease", "true", "false"]]


class RuleEntry(Document):
    """What the policy does in an abstract state."""

    state: dict[str, bool]
    """feature: true or positive"""
    action: str


class PoolStatistics(Document):
    """What the feature pool holds."""

    formulas: int
    features: int
    views_too_large: int
    """predicates' views left out because they would not fit into memory"""
    seconds: float


class PruningEntry(BaseModel):
    """What became of the formulas that a rule made at a level: counts by reason, `new` for those that were kept."""

    model_config = ConfigDict(extra="allow", use_attribute_docstrings=True)
    __pydantic_extra__: dict[str, int]

    level: str
    rule: str


class LearnSettings(Document):
    """How a policy is learned; null stands for the task's own value, or for `seed` in the place of `solver_seed`."""

    model_config = ConfigDict(frozen=True)

    seed: int = Field(default=0, ge=0)
    """Same seed, same result."""
    solver_seed: int | None = Field(default=None, ge=0)
    """Seed of clingo's search alone [--seed]."""
    robot: str | None = None
    """Robot instead of the task's: a name or a .yaml, see docs/robots.md."""
    grammars: tuple[Annotated[str, BeforeValidator(str)], ...] = ()
    """Grammar file to add, or the name of a shipped one: paper (repeatable)."""
    max_complexity: int | None = Field(default=None, ge=1)
    """Highest cost of a feature [that of the task file]."""
    around: bool = True
    """Plans only, or plans and what is around them."""
    fairness: Fairness = "qnp"
    """Weakest guarantee to accept."""
    unseen: Unseen = "drop"
    """Falling counts may run out or not; what to make of outcomes that no state shows."""

    def changed(self, changes: Mapping[str, Any]) -> LearnSettings:
        """The settings with other values. Raises InputError, naming the setting, for values that cannot be."""
        try:
            return LearnSettings.model_validate({**dict(self), **changes})
        except ValidationError as error:
            raise InputError(*(f"{'.'.join(map(str, e['loc']))}: {e['msg']}" for e in error.errors())) from None


class _OfTask(Document):
    task: str
    """name of a shipped task, or path of the task file"""


class RecordedSettings(LearnSettings, _OfTask):
    """What `learn` was called with."""


class LearnSeconds(Document):
    """Wall-clock time of the stages."""

    demonstrations: float
    pool: float
    theory: float
    solving: float
    policy: float
    rollouts: float
    compilation: float
    total: float


class LearnReport(Document):
    """What `learn --json` prints, and report.json of a policy bundle."""

    task: str
    version: str
    features: list[FeatureEntry]
    actions: list[ActionEntry]
    policy: list[RuleEntry]
    fairness: Fairness
    """the level that the certificate proves"""
    optimal: bool
    cost: int
    bound: int
    """proved lower bound of the cost, at `complexity`"""
    complexity: int
    """of the pool from which the features come"""
    proved_complexity: int
    """no cheaper abstraction exists among features up to this complexity"""
    states: int
    transitions: int
    problems: int
    pool_size: int
    pool_statistics: PoolStatistics
    pruning: list[PruningEntry]
    refinement_rounds: int
    refined_on: list[Failure]
    validation: list[str]
    """sizes on which the policy was tried"""
    notes: list[str]
    settings: RecordedSettings
    seconds: LearnSeconds


def read_report(folder: Path) -> Mapping[str, Any]:
    """The report of a bundle, empty if there is none; parts may be missing. Raises InputError when it is damaged."""
    path = folder / "report.json"
    report = read_json(path) if path.exists() else {}
    try:
        if not isinstance(report, dict):
            raise InputError(Diagnostic("the report is not a JSON object", path))
        for name in report.keys() & LearnReport.model_fields.keys():
            TypeAdapter(LearnReport.model_fields[name].rebuild_annotation()).validate_python(report[name])
    except ValidationError as error:
        wrong = error.errors()[0]
        place = ".".join(map(str, (name, *wrong["loc"])))
        raise InputError(Diagnostic(f"{place}: {wrong['msg']}", path, hint="gentamp-lp schema learn")) from None
    return report
