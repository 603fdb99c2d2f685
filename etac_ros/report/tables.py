"""The tables of a report as rows of text; how they look is the page's business."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from etac_ros.figures import label, stands_alone
from etac_ros.report.source import ReportedRun
from etac_ros.report.view import View
from etac_ros.scenario.schema import PublishedFigure
from etac_ros.traffic import Summary, Topic, Totals, with_measured

_KINDS = ("network", "internal", "emulation")
_OF_BASELINE = "baseline_"
_AGAINST_BASELINE = (_OF_BASELINE, "reduction_")


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
    if view.run.is_baseline:
        # The paper's other figures are those of its event-triggered run.
        found = {
            f"{_OF_BASELINE}messages": found["network_messages"],
            f"{_OF_BASELINE}payload_bytes": found["network_payload_bytes"],
        }
    elif baseline is None and view.paper_baseline is not None and view.paper_baseline.value > 0.0:
        ratio = view.run.summary.network.payload_bytes / view.paper_baseline.value
        found = {**found, "reduction_percent": 100.0 * (1.0 - ratio)}
    return found


def published(view: View) -> dict[str, PublishedFigure]:
    """The paper's figures that a run of this kind can be compared with."""
    figures = dict(view.run.scenario.published)
    if view.run.is_baseline:
        return {name: figure for name, figure in figures.items() if name.startswith(_OF_BASELINE)}
    return figures


def identity_table(view: View) -> Table:
    """What was run, so that it can be run again."""
    runs = _runs(view)
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
    headings = _headings(view)
    return Table(
        "The run",
        ("", *headings),
        tuple(Row((name, *values)) for name, values in rows),
        texts=frozenset(headings),
    )


def published_table(view: View) -> Table | None:
    """Figures of this run beside those of the paper; None if there is nothing of the paper to show."""
    here, paper = measured(view), published(view)
    if not paper:
        return None
    names = [name for name in here if name in paper or (stands_alone(name) and not name.startswith(_OF_BASELINE))]
    names += [name for name in paper if name not in here]
    rows = []
    for name in names:
        figure, value = paper.get(name), here.get(name)
        # What was measured at the baseline stands in the baseline's column.
        of_other = view.baseline is not None and name.startswith(_OF_BASELINE)
        cells = [
            label(name, view.run.summary.triggers, "" if figure is None else figure.label),
            "" if value is None or of_other else _number(value),
            "" if figure is None else _number(figure.value),
            _band(figure),
            _verdict(value, figure),
        ]
        if view.other is not None:
            beside = value if of_other else _beside(view.other, name)
            cells.append("" if beside is None else _number(beside))
        rows.append(Row(tuple(cells)))
    return Table(
        "Beside the published figures",
        ("", "this run", view.source, "band", "in the band", *_headings(view)[1:]),
        tuple(rows),
        _published_notes(view),
    )


def traffic_table(view: View) -> Table:
    """What each topic carried, kinds apart."""
    runs = [run.summary for run in _runs(view)]
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
    headings: tuple[str, ...] = columns
    groups: tuple[tuple[str, int], ...] = ()
    if view.other is not None:
        headings = (*columns, *columns[:2])
        groups = (("", 1), ("this run", 3), (view.other_label, 2), ("", 1))
    return Table(
        "What crossed the links",
        ("topic", *headings, "type"),
        tuple(rows),
        (
            "Payload: 4 bytes a component, as the papers count. CDR: the serialized messages, as recorded.",
            "The emulation plane carries what is light or torque in hardware, and the simulator's own; it is "
            "never added to the network. Only what the bag holds of it stands here.",
        ),
        frozenset({"type"}),
        groups,
    )


def trigger_table(view: View) -> Table | None:
    """Triggering instants of each sensor; None if no module triggers."""
    rows = []
    for run, heading in zip(_runs(view), _headings(view), strict=True):
        for name, triggers in run.summary.triggers.items():
            spans = (triggers.min_interval_s, triggers.mean_interval_s, triggers.max_interval_s)
            cells = ["" if span is None else f"{span:.4g}" for span in spans]
            words = name if view.other is None else f"{name}, {heading}"
            rows.append(Row((words, f"{triggers.count:,}", *cells)))
    if not rows:
        return None
    columns = ("sensor", "triggering instants", "shortest interval [s]", "mean [s]", "longest [s]")
    return Table("Triggering", columns, tuple(rows))


def performance_table(view: View) -> Table:
    """How well each plant pointed, and at what cost."""
    rows = []
    for run, heading in zip(_runs(view), _headings(view), strict=True):
        for name, figures in run.summary.performance.items():
            numbers = (
                figures.attitude_error_deg,
                figures.max_attitude_error_deg,
                figures.rate_deg_s,
                figures.max_rate_deg_s,
            )
            words = name if view.other is None else f"{name}, {heading}"
            energy = f"{figures.energy_n2m2s:.4g}"
            rows.append(Row((words, *(f"{number:.3g}" for number in numbers), energy)))
    return Table(
        "Pointing",
        (
            "plant",
            "error at the end [deg]",
            "largest* [deg]",
            "rate at the end [deg/s]",
            "largest* [deg/s]",
            "energy [N²m²s]",
        ),
        tuple(rows),
        (f"* from {view.run.summary.steady_from_s:g} s on. Energy: integral of the square of the held torque.",),
    )


def remarks(view: View) -> tuple[str, ...]:
    """What a reader has to know before believing any of the rest."""
    found = []
    for run, heading in zip(_runs(view), _headings(view), strict=True):
        whose = "This run" if heading == "this run" else f"The {heading}"
        if run.was_recovered:
            found.append(f"{whose}: the bag had been cut off and was repaired ({run.was_recovered}).")
        if not run.is_complete:
            of = run.scenario.run.duration_s
            found.append(f"{whose} ended before its time: {run.end_s:g} s of {of:g} s stand in the bag.")
    return tuple(found)


def _runs(view: View) -> tuple[ReportedRun, ...]:
    return (view.run,) if view.other is None else (view.run, view.other)


def _headings(view: View) -> tuple[str, ...]:
    return ("this run",) if view.other is None else ("this run", view.other_label)


def _overrides(values: dict[str, Any]) -> str:
    return ", ".join(f"{key}={value}" for key, value in values.items()) or "none"


def _published_notes(view: View) -> tuple[str, ...]:
    notes = []
    run = view.run
    if run.scenario.variant and not run.is_baseline:
        notes.append(
            f"This run is the scenario's variant '{run.scenario.variant}': what was published may be meant for the "
            "scenario without it."
        )
    if run.overrides:
        notes.append(
            "The published figures belong to the scenario as it stands in its file; this run overrides "
            f"{', '.join(run.overrides)}."
        )
    if not run.is_baseline and view.baseline is None and view.paper_baseline is not None:
        notes.append(f"Reduction: against the published baseline ({view.source}); none was measured here.")
    notes.append("Band: where one run of many like it may lie; late triggering instants are sensitive to the start.")
    return tuple(notes)


def _beside(other: ReportedRun, name: str) -> float | None:
    return None if name.startswith(_AGAINST_BASELINE) else other.summary.measured.get(name)


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
