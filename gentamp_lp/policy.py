"""A policy over abstract states: the value, its certificate, and its printed form.

Names follow the paper: Boolean and numeric features, abstract actions with preconditions and qualitative
effects, and rules that map a valuation of the features to one abstract action. A valuation is a tuple with one
truth value for each feature, in order: a Boolean holds, a count is above zero.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from gentamp_lp.abstraction import Solution
from gentamp_lp.evidence import Evidence, parse_evidence
from gentamp_lp.sieve import Edge, components, sieve

Valuation = tuple[bool, ...]
_RAISES = {"increase": True, "true": True, "decrease": False, "false": False}
_SIGN = {"increase": "↑", "decrease": "↓", "true": "=⊤", "false": "=⊥"}


@dataclass(frozen=True)
class Feature:
    """A selected feature: `formula` is a term over `variable`, which ranges over `sort`."""

    name: str
    kind: str
    cost: int
    formula: str
    variable: str | None = None
    sort: str | None = None
    text: str = ""

    def show(self, positive: bool) -> str:
        """Return a condition on the feature as the paper prints it."""
        if self.kind == "boolean":
            return f"{self.name}={'⊤' if positive else '⊥'}"
        return f"{self.name}{'>0' if positive else '=0'}"


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
class Policy:
    """Everything learned for one task; see `text()` for a look and `check()` for the guarantee."""

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
        from gentamp_lp.bundle import load

        return load(Path(folder))

    def save(self, folder: Path | str, *, domain_pddl: str, stream_pddl: str, report: dict[str, Any]) -> None:
        """Write a bundle whole or not at all, in the place of an older one."""
        from gentamp_lp.bundle import save

        save(self, Path(folder), domain_pddl=domain_pddl, stream_pddl=stream_pddl, report=report)

    def svg(self) -> str:
        """Return the policy graph as a drawing."""
        from gentamp_lp.drawing import draw

        return draw(self)

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

    def check(self) -> list[str]:
        """Verify the guarantee from the rules alone; one sentence for each thing that is wrong."""
        return _problems(self)

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
            look: tuple(after for after in seen if self.possible(look, effect, after))
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

    def possible(self, look: Valuation, effect: tuple[str, ...], after: Valuation) -> bool:
        return all(
            _possible(before, word, now) for before, word, now in zip(look, effect, after, strict=True)
        )

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


def _possible(before: bool, word: str, now: bool) -> bool:
    """Whether a feature can have this value after this effect: a falling count may or may not reach zero."""
    return word == "decrease" or now == _RAISES.get(word, before)


def _breadth_first(
    initial: Sequence[Valuation], outcomes: Mapping[Valuation, Sequence[Valuation]]
) -> list[Valuation]:
    """Order the abstract states as the policy meets them; those it never meets come last."""
    order = dict.fromkeys(look for look in initial if look in outcomes)
    queue = list(order)
    for look in queue:
        for after in outcomes[look]:
            if after in outcomes and after not in order:
                order[after] = None
                queue.append(after)
    return [*order, *sorted(set(outcomes) - order.keys(), reverse=True)]


def _edges(
    rules: Sequence[Rule], actions: Mapping[str, AbstractAction], names: Sequence[str]
) -> list[Edge[Valuation]]:
    position = {name: i for i, name in enumerate(names)}
    states = {rule.valuation for rule in rules}
    edges = []
    for rule in rules:
        effects = actions[rule.action].effects.items() if rule.action in actions else ()
        lowered = frozenset(position[name] for name, word in effects if word == "decrease")
        raised = frozenset(position[name] for name, word in effects if word == "increase")
        edges += [Edge(rule.valuation, after, lowered, raised) for after in rule.outcomes if after in states]
    return edges


def certify(
    rules: Sequence[Rule], actions: Any, names: Sequence[str]
) -> tuple[str, tuple[CertificateStep, ...]]:
    """Return the strongest fairness level that closed rules reach, with SIEVE's deletions if they are needed.

    `strong`: no loop, the goal is reached whatever happens. `qnp`: every run in which a count that is lowered
    for ever and raised only finitely often reaches zero. `strong-cyclic`: every run in which each outcome of an
    endlessly repeated step happens some day.
    """
    edges = _edges(rules, {action.name: action for action in actions}, names)
    if not components(edges):
        return "strong", ()
    verdict = sieve(edges)
    if not verdict.terminates:
        return "strong-cyclic", ()
    return "qnp", tuple(CertificateStep(names[cut.variable], cut.nodes) for cut in verdict.cuts)


def _problems(policy: Policy) -> list[str]:
    """Check closedness, goal reachability and the certificate; SIEVE's own search is not trusted."""
    problems = []
    known = {rule.valuation for rule in policy.rules}
    names = [feature.name for feature in policy.features]
    actions = {action.name: action for action in policy.actions}
    if len(known) < len(policy.rules):
        problems.append("two rules for one abstract state")
    for rule in policy.rules:
        here = policy.show(rule.valuation)
        if rule.valuation in policy.goals:
            problems.append(f"rule in a goal state: {here}")
        if rule.action not in actions:
            problems.append(f"unknown action {rule.action} in {here}")
            continue
        problems += _applicable(actions[rule.action], dict(zip(names, rule.valuation, strict=True)), here)
        effects = actions[rule.action].effects
        if not rule.outcomes:
            problems.append(f"no outcome of {rule.action} in {here}")
        for after in rule.outcomes:
            legal = all(
                _possible(b, effects.get(n, ""), a) for n, b, a in zip(names, rule.valuation, after, strict=True)
            )
            if not legal:
                problems.append(f"{rule.action} in {here} cannot lead to {policy.show(after)}")
            if after not in known and after not in policy.goals:
                problems.append(f"not closed: {rule.action} in {here} leads to {policy.show(after)}, no rule there")
    for look in policy.initial:
        if look not in known and look not in policy.goals:
            problems.append(f"no rule for the initial state {policy.show(look)}")
    safe = set(policy.goals)
    while more := {r.valuation for r in policy.rules if r.valuation not in safe and safe & set(r.outcomes)}:
        safe |= more
    problems += [f"no goal can be reached from {policy.show(look)}" for look in sorted(known - safe, reverse=True)]
    return problems or _ends(policy, _edges(policy.rules, actions, names), names)


