"""How a policy is learned: the one declaration that command line, Python and report share."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any

from pydantic import BeforeValidator, ConfigDict, Field, ValidationError

from gentamp_lp.base.documents import Document
from gentamp_lp.base.fairness import Fairness, Unseen
from gentamp_lp.errors import InputError


def _plain(name: object) -> object:
    return str(name) if isinstance(name, Path) else name


class LearnSettings(Document):
    """How a policy is learned; null stands for the task's own value, or for `seed` in the place of `solver_seed`."""

    model_config = ConfigDict(frozen=True)

    seed: int = Field(default=0, ge=0)
    """Same seed, same result."""
    solver_seed: int | None = Field(default=None, ge=0)
    """Seed of clingo's search alone [--seed]."""
    robot: str | None = None
    """Robot instead of the task's: a name or a .yaml, see docs/robots.md."""
    grammars: tuple[Annotated[str, BeforeValidator(_plain)], ...] = ()
    """Grammar file to add, or the name of a shipped one: paper (repeatable)."""
    max_complexity: int | None = Field(default=None, ge=1)
    """Highest cost of a feature [that of the task file]."""
    around: bool = True
    """Plans only, or plans and what is around them."""
    fairness: Fairness = "qnp"
    """Weakest guarantee to accept."""
    unseen: Unseen = "drop"
    """Falling counts may run out or not; what to make of outcomes that no state shows."""

    def changed(self, changes: Mapping[str, Any]) -> LearnSettings:
        """The settings with other values. Raises InputError, naming the setting, for values that cannot be."""
        try:
            return LearnSettings.model_validate({**dict(self), **changes})
        except ValidationError as error:
            raise InputError(*(f"{'.'.join(map(str, e['loc']))}: {e['msg']}" for e in error.errors())) from None
