"""Predicates of which at most one atom can be true in any state: the domain's logic, not its data, says so.

A set of fluent predicates never gains true atoms when every action deletes (and requires) at least as many atoms of
the set as it adds; if the set starts with at most one, it keeps at most one. This is monotonicity invariant
synthesis (Helmert, AIJ 2009, section 5) for sets whose arguments are all counted.
"""

from __future__ import annotations

from collections.abc import Iterable

from gentamp_lp.streams.formula import Atom, Exists, Formula, conjuncts
from gentamp_lp.streams.pddl import ActionSchema, Domain
from gentamp_lp.streams.semantics import State


def at_most_one(domain: Domain, initial: Iterable[State]) -> list[str]:
    """Fluent and derived predicates with at most one true atom in every reachable state, in name order."""
    states = list(initial)
    nullary = sorted(p for p in domain.fluents if domain.predicates[p].arity == 0)
    found = set()
    for predicate in sorted(domain.fluents):
        for partner in (None, *nullary):
            group = frozenset(p for p in (predicate, partner) if p)
            small = all(sum(fact[0] in group for fact in state) <= 1 for state in states)
            if small and all(_never_grows(schema, group) for schema in domain.actions):
                found.add(predicate)
                break
    for axiom in domain.axioms:
        alone = sum(a.head.predicate == axiom.head.predicate for a in domain.axioms) == 1
        if alone and any(a.predicate in found and set(axiom.head.args) <= set(a.args) for a in _top(axiom.body)):
            found.add(axiom.head.predicate)
    return sorted(found)


def _never_grows(schema: ActionSchema, group: frozenset[str]) -> bool:
    relevant = [e for e in schema.effects if e.atom.predicate in group]
    added = [e for e in relevant if e.positive]
    if any(e.variables or conjuncts(e.condition) for e in added):
        return False
    required = set(conjuncts(schema.precondition))
    removed = {
        e.atom
        for e in relevant
        if not e.positive and not e.variables and not conjuncts(e.condition) and e.atom in required
    }
    removed -= {e.atom for e in added}
    return len(added) <= len({a.predicate for a in removed})  # atoms of one predicate may coincide


def _top(body: Formula) -> list[Atom]:
    while isinstance(body, Exists):
        body = body.body
    return [part for part in conjuncts(body) if isinstance(part, Atom)]
