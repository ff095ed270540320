"""The graph of tasks as text and as SVG, with what flows on its edges.

Layers are laid from writers to readers, left to right; that is all the layout that a graph of a dozen tasks needs, and
Graphviz would be one more thing to install.
"""

from __future__ import annotations

from dataclasses import dataclass
from html import escape
from typing import Any

from sonar_component.middleware.deployment.plan import Plan

_WIDTH, _HEIGHT, _GAP_X, _GAP_Y, _MARGIN = 190, 60, 290, 30, 20  # [px]
_ROW, _LABEL, _LANE = 32, 200, 22  # [px] for one incoming connection, for its words, for a detour
_COLOURS = {"RUNNING": "#2e7d32", "RUNTIME_ERROR": "#e65100", "EXCEPTION": "#c62828", "FATAL_ERROR": "#c62828"}


@dataclass(frozen=True)
class Node:
    """A task."""

    name: str
    type: str
    process: str
    state: str = ""


@dataclass(frozen=True)
class Edge:
    """A connection; rate [Hz] and losses are None in a graph that does not run.

    Attributes
    ----------
    left_out : samples replaced by newer ones before they were read, which a data connection is for.
    lost : samples dropped from a full buffer or on the way.
    """

    source: str
    target: str
    policy: str
    rate: float | None = None
    left_out: int = 0
    lost: int = 0

    @property
    def label(self) -> str:
        """Policy, rate and losses."""
        if self.rate is None:
            return self.policy
        replaced = f", {self.left_out} replaced" if self.left_out else ""
        return f"{self.policy}, {self.rate:.1f} Hz{replaced}" + (f", {self.lost} lost" if self.lost else "")


@dataclass(frozen=True)
class _Box:
    x: int
    y: float
    height: float


@dataclass(frozen=True)
class Graph:
    """Tasks and connections."""

    nodes: list[Node]
    edges: list[Edge]


def of_plan(plan: Plan) -> Graph:
    """The graph of a deployment that need not run."""
    nodes = [Node(task.name, task.type, task.process) for task in plan.tasks]
    lines = [(c, c.policy if c.policy == "data" else f"{c.policy} {c.size}") for c in plan.connections]
    return Graph(nodes, [Edge(c.source, c.target, policy) for c, policy in lines])


def of_running(before: list[dict[str, Any]], after: list[dict[str, Any]], seconds: float) -> Graph:
    """The graph of running tasks, from two surveys (``describe``) that lie `seconds` apart."""
    counts = {(c["from"], target): c["received"] for target, c in _connections(before)}
    edges = []
    for target, c in _connections(after):
        rate = (c["received"] - counts.get((c["from"], target), c["received"])) / seconds
        edges.append(Edge(c["from"], target, c["policy"], rate, c["replaced"], c["dropped"] + c["lost"]))
    nodes = [Node(t["task"], t["type"], t["process"], t["state"]) for t in after]
    return Graph(nodes + _others(nodes, edges), edges)


def _others(nodes: list[Node], edges: list[Edge]) -> list[Node]:
    """Who writes and is no task of the survey: clients, and tasks of hosts that were not asked."""
    known = {node.name for node in nodes}
    names = dict.fromkeys(name for edge in edges if (name := _task(edge.source)) not in known)
    return [Node(name, "client" if name.startswith("client_") else "task", "elsewhere") for name in names]


def _connections(survey: list[dict[str, Any]]) -> list[tuple[str, dict[str, Any]]]:
    return [
        (f"{task['task']}.{name}", connection)
        for task in survey
        for name, port in task.get("description", {}).get("inputs", {}).items()
        for connection in port["connections"]
    ]


def layers(graph: Graph) -> list[list[Node]]:
    """Tasks by their longest distance from a task that reads nothing; circles are cut where they close."""
    writers: dict[str, set[str]] = {node.name: set() for node in graph.nodes}
    for edge in graph.edges:
        writers.get(_task(edge.target), set()).add(_task(edge.source))

    def depth(name: str, seen: frozenset[str]) -> int:
        below = [depth(w, seen | {name}) for w in writers.get(name, ()) if w not in seen and w != name]
        return 1 + max(below, default=-1)

    depths = {node.name: depth(node.name, frozenset()) for node in graph.nodes}
    return [[n for n in graph.nodes if depths[n.name] == d] for d in range(max(depths.values(), default=-1) + 1)]


def as_text(graph: Graph) -> str:
    """One line for each task, one below it for each connection that it reads."""
    lines = []
    for node in (node for layer in layers(graph) for node in layer):
        state = f" {node.state}" if node.state else ""
        lines.append(f"{node.name} ({node.type}, process {node.process}){state}")
        lines += [f"  {e.target} <- {e.source}  [{e.label}]" for e in graph.edges if _task(e.target) == node.name]
    return "\n".join(lines)


