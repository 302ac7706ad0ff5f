"""What commands print with `--json`, where they put it together themselves."""

from __future__ import annotations

from gentamp_lp.base.documents import Document
from gentamp_lp.cli.doctor import Finding
from gentamp_lp.explaining.what_it_does import ExplainedFeature, ExplainedState


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
