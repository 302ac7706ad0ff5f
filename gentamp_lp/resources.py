"""Where the shipped `logic/`, `asp/`, `domains/` and `tasks/` folders are, in a checkout and in a wheel."""

from __future__ import annotations

from importlib.resources import files
from pathlib import Path

_IN_WHEEL = Path(str(files(__package__))) / "_data"
_IN_CHECKOUT = Path(__file__).resolve().parent.parent


def resource(*names: str) -> Path:
    """Return the path of a shipped file or folder, e.g. `resource("tasks", "unstack.yaml")`."""
    return (_IN_WHEEL if _IN_WHEEL.is_dir() else _IN_CHECKOUT).joinpath(*names)
