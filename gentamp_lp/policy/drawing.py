"""The policy graph as SVG, in the manner of the paper's figures, with the same bytes for the same policy.

Nodes are abstract states, edges the outcomes of their abstract actions. Layers and crossings are grandalf's
(Sugiyama); an edge label is a small node of the layout, so labels overlap neither nodes nor one another.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from itertools import pairwise
from typing import Any
from xml.sax.saxutils import escape, quoteattr

from grandalf.graphs import Edge, Graph, Vertex
from grandalf.layouts import SugiyamaLayout

from gentamp_lp.policy.model import PolicyGraph, Valuation

_LINE, _WIDE, _PAD, _MARGIN = 17.0, 7.4, 9.0, 24.0
_STYLE = """\
text{font-family:Helvetica,Arial,sans-serif;font-size:12px;fill:#1b2733}
.h{font-weight:bold;font-size:11px;fill:#5b6b7b}.e{font-size:11.5px}.a{font-weight:bold;fill:#0b5394}
.n{fill:#f6f8fa;stroke:#44546a;stroke-width:1.2}.i{fill:#e3effb;stroke:#0b5394;stroke-width:1.6}
.g{fill:#e8f5e9;stroke:#2e7d32;stroke-width:1.2}.o{fill:none;stroke:#2e7d32;stroke-width:1.2}
.w{fill:none;stroke:#5b6b7b;stroke-width:1.3}.l{fill:#ffffff}
"""
Point = tuple[float, float]


@dataclass
class _Box:
    """What grandalf places: `xy` is the centre, which it sets."""

    lines: tuple[str, ...]
    kind: str
    w: float
    h: float
    loop: str = ""
    xy: Point = (0.0, 0.0)
    body: float = 0.0
    name: str = ""

    def edge(self, upper: bool) -> float:
        return self.xy[1] + (-self.h / 2 if upper else self.h / 2)


def draw(policy: PolicyGraph, *, legend: bool = True) -> str:
    """Return the SVG text, perhaps without the features below it.

    Each abstract state is a group with class `s` and its printed conditions as `data-state`.
    """
    boxes = _boxes(policy)
    vertices = {valuation: Vertex(valuation) for valuation in boxes}
    wires: list[tuple[Vertex, Vertex]] = []
    labels: list[Vertex] = []
    order = {valuation: i for i, valuation in enumerate(boxes)}
    views: dict[Vertex, _Box] = {vertices[valuation]: box for valuation, box in boxes.items()}
    for rule in policy.rules:
        text = _label(policy, rule.action)
        for after in rule.outcomes:
            if after == rule.valuation:
                continue
            label = Vertex((rule.valuation, after))
            views[label] = _Box((text,), "label", _width(text, 6.6), _LINE + 4)
            labels.append(label)
            wires += [(vertices[rule.valuation], label), (label, vertices[after])]
    paths = _layout(policy, [*vertices.values(), *labels], wires, views, order)
    return _svg(policy, views, paths, legend)


def _boxes(policy: PolicyGraph) -> dict[Valuation, _Box]:
    valuations: dict[Valuation, None] = dict.fromkeys(rule.valuation for rule in policy.rules)
    valuations |= dict.fromkeys(after for rule in policy.rules for after in rule.outcomes)
    valuations |= dict.fromkeys((*policy.initial, *policy.goals))
    boxes = {}
    for number, valuation in enumerate(valuations, 1):
        kind = "goal" if valuation in policy.goals else "initial" if valuation in policy.initial else "state"
        head = f"s{number}" + ("" if kind == "state" else f" · {kind}")
        lines = (head, *(f.show(v) for f, v in zip(policy.features, valuation, strict=True)))
        body = max(_width(line) for line in lines)
        rule = policy.rule_for(valuation)
        loop = _label(policy, rule.action) if rule and valuation in rule.outcomes else ""
        side = 34 + _width(loop, 6.6) if loop else 0.0
        boxes[valuation] = _Box(
            lines, kind, body + 2 * side, _LINE * len(lines) + 2 * _PAD, loop, body=body, name=policy.show(valuation)
        )
    return boxes


def _label(policy: PolicyGraph, action: str) -> str:
    return " ".join([action, "/".join(policy.action(action).schemas)]).strip()


def _width(text: str, wide: float = _WIDE) -> float:
    return len(text) * wide + 2 * _PAD


def _layout(
    policy: PolicyGraph,
    vertices: list[Vertex],
    wires: list[tuple[Vertex, Vertex]],
    views: dict[Vertex, _Box],
    order: dict[Valuation, int],
) -> list[list[Point]]:
    """Place the boxes, component beside component, and return the corners of each wire."""
    for vertex in vertices:
        vertex.view = views[vertex]
    edges = [Edge(a, b) for a, b in wires]
    for edge in edges:
        edge.view = _Wire()
    right = 0.0
    first = list(order)[: max(1, sum(valuation in order for valuation in policy.initial))]
    for component in Graph(vertices, edges).C:
        members = [vertex for vertex in vertices if vertex in component.sV]
        roots = [vertex for vertex in members if vertex.data in first] or members[:1]
        _place(component, roots, [edge for edge in edges if edge.v[0] in component.sV])
        shift = right - min(views[v].xy[0] - views[v].w / 2 for v in members)
        top = min(views[v].edge(upper=True) for v in members)
        for vertex in members:
            x, y = views[vertex].xy
            views[vertex].xy = (x + shift, y - top)
        for edge in edges:
            if edge.v[0] in component.sV:
                edge.view.points = [(x + shift, y - top) for x, y in edge.view.points]
        right = max(views[v].xy[0] + views[v].w / 2 for v in members) + 40
    return _ports(edges, views)


@dataclass(eq=False)
class _Wire:
    points: list[Point] = field(default_factory=list)

    def setpath(self, points: list[Point]) -> None:
        self.points = list(points)


def _place(component: Any, roots: list[Vertex], edges: list[Edge]) -> None:
    if len(component.sV) == 1:
        return
    layout = SugiyamaLayout(component)
    layout.xspace, layout.yspace = 26, 26
    back = _backward(roots, edges)
    entered = {edge.v[1] for edge in edges if edge not in back}  # an initial state may also come after another one
    layout.init_all(roots=[vertex for vertex in roots if vertex not in entered], inverted_edges=back)
    layout.draw(12)


def _backward(roots: list[Vertex], edges: list[Edge]) -> list[Edge]:
    """Return the edges that close a cycle in a depth-first walk from the roots."""
    out: dict[Vertex, list[Edge]] = {}
    for edge in edges:
        out.setdefault(edge.v[0], []).append(edge)
    state: dict[Vertex, str] = {}
    back: list[Edge] = []

    def walk(vertex: Vertex) -> None:
        state[vertex] = "open"
        for edge in out.get(vertex, []):
            if state.get(edge.v[1]) == "open":
                back.append(edge)
            elif edge.v[1] not in state:
                walk(edge.v[1])
        state[vertex] = "done"

    for vertex in [*roots, *out]:
        if vertex not in state:
            walk(vertex)
    return back


def _ports(edges: list[Edge], views: dict[Vertex, _Box]) -> list[list[Point]]:
    """Let wires leave and enter at separate points of the upper and lower side of a box."""
    corners = {id(edge): edge.view.points[1:-1] for edge in edges}
    ends: dict[tuple[int, bool], list[tuple[float, int, int]]] = {}
    for i, edge in enumerate(edges):
        for end, (here, there) in enumerate((edge.v, reversed(edge.v))):
            bends = corners[id(edge)] if end == 0 else corners[id(edge)][::-1]
            x, y = bends[0] if bends else views[there].xy
            upper = y < views[here].xy[1]
            ends.setdefault((id(here), upper), []).append((x, i, end))
    paths: list[list[Point]] = [[(0.0, 0.0), *corners[id(edge)], (0.0, 0.0)] for edge in edges]
    boxes = {id(vertex): box for vertex, box in views.items()}
    for (vertex, upper), meeting in ends.items():
        box = boxes[vertex]
        meeting.sort()
        step = min(22.0, (box.body or box.w) / (len(meeting) + 1))
        for position, (_, i, end) in enumerate(meeting):
            x = box.xy[0] + step * (position - (len(meeting) - 1) / 2)
            paths[i][-end] = (x, box.edge(upper))
    return paths


def _svg(policy: PolicyGraph, views: dict[Vertex, _Box], paths: list[list[Point]], described: bool) -> str:
    legend = [f"{f.name}: {f.text or f.formula}" for f in policy.features if described]
    points = [point for path in paths for point in path]
    width = max([b.xy[0] + b.w / 2 for b in views.values()] + [x for x, _ in points])
    left = min([0.0] + [x for x, _ in points])
    height = max([b.edge(upper=False) for b in views.values()] + [y for _, y in points])
    width = max([width - left, *(_width(line, 6.6) for line in legend), 60.0]) + 2 * _MARGIN
    total = height + 2 * _MARGIN + _LINE * (len(legend) + 1)
    shift = (_MARGIN - left, _MARGIN)
    out = [
        f'<svg xmlns="http://www.w3.org/2000/svg" width="{width:.0f}" height="{total:.0f}" '
        f'viewBox="0 0 {width:.0f} {total:.0f}">',
        f"<title>{escape(policy.task or 'policy')}</title>",
        f"<style>{_STYLE}</style>",
        '<defs><marker id="t" viewBox="0 0 8 8" refX="7" refY="4" markerWidth="7" markerHeight="7" '
        'orient="auto"><path d="M0,0.6 L8,4 L0,7.4 z" fill="#5b6b7b"/></marker></defs>',
        '<rect width="100%" height="100%" fill="#ffffff"/>',
        f'<g transform="translate({shift[0]:.1f},{shift[1]:.1f})">',
    ]
    into_label = {i: i % 2 == 0 for i in range(len(paths))}
    for i, path in enumerate(paths):
        arrow = "" if into_label[i] else ' marker-end="url(#t)"'
        out.append(f'<path class="w" d="{_curve(path)}"{arrow}/>')
    for box in views.values():
        out += _text(box) if box.kind == "label" else _node(box)
    out.append("</g>")
    for i, line in enumerate(legend):
        y = height + 2 * _MARGIN + _LINE * (i + 0.5)
        out.append(f'<text x="{_MARGIN:.1f}" y="{y:.1f}" class="e">{escape(line)}</text>')
    return "\n".join([*out, "</svg>"]) + "\n"


def _curve(path: list[Point]) -> str:
    out = [f"M{path[0][0]:.1f},{path[0][1]:.1f}"]
    for (x, y), (u, v) in pairwise(path):
        out.append(f"C{x:.1f},{(y + v) / 2:.1f} {u:.1f},{(y + v) / 2:.1f} {u:.1f},{v:.1f}")
    return " ".join(out)


def _text(box: _Box) -> Iterator[str]:
    x, y = box.xy
    yield f'<rect class="l" x="{x - box.w / 2:.1f}" y="{y - box.h / 2:.1f}" width="{box.w:.1f}" height="{box.h:.1f}"/>'
    yield _caption(box.lines[0], x, y + 4)


def _caption(label: str, x: float, y: float) -> str:
    action, _, schemas = label.partition(" ")
    return (
        f'<text class="e" x="{x:.1f}" y="{y:.1f}" text-anchor="middle">'
        f'<tspan class="a">{escape(action)}</tspan> {escape(schemas)}</text>'
    )


def _node(box: _Box) -> Iterator[str]:
    x, y = box.xy
    left, top = x - box.body / 2, box.edge(upper=True)
    yield f'<g class="s" data-state={quoteattr(box.name)}>'
    style = {"goal": "g", "initial": "i"}.get(box.kind, "n")
    if box.loop:
        side, low = x + box.body / 2, y + 16
        yield (
            f'<path class="w" d="M{side:.1f},{y - 16:.1f} C{side + 40:.1f},{y - 22:.1f} '
            f'{side + 40:.1f},{low + 6:.1f} {side + 2:.1f},{low:.1f}" marker-end="url(#t)"/>'
        )
        yield _caption(box.loop, side + 32 + _width(box.loop, 6.6) / 2, y + 4)
    yield f'<rect class="{style}" x="{left:.1f}" y="{top:.1f}" width="{box.body:.1f}" height="{box.h:.1f}" rx="7"/>'
    if box.kind == "goal":
        yield (
            f'<rect class="o" x="{left + 3:.1f}" y="{top + 3:.1f}" width="{box.body - 6:.1f}" '
            f'height="{box.h - 6:.1f}" rx="5"/>'
        )
    for i, line in enumerate(box.lines):
        yield (
            f'<text class="{"h" if i == 0 else "v"}" x="{x:.1f}" y="{top + _PAD + _LINE * (i + 0.72):.1f}" '
            f'text-anchor="middle">{escape(line)}</text>'
        )
    yield "</g>"
