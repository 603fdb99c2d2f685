"""Tables for the terminal."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from pathlib import Path

from rich import box
from rich.console import Console
from rich.table import Table

from etac_ros.bag.describe import describe
from etac_ros.bag.recover import recover
from etac_ros.metrics.published import families, label, stands_alone
from etac_ros.metrics.summary import PublishedValue, Summary
from etac_ros.plain_text import one_line
from etac_ros.scenario.load import Scenario

_NARROWEST = 124
"""Columns below which the tables would be cut."""


def make_console(narrowest: int = _NARROWEST) -> Console:
    """A console that leaves brackets alone and never breaks a table, also where output goes to a file."""
    console = Console(markup=False, emoji=False)
    console.width = max(console.width, narrowest)
    return console


def show_summary(scenario: Scenario, summary: Summary, console: Console) -> None:
    """The tables that stand after a run."""
    variant = f", variant {summary.variant}" if summary.variant else ""
    console.print(f"\n{scenario.run.title or scenario.name}{variant}", style="bold")
    alike = families(_shown(summary), scenario.nodes)
    of_families = {name for members in alike.values() for name in members.values()}
    console.print(_figures(scenario, summary, of_families))
    console.print()
    if alike:
        console.print(_by_namespace(scenario, summary, alike))
        console.print()
    console.print(_topics(summary))
    console.print()
    console.print(_performance(summary))
    console.print()
    if summary.watches:
        console.print(_watched(summary))
        console.print()
    for name, count in summary.samples.items():
        console.print(f"{name}: {count:,} samples inside the module, which no message carries")
    timing = summary.timing
    speed = summary.duration_s / timing.loop_s if timing.loop_s else 0.0
    console.print(
        f"engine {summary.engine}: {summary.duration_s:g} s simulated in {timing.loop_s:.3f} s "
        f"({speed:,.0f} x real time), start-up {timing.startup_s:.2f} s, in all {timing.total_s:.2f} s",
    )
    if summary.bag is not None:
        console.print(f"bag: {summary.bag}   (etac info, etac report)", soft_wrap=True)


def _figures(scenario: Scenario, summary: Summary, alike: Collection[str]) -> Table:
    source = scenario.run.published.source or "paper"
    baseline = summary.baseline
    table = plain_table("")
    for column in ["this run", source, "band"] + ([f"{baseline.variant} baseline"] if baseline else []):
        table.add_column(column, justify="right", no_wrap=True)
    for name in _shown(summary):
        if name in alike:
            continue
        measured = summary.measured.get(name)
        figure = summary.published.get(name)
        row = [
            figure_label(name, summary),
            "-" if measured is None else number(measured),
            "" if figure is None else number(figure.value),
            "" if figure is None else band(figure) + _mark(measured, figure),
        ]
        if baseline is not None:
            beside = baseline.measured.get(name)
            row.append("" if beside is None else number(beside))
        table.add_row(*row)
    return table


def _mark(measured: float | None, figure: PublishedValue) -> str:
    return " " if measured is None or figure.low <= measured <= figure.high else "!"


def _shown(summary: Summary) -> list[str]:
    broadcasts = {"network_deliveries"} if summary.network.deliveries != summary.network.messages else set()
    shown = [name for name in summary.measured if name in summary.published or name in broadcasts or stands_alone(name)]
    return [*shown, *(name for name in summary.published if name not in summary.measured)]


def _by_namespace(scenario: Scenario, summary: Summary, alike: Mapping[str, Mapping[str, str]]) -> Table:
    """Figures that the spacecraft of a formation have alike, a column for each."""
    namespaces = list(dict.fromkeys(namespace for members in alike.values() for namespace in members))
    table = plain_table(f"this run ({scenario.run.published.source or 'paper'})")
    for namespace in namespaces:
        table.add_column(namespace, justify="right", no_wrap=True)
    outside = False
    for members in alike.values():
        cells = []
        for namespace in namespaces:
            name = members.get(namespace, "")
            measured, figure = summary.measured.get(name), summary.published.get(name)
            cell = "-" if measured is None else number(measured)
            if figure is not None:
                met = measured is not None and figure.low <= measured <= figure.high
                marked = measured is not None and not met
                outside |= marked
                limit = "≤ " if figure.low == 0.0 and figure.high == figure.value else ""
                cell += f" ({limit}{number(figure.value)}){'!' if marked else ' '}"
            cells.append(cell)
        first = next(iter(members.values()))
        own = summary.published.get(first)
        words = own.label if own is not None and own.label else figure_label(first, summary).partition(",")[0]
        table.add_row(words, *cells)
    if outside:
        table.caption = "! outside the band"
    return table


def figure_label(name: str, summary: Summary) -> str:
    """What a measured or published figure is called in a table."""
    published = summary.published.get(name)
    own = "" if published is None else published.label
    words = label(name, summary.triggers, own)
    plants = [plant for plant in summary.performance if name.endswith(plant.replace("/", "_"))]
    return f"{words}, {plants[0]}" if own and plants and len(summary.performance) > 1 else words


def _topics(summary: Summary) -> Table:
    table = _topic_table()
    for kind in ("network", "internal", "emulation"):
        rows = {name: topic for name, topic in summary.topics.items() if topic.kind == kind}
        if not rows:
            continue
        for name, topic in rows.items():
            payload = topic.payload_bytes
            table.add_row(*_topic_row(name, topic.type, topic.messages, payload, topic.cdr_bytes))
        totals = getattr(summary, kind)
        total = _topic_row(f"all {kind}", "", totals.messages, totals.payload_bytes, totals.cdr_bytes)
        table.add_row(*total, style="bold", end_section=True)
    return table


def _performance(summary: Summary) -> Table:
    table = plain_table("plant")
    for column in ("error [deg]", "maximum*", "rate [deg/s]", "maximum*", "energy [N²m²s]"):
        table.add_column(column, justify="right", no_wrap=True)
    runs = dict(summary.performance)
    if summary.baseline is not None:
        for name, figures in summary.baseline.performance.items():
            runs[f"{name}, {summary.baseline.variant}"] = figures
    for name, figures in runs.items():
        errors = figures.attitude_error_deg, figures.max_attitude_error_deg
        pointing = (*errors, figures.rate_deg_s, figures.max_rate_deg_s)
        table.add_row(
            name,
            *("" if number is None else f"{number:.3g}" for number in pointing),
            f"{figures.energy_n2m2s:.4g}",
        )
    table.caption = f"* from {summary.steady_from_s:g} s on"
    return table


def _watched(summary: Summary) -> Table:
    table = plain_table("watched", "")
    for column in ("largest", "at [s]"):
        table.add_column(column, justify="right", no_wrap=True)
    table.add_column("axis", no_wrap=True)
    for column in ("largest*", "at the end", "notice", "limit"):
        table.add_column(column, justify="right", no_wrap=True)
    for node, watched in summary.watches.items():
        for place, watch in enumerate(watched):
            table.add_row(
                node if place == 0 else "",
                f"{watch.name} [{watch.unit}]" if watch.unit else watch.name,
                f"{watch.largest:.4g}",
                f"{watch.at_s:g}",
                watch.axis,
                f"{watch.steady:.3g}",
                f"{watch.final:.3g}",
                "" if watch.notice is None else f"{watch.notice:g}",
                "" if watch.bound is None else f"{watch.bound:g}",
            )
    table.caption = f"* from {summary.steady_from_s:g} s on"
    return table


def show_bag(bag: Path, console: Console) -> None:
    """What ``etac info`` prints."""
    described = describe(bag)
    messages = sum(row.messages for row in described.topics)
    console.print(
        f"{bag}: {described.duration_s:g} s, {messages:,} messages, {described.file_bytes:,} bytes on disk",
        soft_wrap=True,
    )
    for key, value in described.metadata.items():
        console.print(f"  {one_line(key)}: {one_line(value)}")
    table = _topic_table("kind", "first [s]", "last [s]")
    for row in described.topics:
        payload = row.payload_bytes if row.kind in ("network", "internal") else 0
        cells = _topic_row(one_line(row.topic), one_line(row.type_name), row.messages, payload, row.cdr_bytes)
        table.add_row(*cells, row.kind, _time(row.first_s), _time(row.last_s))
    console.print(table)


def show_recovery(bag: Path, output: Path | None, console: Console) -> None:
    """What ``etac recover`` prints."""
    report = recover(bag, output)
    if report.nothing_to_do:
        console.print(f"{report.bag}: is whole, nothing to do", soft_wrap=True)
        return
    console.print(f"{report.bag}: {one_line(report.found)}; saved", soft_wrap=True)
    for topic, messages in report.messages.items():
        console.print(f"  {messages:8,} messages of {one_line(topic)}")
    if report.original is not None:
        console.print(f"the file as it was found is kept: {report.original}", soft_wrap=True)


def _topic_table(*more: str) -> Table:
    table = plain_table("topic", "type")
    for column in ("messages", "payload", "CDR bytes"):
        table.add_column(column, justify="right", no_wrap=True)
    for column in more:
        table.add_column(column, justify="right", no_wrap=True)
    return table


def _topic_row(name: str, type_name: str, messages: int, payload_bytes: int, cdr_bytes: int) -> tuple[str, ...]:
    payload = f"{payload_bytes:,}" if payload_bytes else ""
    return name, type_name.replace("/msg/", "/"), f"{messages:,}", payload, f"{cdr_bytes:,}"


def plain_table(*columns: str) -> Table:
    """A table that keeps its words whole, also where the terminal is narrow."""
    table = Table(box=box.SIMPLE_HEAD, show_edge=False, pad_edge=False, padding=(0, 1))
    for column in columns:
        table.add_column(column, no_wrap=True)
    return table


def _time(value: float | None) -> str:
    return "" if value is None else f"{value:g}"


def number(value: float) -> str:
    """A figure for people: whole numbers whole, others to four digits."""
    return f"{value:,.0f}" if float(value).is_integer() else f"{value:,.4g}"


def band(figure: PublishedValue) -> str:
    """The band of a published figure; empty where it has no width."""
    return "" if figure.low == figure.high else f"{number(figure.low)} to {number(figure.high)}"
