"""What the report page shows, as data."""

from __future__ import annotations

from gentamp_lp.base.documents import Document
from gentamp_lp.base.fairness import Fairness
from gentamp_lp.explaining.what_it_does import ExplainedFeature, ExplainedState
from gentamp_lp.features.pool import PruningEntry


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
    frames: list[tuple[int, dict[int, list[float]]]]
    """step, and position (m) and quaternion x, y, z, w of each node that moved"""
    camera: View


class RunOnPage(Document):
    """A demonstration, or the plan."""

    title: str
    states: list[ExplainedState]
    animation: AnimatedPlan | None


class PageData(Document):
    """The data of the page."""

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


class _PageFile(Document):
    file: str
    bytes: int


class PageReport(PageData, _PageFile):
    """What `report --json` prints: the data of the page, and where it is."""
