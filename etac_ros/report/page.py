"""The page: one HTML file that needs nothing but itself."""

from __future__ import annotations

import json
from base64 import b64encode
from collections.abc import Mapping
from dataclasses import dataclass
from html import escape
from importlib import resources
from typing import Any

from plotly.offline import get_plotlyjs  # type: ignore[import-untyped]

from etac_ros import __version__
from etac_ros.metrics.figures import FigureKey
from etac_ros.plain_text import one_line
from etac_ros.report import tables
from etac_ros.report.figures.kind import FigureKind
from etac_ros.report.figures.style import Rendered
from etac_ros.report.interactive import COLUMNS, colours_in_the_dark, spec
from etac_ros.report.stylesheet import STYLESHEET
from etac_ros.report.turning import turning
from etac_ros.report.view import View
from etac_ros.tables.html import html_section, line


@dataclass(frozen=True)
class Drawn:
    """A figure of the report and its files."""

    kind: FigureKind
    files: Rendered


_POLICY = (
    "default-src 'none'; script-src 'unsafe-inline'; style-src 'unsafe-inline'; img-src data: blob:; font-src data:"
)
MOST_BYTES = 6_000_000
"""Of a page: it should fit into a letter."""
_FEWEST_COLUMNS = 40


def page(view: View, drawn: list[Drawn]) -> str:
    """The HTML text. The same bags give the same text: nothing of the wall clock or of paths stands in it.

    Curves are thinned out until the page is no larger than :data:`MOST_BYTES`.
    """
    columns = COLUMNS
    while len((text := _page(view, drawn, columns)).encode()) > MOST_BYTES and columns > _FEWEST_COLUMNS:
        columns = columns * 2 // 3
    return text


def _page(view: View, drawn: list[Drawn], columns: int) -> str:
    run = view.run
    specs = {figure.kind.name: spec(figure.files.figure, columns) for figure in drawn}
    shown = {name: found for name, found in specs.items() if found is not None}
    title = run.scenario.run.title or run.scenario.name
    parts = [
        "<header>",
        f'<p class="kicker">{line(_kicker(view))}</p>',
        f"<h1>{line(title)}</h1>",
        f'<p class="lead">{line(lead(view))}</p>',
        "</header>",
        *(f'<p class="remark">{line(remark)}</p>' for remark in tables.remarks(view)),
        _tiles(view),
    ]
    overview = [figure for figure in drawn if figure.kind.name == "overview"]
    others = [figure for figure in drawn if figure.kind.name != "overview"]
    numbers = {figure.kind.name: number for number, figure in enumerate([*overview, *others], start=1)}
    parts += [_figure(view, figure, numbers[figure.kind.name], figure.kind.name in shown) for figure in overview]
    bodies = turning(run)
    if bodies is not None:
        parts.append(_turning(view))
    for table in (
        tables.published_table(view),
        tables.traffic_table(view),
        tables.link_table(view),
        tables.acknowledgement_table(view),
        *tables.wire_tables(view),
        tables.medium_table(view),
        tables.hold_table(view),
        tables.fault_table(view),
        tables.trigger_table(view),
        tables.performance_table(view),
        tables.watched_table(view),
        *tables.real_time(view),
        tables.identity_table(view),
    ):
        if table is not None:
            parts.append(html_section(table))
    parts.append("<h2>Figures</h2>")
    parts += [_figure(view, figure, numbers[figure.kind.name], figure.kind.name in shown) for figure in others]
    parts.append(
        f"<footer>Drawn by etac_ros {escape(__version__)} from the bag alone: messages of the links and "
        "committed samples, at simulated time.</footer>"
    )
    return "\n".join(
        [
            "<!DOCTYPE html>",
            '<html lang="en">',
            "<head>",
            '<meta charset="utf-8">',
            '<meta name="viewport" content="width=device-width, initial-scale=1">',
            '<meta name="color-scheme" content="light dark">',
            # The page may load nothing from anywhere, whatever a bag has written into it.
            f'<meta http-equiv="Content-Security-Policy" content="{_POLICY}">',
            f"<title>{line(title)}</title>",
            f"<style>\n{STYLESHEET}\n</style>",
            "</head>",
            "<body>",
            "<main>",
            *parts,
            "</main>",
            f'<script id="data" type="application/json">{_json(shown, bodies)}</script>',
            f"<script>{get_plotlyjs()}</script>",
            f"<script>{_script()}</script>",
            "</body>",
            "</html>",
            "",
        ]
    )


