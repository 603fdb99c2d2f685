"""``etac reproduce``: every published figure beside a measured one, and the stored sweeps behind the verdicts."""

from __future__ import annotations

import tempfile
from collections.abc import Callable, Sequence
from dataclasses import replace
from itertools import groupby
from pathlib import Path

from rich.console import Console

from etac_ros.cli.interrupts import NOTHING_KEPT, keeping
from etac_ros.cli.outputs import check_output, write_output
from etac_ros.cli.progress import steps
from etac_ros.errors import EtacError, ScenarioError
from etac_ros.metrics.stored import Stored, stored
from etac_ros.metrics.verdict import Verdict
from etac_ros.reproduce.bands import make, place, why_stale, write
from etac_ros.reproduce.kept import Kept
from etac_ros.reproduce.rows import Baselines, Row, rows_of
from etac_ros.reproduce.variants import published_variants, title_of
from etac_ros.reproduce.write import as_json, markdown, rows_table, tally
from etac_ros.scenario.load import Scenario
from etac_ros.scenario.places import available
from etac_ros.tables.table import Row as TableRow
from etac_ros.tables.terminal import show

_COLOURS = {
    Verdict.REPRODUCED: "green",
    Verdict.KEPT: "green",
    Verdict.NEAR: "yellow",
    Verdict.NOT_REPRODUCED: "red",
    Verdict.NOT_KEPT: "red",
    Verdict.MISSED: "red",
    Verdict.FITTED: "dim",
    Verdict.CONSTRUCTED: "dim",
    Verdict.NOT_TESTABLE: "dim",
}


def reproduce(
    names: Sequence[str],
    engine: str,
    console: Console,
    page: Path | None = None,
    data: Path | None = None,
    afresh: bool = False,
) -> list[Row]:
    """Run everything that has published figures, and show what became of them.

    Each variant is kept as soon as it is measured, until all are: after an interruption the same command goes on.

    Parameters
    ----------
    names
        Scenarios; none takes all.
    engine
        ``ros`` or ``inprocess``, for the measured figures.
    console
        Where to.
    page, data
        Files for Markdown and JSON.
    afresh
        Measure anew what an interrupted call has left.

    Raises
    ------
    EtacError
        If a scenario cannot be loaded or run, or a file not be written.
    Interrupted
        Saying where that stands which is measured.
    """
    chosen = list(names) or available()
    with steps(console, "preparing"):
        variants = {name: published_variants(name) for name in chosen}  # a mistake is found before anything runs
    check_output("--write", page)
    check_output("--json", data)
    planned = [scenario for name in chosen for scenario in variants[name]]
    kept = Kept(planned, engine)
    if afresh:
        kept.forget()
    if len(kept):
        console.print(
            f"{len(kept)} of {len(planned)} variants were measured before the last interruption ({kept.path}); "
            "--afresh measures them anew"
        )

    def left() -> str:
        return (
            f"{len(kept)} of {len(planned)} variants are measured and stand in {kept.path}; the same command goes on"
            if len(kept)
            else NOTHING_KEPT
        )

    rows: list[Row] = []
    with tempfile.TemporaryDirectory(prefix="etac_reproduce_") as folder, keeping(left):
        for name in chosen:
            with steps(console, name) as say:
                found = _rows(
                    name,
                    variants[name],
                    engine,
                    Path(folder),
                    lambda text, say=say: say(f"{text} ({len(kept) + 1} of {len(planned)})"),  # type: ignore[misc]
                    kept,
                )
            if not found:
                console.print(f"{name}: publishes no figures")
            for variant, of_variant in groupby(found, key=lambda row: row.variant):
                console.print(f"\n{name}, {variant or 'as the file stands'}", style="bold")
                _show(list(of_variant), console)
            rows += found
    console.print(f"\n{tally(rows)}")
    words = ["etac reproduce", *names, *([f"--engine {engine}"] if engine != "ros" else [])]
    if page is not None:
        write_output("--write", page, markdown(rows, engine, " ".join([*words, f"--write {page}"]), stored()))
    if data is not None:
        write_output("--json", data, as_json(rows, engine))
    kept.forget()
    return rows


def make_bands(names: Sequence[str], runs: int, workers: int | None, console: Console) -> None:
    """Make the stored sweeps that are stale or missing anew.

    Parameters
    ----------
    names
        Scenarios; none takes all.
    runs
        Dispersed runs of each variant.
    workers
        Processes; None takes every core.
    console
        Where to.

    Raises
    ------
    EtacError
        If a scenario cannot be loaded, or the file not be written.
    """
    if workers is not None and workers < 1:
        raise ScenarioError(f"--workers {workers}", "is no number of processes", "1 or more")
    known, stale = stored(), []
    sweeps = {(one.scenario, one.variant): one for one in (known.sweeps if known is not None else [])}
    for name in list(names) or available():
        for scenario in published_variants(name):
            found = sweeps.get((scenario.name, scenario.variant))
            why = "none is stored" if found is None else why_stale(scenario, found)
            if found is not None and not why and found.runs < runs:
                why = f"{found.runs} runs are stored"
            if why:
                stale.append(title_of(scenario))
                console.print(f"{title_of(scenario)}: {why}", soft_wrap=True)
    path = place()

    def keep(made: Stored) -> None:
        write(made, path)

    with steps(console, "...") as say, keeping(f"sweeps that are finished stand in {path}; the same command goes on"):
        made = make(list(names) or available(), known, runs, workers, say, keep)
    console.print(f"{len(stale)} of {len(made.sweeps)} sweeps made anew: {path}", soft_wrap=True)


def _rows(
    name: str, variants: Sequence[Scenario], engine: str, folder: Path, say: Callable[[str], None], kept: Kept
) -> list[Row]:
    rows: list[Row] = []
    baselines: Baselines = {}
    for scenario in variants:
        try:
            rows += rows_of(scenario, engine, folder, say, baselines, kept)
        except EtacError as error:
            raise type(error)(f"{name}, variant {scenario.variant}", str(error)) from error
    return rows


def _show(rows: Sequence[Row], console: Console) -> None:
    """The figures of one variant, and below them the reasons, each once."""
    distinct = dict.fromkeys(row.reason for row in rows if row.reason)
    reasons = {reason: chr(ord("a") + place) for place, reason in enumerate(distinct)}
    table = rows_table(rows)
    lines = tuple(
        TableRow(
            (*line.cells[:-2], row.verdict + (f" ({reasons[row.reason]})" if row.reason else "")),
            style=_COLOURS[row.verdict],
        )
        for row, line in zip(rows, table.rows, strict=True)
    )
    notes = tuple(f"  ({letter}) {reason}" for reason, letter in reasons.items())
    spare = frozenset({"kind", "where"})
    show(replace(table, columns=table.columns[:-1], rows=lines, notes=notes, spare=spare), console)
