"""Generalized task and motion planning with logic programming.

>>> from gentamp_lp import Task, learn, solve
>>> task = Task.load("unstack")
>>> learned = learn(task)                                    # doctest: +SKIP
>>> print(learned.policy.text())                             # doctest: +SKIP
>>> result = solve(task, 16, seed=1, policy=learned.policy)  # doctest: +SKIP
>>> result.valid, len(result.plan.steps)                     # doctest: +SKIP
(True, 22)
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

from gentamp_lp.base.version import __version__

if TYPE_CHECKING:
    from gentamp_lp.features.listing import list_features
    from gentamp_lp.learning.learn import learn
    from gentamp_lp.planning.solve import solve
    from gentamp_lp.policy.learn_settings import LearnSettings
    from gentamp_lp.policy.policy import Policy
    from gentamp_lp.tasks.task import Task

__all__ = ["LearnSettings", "Policy", "Task", "__version__", "learn", "list_features", "solve"]

_HOMES = {
    "LearnSettings": "policy.learn_settings",
    "Policy": "policy.policy",
    "Task": "tasks.task",
    "learn": "learning.learn",
    "list_features": "features.listing",
    "solve": "planning.solve",
}


def __getattr__(name: str) -> Any:
    """Import the parts on first use: `gentamp-lp --help` should not load a physics engine."""
    if name in _HOMES:
        return getattr(import_module(f"{__name__}.{_HOMES[name]}"), name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
