"""``etac reproduce``: every published figure beside a measured one, and the stored sweeps behind the verdicts."""

from __future__ import annotations

import tempfile
from collections.abc import Sequence
from dataclasses import replace
from itertools import groupby
from pathlib import Path

from rich.console import Console
from rich.status import Status

from etac_ros.errors import EtacError, ScenarioError
from etac_ros.metrics.stored import Stored, stored
from etac_ros.metrics.verdict import Verdict
from etac_ros.reproduce.bands import make, place, why_stale, write
from etac_ros.reproduce.rows import Baselines, Row, rows_of
from etac_ros.reproduce.variants import published_variants, title_of
from etac_ros.reproduce.write import as_json, markdown, rows_table, tally
from etac_ros.scenario.load import available
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
    names: Sequence[str], engine: str, console: Console, page: Path | None = None, data: Path | None = None
) -> list[Row]:
    """Run everything that has published figures, and show what became of them.

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

    Raises
    ------
    EtacError
        If a scenario cannot be loaded or run, or a file not be written.
    """
    chosen = list(names) or available()
    for name in chosen:
        published_variants(name)  # a mistake is found before anything runs
    for path in (page, data):
        if path is not None and not path.parent.is_dir():
            raise ScenarioError(str(path), f"there is no folder {path.parent}", "a folder that exists")
    rows: list[Row] = []
    with tempfile.TemporaryDirectory(prefix="etac_reproduce_") as folder:
        for name in chosen:
            with console.status(f"{name} ...") as status:
                found = _rows(name, engine, Path(folder), status)
            if not found:
                console.print(f"{name}: publishes no figures")
            for variant, of_variant in groupby(found, key=lambda row: row.variant):
                console.print(f"\n{name}, {variant or 'as the file stands'}", style="bold")
                _show(list(of_variant), console)
            rows += found
    console.print(f"\n{tally(rows)}", soft_wrap=True)
    words = ["etac reproduce", *names, *([f"--engine {engine}"] if engine != "ros" else [])]
    if page is not None:
        page.write_text(markdown(rows, engine, " ".join([*words, f"--write {page}"]), stored()), encoding="utf-8")
    if data is not None:
        data.write_text(as_json(rows, engine), encoding="utf-8")
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

    with console.status("...") as status:
        made = make(list(names) or available(), known, runs, workers, lambda text: status.update(f"{text} ..."), keep)
    console.print(f"{len(stale)} of {len(made.sweeps)} sweeps made anew: {path}", soft_wrap=True)


def _rows(name: str, engine: str, folder: Path, status: Status) -> list[Row]:
    rows: list[Row] = []
    baselines: Baselines = {}
    for scenario in published_variants(name):
        try:
            rows += rows_of(scenario, engine, folder, lambda text: status.update(f"{text} ..."), baselines)
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
