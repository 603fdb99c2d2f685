"""The communication graph: who sends to whom over the network, with what was delivered on each edge."""

from __future__ import annotations

import math
from collections import Counter
from typing import TYPE_CHECKING

from etac_ros.graph.graph import LinkKind
from etac_ros.graph.replay import deliveries
from etac_ros.report.figures.kind import FigureKind
from etac_ros.report.figures.style import WIDTH_IN, Theme
from etac_ros.report.view import View

if TYPE_CHECKING:
    from matplotlib.figure import Figure

Edge = tuple[str, str]

_ROW_IN = 1.5
_RING_IN = 4.6
_MOST_LABELS = 40
"""Beyond so many edges the numbers would lie on each other: the widths of the lines remain."""
_BEND = 0.18


def edges(view: View) -> dict[Edge, int]:
    """Messages delivered from one carrier to another; a carrier is a namespace, or a node where no link leaves one."""
    graph, recording = view.run.graph, view.run.recording
    network = [link for link in graph.links.values() if link.kind is LinkKind.NETWORK]
    ways = [(link.sender.rpartition("/")[0], to.rpartition("/")[0]) for link in network for to in link.receivers]
    several = any(sender != receiver for sender, receiver in ways)

    def carrier(node: str) -> str:
        return (node.rpartition("/")[0] or "/") if several else node

    found: Counter[Edge] = Counter()
    for link in network:
        for receiver in link.receivers:
            if carrier(link.sender) != carrier(receiver):
                delivered = len(deliveries(graph, recording, link, receiver))
                found[carrier(link.sender), carrier(receiver)] += delivered
    return dict(found)


def _carriers(view: View) -> list[str]:
    found = edges(view)
    ends = {carrier for edge in found for carrier in edge}
    order = [name for name in view.run.graph.modules if name in ends]
    order += [
        name for name in dict.fromkeys(n.rpartition("/")[0] or "/" for n in view.run.graph.modules) if name in ends
    ]
    return list(dict.fromkeys(order))


def _places(carriers: list[str]) -> dict[str, tuple[float, float]]:
    """On a line up to three carriers, then on a ring, the first on top."""
    if len(carriers) <= 3:
        return {name: (2.0 * place - len(carriers) + 1.0, 0.0) for place, name in enumerate(carriers)}
    turn = 2.0 * math.pi / len(carriers)
    return {name: (1.9 * math.sin(turn * i), 1.05 * math.cos(turn * i)) for i, name in enumerate(carriers)}


def _half_box(name: str, dx: float, dy: float) -> float:
    """From the middle of a box to its edge along a direction, as if it were an ellipse [pt]."""
    length = math.hypot(dx, dy)
    width, height = 3.2 * len(name) + 9.0, 12.0
    return 1.0 / math.hypot(dx / length / width, dy / length / height)


def _draw(view: View, figure: Figure, theme: Theme) -> None:
    from matplotlib.patches import FancyArrowPatch

    found = edges(view)
    carriers = _carriers(view)
    places = _places(carriers)
    axes = figure.subplots()
    axes.set_axis_off()
    axes.grid(visible=False)
    height = 0.45 if len(carriers) <= 3 else 1.4
    axes.set_xlim(-2.6, 2.6)
    axes.set_ylim(-height, height)
    busiest = max(found.values(), default=1) or 1
    labelled = len(found) <= _MOST_LABELS
    for name in carriers:
        axes.text(
            *places[name], name, ha="center", va="center", color=theme.ink, fontweight="bold", zorder=4,
            bbox={"boxstyle": "round,pad=0.45", "facecolor": theme.paper, "edgecolor": theme.muted, "linewidth": 1.2},
        )  # fmt: skip
    for (sender, receiver), delivered in found.items():
        (x0, y0), (x1, y1) = places[sender], places[receiver]
        both_ways = (receiver, sender) in found
        bend = _BEND if both_ways or len(carriers) > 3 else 0.0
        axes.add_patch(
            FancyArrowPatch(
                (x0, y0), (x1, y1), connectionstyle=f"arc3,rad={bend}", arrowstyle="-|>", mutation_scale=13,
                shrinkA=_half_box(sender, x1 - x0, y1 - y0), shrinkB=_half_box(receiver, x1 - x0, y1 - y0) + 2.0,
                linewidth=0.7 + 2.3 * delivered / busiest, color=theme.this if delivered else theme.muted,
                linestyle="solid" if delivered else "dashed", zorder=2,
            )
        )  # fmt: skip
        if labelled:
            # Two fifths of the way, where the arcs of a pair are apart and crossing edges seldom meet.
            along = 0.42
            x, y = x0 + along * (x1 - x0), y0 + along * (y1 - y0)
            sag = 2.0 * bend * along * (1.0 - along)
            x, y = x + sag * (y1 - y0), y - sag * (x1 - x0)
            lift = 0.13 if len(carriers) <= 3 else 0.0
            axes.text(
                x, y + lift, f"{delivered:,}", ha="center", va="center", color=theme.this, zorder=3,
                bbox={"boxstyle": "round,pad=0.15", "facecolor": theme.paper, "edgecolor": "none"},
            )  # fmt: skip


def _caption(view: View) -> str:
    found = edges(view)
    network = view.run.summary.network
    silent = sum(not delivered for delivered in found.values())
    text = (
        f"Arrows point from sender to receiver and are as wide as they are busy: {network.messages:,} network messages "
        f"were published, {network.deliveries:,} delivered, over {len(found)} edges."
    )
    return text + (f" {silent} of them carried nothing (dashed)." if silent else "")


FIGURE = FigureKind(
    name="network",
    title="Communication graph",
    draw=_draw,
    height_in=lambda view: _ROW_IN if len(_carriers(view)) <= 3 else _RING_IN * WIDTH_IN / 7.2,
    caption=_caption,
    applies=lambda view: bool(edges(view)),
    over_time=False,
)