def lead(view: View) -> str:
    """The run in a sentence or two."""
    run = view.run
    network = run.summary.network
    text = (
        f"{view.triggering_instants:,} triggering instants in {run.end_s:g} s put {network.messages:,} messages and "
        f"{network.payload_bytes:,} bytes of payload on the network."
    )
    if view.overlaid:
        beside = [
            f"{label} put {other.summary.network.messages:,} messages and {other.summary.network.payload_bytes:,} bytes"
            for label, other in zip(view.labels[1:], view.others, strict=True)
        ]
        text += f" Beside it: {'; '.join(beside)}."
    return text


def _kicker(view: View) -> str:
    run = view.run
    words = [run.scenario.name]
    if run.scenario.variant:
        words.append(f"variant {run.scenario.variant}")
    if run.overrides:
        words.append(f"{len(run.overrides)} value{'s' if len(run.overrides) > 1 else ''} overridden")
    words.append(f"{run.end_s:g} s simulated")
    words.append(f"engine {run.metadata.get('engine') or 'unknown'}")
    return " · ".join(words)


def _tiles(view: View) -> str:
    here = tables.measured(view)
    summary = view.run.summary
    tiles = [
        (f"{view.triggering_instants:,}", "triggering instants"),
        (f"{summary.network.messages:,}", "network messages"),
        (f"{summary.network.payload_bytes:,} B", "network payload"),
    ]
    less = here.get(FigureKey("reduction_percent"))
    if less is not None:
        against = "measured" if view.baseline is not None else "published"
        words = f"bytes {'less' if less >= 0.0 else 'more'}, as sent, than the {against} baseline"
        tiles.append((f"{abs(less):.1f} %", words))
    longest = here.get(FigureKey("max_interval_s"))
    if longest is not None:
        tiles.append((f"{longest:.4g} s", "longest interval"))
    cells = [f'<div class="tile"><b>{line(value)}</b><span>{line(name)}</span></div>' for value, name in tiles]
    return "\n".join(['<div class="tiles">', *cells, "</div>"])


def _json(shown: Mapping[str, Any], bodies: Any) -> str:
    """The data of the figures; no text in it can end the element that it stands in."""
    found = json.dumps({"figures": shown, "turning": bodies, "dark": colours_in_the_dark()}, separators=(",", ":"))
    return found.replace("<", "\\u003c")


def _script() -> str:
    return resources.files("etac_ros.report").joinpath("interactive.js").read_text(encoding="utf-8")


def _turning(view: View) -> str:
    other = " Only this run is shown." if view.overlaid else ""
    return "\n".join(
        [
            '<figure id="turning">',
            '<div class="plot" id="turning-plot" role="img" aria-label="Attitude in three dimensions"></div>',
            '<p class="slider"><label for="turning-time">time</label>'
            '<input id="turning-time" type="range" min="0" max="1" value="0"><output id="turning-words"></output></p>',
            "<figcaption><b>Attitude in three dimensions.</b> Drag to look from elsewhere, move the slider through the "
            "run; it goes slowly where it begins. x red, y green, z blue; the torque yellow, 1 m for 1 N m and a "
            "quarter less for each decade less. Plants have inertias, not shapes: this one is made up."
            f"{other}</figcaption>",
            "</figure>",
        ]
    )


def _figure(view: View, figure: Drawn, number: int, interactive: bool) -> str:
    kind = figure.kind
    caption = kind.words(view)
    place = view.shown_in(kind.name).replace(". ", ".\u00a0")  # a number stays with its "fig."
    shown = f" The {view.source} shows the same in its {place}." if place else ""
    width, height = (round(96 * inches) for inches in kind.size_in(view))
    alt = escape(one_line(f"{kind.title}. {caption}"))
    if interactive:
        drawing = [
            f'<div class="plot" id="plot-{kind.name}" role="img" aria-label="{alt}"></div>',
            f"<noscript>Its picture is the file {kind.name}.png beside this page.</noscript>",
        ]
    else:
        drawing = [
            f'<div class="scroll" tabindex="0" role="region" aria-label="{escape(kind.title)}">',
            "<picture>",
            f'<source media="screen and (prefers-color-scheme: dark)" srcset="{_data(figure.files.dark)}">',
            f'<img src="{_data(figure.files.light)}" width="{width}" height="{height}" alt="{alt}">',
            "</picture>",
            "</div>",
        ]
    return "\n".join(
        [
            f'<figure id="{kind.name}">',
            *drawing,
            f"<figcaption><b>Figure {number}. {line(kind.title)}.</b> {line(caption + shown)}</figcaption>",
            "</figure>",
        ]
    )


def _data(png: bytes) -> str:
    return f"data:image/png;base64,{b64encode(png).decode()}"
