"""The tables of a report."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

from etac_ros.metrics.cells import (
    ACKNOWLEDGEMENT_ACCOUNT,
    BAND,
    FAULT_ACCOUNT,
    HOLD_ACCOUNT,
    KINDS,
    LINK_ACCOUNT,
    MEDIUM_ACCOUNT,
    PERFORMANCE,
    WATCHED,
    acknowledgement_account_cells,
    energy_heading,
    fault_account_cells,
    fault_notes,
    hold_account_cells,
    link_account_cells,
    medium_account_cells,
    paper_cells,
    performance_cells,
    steady_note,
    topic_type,
    totals_of,
    watched_cells,
    watched_name,
)
from etac_ros.metrics.figures import FigureKey, stands_alone
from etac_ros.metrics.latency_tables import real_time_tables
from etac_ros.metrics.summary import PublishedValue, Topic, Totals, with_measured
from etac_ros.metrics.wire import wire_table
from etac_ros.report.figures.style import symbols
from etac_ros.report.source import ReportedRun, plants_apart
from etac_ros.report.view import View
from etac_ros.tables.numbers import optional
from etac_ros.tables.table import Row, Table

_Cells = dict[str, tuple[str, ...]]
"""Cells of one run by what stands at the head of their row."""
_REDUCTION = FigureKey("reduction_percent")
_BASELINE_BYTES = FigureKey("baseline_payload_bytes")
_AT_BASELINE = (FigureKey("baseline_messages"), _BASELINE_BYTES)
"""What is measured at the baseline, and stands in its column."""


def measured(view: View) -> dict[FigureKey, float]:
    """The figures that stand beside the published ones."""
    baseline = view.baseline
    found = with_measured(view.run.summary, None if baseline is None else baseline.summary).figures
    if baseline is None and view.paper_baseline is not None and view.paper_baseline.value > 0.0:
        ratio = view.run.summary.network.payload_bytes / view.paper_baseline.value
        found = {**found, _REDUCTION: 100.0 * (1.0 - ratio)}
    return found


def identity_table(view: View) -> Table:
    """What was run, so that it can be run again."""
    runs = view.runs
    rows = [
        ("scenario", [run.scenario.name for run in runs]),
        ("variant", [run.scenario.variant or "none" for run in runs]),
        ("overrides", [_overrides(run.overrides) for run in runs]),
        ("seed", [str(run.scenario.run.seed) for run in runs]),
        ("simulated time", [f"{run.end_s:g} s" for run in runs]),
        ("trigger grid", [f"{run.graph.ticks_per_second:g} Hz" for run in runs]),
        ("engine", [run.metadata.get("engine") or "unknown" for run in runs]),
        ("etac_ros", [run.metadata.get("version") or "unknown" for run in runs]),
        ("digest", [run.metadata.get("digest") or "unknown" for run in runs]),
    ]
    return Table(
        "The runs" if view.overlaid else "The run",
        ("", *view.labels),
        tuple(Row((name, *values)) for name, values in rows),
        texts=frozenset(view.labels),
    )


def published_table(view: View) -> Table | None:
    """Figures of this run beside those of the paper; None where the paper publishes nothing of it.

    Where the run is not the paper's, its figures stand without the paper's, with the reason.
    """
    summary = view.run.summary
    here, paper = measured(view), summary.paper
    if not paper and not summary.published_not:
        return None
    own = {one.key for one in summary.own}
    keys = [key for key in here if key in paper or (stands_alone(key, own) and key not in _AT_BASELINE)]
    keys += [key for key in paper if key not in here]
    if not paper:
        keys += [key for key in _AT_BASELINE if key in here]
    rows = []
    for key in keys:
        figure, value = paper.get(key), here.get(key)
        of_baseline = view.baseline is not None and key in _AT_BASELINE
        cells = [summary.label_of(key), "" if of_baseline else optional(value)]
        if paper:
            cells += [*paper_cells(figure), _verdict(value, figure)]
        cells += [optional(_beside(view, other).get(key)) for other in view.others]
        rows.append(Row(tuple(cells)))
    beside = (view.source, BAND, "verdict") if paper else ()
    title = "Beside the published figures" if paper else "Figures"
    return Table(title, ("", view.labels[0], *beside, *view.labels[1:]), tuple(rows), _published_notes(view))


def traffic_table(view: View) -> Table:
    """What each topic carried, kinds apart."""
    runs = [run.summary for run in view.runs]
    rows = []
    for kind in KINDS:
        names = list(dict.fromkeys(name for run in runs for name, topic in run.topics.items() if topic.kind == kind))
        if not names:
            continue
        for name in names:
            topics = [run.topics.get(name) for run in runs]
            of = next(topic for topic in topics if topic is not None)
            rows.append(Row((name, *_counts(topics), topic_type(of))))
        rows.append(Row((f"all {kind}", *_counts([totals_of(run, kind) for run in runs]), ""), strong=True))
    columns = ("messages", "payload [bytes]", "CDR [bytes]")
    headings = (*columns, *(columns[:2] * len(view.others)))
    groups: tuple[tuple[str, int], ...] = ()
    if view.overlaid:
        groups = (("", 1), (view.labels[0], 3), *((name, 2) for name in view.labels[1:]), ("", 1))
    return Table(
        "What crossed the links",
        ("topic", *headings, "type"),
        tuple(rows),
        (
            "Payload: 4 bytes a component of float32, as the papers count, 8 of float64. "
            "CDR: the serialized messages, as recorded.",
            "The emulation plane carries what is light or torque in hardware, and the simulator's own; it is "
            "never added to the network. Only what the bag holds of it stands here.",
        ),
        frozenset({"type"}),
        groups,
    )


def link_table(view: View) -> Table | None:
    """What became of messages on links that are not ideal; None if all are."""
    found: list[_Cells] = [
        {name: link_account_cells(account) for name, account in run.summary.links.items()} for run in view.runs
    ]
    notes = (
        "Each message counts once for each receiver. Delay: median, 99 % and most of first arrivals. Age: of the "
        "newest information at a receiver, from its first arrival on, mean and peak.",
    )
    return (
        _of_runs("What became of messages on their way", "link", LINK_ACCOUNT, view, found, notes)
        if any(found)
        else None
    )


def acknowledgement_table(view: View) -> Table | None:
    """What was sent again and acknowledged; None if nothing is acknowledged."""
    found: list[_Cells] = [
        {
            name: acknowledgement_account_cells(account.acknowledgement)
            for name, account in run.summary.links.items()
            if account.acknowledgement is not None
        }
        for run in view.runs
    ]
    notes = ("A frame that was sent again counts once, however many receive it.",)
    return (
        _of_runs("What was acknowledged", "link", ACKNOWLEDGEMENT_ACCOUNT, view, found, notes) if any(found) else None
    )


def wire_tables(view: View) -> list[Table]:
    """What was captured of each run; none where nothing was."""
    found = []
    for label, run in zip(view.labels, view.runs, strict=True):
        if run.summary.wire is not None:
            table = wire_table(run.summary.wire, {name: topic.kind for name, topic in run.summary.topics.items()})
            found.append(replace(table, title=f"On the wire, {label}") if view.overlaid else table)
    return found


def medium_table(view: View) -> Table | None:
    """What shared media carried; None if there are none."""
    found: list[_Cells] = [
        {name: medium_account_cells(account) for name, account in run.summary.media.items()} for run in view.runs
    ]
    notes = (
        "The emulated air: over DDS each message crosses once, whatever becomes of it here. Payload, overhead and "
        "acknowledging frames [bytes] are those of frames that were alone on the air.",
    )
    return _of_runs("What was on the air", "medium", MEDIUM_ACCOUNT, view, found, notes) if any(found) else None


def hold_table(view: View) -> Table | None:
    """Which holds expired; None if none has a time to live."""
    found: list[_Cells] = [
        {name: hold_account_cells(account) for name, account in run.summary.holds.items()} for run in view.runs
    ]
    return _of_runs("Holds with a time to live", "node", HOLD_ACCOUNT, view, found) if any(found) else None


def fault_table(view: View) -> Table | None:
    """What each fault cost; None if there are none."""
    found: list[_Cells] = [
        {
            (name if len(account.plants) < 2 else f"{name}, {cells[6]}"): cells
            for name, account in run.summary.faults.items()
            for cells in fault_account_cells(account)
        }
        for run in view.runs
    ]
    if not any(found):
        return None
    notes = dict.fromkeys(
        note for run in view.runs for note in fault_notes(run.summary.faults, run.recording.wall is not None)
    )
    return _of_runs("What faults cost", "fault", FAULT_ACCOUNT, view, found, tuple(f"{note}." for note in notes))


def trigger_table(view: View) -> Table | None:
    """Triggering instants of each sensor; None if no module triggers."""
    found: list[_Cells] = [
        {
            name: (f"{triggers.count:,}", _interval(triggers.min_interval_s), _interval(triggers.mean_interval_s),
                   _interval(triggers.max_interval_s))
            for name, triggers in run.summary.triggers.items()
        }
        for run in view.runs
    ]  # fmt: skip
    columns = ("triggering instants", "shortest interval [s]", "mean [s]", "longest [s]")
    return _of_runs("Triggering", "sensor", columns, view, found) if any(found) else None


def performance_table(view: View) -> Table:
    """How well each plant pointed, and at what cost."""
    found: list[_Cells] = [
        {name: performance_cells(figures) for name, figures in run.summary.performance.items()} for run in view.runs
    ]
    energy = energy_heading(one for run in view.runs for one in run.summary.performance.values())
    note = f"{_steady_note(view)} Error and rate: at the end."
    if "energy" in energy:
        note += " Energy: integral of the square of the held torque."
    return _of_runs("Pointing", "plant", (*PERFORMANCE, energy), view, found, (note,)).without_empty_columns()


def watched_table(view: View) -> Table | None:
    """Extremes of the watched quantities; None if nothing is watched."""
    found: list[_Cells] = [
        {
            f"{node}, {symbols(watched_name(watch))}": watched_cells(watch)
            for node, watches in run.summary.watches.items()
            for watch in watches
        }
        for run in view.runs
    ]
    notes = (f"{_steady_note(view)} Notice: a bound that is only reported. Beyond the limit a run ends.",)
    return _of_runs("Watched", "watched", WATCHED, view, found, notes) if any(found) else None


def real_time(view: View) -> list[Table]:
    """What a run in real time tells of time; nothing of a run in simulated time."""
    account = view.run.summary.real_time
    return [] if account is None else real_time_tables(account)


def remarks(view: View) -> tuple[str, ...]:
    """What a reader has to know before believing any of the rest."""
    found = []
    for number, (run, heading) in enumerate(zip(view.runs, view.labels, strict=True)):
        whose = f"{heading[:1].upper()}{heading[1:]}" if number == 0 else f"The run '{heading}'"
        if run.left_out:
            found.append(f"{whose}: {run.left_out}")
        if run.was_recovered:
            found.append(f"{whose}: the bag had been cut off and was repaired ({run.was_recovered}).")
        if not run.is_complete:
            of = run.scenario.run.duration_s
            found.append(f"{whose} ended before its time: {run.end_s:g} s of {of:g} s stand in the bag.")
        apart = plants_apart(view.run, run)
        if apart:
            found.append(f"{whose} is of a plant with other parameters: {', '.join(apart)}.")
    return tuple(found)


def _of_runs(
    title: str,
    first: str,
    columns: tuple[str, ...],
    view: View,
    found: list[_Cells],
    notes: tuple[str, ...] = (),
) -> Table:
    """One run: a row for each name. Several: a row for each name and figure, and a column for each run."""
    if not view.overlaid:
        rows = tuple(Row((name, *cells)) for name, cells in found[0].items())
        return Table(title, (first, *columns), rows, notes)
    names = dict.fromkeys(name for of_run in found for name in of_run)
    rows = tuple(
        Row((f"{name}: {column}", *cells))
        for name in names
        for place, column in enumerate(columns)
        if any(cells := [of_run[name][place] if name in of_run else "" for of_run in found])
    )
    return Table(title, (first, *view.labels), rows, notes)


def _steady_note(view: View) -> str:
    notes = [steady_note(run.summary.steady_from_s, run.end_s) for run in view.runs]
    if len(set(notes)) == 1:
        return f"{notes[0]}."
    return f"* {', '.join(f'{note[2:]} ({name})' for note, name in zip(notes, view.labels, strict=True))}."


def _overrides(values: dict[str, Any]) -> str:
    return ", ".join(f"{key}={value}" for key, value in values.items()) or "none"


def _published_notes(view: View) -> tuple[str, ...]:
    notes = []
    run = view.run
    if run.summary.published_not:
        return (f"{run.summary.published_not[:1].upper()}{run.summary.published_not[1:]}.",)
    if not run.is_baseline and view.baseline is None and view.paper_baseline is not None:
        notes.append(f"Reduction: against the published baseline ({view.source}); none was measured here.")
    notes.append(
        f"{BAND}: of stored runs with dispersed starts; late triggering instants are sensitive to the start. "
        "docs/reproduction.md states the rule of the verdict."
    )
    return tuple(notes)


def _beside(view: View, other: ReportedRun) -> dict[FigureKey, float]:
    """The figures of another run: of the baseline those measured at it, of others also those against it."""
    baseline = view.baseline
    if other is baseline:
        here = measured(view)
        return {**other.summary.figures, **{key: here[key] for key in _AT_BASELINE}}
    found = with_measured(other.summary, None if baseline is None else baseline.summary).figures
    return {key: value for key, value in found.items() if key not in _AT_BASELINE}


def _counts(counted: list[Topic | None] | list[Totals]) -> tuple[str, ...]:
    """Messages, payload and CDR of the reported run, then messages and payload of the other."""
    cells: list[str] = []
    for place, some in enumerate(counted):
        numbers = (0, 0, 0) if some is None else (some.messages, some.payload_bytes, some.cdr_bytes)
        messages, payload, size = (f"{number:,}" if number else "" for number in numbers)
        cells += [messages or "0", payload, size] if place == 0 else [messages or "0", payload]
    return tuple(cells)


def _interval(seconds: float | None) -> str:
    return optional(seconds, ".4g")


def _verdict(value: float | None, figure: PublishedValue | None) -> str:
    if value is None or figure is None:
        return ""
    return figure.judge(value).verdict.value
