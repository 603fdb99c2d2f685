"""The tables of a report as rows of text; how they look is the page's business."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from etac_ros.metrics.published import label, stands_alone
from etac_ros.metrics.summary import Summary, Topic, Totals, with_measured
from etac_ros.report.figures.style import symbols
from etac_ros.report.source import ReportedRun, plants_apart
from etac_ros.report.view import View
from etac_ros.scenario.schema import PublishedFigure

_Cells = dict[str, tuple[str, ...]]
"""Cells of one run by what stands at the head of their row."""
_KINDS = ("network", "internal", "emulation")
_AT_BASELINE = ("baseline_messages", "baseline_payload_bytes")
"""What is measured at the baseline, and stands in its column."""


@dataclass(frozen=True)
class Row:
    """One line of a table.

    Attributes
    ----------
    cells
        As many as the table has columns.
    strong
        Whether it is a total.
    """

    cells: tuple[str, ...]
    strong: bool = False


@dataclass(frozen=True)
class Table:
    """A table.

    Attributes
    ----------
    title
        Heads its section.
    columns
        Headings; the first column is text, all others are numbers unless they are named in ``texts``.
    rows
        Its lines.
    notes
        Sentences below it.
    texts
        Headings of further columns of text.
    groups
        Headings above the headings, each with the number of columns that it spans.
    """

    title: str
    columns: tuple[str, ...]
    rows: tuple[Row, ...]
    notes: tuple[str, ...] = ()
    texts: frozenset[str] = frozenset()
    groups: tuple[tuple[str, int], ...] = ()


def measured(view: View) -> dict[str, float]:
    """The figures that stand beside the published ones, by their names."""
    baseline = view.baseline
    found = with_measured(view.run.summary, None if baseline is None else baseline.summary).measured
    if baseline is None and view.paper_baseline is not None and view.paper_baseline.value > 0.0:
        ratio = view.run.summary.network.payload_bytes / view.paper_baseline.value
        found = {**found, "reduction_percent": 100.0 * (1.0 - ratio)}
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
    """Figures of this run beside those of the paper; None if there is nothing of the paper to show."""
    here, paper = measured(view), view.run.scenario.published
    if not paper:
        return None
    names = [name for name in here if name in paper or (stands_alone(name) and name not in _AT_BASELINE)]
    names += [name for name in paper if name not in here]
    rows = []
    for name in names:
        figure, value = paper.get(name), here.get(name)
        of_baseline = view.baseline is not None and name in _AT_BASELINE
        cells = [
            label(name, view.run.summary.triggers, "" if figure is None else figure.label),
            "" if value is None or of_baseline else _number(value),
            "" if figure is None else _number(figure.value),
            _band(figure),
            _verdict(value, figure),
        ]
        for other in view.others:
            beside = _beside(view, other).get(name)
            cells.append("" if beside is None else _number(beside))
        rows.append(Row(tuple(cells)))
    return Table(
        "Beside the published figures",
        ("", view.labels[0], view.source, "band", "in the band", *view.labels[1:]),
        tuple(rows),
        _published_notes(view),
    )


def traffic_table(view: View) -> Table:
    """What each topic carried, kinds apart."""
    runs = [run.summary for run in view.runs]
    rows = []
    for kind in _KINDS:
        names = list(dict.fromkeys(name for run in runs for name, topic in run.topics.items() if topic.kind == kind))
        if not names:
            continue
        for name in names:
            topics = [run.topics.get(name) for run in runs]
            of = next(topic for topic in topics if topic is not None)
            rows.append(Row((name, *_counts(topics), of.type.replace("/msg/", "/"))))
        rows.append(Row((f"all {kind}", *_counts([_totals(run, kind) for run in runs]), ""), strong=True))
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


def trigger_table(view: View) -> Table | None:
    """Triggering instants of each sensor; None if no module triggers."""
    found: list[_Cells] = [
        {
            name: (f"{triggers.count:,}", _span(triggers.min_interval_s), _span(triggers.mean_interval_s),
                   _span(triggers.max_interval_s))
            for name, triggers in run.summary.triggers.items()
        }
        for run in view.runs
    ]  # fmt: skip
    columns = ("triggering instants", "shortest interval [s]", "mean [s]", "longest [s]")
    return _of_runs("Triggering", "sensor", columns, view, found) if any(found) else None


def performance_table(view: View) -> Table:
    """How well each plant pointed, and at what cost."""
    found: list[_Cells] = []
    for run in view.runs:
        of_run: _Cells = {}
        for name, figures in run.summary.performance.items():
            numbers = (
                figures.attitude_error_deg,
                figures.max_attitude_error_deg,
                figures.rate_deg_s,
                figures.max_rate_deg_s,
            )
            of_run[name] = (
                *("" if number is None else f"{number:.3g}" for number in numbers),
                f"{figures.energy_n2m2s:.4g}",
            )
        found.append(of_run)
    columns = (
        "error at the end [deg]",
        "largest* [deg]",
        "rate at the end [deg/s]",
        "largest* [deg/s]",
        "energy [N²m²s]",
    )
    note = f"{_steady_note(view)} Energy: integral of the square of the held torque."
    return _of_runs("Pointing", "plant", columns, view, found, (note,))


def watched_table(view: View) -> Table | None:
    """Extremes of the watched quantities; None if nothing is watched."""
    found: list[_Cells] = [
        {
            f"{node}, {symbols(watch.name)}{_bracketed(watch.unit)}": (
                f"{watch.largest:.4g}",
                f"{watch.at_s:g}",
                watch.axis,
                f"{watch.steady:.3g}",
                f"{watch.final:.3g}",
                "" if watch.notice is None else f"{watch.notice:g}",
                "" if watch.bound is None else f"{watch.bound:g}",
            )
            for node, watches in run.summary.watches.items()
            for watch in watches
        }
        for run in view.runs
    ]
    columns = ("largest", "at [s]", "axis", "largest*", "at the end", "notice", "limit")
    notes = (f"{_steady_note(view)} Notice: a bound that is only reported. Beyond the limit a run ends.",)
    return _of_runs("Watched", "watched", columns, view, found, notes) if any(found) else None


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
    starts = [run.summary.steady_from_s for run in view.runs]
    if len(set(starts)) == 1:
        return f"* from {starts[0]:g} s on."
    of_runs = (f"{start:g} s on ({name})" for start, name in zip(starts, view.labels, strict=True))
    return f"* from {', '.join(of_runs)}."


def _span(seconds: float | None) -> str:
    return "" if seconds is None else f"{seconds:.4g}"


def _bracketed(unit: str) -> str:
    return f" [{symbols(unit)}]" if unit not in ("", "1") else ""


def _overrides(values: dict[str, Any]) -> str:
    return ", ".join(f"{key}={value}" for key, value in values.items()) or "none"


def _published_notes(view: View) -> tuple[str, ...]:
    notes = []
    run = view.run
    if run.overrides:
        notes.append(
            "The published figures belong to the scenario as it stands in its file; this run overrides "
            f"{', '.join(run.overrides)}."
        )
    if not run.is_baseline and view.baseline is None and view.paper_baseline is not None:
        notes.append(f"Reduction: against the published baseline ({view.source}); none was measured here.")
    notes.append("Band: where one run of many like it may lie; late triggering instants are sensitive to the start.")
    return tuple(notes)


def _beside(view: View, other: ReportedRun) -> dict[str, float]:
    """The figures of another run: of the baseline those measured at it, of others also those against it."""
    baseline = view.baseline
    if other is baseline:
        here = measured(view)
        return {**other.summary.measured, **{name: here[name] for name in _AT_BASELINE}}
    found = with_measured(other.summary, None if baseline is None else baseline.summary).measured
    return {name: value for name, value in found.items() if name not in _AT_BASELINE}


def _counts(counted: list[Topic | None] | list[Totals]) -> tuple[str, ...]:
    """Messages, payload and CDR of the reported run, then messages and payload of the other."""
    cells: list[str] = []
    for place, some in enumerate(counted):
        numbers = (0, 0, 0) if some is None else (some.messages, some.payload_bytes, some.cdr_bytes)
        messages, payload, size = (f"{number:,}" if number else "" for number in numbers)
        cells += [messages or "0", payload, size] if place == 0 else [messages or "0", payload]
    return tuple(cells)


def _totals(summary: Summary, kind: str) -> Totals:
    return {"network": summary.network, "internal": summary.internal, "emulation": summary.emulation}[kind]


def _band(figure: PublishedFigure | None) -> str:
    if figure is None or figure.low == figure.high:
        return ""
    return f"{_number(figure.low)} to {_number(figure.high)}"


def _verdict(value: float | None, figure: PublishedFigure | None) -> str:
    if value is None or figure is None:
        return ""
    return "yes" if figure.low <= value <= figure.high else "no"


def _number(value: float) -> str:
    return f"{value:,.0f}" if float(value).is_integer() else f"{value:,.4g}"
