"""The JSON Schemas of what users write and of what the commands print; `gentamp-lp schema NAME` shows one."""

from __future__ import annotations

from typing import Any

from pydantic import TypeAdapter

from gentamp_lp.bench.runs import BenchReport, Row
from gentamp_lp.cli.documents import (
    CheckReport,
    CompileReport,
    DoctorReport,
    ExplainReport,
    ValidateReport,
)
from gentamp_lp.features.listing import FeaturesReport
from gentamp_lp.geometry.description import Description
from gentamp_lp.planning.solved import SolveReport
from gentamp_lp.plans.plan import PlanFile
from gentamp_lp.policy.learn_report import Failure, LearnReport
from gentamp_lp.report.document import PageReport
from gentamp_lp.synthesis.certificate import Certificate
from gentamp_lp.synthesis.show import SynthesisReport
from gentamp_lp.tasks.task import TaskFile

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
