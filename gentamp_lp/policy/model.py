"""A policy over abstract states, as a value.

Names follow the paper: Boolean and numeric features, abstract actions with preconditions and qualitative
effects, and rules that map a valuation of the features to one abstract action.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

from gentamp_lp.features.feature import Feature

Valuation = tuple[bool, ...]
"""One truth value for each feature of a policy, in order: a Boolean holds, a count is above zero."""


@dataclass(frozen=True)
class AbstractAction:
    """A qualitative change, with the conditions that agree wherever it was chosen."""

    name: str
    preconditions: dict[str, bool]
    effects: dict[str, str]
    schemas: tuple[str, ...] = ()


@dataclass(frozen=True)
class Rule:
    """In the abstract state `valuation` do `action`; `outcomes` are those that some seen state shows."""

    valuation: Valuation
    action: str
    outcomes: tuple[Valuation, ...]


@dataclass(frozen=True)
class CertificateStep:
    """Inside `states`, `feature` is lowered and never raised: the steps that lower it are taken finitely often."""

    feature: str
    states: tuple[Valuation, ...]


@dataclass(frozen=True)
class PolicyGraph:
    """Features, abstract actions and rules, with what is claimed of them: a guarantee and an optimum."""

    task: str
    features: tuple[Feature, ...]
    actions: tuple[AbstractAction, ...]
    rules: tuple[Rule, ...]
    goals: tuple[Valuation, ...]
    initial: tuple[Valuation, ...]
    fairness: str
    certificate: tuple[CertificateStep, ...]
    optimal: bool
    cost: int
    bound: int
    extra: dict[str, Any] = field(default_factory=dict)

    @property
    def sorts(self) -> dict[str, tuple[str, ...]]:
        """The sorts of the arguments of each predicate that features may speak of."""
        return {name: tuple(row) for name, row in self.extra["sorts"].items()}

    def rule_for(self, valuation: Mapping[str, bool] | Sequence[bool]) -> Rule | None:
        """Return the rule of an abstract state; None in a goal or in a state never seen."""
        if isinstance(valuation, Mapping):
            key = tuple(bool(valuation[feature.name]) for feature in self.features)
        else:
            key = tuple(map(bool, valuation))
        return next((rule for rule in self.rules if rule.valuation == key), None)

    def action(self, name: str) -> AbstractAction:
        """Return an abstract action by name."""
        return next(action for action in self.actions if action.name == name)

    def show(self, valuation: Valuation) -> str:
        """Return an abstract state as a line of conditions."""
        return ", ".join(f.show(positive) for f, positive in zip(self.features, valuation, strict=True))
