"""A learned policy: from a solution or a bundle, and its printed form."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from gentamp_lp.abstraction.choose import Solution
from gentamp_lp.abstraction.observations import Observations, observation_facts, parse_observations
from gentamp_lp.base.shipped import resource
from gentamp_lp.features.feature import Feature
from gentamp_lp.policy.bundle import load, save
from gentamp_lp.policy.certify import certify
from gentamp_lp.policy.check import problems
from gentamp_lp.policy.drawing import draw
from gentamp_lp.policy.model import AbstractAction, CertificateStep, PolicyGraph, Rule, Valuation
from gentamp_lp.solvers.asp import Term, deduce

__all__ = ["AbstractAction", "CertificateStep", "Feature", "Policy", "Rule", "Valuation"]

_SIGN = {"increase": "↑", "decrease": "↓", "true": "=⊤", "false": "=⊥"}


@dataclass(frozen=True)
class Policy(PolicyGraph):
    """Everything learned for one task; see `text()` to read it and `check()` for the guarantee."""

    @classmethod
    def from_solution(
        cls,
        solution: Solution,
        facts: str | Observations,
        formulas: Mapping[int, str],
        texts: Mapping[int, str],
        *,
        task: str = "",
        variables: Mapping[int, tuple[str | None, str | None]] | None = None,
        extra: Mapping[str, Any] | None = None,
    ) -> Policy:
        """Build the policy that a solution describes; `variables` maps a feature to its variable and sort."""
        observations = parse_observations(facts) if isinstance(facts, str) else facts
        return _Builder(solution, observations).build(formulas, texts, task, variables or {}, dict(extra or {}))

    @classmethod
    def load(cls, folder: Path | str) -> Policy:
        """Read a bundle, perhaps edited by hand; an InputError names file and line."""
        return cls(**vars(load(Path(folder))))

    def save(self, folder: Path | str, *, domain_pddl: str, stream_pddl: str, report: dict[str, Any]) -> None:
        """Write a bundle whole or not at all, in the place of an older one."""
        save(self, Path(folder), domain_pddl=domain_pddl, stream_pddl=stream_pddl, report=report)

    def svg(self) -> str:
        """Return the policy graph as a drawing."""
        return draw(self)

    def check(self) -> list[str]:
        """Verify the guarantee from the rules alone (asp/certificate.lp); one sentence for each thing that is wrong."""
        return problems(self)

    def text(self) -> str:
        """Return the policy for people: features, abstract actions, rules."""
        lines = [f"{self.task or 'policy'}: cost {self.cost}, {self._proof()}, fairness {self.fairness}", ""]
        lines.append("Features")
        for feature in self.features:
            lines.append(f"  {feature.name}  {feature.kind:<7}  cost {feature.cost}  {feature.text or feature.formula}")
        lines += ["", "Abstract actions"]
        kinds = {feature.name: feature for feature in self.features}
        for action in self.actions:
            lines.append(f"  {action.name}  {', '.join(action.schemas)}")
            conditions = (kinds[name].show(positive) for name, positive in action.preconditions.items())
            lines.append(f"      pre: {', '.join(conditions) or 'none'}")
            lines.append(f"      eff: {', '.join(name + _SIGN[e] for name, e in action.effects.items())}")
        lines += ["", "Policy"]
        for rule in self.rules:
            mark = "  (initial)" if rule.valuation in self.initial else ""
            lines.append(f"  {self.show(rule.valuation)}  do {rule.action}{mark}")
            for outcome in rule.outcomes:
                lines.append(f"      to {self.show(outcome)}{'  (goal)' if outcome in self.goals else ''}")
        if self.certificate:
            lines += ["", "Why it ends"]
            for number, step in enumerate(self.certificate, 1):
                lines.append(
                    f"  {number}. {step.feature} falls and never rises among {len(step.states)} "
                    f"abstract state{'s' if len(step.states) > 1 else ''}"
                )
        return "\n".join(lines) + "\n"

    def _proof(self) -> str:
        return "optimal" if self.optimal else f"not proved optimal (at least {self.bound})"


class _Builder:
    """The answer of `asp/policy.lp`, in the order of a walk, with names: f1, ... for features, a1, ... for actions."""

    def __init__(self, solution: Solution, observations: Observations) -> None:
        self.solution, self.observations = solution, observations
        self.names: dict[Term, str] = {feature: f"f{i}" for i, feature in enumerate(solution.features, 1)}
        mask = sum(1 << observations.bit(feature) for feature in solution.features)
        chosen = [f"selected({feature})." for feature in solution.features]
        chosen += [f"chosen({number})." for number in solution.chosen]
        facts = observation_facts(observations, mask) + "\n".join(chosen)
        self.found = defaultdict(list, deduce([resource("asp", "policy.lp")], facts))
        self.valuations: dict[Term, Valuation] = defaultdict(tuple)
        for state, _, word in self.found["value"]:
            self.valuations[state] += (word in ("true", "positive"),)

    def build(
        self,
        formulas: Mapping[int, str],
        texts: Mapping[int, str],
        task: str,
        variables: Mapping[int, tuple[str | None, str | None]],
        extra: dict[str, Any],
    ) -> Policy:
        known = {feature.id: feature for feature in self.observations.features}
        features = tuple(
            Feature(name, known[i].kind, known[i].cost, formulas[i], *variables.get(i, (None, None)), texts[i])
            for i, name in zip(self.solution.features, self.names.values(), strict=True)
        )
        initial, goals = (
            _sorted(self.valuations[state] for (state,) in self.found[name]) for name in ("initial", "goal")
        )
        does = {self.valuations[state]: action for state, action in self.found["rule"]}
        after: dict[Valuation, list[Valuation]] = {valuation: [] for valuation in does}
        for state, outcome in self.found["outcome"]:
            after[self.valuations[state]].append(self.valuations[outcome])
        outcomes = {valuation: _sorted(seen) for valuation, seen in after.items()}
        order = _breadth_first(initial, outcomes)
        name = {term: f"a{i}" for i, term in enumerate(dict.fromkeys(does[valuation] for valuation in order), 1)}
        actions = tuple(self.action(term, name[term]) for term in name)
        rules = tuple(Rule(valuation, name[does[valuation]], outcomes[valuation]) for valuation in order)
        level, certificate = certify(rules, actions, list(self.names.values()))
        return Policy(
            task, features, actions, rules, goals, initial, level, certificate,
            self.solution.optimal, self.solution.cost, self.solution.bound, extra,
        )  # fmt: skip

    def action(self, term: Term, name: str) -> AbstractAction:
        return AbstractAction(
            name,
            {self.names[f]: word in ("true", "positive") for a, f, word in self.found["precondition"] if a == term},
            {self.names[f]: str(word) for a, f, word in self.found["effect"] if a == term},
            tuple(sorted(str(schema) for a, schema in self.found["schema"] if a == term)),
        )


def _sorted(valuations: Iterable[Valuation]) -> tuple[Valuation, ...]:
    """Order abstract states, positive values first, each once."""
    return tuple(sorted(set(valuations), reverse=True))


def _breadth_first(initial: Sequence[Valuation], outcomes: Mapping[Valuation, Sequence[Valuation]]) -> list[Valuation]:
    """Order the abstract states as the policy meets them; those it never meets come last."""
    order = dict.fromkeys(valuation for valuation in initial if valuation in outcomes)
    queue = list(order)
    for valuation in queue:
        for after in outcomes[valuation]:
            if after in outcomes and after not in order:
                order[after] = None
                queue.append(after)
    return [*order, *sorted(set(outcomes) - order.keys(), reverse=True)]
