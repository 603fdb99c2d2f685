"""Quantities that are watched: what is reported of a run, and what would have ended it."""

from __future__ import annotations

from functools import partial

import numpy as np

from etac_ros.maths.ticks import seconds
from etac_ros.metrics.curves import Curve
from etac_ros.plants.watch import Watch
from etac_ros.report.figures import quantities
from etac_ros.report.figures.kind import FigureKind
from etac_ros.report.figures.quantities import Bound, Quantity
from etac_ros.report.figures.style import symbols
from etac_ros.report.source import ReportedRun
from etac_ros.report.view import View


def _all(view: View) -> dict[tuple[str, str], Watch]:
    """What any of the runs watches, by node and name; the bounds are those of the first that does."""
    found: dict[tuple[str, str], Watch] = {}
    for run in view.runs:
        for node, (_, watches) in run.watches.items():
            for watch in watches:
                found.setdefault((node, watch.name), watch)
    return found


def _curve(run: ReportedRun, node: str, name: str) -> Curve | None:
    first, watches = run.watches.get(node, (0, ()))
    for watch in watches:
        if watch.name == name:
            ticks = np.arange(first, first + watch.values.shape[0])
            return Curve(np.asarray(seconds(ticks, run.graph.ticks_per_second)), watch.values)
    return None


def _found(view: View) -> list[Quantity]:
    return [
        Quantity(
            node,
            symbols(watch.name),
            symbols(_unit(watch)),
            watch.axes,
            partial(_curve, node=node, name=name),
            bounds=tuple(
                Bound(words, value)
                for words, value in (("limit", watch.bound), ("notice", watch.notice))
                if value is not None
            ),
        )
        for (node, name), watch in _all(view).items()
    ]


def _unit(watch: Watch) -> str:
    return "" if watch.unit == "1" else watch.unit


def _caption(view: View) -> str:
    sentences = ["Quantities that are watched at every tick."]
    bounds = {
        symbols(name): [
            f"{words} {value:g} {symbols(_unit(watch))}".rstrip()
            for words, value in (("noticed beyond", watch.notice), ("ends the run at", watch.bound))
            if value is not None
        ]
        for (_, name), watch in _all(view).items()
    }
    sentences += [f"{name[:1].upper()}{name[1:]}: {', '.join(words)}." for name, words in bounds.items() if words]
    if any(bounds.values()):
        sentences.append("A dotted line stands only where a curve comes near it.")
    else:
        sentences.append("Nothing here has a bound; they are reported only.")
    return " ".join(sentences)


FIGURE = FigureKind(
    name="watched",
    title="Watched quantities",
    draw=lambda view, figure, theme: quantities.draw(_found(view), view, figure, theme),
    height_in=lambda view: quantities.height_in(_found(view), view),
    caption=_caption,
    applies=lambda view: bool(_all(view)),
)
