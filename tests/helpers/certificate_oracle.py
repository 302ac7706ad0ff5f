"""The check of a policy in Python, an oracle for `asp/certificate.lp`: written apart from it, and mostly before."""

from collections.abc import Mapping, Sequence

from gentamp_lp.policy.model import AbstractAction, PolicyGraph, Valuation
from gentamp_lp.synthesis.sieve import Edge, components

_RAISES = {"increase": True, "true": True, "decrease": False, "false": False}


def _possible(before: bool, word: str, now: bool) -> bool:
    return word == "decrease" or now == _RAISES.get(word, before)


def _edges(policy: PolicyGraph, actions: Mapping[str, AbstractAction], names: Sequence[str]) -> list[Edge[Valuation]]:
    position = {name: i for i, name in enumerate(names)}
    states = {rule.valuation for rule in policy.rules}
    edges = []
    for rule in policy.rules:
        effects = actions[rule.action].effects.items() if rule.action in actions else ()
        lowered = frozenset(position[name] for name, word in effects if word == "decrease")
        raised = frozenset(position[name] for name, word in effects if word == "increase")
        edges += [Edge(rule.valuation, after, lowered, raised) for after in rule.outcomes if after in states]
    return edges


def problems(policy: PolicyGraph) -> list[str]:
    """Check closedness, goal reachability and the certificate; SIEVE's own search is not trusted."""
    found = []
    known = {rule.valuation for rule in policy.rules}
    names = [feature.name for feature in policy.features]
    actions = {action.name: action for action in policy.actions}
    if len(known) < len(policy.rules):
        found.append("two rules for one abstract state")
    for rule in policy.rules:
        here = policy.show(rule.valuation)
        if rule.valuation in policy.goals:
            found.append(f"rule in a goal state: {here}")
        if rule.action not in actions:
            found.append(f"unknown action {rule.action} in {here}")
            continue
        found += _applicable(actions[rule.action], dict(zip(names, rule.valuation, strict=True)), here)
        effects = actions[rule.action].effects
        if not rule.outcomes:
            found.append(f"no outcome of {rule.action} in {here}")
        for after in rule.outcomes:
            legal = all(
                _possible(b, effects.get(n, ""), a) for n, b, a in zip(names, rule.valuation, after, strict=True)
            )
            if not legal:
                found.append(f"{rule.action} in {here} cannot lead to {policy.show(after)}")
            if after not in known and after not in policy.goals:
                found.append(f"not closed: {rule.action} in {here} leads to {policy.show(after)}, no rule there")
    for look in policy.initial:
        if look not in known and look not in policy.goals:
            found.append(f"no rule for the initial state {policy.show(look)}")
    safe = set(policy.goals)
    while more := {r.valuation for r in policy.rules if r.valuation not in safe and safe & set(r.outcomes)}:
        safe |= more
    found += [f"no goal can be reached from {policy.show(look)}" for look in sorted(known - safe, reverse=True)]
    return (found or _ends(policy, _edges(policy, actions, names), names)) + _missing(policy, names)


def _applicable(action: AbstractAction, values: Mapping[str, bool], here: str) -> list[str]:
    found = [
        f"{action.name} is chosen in {here} against its precondition on {name}"
        for name, wanted in action.preconditions.items()
        if values[name] != wanted
    ]
    for name, word in action.effects.items():
        if (word == "true" and values[name]) or (word in ("false", "decrease") and not values[name]):
            found.append(f"{action.name} cannot make {name} {word} in {here}")
    return found


def _missing(policy: PolicyGraph, names: Sequence[str]) -> list[str]:
    """Preconditions that an action lacks: the paper has all that agree where it was seen."""
    found = []
    for action in policy.actions:
        where = [rule.valuation for rule in policy.rules if rule.action == action.name]
        for i, name in enumerate(names):
            if len({valuation[i] for valuation in where}) == 1 and name not in action.preconditions:
                found.append(f"{action.name} has no precondition on {name}, which has one value wherever it is chosen")
    return found


def _ends(policy: PolicyGraph, edges: list[Edge[Valuation]], names: Sequence[str]) -> list[str]:
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
            edge for edge in edges if not (feature in edge.lowered and edge.source in inside and edge.target in inside)
        ]
    if components(edges):
        return [f"a loop is left: the policy is not {policy.fairness}"]
    return []
