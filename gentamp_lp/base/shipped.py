"""Where the shipped `logic/`, `asp/`, `domains/` and `tasks/` folders are, in a checkout and in a wheel."""

from __future__ import annotations

from pathlib import Path

PACKAGE = Path(__file__).resolve().parents[1]
_IN_WHEEL = PACKAGE / "_data"


def resource(*names: str) -> Path:
    """Return the path of a shipped file or folder, e.g. `resource("tasks", "unstack.yaml")`."""
    return (_IN_WHEEL if _IN_WHEEL.is_dir() else PACKAGE.parent).joinpath(*names)
