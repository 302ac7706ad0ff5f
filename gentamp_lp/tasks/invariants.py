"""Atoms that exclude each other in every reachable state: the domain's logic, not its data, says so.

A set of fluent predicates never gains true atoms when every action deletes (and requires) at least as many atoms of
the set as it adds; if the set starts with at most one, it keeps at most one. The atoms may be counted together, or
separately for each entity at one place of their arguments. This is monotonicity invariant synthesis (Helmert, AIJ 2009,
section 5) for at most two predicates.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Mapping
from itertools import product

from gentamp_lp.streams.formula import Atom, Exists, Formula, conjuncts
from gentamp_lp.streams.pddl import ActionSchema, Domain
from gentamp_lp.streams.semantics import State

Group = Mapping[str, int | None]
"""Predicates of which at most one atom is true for each entity at the given place (None: at all)."""


def exclusive(domain: Domain, initial: Iterable[State]) -> list[Group]:
    """Groups with at most one true atom (for each key) in every state that is reachable from the initial ones.

    Without any initial state there is none.
    """
    states = list(initial)
    names = sorted(domain.fluents)
    places: dict[str, tuple[int | None, ...]] = {p: (None, *range(domain.predicates[p].arity)) for p in names}
    found: list[Group] = []
    for i, first in enumerate(names):
        for second in names[i:]:
            for group in ({first: k, second: j} for k, j in product(places[first], places[second])):
                alike = len({key is None for key in group.values()}) == 1
                small = alike and states and all(_small(state, group) for state in states)
                if small and group not in found and all(_never_grows(schema, group) for schema in domain.actions):
                    found.append(group)
    return found


def at_most_one(domain: Domain, initial: Iterable[State]) -> list[str]:
    """Fluent and derived predicates with at most one true atom in every reachable state, in name order.

    Of predicates without arguments only those that never become true.
    """
    groups = [group for group in exclusive(domain, initial) if None in group.values()]
    found = {name for group in groups for name in group if len(group) == 1 or domain.predicates[name].arity}
    for axiom in domain.axioms:
        alone = sum(a.head.predicate == axiom.head.predicate for a in domain.axioms) == 1
        if alone and any(a.predicate in found and set(axiom.head.args) <= set(a.args) for a in _top(axiom.body)):
            found.add(axiom.head.predicate)
    return sorted(found)


def key_of(atom: Atom, group: Group) -> str | None:
    """The argument for which a group's atom is counted; None where all are counted together."""
    place = group[atom.predicate]
    return None if place is None else atom.args[place]


def _small(state: State, group: Group) -> bool:
    counts = Counter(key_of(Atom(fact[0], fact[1:]), group) for fact in state if fact[0] in group)
    return all(number <= 1 for number in counts.values())


def _never_grows(schema: ActionSchema, group: Group) -> bool:
    relevant = [e for e in schema.effects if e.atom.predicate in group]
    added = [e for e in relevant if e.positive]
    keys = {key_of(e.atom, group) for e in added}
    if len(keys) > 1 or any(e.variables or conjuncts(e.condition) for e in added):
        return False
    required = set(conjuncts(schema.precondition))
    removed = {
        e.atom
        for e in relevant
        if not e.positive and not e.variables and not conjuncts(e.condition) and e.atom in required
    }
    removed = {atom for atom in removed - {e.atom for e in added} if key_of(atom, group) in keys}
    return len(added) <= len({a.predicate for a in removed})  # atoms of one predicate may coincide


def _top(body: Formula) -> list[Atom]:
    while isinstance(body, Exists):
        body = body.body
    return [part for part in conjuncts(body) if isinstance(part, Atom)]
