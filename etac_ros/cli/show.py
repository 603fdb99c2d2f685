"""What the commands print of a run and of a bag."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path

from rich.console import Console

from etac_ros.bag.describe import TopicRow, describe
from etac_ros.bag.recover import recover
from etac_ros.capture.kept import read_from_bag
from etac_ros.capture.model import data_frames
from etac_ros.metrics.accounts import overflows
from etac_ros.metrics.cells import (
    ACKNOWLEDGEMENT_ACCOUNT,
    BAND,
    FAULT_ACCOUNT,
    HOLD_ACCOUNT,
    KINDS,
    LINK_ACCOUNT,
    MEDIUM_ACCOUNT,
    PERFORMANCE_SHORT,
    WATCHED,
    acknowledgement_account_cells,
    energy_heading,
    falls_short,
    fault_account_cells,
    fault_notes,
    hold_account_cells,
    link_account_cells,
    medium_account_cells,
    paper_cells,
    performance_cells,
    printed,
    steady_note,
    topic_cells,
    topic_type,
    totals_of,
    watched_cells,
    watched_name,
)
from etac_ros.metrics.figures import FigureKey, families, stands_alone
from etac_ros.metrics.latency_tables import real_time_tables
from etac_ros.metrics.summary import Summary, Totals
from etac_ros.metrics.wire import wire_table, with_model
from etac_ros.plain_text import one_line
from etac_ros.scenario.load import Scenario
from etac_ros.tables.numbers import number, optional, type_words
from etac_ros.tables.table import Row, Table
from etac_ros.tables.terminal import make_console, show

__all__ = ["make_console", "show", "show_bag", "show_recovery", "show_summary"]

_SHORT = "! not the paper's: etac reproduce says how far"


def show_summary(scenario: Scenario, summary: Summary, console: Console) -> None:
    """The tables that stand after a run."""
    variant = f", variant {summary.variant}" if summary.variant else ""
    console.print(f"\n{scenario.run.title or scenario.name}{variant}", style="bold")
    for table in run_tables(scenario, summary):
        show(table, console)
        console.print()
    for name, count in summary.samples.items():
        console.print(f"{name}: {count:,} samples inside the module, which no message carries")
    for topic, messages in summary.strangers.items():
        console.print(f"{topic}: {messages:,} messages of others, not of this run, were ignored", soft_wrap=True)
    if summary.real_time is not None and summary.real_time.overruns:
        words = f"{summary.real_time.overruns:,} overruns: real time was not kept; at a lower --rate it may be"
        console.print(words, soft_wrap=True)
    timing = summary.timing
    speed = summary.ended_s / timing.loop_s if timing.loop_s else 0.0
    console.print(
        f"engine {summary.engine}: {summary.ended_s:g} s simulated in {timing.loop_s:.3f} s "
        f"({speed:,.0f} x real time), start-up {timing.startup_s:.2f} s, in all {timing.total_s:.2f} s",
    )
    if summary.bag is not None:
        console.print(f"bag: {summary.bag}   (etac info, etac report)", soft_wrap=True)


def run_tables(scenario: Scenario, summary: Summary) -> list[Table]:
    """The tables of a run: its figures beside the paper's, its topics, how it pointed, what it watched."""
    source = scenario.run.published.source or "paper"
    shown = _shown(summary)
    alike = families(shown)
    of_families = {key for members in alike for key in members.values()}
    tables = [_figures([key for key in shown if key not in of_families], source, summary, bool(alike))]
    if alike:
        tables.append(_by_namespace(alike, source, summary))
    tables += [
        _topics(summary),
        *_wire(summary),
        *_accounts(summary, scenario.run.ticks_per_second),
        _performance(summary),
    ]
    tables += [_watched(summary)] if summary.watches else []
    return tables + ([] if summary.real_time is None else real_time_tables(summary.real_time))


def _shown(summary: Summary) -> list[FigureKey]:
    """The figures of a table in their order: those measured, then those of the paper that the run does not have."""
    paper, own = summary.paper, {one.key for one in summary.own}
    broadcasts = summary.network.deliveries != summary.network.messages
    shown = [
        key
        for key in summary.figures
        if key in paper or stands_alone(key, own) or (broadcasts and key.name == "network_deliveries")
    ]
    return [*shown, *(key for key in paper if key not in summary.figures)]


