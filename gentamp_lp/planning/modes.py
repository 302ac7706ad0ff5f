"""How an instance is planned."""

from __future__ import annotations

from typing import Literal

Mode = Literal["guided", "unguided", "skeleton"]
Algorithm = Literal["incremental", "adaptive"]
"""How sampling and search take turns in unguided planning."""
Engine = Literal["embedded", "pddlstream"]
"""Who plans."""
