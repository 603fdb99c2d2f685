"""Layouts for Foxglove and PlotJuggler: which topics of a run's bag are shown, and where.

Both are made from the topics that a bag of the scenario has, so a layout names nothing that is not there.
"""

from __future__ import annotations

import json
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any
from xml.etree import ElementTree

from etac_ros.bag.markers import MARKERS_TYPE
from etac_ros.bag.state import WORLD
from etac_ros.bag.topics import TopicDescription
from etac_ros.graph.graph import Graph, LinkKind
from etac_ros.graph.topics import STATE
from etac_ros.graph.wire import SCALAR_FIELDS

_COLOURS = ("#4c78a8", "#f58518", "#54a24b", "#e45756", "#b279a2", "#9d755d", "#72b7b2", "#eeca3b")
_TITLES = {
    "attitude_error_deg": "attitude error [deg]",
    "euler_error_deg": "error as roll (x), pitch (y), yaw (z) [deg]",
    "rate": "angular velocity [rad/s]",
    "torque": "held torque [N m]",
}
"""Quantities in the order in which they are shown; what is watched follows."""
_MOST_COMPONENTS = 3


@dataclass(frozen=True)
class PlottedCurve:
    """One curve: a topic, and the way to a number in its messages."""

    topic: str
    fields: tuple[str, ...]


@dataclass(frozen=True)
class Plot:
    """Curves that share their axes."""

    title: str
    curves: tuple[PlottedCurve, ...]


def plots(graph: Graph, state: Iterable[TopicDescription]) -> tuple[Plot, ...]:
    """What is plotted of a run: its state, then what crossed the network.

    Parameters
    ----------
    graph
        What runs.
    state
        Topics of :class:`~etac_ros.bag.state.StateStreams`.
    """
    by_title: dict[str, list[PlottedCurve]] = {title: [] for title in _TITLES.values()}
    for topic in state:
        if topic.type_name == MARKERS_TYPE or not topic.name.startswith(f"{STATE}/"):
            continue
        *_, last = topic.name.split("/")
        watched = topic.name.partition("/watched/")[2]
        title = _TITLES.get(last) or (f"watched: {watched.partition('/')[0].replace('_', ' ')}" if watched else "")
        if title:
            by_title.setdefault(title, []).extend(_curves(topic.name, topic.type_name, _MOST_COMPONENTS))
    network = [link for link in graph.links.values() if link.kind is LinkKind.NETWORK]
    sent = [curve for link in network for curve in _curves(link.topic, link.wire.type_name, link.wire.size)]
    if sent:
        by_title["what was sent over the network"] = sent
    return tuple(Plot(title, tuple(curves)) for title, curves in by_title.items() if curves)


def foxglove(graph: Graph, state: Sequence[TopicDescription]) -> str:
    """A Foxglove layout: the bodies in 3-D on the left, plots with a common time axis on the right."""
    panels: dict[str, Any] = {}
    markers = [topic.name for topic in state if topic.type_name == MARKERS_TYPE]
    if markers:
        panels["3D!bodies"] = {
            "followTf": WORLD,
            "followMode": "follow-none",
            "cameraState": {
                "perspective": True,
                "distance": 6.0 + 4.0 * len(graph.plants),
                "phi": 60.0,
                "thetaOffset": 45.0,
            },
            # The bodies have axes of their own. The second key is what the open fork of Foxglove knows.
            "scene": {"transforms": {"axisSize": 0.0, "axisScale": 0.0}},
            "topics": {name: {"visible": True} for name in markers},
        }
    names = []
    for number, plot in enumerate(plots(graph, state)):
        names.append(f"Plot!{number}")
        panels[names[-1]] = {
            "title": plot.title,
            "foxglovePanelTitle": plot.title,
            "paths": [
                {
                    "value": ".".join([curve.topic, *curve.fields]),
                    "enabled": True,
                    "timestampMethod": "receiveTime",
                    "label": _label(curve),
                    "color": _COLOURS[place % len(_COLOURS)],
                }
                for place, curve in enumerate(plot.curves)
            ],
            "isSynced": True,
            "xAxisVal": "timestamp",
            "showLegend": True,
            "legendDisplay": "floating",
            "showXAxisLabels": True,
            "showYAxisLabels": True,
        }
    shown: Any = _stacked(names)
    if markers:
        shown = {"direction": "row", "first": "3D!bodies", "second": shown, "splitPercentage": 40}
    layout = {"configById": panels, "globalVariables": {}, "userNodes": {}, "playbackConfig": {"speed": 1}}
    return json.dumps({**layout, "layout": shown}, indent=1) + "\n"


def plotjuggler(graph: Graph, state: Sequence[TopicDescription]) -> str:
    """A PlotJuggler layout: a tab of plots below each other for the state, and one for the network."""
    root = ElementTree.Element("root")
    window = ElementTree.SubElement(root, "tabbed_widget", {"parent": "main_window", "name": "Main Window"})
    everything = plots(graph, state)
    for start in range(0, len(everything), 4):
        some = everything[start : start + 4]
        name = "state" if start == 0 else f"more {start // 4}"
        tab = ElementTree.SubElement(window, "Tab", containers="1", tab_name=name)
        container = ElementTree.SubElement(tab, "Container")
        sizes = ";".join(f"{1.0 / len(some):.6f}" for _ in some)
        splitter = ElementTree.SubElement(container, "DockSplitter", orientation="-", count=str(len(some)), sizes=sizes)
        for plot in some:
            area = ElementTree.SubElement(splitter, "DockArea", name=plot.title)
            drawn = ElementTree.SubElement(
                area, "plot", mode="TimeSeries", style="Lines", flip_x="false", flip_y="false"
            )
            ElementTree.SubElement(drawn, "limitY")
            for place, curve in enumerate(plot.curves):
                name = "/".join([curve.topic, *curve.fields])
                ElementTree.SubElement(drawn, "curve", name=name, color=_COLOURS[place % len(_COLOURS)])
    ElementTree.SubElement(window, "currentTabIndex", index="0")
    ElementTree.SubElement(root, "use_relative_time_offset", enabled="1")
    ElementTree.indent(root, " ")
    return '<?xml version="1.0" encoding="UTF-8"?>\n' + ElementTree.tostring(root, encoding="unicode") + "\n"


def _curves(topic: str, type_name: str, size: int) -> Iterator[PlottedCurve]:
    if type_name == "std_msgs/msg/Float64":
        yield PlottedCurve(topic, ("data",))
    elif type_name in SCALAR_FIELDS:
        for field in SCALAR_FIELDS[type_name][:size]:
            yield PlottedCurve(topic, tuple(field.split(".")))
    else:
        for place in range(min(size, _MOST_COMPONENTS)):
            yield PlottedCurve(topic, (f"data[{place}]",))


def _label(curve: PlottedCurve) -> str:
    """Whose it is, and which component."""
    words = [word for word in curve.topic.removeprefix(STATE).strip("/").split("/") if word not in _TITLES]
    return " ".join(["/".join(words), *(field for field in curve.fields[-1:] if field != "data")])


def _stacked(names: Sequence[str]) -> Any:
    """Panels below each other, all of one height."""
    first, *rest = names
    if not rest:
        return first
    share = 100.0 / len(names)
    return {"direction": "column", "first": first, "second": _stacked(rest), "splitPercentage": share}