def _figures(keys: Sequence[FigureKey], source: str, summary: Summary, more: bool) -> Table:
    """Figures beside the paper's; the reason why there are none of the paper's stands below the last table of them."""
    figures, paper, baseline = summary.figures, summary.paper, summary.baseline
    rows, outside = [], False
    for key in keys:
        value, figure = figures.get(key), paper.get(key)
        published, band = paper_cells(figure)
        marked = falls_short(value, figure)
        outside |= marked
        cells = [
            "-" if value is None else number(value),
            *([published, band + ("!" if marked else " ")] if paper else []),
        ]
        if baseline is not None:
            cells.append(optional(baseline.figures.get(key)))
        rows.append(Row((summary.label_of(key), *cells)))
    columns = ("", "this run", *((source, BAND) if paper else ()))
    if baseline is not None:
        columns = (*columns, "baseline")
    against = () if baseline is None else (f"baseline: {baseline.variant}",)
    notes = against + ((_SHORT,) if outside else ()) + (() if more else _reason(source, summary))
    return Table("", columns, tuple(rows), notes)


def _reason(source: str, summary: Summary) -> tuple[str, ...]:
    return (f"no column '{source}': {summary.published_not}",) if summary.published_not else ()


def _by_namespace(alike: Sequence[Mapping[str, FigureKey]], source: str, summary: Summary) -> Table:
    """Figures that the spacecraft of a formation have alike, a column for each."""
    figures, paper = summary.figures, summary.paper
    namespaces = tuple(dict.fromkeys(namespace for members in alike for namespace in members))
    rows, outside = [], False
    for members in alike:
        cells = []
        for namespace in namespaces:
            key = members.get(namespace)
            value, figure = (None, None) if key is None else (figures.get(key), paper.get(key))
            marked = falls_short(value, figure)
            outside |= marked
            cell = "-" if value is None else number(value)
            cells.append(cell if figure is None else f"{cell} ({printed(figure)}){'!' if marked else ' '}")
        first = next(iter(members.values()))
        rows.append(Row((summary.label_of(first).removesuffix(f", {first.node}"), *cells)))
    notes = ((_SHORT,) if outside else ()) + _reason(source, summary)
    return Table("", (f"this run ({source})" if paper else "this run", *namespaces), tuple(rows), notes)


def _topics(summary: Summary) -> Table:
    rows = []
    for kind in KINDS:
        topics = {name: topic for name, topic in summary.topics.items() if topic.kind == kind}
        rows += [Row((name, topic_type(topic), *topic_cells(topic))) for name, topic in topics.items()]
        if topics:
            rows.append(Row((f"all {kind}", "", *topic_cells(totals_of(summary, kind))), strong=True, ends=True))
    if summary.wire is not None:
        return _topic_table(rows)
    modelled = {name: topic.model_wire_bytes for name, topic in summary.topics.items()}
    for kind in KINDS:
        of_kind = [topic.model_wire_bytes or 0 for topic in summary.topics.values() if topic.kind == kind]
        modelled[f"all {kind}"] = sum(of_kind)
    return with_model(_topic_table(rows), modelled)


def _wire(summary: Summary) -> list[Table]:
    """What was captured, if anything was."""
    if summary.wire is None:
        return []
    return [wire_table(summary.wire, {name: topic.kind for name, topic in summary.topics.items()})]


