"""Problems on which following a policy failed: kept beside the policy, so that learning can go on from there.

`gentamp-lp solve` appends to `failures.jsonl` in the bundle; `gentamp-lp learn --refine` learns again with these
problems and lists them as `refined_on` in the new bundle's `report.json` (counterexample-guided refinement).
"""

from __future__ import annotations

import json
from dataclasses import asdict
from pathlib import Path
from typing import Any

from gentamp_lp.base.reading import read_text
from gentamp_lp.base.writing import writing
from gentamp_lp.errors import Diagnostic, InputError
from gentamp_lp.policy.learn_report import Failure, read_report

_FILE = "failures.jsonl"
_FIELDS = {"size": str, "seed": int, "robot": str, "reason": str}


def record(folder: Path, failure: Failure) -> None:
    """Append a failure to a bundle, unless its problem is there. Raises InputError when it cannot be written."""
    if any(_problem(known) == _problem(failure) for known in known_failures(folder)):
        return
    path = folder / _FILE
    with writing(path), path.open("a", encoding="utf-8") as file:
        file.write(json.dumps(asdict(failure), ensure_ascii=False) + "\n")


def known_failures(folder: Path) -> list[Failure]:
    """What a bundle was refined on, then what failed since. Raises InputError for a damaged file."""
    return [*_refined_on(folder), *_failed(folder / _FILE)]


def settings(folder: Path) -> dict[str, Any]:
    """How a bundle was learned: keyword arguments of `learn` by name, and its `task`.

    Raises InputError when the bundle does not say.
    """
    found: dict[str, Any] | None = read_report(folder).get("settings")
    if found is None:
        hint = "refine a bundle that `gentamp-lp learn` wrote"
        raise InputError(
            Diagnostic("the report does not say how the policy was learned", folder / "report.json", hint=hint)
        )
    return found


def _problem(failure: Failure) -> tuple[str, int, str]:
    return failure.size, failure.seed, failure.robot


def _refined_on(folder: Path) -> list[Failure]:
    return [_failure(row, folder / "report.json", None) for row in read_report(folder).get("refined_on", ())]


def _failed(path: Path) -> list[Failure]:
    lines = read_text(path).splitlines() if path.exists() else []
    found = []
    for number, line in enumerate(lines, 1):
        try:
            found.append(_failure(json.loads(line), path, number))
        except json.JSONDecodeError as error:
            raise InputError(Diagnostic(f"not JSON: {error.msg}", path, number)) from None
    return found


def _failure(row: Any, path: Path, line: int | None) -> Failure:
    if not isinstance(row, dict) or {k: type(v) for k, v in row.items()} != _FIELDS:
        raise InputError(Diagnostic(f"not a failure: want {', '.join(_FIELDS)}", path, line))
    return Failure(**row)
