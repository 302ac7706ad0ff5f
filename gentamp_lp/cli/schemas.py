"""The JSON Schemas of what users write and of what the commands print; `gentamp-lp schema NAME` shows one.

Rows that a module collects as dataclasses are described by these; what commands put together is described here.
"""

from __future__ import annotations

from typing import Any, Literal

from pydantic import Field, TypeAdapter

from gentamp_lp.base.documents import Document
from gentamp_lp.bench.runs import Cell, Row
from gentamp_lp.cli.doctor import Finding
from gentamp_lp.explaining.what_it_does import ExplainedFeature, ExplainedState
from gentamp_lp.features.listing import ListedFeature, ListedFormula
from gentamp_lp.geometry.description import Description
from gentamp_lp.planning.solved import SolveReport
from gentamp_lp.policy.learn_report import Failure, LearnReport, PruningEntry
from gentamp_lp.synthesis.fairness import Fairness
from gentamp_lp.tasks.task import TaskFile


class Decision(Document):
    """What the policy does in a state."""

    state: str
    action: str


class ProblemSize(Document):
    """How large the problem was."""

    states: int
    choices: int


class SynthesisReport(Document):
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


class CertificateRule(Document):
    """What the policy does in a state, and what may come of it."""

    state: str
    action: str
    outcomes: list[str]
    con_A: list[str]
    """fairness constraints of which the action is a premise: counts that it lowers"""
    con_B: list[str]
    """fairness constraints that the action breaks: counts that it raises"""


class Deletion(Document):
    """A step of the proof that the policy ends: among these states the constraint removes its actions."""

    constraint: str
    states: list[str]


class SourceText(Document):
    """A file of the problem."""

    name: str
    text: str


class Certificate(Document):
    """A policy and why it is right, with the text of its problem."""

    format: Literal["gentamp-lp policy certificate"]
    version: Literal[1]
    fairness: Fairness
    initial: list[str]
    rules: list[CertificateRule]
    deletions: list[Deletion]
    """in this order"""
    sources: list[SourceText]


class FeaturesReport(Document):
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


class LearningTime(Document):
    """Seconds of learning without demonstrations, and the paper's."""

    task: str
    seconds: float
    paper: float | None


class BenchReport(Document):
    """What `bench --json` prints."""

    results: str
    """path of the table"""
    figure: str
    summary: list[Cell]
    learning: list[LearningTime]


class ValidateReport(Document):
    """What `validate --json` prints."""

    file: str
    valid: bool
    problems: list[str]


class ExplainReport(Document):
    """What `explain --json` prints."""

    features: list[ExplainedFeature]
    states: list[ExplainedState]
    """the states of the plan, with `--state`"""


class CompileReport(Document):
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


class CheckReport(Document):
    """What `check --json` prints."""

    files: list[str]
    errors: list[str]
    """file:line: message"""


class DoctorReport(Document):
    """What `doctor --json` prints."""

    ok: bool
    version: str
    findings: list[Finding]


class AbstractState(Document):
    """An abstract state on the report page."""

    state: str
    values: list[str]
    initial: bool
    goal: bool
    does: str
    outcomes: list[str]


class Ending(Document):
    """A step of the proof that the policy ends: the feature falls and never rises among these states."""

    feature: str
    states: list[str]


class View(Document):
    """Where the picture of a plan is taken from."""

    eye: tuple[float, float, float]
    """metres"""
    target: tuple[float, float, float]
    angle: float
    """degrees"""


class AnimatedPlan(Document):
    """A plan for the viewer of the page."""

    viewer: str
    """HTML"""
    frames: list[tuple[int, dict[str, list[float]]]]
    """step, and position (m) and quaternion x, y, z, w of each node that moved"""
    camera: View


class RunOnPage(Document):
    """A demonstration, or the plan."""

    title: str
    states: list[ExplainedState]
    animation: AnimatedPlan | None


class PageReport(Document):
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