def _accounts(summary: Summary, ticks_per_second: int) -> list[Table]:
    """What became of messages on links that are not ideal, and what shared media carried; nothing for ideal links."""
    tables = []
    if summary.links:
        rows = tuple(Row((name, *link_account_cells(account))) for name, account in summary.links.items())
        note = "each message counted for each receiver; age: of the newest information, mean and peak"
        tables.append(Table("", ("link", *LINK_ACCOUNT), rows, (note,)))
        told = {name: one.acknowledgement for name, one in summary.links.items() if one.acknowledgement is not None}
        if told:
            rows = tuple(Row((name, *acknowledgement_account_cells(account))) for name, account in told.items())
            tables.append(Table("", ("link", *ACKNOWLEDGEMENT_ACCOUNT), rows))
    if summary.media:
        rows = tuple(Row((name, *medium_account_cells(account))) for name, account in summary.media.items())
        tables.append(Table("", ("medium", *MEDIUM_ACCOUNT), rows, overflows(summary.media, ticks_per_second)))
    if summary.holds:
        rows = tuple(Row((name, *hold_account_cells(account))) for name, account in summary.holds.items())
        tables.append(Table("", ("hold", *HOLD_ACCOUNT), rows))
    if summary.faults:
        rows = tuple(Row((name, *cells)) for name, one in summary.faults.items() for cells in fault_account_cells(one))
        notes = fault_notes(summary.faults, summary.real_time is not None)
        tables.append(Table("", ("fault", *FAULT_ACCOUNT), rows, notes, frozenset(("node", "does", "plant"))))
    return tables


def _topic_table(rows: Sequence[Row], *more: str) -> Table:
    columns = ("topic", "type", "messages", "payload", "CDR bytes", *more)
    return Table("", columns, tuple(rows), texts=frozenset({"type"}), spare=frozenset({"type"}))


def _performance(summary: Summary) -> Table:
    runs = dict(summary.performance)
    if summary.baseline is not None:
        runs |= {f"{name}, {summary.baseline.variant}": one for name, one in summary.baseline.performance.items()}
    rows = tuple(Row((name, *performance_cells(figures))) for name, figures in runs.items())
    note = f"error and rate at the end, {steady_note(summary.steady_from_s, summary.ended_s)}"
    columns = "plant", *PERFORMANCE_SHORT, energy_heading(runs.values())
    table = Table("", columns, rows, (note,)).without_empty_columns()
    return table if len(table.columns) > 2 else replace(table, notes=())


def _watched(summary: Summary) -> Table:
    rows = tuple(
        Row((node if place == 0 else "", watched_name(watch), *watched_cells(watch)))
        for node, watched in summary.watches.items()
        for place, watch in enumerate(watched)
    )
    columns = ("watched", "quantity", *WATCHED)
    notes = (steady_note(summary.steady_from_s, summary.ended_s),)
    return Table("", columns, rows, notes, frozenset({"quantity", "axis"}))


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
    rows = []
    modelled: dict[str, int | None] = {}
    for row in described.topics:
        payload = row.payload_bytes if row.kind in ("network", "internal") else 0
        counted = Totals(messages=row.messages, deliveries=0, payload_bytes=payload, cdr_bytes=row.cdr_bytes)
        modelled[one_line(row.topic)] = _modelled(row)
        more = (row.kind, optional(row.first_s, "g"), optional(row.last_s, "g"))
        rows.append(Row((one_line(row.topic), type_words(one_line(row.type_name)), *topic_cells(counted), *more)))
    wire = read_from_bag(bag)
    table = _topic_table(rows, "kind", "first [s]", "last [s]")
    show(table if wire is not None else with_model(table, modelled), console)
    if wire is not None:
        console.print()
        show(wire_table(wire, {row.topic: row.kind for row in described.topics}), console)


def _modelled(row: TopicRow) -> int | None:
    """A model of what a link's messages took on Ethernet; None of what is no link, or has messages of several sizes."""
    if row.kind not in ("network", "internal") or row.receivers is None or not row.messages:
        return None
    cdr, rest = divmod(row.cdr_bytes, row.messages)
    return None if rest else row.messages * data_frames(cdr, 0, row.receivers, others=1).total_bytes


def show_recovery(bag: Path, output: Path | None, console: Console) -> None:
    """What ``etac recover`` prints."""
    from etac_ros.runs import state_rest  # takes a while to load, which most commands need not

    report = recover(bag, output, state_rest)
    if report.nothing_to_do:
        console.print(f"{report.bag}: is whole, nothing to do", soft_wrap=True)
        return
    console.print(f"{report.bag}: {one_line(report.found)}; saved", soft_wrap=True)
    for topic, messages in report.messages.items():
        console.print(f"  {messages:8,} messages of {one_line(topic)}")
    if report.original is not None:
        console.print(f"the file as it was found is kept: {report.original}", soft_wrap=True)
