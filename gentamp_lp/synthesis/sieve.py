"""SIEVE: does a policy of a qualitative numeric problem terminate?

A numeric variable that a loop lowers, and never raises, must reach zero some day: the loop is left. SIEVE
takes the strongly connected components of the policy graph, in each deletes the edges that lower a variable
raised nowhere *in that component*, and starts again on what is left. The policy terminates if and only if no
cycle survives (Srivastava, Zilberstein, Immerman and Geffner, AAAI 2011; Bonet and Geffner, JAIR 69, 2020).
One pass is not enough: an inner loop may show only after the outer one is cut.
"""

from __future__ import annotations

from collections.abc import Collection, Hashable, Iterable, Mapping
from dataclasses import dataclass
from typing import Generic, TypeVar

import networkx as nx

Node = TypeVar("Node", bound=Hashable)


@dataclass(frozen=True)
class Edge(Generic[Node]):
    """One step of the policy graph, with the numeric variables it lowers and raises."""

    source: Node
    target: Node
    lowered: frozenset[int] = frozenset()
    raised: frozenset[int] = frozenset()


@dataclass(frozen=True)
class Cut(Generic[Node]):
    """One deletion: in the component of `nodes` the edges that lower `variable` are taken only finitely often."""

    variable: int
    nodes: tuple[Node, ...]


@dataclass(frozen=True)
class Verdict(Generic[Node]):
    """The deletions in order, and the components that no deletion breaks (none: the policy terminates)."""

    cuts: tuple[Cut[Node], ...]
    stuck: tuple[tuple[Edge[Node], ...], ...]

    @property
    def terminates(self) -> bool:
        """Whether every fair run ends."""
        return not self.stuck


def sieve(edges: Iterable[Edge[Node]], outcomes: Mapping[Node, Collection[Node]] | None = None) -> Verdict[Node]:
    """Run SIEVE; nodes and variables keep the order in which they first appear, so the answer is reproducible.

    With `outcomes`, all that may follow each node, it decides conditional fairness: `lowered` and `raised` are the
    constraints i with the action of the node in con_A(i), con_B(i). Then an edge is deleted only if its node has an
    outcome outside the component, because a fair action that cannot leave may go on for ever.

    >>> sieve([Edge("a", "a", lowered=frozenset({1}))]).cuts
    (Cut(variable=1, nodes=('a',)),)
    >>> sieve([Edge("a", "b", lowered=frozenset({1})), Edge("b", "a", raised=frozenset({1}))]).terminates
    False
    """
    cuts: list[Cut[Node]] = []
    stuck: list[tuple[Edge[Node], ...]] = []
    waiting = components(list(edges))
    while waiting:
        inside = waiting.pop(0)
        raised = frozenset[int]().union(*(edge.raised for edge in inside))
        nodes = dict.fromkeys(edge.source for edge in inside)
        leaving = {node for node in nodes if outcomes is None or any(after not in nodes for after in outcomes[node])}
        gone = {edge for edge in inside if edge.source in leaving and edge.lowered - raised}
        if not gone:
            stuck.append(tuple(inside))
            continue
        lowered = frozenset[int]().union(*(edge.lowered for edge in gone)) - raised
        cuts.extend(Cut(variable, tuple(nodes)) for variable in sorted(lowered))
        waiting.extend(components([edge for edge in inside if edge not in gone]))
    return Verdict(tuple(cuts), tuple(stuck))


def components(edges: list[Edge[Node]]) -> list[list[Edge[Node]]]:
    """Return the edges inside each strongly connected component that has a cycle."""
    graph: nx.DiGraph = nx.DiGraph()
    graph.add_edges_from((edge.source, edge.target) for edge in edges)
    number = {node: i for i, part in enumerate(nx.strongly_connected_components(graph)) for node in part}
    inside: dict[int, list[Edge[Node]]] = {}
    for edge in edges:
        if number[edge.source] == number[edge.target]:
            inside.setdefault(number[edge.source], []).append(edge)
    return list(inside.values())


def short_loops(edges: list[Edge[Node]], most: int | None = None) -> list[list[Edge[Node]]]:
    """Return a shortest loop through each edge (or each of the first `most` edges) of a component, shortest first."""
    out: dict[Node, list[Edge[Node]]] = {}
    for edge in edges:
        out.setdefault(edge.source, []).append(edge)
    loops: dict[frozenset[tuple[Node, Node]], list[Edge[Node]]] = {}
    for first in edges[:most]:
        came: dict[Node, Edge[Node] | None] = {first.target: None}
        queue = [first.target]
        for node in queue:
            for edge in out.get(node, ()):
                if edge.target not in came:
                    came[edge.target] = edge
                    queue.append(edge.target)
        loop, step = [first], came.get(first.source)
        while step is not None:
            loop.append(step)
            step = came[step.source]
        loops.setdefault(frozenset((edge.source, edge.target) for edge in loop), loop)
    return sorted(loops.values(), key=len)
