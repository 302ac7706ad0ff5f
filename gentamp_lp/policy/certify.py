"""The guarantee of a policy: the fairness level it reaches (`check.py` checks a claim independently)."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence

from gentamp_lp.policy.model import AbstractAction, CertificateStep, Rule, Valuation
from gentamp_lp.synthesis.sieve import Edge, components, sieve


def _edges(rules: Sequence[Rule], actions: Mapping[str, AbstractAction], names: Sequence[str]) -> list[Edge[Valuation]]:
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
    rules: Sequence[Rule], actions: Iterable[AbstractAction], names: Sequence[str]
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
