"""The JSON Schemas of what users write and of what the commands print; `gentamp-lp schema NAME` shows one."""

from __future__ import annotations

from typing import Any, Literal

from pydantic import BaseModel, ConfigDict

from gentamp_lp.geometry.description import Description
from gentamp_lp.task import TaskFile

Fairness = Literal["strong", "qnp", "strong-cyclic"]


class _Document(BaseModel):
    model_config = ConfigDict(extra="forbid", use_attribute_docstrings=True)


class FeatureEntry(_Document):
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


class ActionEntry(_Document):
    """An abstract action."""

    name: str
    schemas: list[str]
    """the concrete actions with which it was seen"""
    preconditions: dict[str, bool]
    """feature: true or positive"""
    effects: dict[str, Literal["increase", "decrease", "true", "false"]]


class RuleEntry(_Document):
    """What the policy does in an abstract state."""

    state: dict[str, bool]
    """feature: true or positive"""
    action: str


class PoolStatistics(_Document):
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


class FailureEntry(_Document):
    """A problem on which a policy could not be followed."""

    size: str
    seed: int
    robot: str
    reason: str


class LearnSettings(_Document):
    """What `learn` was called with; null stands for the task's own value."""

    task: str
    seed: int
    solver_seed: int | None
    robot: str | None
    grammars: list[str]
    max_complexity: int | None
    around: bool
    fairness: Fairness
    unseen: Literal["drop", "refuse"]


class LearnSeconds(_Document):
    """Wall-clock time of the stages."""

    demonstrations: float
    pool: float
    theory: float
    solving: float
    policy: float
    rollouts: float
    compilation: float
    total: float


class LearnReport(_Document):
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
    refined_on: list[FailureEntry]
    validation: list[str]
    """sizes on which the policy was tried"""
    notes: list[str]
    settings: LearnSettings
    seconds: LearnSeconds


class StreamCalls(_Document):
    """How often a stream was called, and how often it gave something."""

    calls: int
    successes: int


class SolveReport(_Document):
    """What `solve --json` prints."""

    task: str
    size: str
    parameters: dict[str, int]
    seed: int
    robot: str
    mode: Literal["guided", "unguided", "skeleton"]
    engine: Literal["embedded", "pddlstream"]
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
    """seconds of the plan's own stream calls, replayed alone"""
    floor_ratio: float | None
    validation_seconds: float
    streams: dict[str, StreamCalls]
    plan_length: int | None
    plan: list[list[str]] | None
    """one list a step: the action and its arguments"""
    motion: dict[str, float] | None
    """with `--motion`: how many `transits` were found, how many of these are `straight`, and the `seconds`"""


class Decision(_Document):
    """What the policy does in a state."""

    state: str
    action: str


class ProblemSize(_Document):
    """How large the problem was."""

    states: int
    choices: int


class SynthesisReport(_Document):
    """What `synthesize --json` prints."""

    solvable: bool | None
    """null if a limit came first"""
    fairness: Fairness
    policy: list[Decision]
    states: int
    """states in which the policy acts"""
    optimal: bool
    """no policy has fewer states (`--minimize`)"""
    bound: int
    problem: ProblemSize
    seconds: float
    statistics: dict[str, int]
    reason: str | None = None
    """why there is no policy"""


FORMATS: dict[str, tuple[type[BaseModel], str]] = {
    "task": (TaskFile, "A task file (YAML)"),
    "robot": (Description, "The description of a robot (YAML)"),
    "learn": (LearnReport, "`learn --json`, and `report.json` of a policy bundle"),
    "solve": (SolveReport, "`solve --json`"),
    "synthesize": (SynthesisReport, "`synthesize --json`"),
}


def schema(name: str) -> dict[str, Any]:
    """Return the JSON Schema (draft 2020-12) of one of FORMATS."""
    document = FORMATS[name][0].model_json_schema()
    return {"$schema": "https://json-schema.org/draft/2020-12/schema", **document}