def _applicable(action: AbstractAction, values: Mapping[str, bool], here: str) -> list[str]:
    problems = [
        f"{action.name} is chosen in {here} against its precondition on {name}"
        for name, wanted in action.preconditions.items()
        if values[name] != wanted
    ]
    for name, word in action.effects.items():
        if (word == "true" and values[name]) or (word in ("false", "decrease") and not values[name]):
            problems.append(f"{action.name} cannot make {name} {word} in {here}")
    return problems


def _ends(policy: Policy, edges: list[Edge[Valuation]], names: Sequence[str]) -> list[str]:
    """Replay the certificate: each step must hold on what the steps before have left, and leave no loop."""
    if policy.fairness == "strong-cyclic":
        return []
    steps = policy.certificate if policy.fairness == "qnp" else ()
    for number, step in enumerate(steps, 1):
        feature, inside = names.index(step.feature), set(step.states)
        for part in components(edges):
            nodes = {edge.source for edge in part}
            if nodes & inside and not nodes <= inside:
                return [f"certificate step {number}: its states are not a whole component"]
            if nodes & inside and any(feature in edge.raised for edge in part):
                return [f"certificate step {number}: {step.feature} rises in its component"]
        edges = [
            edge
            for edge in edges
            if not (feature in edge.lowered and edge.source in inside and edge.target in inside)
        ]
    if components(edges):
        return [f"a loop is left: the policy is not {policy.fairness}"]
    return []
