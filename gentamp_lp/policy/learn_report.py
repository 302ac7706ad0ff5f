"""What `learn` reports: `report.json` of a policy bundle."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

from pydantic import TypeAdapter, ValidationError

from gentamp_lp.base.documents import Document
from gentamp_lp.base.fairness import Fairness
from gentamp_lp.base.reading import read_json
from gentamp_lp.errors import Diagnostic, InputError
from gentamp_lp.features.pool import PruningEntry
from gentamp_lp.policy.learn_settings import LearnSettings


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
