"""The JSON Schemas of what users write and of what the commands print; `gentamp-lp schema NAME` shows one.

Rows that a module collects as dataclasses are described by these; what commands put together is described here.
"""

from __future__ import annotations

from typing import Any, Literal

from pydantic import BaseModel, ConfigDict, Field, TypeAdapter

from gentamp_lp.bench import Cell, Row
from gentamp_lp.doctor import Finding
from gentamp_lp.explain import ExplainedFeature, ExplainedState
from gentamp_lp.geometry.description import Description
from gentamp_lp.listing import ListedFeature, ListedFormula
from gentamp_lp.refinement import Failure
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
    refined_on: list[Failure]
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
    """with `--motion`: how many `transits` were found, how many of these are `straight`, how often steps were chosen
    `anew` for want of one, and the `seconds`"""


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


class PlanStep(_Document):
    """A step of a plan."""

    action: str
    args: list[str]


class PlanFile(_Document):
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


class CertificateRule(_Document):
    """What the policy does in a state, and what may come of it."""

    state: str
    action: str
    outcomes: list[str]
    con_A: list[str]
    """fairness constraints of which the action is a premise: counts that it lowers"""
    con_B: list[str]
    """fairness constraints that the action breaks: counts that it raises"""


class Deletion(_Document):
    """A step of the proof that the policy ends: among these states the constraint removes its actions."""

    constraint: str
    states: list[str]


class SourceText(_Document):
    """A file of the problem."""

    name: str
    text: str


class Certificate(_Document):
    """A policy and why it is right, with the text of its problem."""

    format: Literal["gentamp-lp policy certificate"]
    version: Literal[1]
    fairness: Fairness
    initial: list[str]
    rules: list[CertificateRule]
    deletions: list[Deletion]
    """in this order"""
    sources: list[SourceText]


class FeaturesReport(_Document):
    """What `features --json` prints."""

    task: str
    complexity: int
    states: int
    transitions: int
    state: str | None
    """the facts of the state that was asked for"""
    pool_size: int
    seconds: float
    features: list[ListedFeature]
    formulas: list[ListedFormula]
    pruning: list[PruningEntry]


class LearningTime(_Document):
    """Seconds of learning without demonstrations, and the paper's."""

    task: str
    seconds: float
    paper: float | None


class BenchReport(_Document):
    """What `bench --json` prints."""

    results: str
    """path of the table"""
    figure: str
    summary: list[Cell]
    learning: list[LearningTime]


class ValidateReport(_Document):
    """What `validate --json` prints."""

    file: str
    valid: bool
    problems: list[str]


class ExplainReport(_Document):
    """What `explain --json` prints."""

    features: list[ExplainedFeature]
    states: list[ExplainedState]
    """the states of the plan, with `--state`"""


class CompileReport(_Document):
    """What `compile --json` prints."""

    domain: str
    stream: str
    actions: list[str]
    doubtful: dict[str, list[str]]
    """feature: test predicates that it reads"""
    supposed: list[str]
    """invariants that the encoding supposes of initial states"""
    checked: dict[str, dict[str, str]]
    """copy of an action: the features that a `check` action has to look at (encoding `local`), and why"""


class CheckReport(_Document):
    """What `check --json` prints."""

    files: list[str]
    errors: list[str]
    """file:line: message"""


class DoctorReport(_Document):
    """What `doctor --json` prints."""

    ok: bool
    version: str
    findings: list[Finding]


class AbstractState(_Document):
    """An abstract state on the report page."""

    state: str
    values: list[str]
    initial: bool
    goal: bool
    does: str
    outcomes: list[str]


class Ending(_Document):
    """A step of the proof that the policy ends: the feature falls and never rises among these states."""

    feature: str
    states: list[str]


class View(_Document):
    """Where the picture of a plan is taken from."""

    eye: tuple[float, float, float]
    """metres"""
    target: tuple[float, float, float]
    angle: float
    """degrees"""


class AnimatedPlan(_Document):
    """A plan for the viewer of the page."""

    viewer: str
    """HTML"""
    frames: list[tuple[int, dict[str, list[float]]]]
    """step, and position (m) and quaternion x, y, z, w of each node that moved"""
    camera: View


class RunOnPage(_Document):
    """A demonstration, or the plan."""

    title: str
    states: list[ExplainedState]
    animation: AnimatedPlan | None


class PageReport(_Document):
    """What `report --json` prints: the data of the page."""

    file: str
    bytes: int
    task: str
    description: str
    goal: str
    proof: str
    fairness: Fairness
    graph: str
    """SVG"""
    features: list[ExplainedFeature]
    states: list[AbstractState]
    ends: list[Ending]
    runs: list[RunOnPage]
    numbers: dict[str, int]
    seconds: dict[str, float]
    pruning: list[PruningEntry]
    notes: list[str]


FORMATS: dict[str, tuple[type, str]] = {
    "task": (TaskFile, "A task file (YAML)"),
    "robot": (Description, "The description of a robot (YAML)"),
    "plan": (PlanFile, "The plan file of `solve --out`"),
    "certificate": (Certificate, "The certificate of `synthesize --out`"),
    "results": (Row, "A line of the `results.csv` of `bench`, its columns as JSON values"),
    "failures": (Failure, "A line of the `failures.jsonl` of a policy bundle"),
    "learn": (LearnReport, "`learn --json`, and `report.json` of a policy bundle"),
    "solve": (SolveReport, "`solve --json`"),
    "bench": (BenchReport, "`bench --json`"),
    "synthesize": (SynthesisReport, "`synthesize --json`"),
    "validate": (ValidateReport, "`validate --json`"),
    "features": (FeaturesReport, "`features --json`"),
    "explain": (ExplainReport, "`explain --json`"),
    "report": (PageReport, "`report --json`"),
    "compile": (CompileReport, "`compile --json`"),
    "check": (CheckReport, "`check --json`"),
    "doctor": (DoctorReport, "`doctor --json`"),
}


def schema(name: str) -> dict[str, Any]:
    """Return the JSON Schema (draft 2020-12) of one of FORMATS."""
    document = TypeAdapter(FORMATS[name][0]).json_schema()
    return {"$schema": "https://json-schema.org/draft/2020-12/schema", **document}
