"""A learned policy: from a solution or a bundle, and its printed form."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from gentamp_lp.abstraction.choose import Solution
from gentamp_lp.abstraction.observations import Evidence, parse_evidence
from gentamp_lp.features.feature import Feature
from gentamp_lp.policy.bundle import load, save
from gentamp_lp.policy.drawing import draw
from gentamp_lp.policy.guarantee import certify, possible
from gentamp_lp.policy.model import AbstractAction, CertificateStep, PolicyGraph, Rule, Valuation
from gentamp_lp.policy.verdict import problems

__all__ = ["AbstractAction", "CertificateStep", "Feature", "Policy", "Rule", "Valuation"]

_SIGN = {"increase": "↑", "decrease": "↓", "true": "=⊤", "false": "=⊥"}


@dataclass(frozen=True)
class Policy(PolicyGraph):
    """Everything learned for one task; see `text()` for a look and `check()` for the guarantee."""

    @classmethod
    def from_solution(
        cls,
        solution: Solution,
        facts: str | Evidence,
        formulas: Mapping[int, str],
        texts: Mapping[int, str],
        *,
        task: str = "",
        variables: Mapping[int, tuple[str | None, str | None]] | None = None,
        extra: Mapping[str, Any] | None = None,
    ) -> Policy:
        """Build the policy that a solution describes; `variables` maps a feature to its variable and sort."""
        evidence = parse_evidence(facts) if isinstance(facts, str) else facts
        return _Builder(solution, evidence).build(formulas, texts, task, variables or {}, dict(extra or {}))

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
    """Project the sample onto the selected features."""

    def __init__(self, solution: Solution, evidence: Evidence) -> None:
        self.solution, self.evidence = solution, evidence
        self.bits = [evidence.bit(feature) for feature in solution.features]
        self.names = [f"f{i}" for i in range(1, len(self.bits) + 1)]
        self.kinds = [evidence.features[bit].kind for bit in self.bits]

    def look(self, state: int) -> Valuation:
        return tuple(bool(self.evidence.states[state] >> bit & 1) for bit in self.bits)

    def effect(self, number: int) -> tuple[str, ...]:
        """Return the change of each selected feature along a transition, empty where there is none."""
        step = self.evidence.transitions[number]
        words = {"boolean": ("true", "false"), "numeric": ("increase", "decrease")}
        return tuple(
            words[kind][0] if step.inc >> bit & 1 else words[kind][1] if step.dec >> bit & 1 else ""
            for bit, kind in zip(self.bits, self.kinds, strict=True)
        )

    def build(
        self,
        formulas: Mapping[int, str],
        texts: Mapping[int, str],
        task: str,
        variables: Mapping[int, tuple[str | None, str | None]],
        extra: dict[str, Any],
    ) -> Policy:
        evidence = self.evidence
        features = tuple(
            Feature(name, kind, evidence.features[bit].cost, formulas[i], *variables.get(i, (None, None)), texts[i])
            for name, kind, bit, i in zip(self.names, self.kinds, self.bits, self.solution.features, strict=True)
        )
        moves: dict[Valuation, list[int]] = {}
        for number in self.solution.chosen:
            moves.setdefault(self.look(evidence.transitions[number].source), []).append(number)
        seen = sorted({self.look(state) for state in evidence.states}, reverse=True)
        initial = tuple(sorted({self.look(state) for state in evidence.initial}, reverse=True))
        goals = tuple(sorted({self.look(state) for state in evidence.goals}, reverse=True))
        effects = {look: self.effect(numbers[0]) for look, numbers in moves.items()}
        outcomes = {
            look: tuple(after for after in seen if self.reaches(look, effect, after))
            for look, effect in effects.items()
        }
        order = _breadth_first(initial, outcomes)
        actions = self.actions(order, effects, moves)
        name = {effect: action.name for effect, action in actions.items()}
        rules = tuple(Rule(look, name[effects[look]], outcomes[look]) for look in order)
        level, certificate = certify(rules, actions.values(), self.names)
        return Policy(
            task, features, tuple(actions.values()), rules, goals, initial, level, certificate,
            self.solution.optimal, self.solution.cost, self.solution.bound, extra,
        )  # fmt: skip

    def reaches(self, look: Valuation, effect: tuple[str, ...], after: Valuation) -> bool:
        return all(possible(before, word, now) for before, word, now in zip(look, effect, after, strict=True))

    def actions(
        self,
        order: Sequence[Valuation],
        effects: Mapping[Valuation, tuple[str, ...]],
        moves: Mapping[Valuation, list[int]],
    ) -> dict[tuple[str, ...], AbstractAction]:
        """Return one abstract action for each effect, with the conditions its states agree on."""
        actions: dict[tuple[str, ...], AbstractAction] = {}
        for effect in dict.fromkeys(effects[look] for look in order):
            looks = [look for look in order if effects[look] == effect]
            schemas = {self.evidence.schemas.get(number, "") for look in looks for number in moves[look]} - {""}
            actions[effect] = AbstractAction(
                f"a{len(actions) + 1}",
                {n: looks[0][i] for i, n in enumerate(self.names) if len({look[i] for look in looks}) == 1},
                {n: word for n, word in zip(self.names, effect, strict=True) if word},
                tuple(sorted(schemas)),
            )
        return actions


def _breadth_first(initial: Sequence[Valuation], outcomes: Mapping[Valuation, Sequence[Valuation]]) -> list[Valuation]:
    """Order the abstract states as the policy meets them; those it never meets come last."""
    order = dict.fromkeys(look for look in initial if look in outcomes)
    queue = list(order)
    for look in queue:
        for after in outcomes[look]:
            if after in outcomes and after not in order:
                order[after] = None
                queue.append(after)
    return [*order, *sorted(set(outcomes) - order.keys(), reverse=True)]
