"""What `learn` returns: a policy with all that is reported about it."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

from gentamp_lp.abstraction.choose import Solution
from gentamp_lp.base.version import __version__
from gentamp_lp.demonstrations.dataset import Dataset
from gentamp_lp.explaining.why_selected import reasons
from gentamp_lp.features.axioms import Features
from gentamp_lp.features.open_world import Openness
from gentamp_lp.features.pool import Pool
from gentamp_lp.features.values import describe_value, recorded
from gentamp_lp.policy.learn_report import Failure, LearnReport
from gentamp_lp.policy.learn_settings import LearnSettings
from gentamp_lp.policy.policy import Policy
from gentamp_lp.tasks.task import Task


@dataclass(frozen=True)
class Learned:
    """A learned policy with all that is reported about it.

    `complexity` is that of the pool in which the policy was found; no abstraction with features up to complexity
    `proved` is cheaper. `rounds` counts refinements, `seconds` the time of each stage.
    """

    task: Task
    settings: LearnSettings
    policy: Policy
    dataset: Dataset
    pool: Pool
    solution: Solution
    complexity: int
    proved: int
    interrupted: bool
    rounds: int
    notes: tuple[str, ...]
    refined_on: tuple[Failure, ...]
    domain_pddl: str
    stream_pddl: str
    seconds: dict[str, float]

    @cached_property
    def document(self) -> LearnReport:
        """What `gentamp-lp learn` reports."""
        policy, solution, data = self.policy, self.solution, self.dataset
        names = [feature.name for feature in policy.features]
        seconds = {stage: round(seconds, 3) for stage, seconds in self.seconds.items()}
        return LearnReport.model_validate(
            {
                "task": self.task.name,
                "version": __version__,
                "features": self._features(),
                "actions": [asdict(action) for action in policy.actions],
                "policy": [
                    {"state": dict(zip(names, rule.valuation, strict=True)), "action": rule.action}
                    for rule in policy.rules
                ],
                "fairness": policy.fairness,
                "optimal": solution.optimal,
                "cost": solution.cost,
                "bound": solution.bound,
                "complexity": self.complexity,
                "proved_complexity": self.proved,
                "states": len(data.states),
                "transitions": len(data.transitions),
                "problems": len(data.problems),
                "pool_size": self.pool.size,
                "pool_statistics": self.pool.statistics,
                "pruning": [{"level": row.level, "rule": row.rule, **row.counts} for row in self.pool.pruned],
                "refinement_rounds": self.rounds,
                "refined_on": self.refined_on,
                "validation": self.task.validation_sizes,
                "notes": self.notes,
                "settings": {"task": self.task.reference, **dict(self.settings)},
                "seconds": {**seconds, "total": round(sum(self.seconds.values()), 3)},
            }
        )

    def report(self) -> dict[str, Any]:
        """The JSON document of `gentamp-lp learn`."""
        return self.document.dump()

    def save(self, folder: Path) -> None:
        """Write the policy bundle, whole or not at all."""
        self.policy.save(folder, domain_pddl=self.domain_pddl, stream_pddl=self.stream_pddl, report=self.report())

    def _features(self) -> list[dict[str, Any]]:
        openness = Openness(self.task.folder.domain, self.task.folder.streams, self.dataset.sorts)
        return [
            {
                "name": f.name,
                "formula": f.text,
                "term": f.formula,
                "kind": f.kind,
                "cost": f.cost,
                "open": openness.is_open(f.formula, f.variable, f.sort),
                "why": self.reasons[f.name],
            }
            for f in self.policy.features
        ]

    @cached_property
    def reasons(self) -> dict[str, str]:
        """Why each feature was selected: what goes wrong without it."""
        chosen = {t.source: t for t in (self.dataset.transitions[number] for number in self.solution.chosen)}
        features = dict(zip(self.solution.features, self.policy.features, strict=True))
        see = recorded(self.dataset, self.task, Features.of(self.policy.features))
        found = reasons(
            self.solution,
            lambda number, state: f"{self.dataset.name(state)}, where {describe_value(features[number], see(state))}",
            lambda state: str(chosen[state]),
        )
        return {f.name: found[number] for number, f in features.items()}
