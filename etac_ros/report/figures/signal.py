"""What trigger rules are shown, component by component, and what was sent of it."""

from __future__ import annotations

from functools import partial

from etac_ros.metrics.curves import Curve
from etac_ros.metrics.decisions import Decisions, Part, sends_over_network
from etac_ros.report.figures import quantities
from etac_ros.report.figures.kind import FigureKind
from etac_ros.report.figures.quantities import Quantity
from etac_ros.report.figures.style import symbols
from etac_ros.report.source import ReportedRun
from etac_ros.report.view import View

_AXES = ("x", "y", "z")
_MOST_DOTS = 400


def _shown(view: View) -> dict[str, Decisions]:
    """Those that save messages or send over the network; a loop inside a carrier that runs by time does neither."""
    graph = view.run.graph
    return {
        name: found for name, found in view.decisions.items() if name in view.margins or sends_over_network(graph, name)
    }


def _curve(run: ReportedRun, found: Decisions, part: Part) -> Curve:
    return found.signal(part, run.graph.ticks_per_second)


def _dots(run: ReportedRun, found: Decisions, part: Part) -> Curve | None:
    return found.sent(part, run.graph.ticks_per_second) if found.ticks.size <= _MOST_DOTS else None


def _found(view: View) -> list[Quantity]:
    return [
        Quantity(
            name,
            symbols(part.symbol),
            symbols(part.unit),
            _columns(part),
            partial(_curve, found=found, part=part),
            dots=partial(_dots, found=found, part=part),
        )
        for name, found in _shown(view).items()
        for part in found.parts
    ]


def _columns(part: Part) -> tuple[str, ...]:
    size = part.columns.stop - part.columns.start
    return _AXES if size == len(_AXES) else tuple(str(place + 1) for place in range(size))


def _caption(view: View) -> str:
    text = (
        "What the trigger rule is shown at every tick, recomputed from the committed samples through the module's own "
        "noise and filter."
    )
    if any(found.ticks.size <= _MOST_DOTS for found in _shown(view).values()):
        text += " The dots are what it held from each triggering instant on."
    return text + (" Of this run only." if view.overlaid else "")


FIGURE = FigureKind(
    name="signal",
    title="Watched signal",
    draw=lambda view, figure, theme: quantities.draw(_found(view), view.alone, figure, theme),
    height_in=lambda view: quantities.height_in(_found(view), view.alone),
    caption=_caption,
    applies=lambda view: bool(_shown(view)),
)