def as_svg(graph: Graph, title: str = "") -> str:
    """A picture that browsers and READMEs show."""
    columns = layers(graph)
    boxes = _boxes(graph, columns)
    lane = max((box.y + box.height for box in boxes.values()), default=0) + _LANE
    long = [edge for edge in graph.edges if _span(edge, columns) > 1]
    width = 2 * _MARGIN + len(columns) * _WIDTH + (len(columns) - 1) * _GAP_X
    height = lane + _LANE * len(long)
    parts = [
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {width} {height:.0f}" width="{width}" '
        f'height="{height:.0f}" font-family="sans-serif" font-size="12">',
        '<defs><marker id="arrow" viewBox="0 0 8 8" refX="8" refY="4" markerWidth="8" markerHeight="8" orient="auto">'
        '<path d="M0 0 L8 4 L0 8 z" fill="#555"/></marker></defs>',
        f'<rect width="{width}" height="{height:.0f}" fill="white"/>',
        f'<text x="{_MARGIN}" y="18" font-weight="bold">{escape(title)}</text>',
        *[part for edge in graph.edges for part in _line(edge, graph, boxes, _detour(edge, long, lane))],
        *[part for node in graph.nodes for part in _box(node, boxes[node.name])],
        "</svg>",
    ]
    return "\n".join(parts)


def _boxes(graph: Graph, columns: list[list[Node]]) -> dict[str, _Box]:
    """A place for each task; a box is as high as the connections that it reads need."""
    boxes = {}
    for index, column in enumerate(columns):
        y = _MARGIN + 14.0
        for node in column:
            height = max(_HEIGHT, _ROW * len(_incoming(graph, node.name)) + 8)
            boxes[node.name] = _Box(_MARGIN + index * (_WIDTH + _GAP_X), y, height)
            y += height + _GAP_Y
    return boxes


def _incoming(graph: Graph, task: str) -> list[Edge]:
    return [edge for edge in graph.edges if _task(edge.target) == task]


def _span(edge: Edge, columns: list[list[Node]]) -> int:
    """How many columns an edge goes to the right."""
    place = {node.name: index for index, column in enumerate(columns) for node in column}
    return place.get(_task(edge.target), 0) - place.get(_task(edge.source), 0)


def _detour(edge: Edge, long: list[Edge], lane: float) -> float | None:
    """Edges that would cross other boxes pass below them, each in a lane of its own."""
    return lane + _LANE * long.index(edge) if edge in long else None


def _line(edge: Edge, graph: Graph, boxes: dict[str, _Box], detour: float | None) -> list[str]:
    source, target = boxes.get(_task(edge.source)), boxes.get(_task(edge.target))
    if source is None or target is None:
        return []
    arriving = _incoming(graph, _task(edge.target))
    x0, y0 = source.x + _WIDTH, source.y + _HEIGHT / 2
    x1, y1 = target.x, target.y + target.height * (arriving.index(edge) + 0.5) / len(arriving)
    x2 = x1 - _LABEL  # from here on it runs level, under its words
    if detour is None:
        path = f"M{x0} {y0:.0f} C{x0 + 35} {y0:.0f} {x2 - 35} {y1:.0f} {x2} {y1:.0f} L{x1} {y1:.0f}"
    else:
        down = f"C{x0 + 30} {y0:.0f} {x0} {detour:.0f} {x0 + 40} {detour:.0f}"
        up = f"C{x2} {detour:.0f} {x2 - 30} {y1:.0f} {x2} {y1:.0f}"
        path = f"M{x0} {y0:.0f} {down} L{x2 - 40} {detour:.0f} {up} L{x1} {y1:.0f}"
    colour = "#c62828" if edge.lost else "#333"
    text = f"{_port(edge.source)} \N{RIGHTWARDS ARROW} {_port(edge.target)}"
    words = 'text-anchor="end" stroke="white" stroke-width="3" paint-order="stroke"'
    return [
        f'<path d="{path}" fill="none" stroke="#555" stroke-width="1.4" marker-end="url(#arrow)"/>',
        f'<text x="{x1 - 12}" y="{y1 - 4:.0f}" {words} fill="#333" font-size="10">{escape(text)}</text>',
        f'<text x="{x1 - 12}" y="{y1 + 11:.0f}" {words} fill="{colour}" font-size="10">{escape(edge.label)}</text>',
    ]


def _box(node: Node, box: _Box) -> list[str]:
    colour, x, y = _COLOURS.get(node.state, "#546e7a"), box.x, box.y
    lines = ((20, "bold", node.name), (36, "normal", node.type))
    below = f"process {node.process}" + (f", {node.state}" if node.state else "")
    return [
        f'<rect x="{x}" y="{y:.0f}" width="{_WIDTH}" height="{box.height:.0f}" rx="6" fill="#f5f7f8" stroke="{colour}" '
        'stroke-width="2"/>',
        *[f'<text x="{x + 10}" y="{y + dy:.0f}" font-weight="{weight}">{escape(t)}</text>' for dy, weight, t in lines],
        f'<text x="{x + 10}" y="{y + 51:.0f}" font-size="10" fill="{colour}">{escape(below)}</text>',
    ]


def _task(port: str) -> str:
    return port.partition(".")[0]


def _port(port: str) -> str:
    return port.partition(".")[2]
