"""Which streams feed which, and which matter to a problem."""

from __future__ import annotations

from collections.abc import Iterable

import networkx as nx

from gentamp_lp.streams.facts import FactBase
from gentamp_lp.streams.formula import Formula
from gentamp_lp.streams.pddl import Domain
from gentamp_lp.streams.semantics import Program
from gentamp_lp.streams.stream_file import Stream


def in_order(streams: Iterable[Stream], domain: Domain) -> tuple[list[Stream], bool]:
    """Streams, each after those that feed it, and whether some feed themselves."""
    named = {stream.name: stream for stream in streams}
    feeds = nx.DiGraph()
    feeds.add_nodes_from(named)
    for stream in named.values():
        certified = {a.predicate for a in stream.certified}
        certified.update(*(domain.supertypes.get(predicate, ()) for predicate in certified))
        feeds.add_edges_from(
            (stream.name, other.name)
            for other in named.values()
            if not certified.isdisjoint(a.predicate for a in other.domain)
        )
    groups = nx.condensation(feeds)
    place = {name: number for number, name in enumerate(named)}
    members = nx.get_node_attributes(groups, "members")
    order = nx.lexicographical_topological_sort(groups, key=lambda group: min(place[n] for n in members[group]))
    ordered = [named[name] for group in order for name in sorted(members[group], key=place.__getitem__)]
    return ordered, not nx.is_directed_acyclic_graph(feeds)


def relevant_streams(program: Program, goal: Formula, base: FactBase) -> set[str]:
    """Streams whose facts some condition reads, directly or as inputs of others."""
    formulas = [goal, *program.preconditions.values(), *(a.body for rows in program.axioms.values() for a in rows)]
    formulas += [e.condition for a in program.domain.actions for e in a.effects]
    waiting = set().union(*(f.predicates for f in formulas))
    waiting |= {a.predicate for f in base.functions.values() for a in f.domain}
    found: set[str] = set()
    seen: set[str] = set()
    while waiting:
        predicate = waiting.pop()
        seen.add(predicate)
        below = {p for p, above in program.domain.supertypes.items() if predicate in above}
        streams = [s for s in base.streams if {a.predicate for a in s.certified} & (below | {predicate})]
        found |= {s.name for s in streams}
        waiting |= {a.predicate for s in streams for a in s.domain} - seen
    return found
