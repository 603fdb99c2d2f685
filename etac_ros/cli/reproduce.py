"""``etac reproduce``: every published figure beside a measured one."""

from __future__ import annotations

import tempfile
from collections.abc import Sequence
from dataclasses import replace
from itertools import groupby
from pathlib import Path

from rich.console import Console
from rich.status import Status

from etac_ros.errors import EtacError, ScenarioError
from etac_ros.reproduce.rows import Effort, Row, published_variants, rows_of
from etac_ros.reproduce.verdict import Verdict
from etac_ros.reproduce.write import as_json, markdown, rows_table, tally
from etac_ros.scenario.load import available
from etac_ros.tables.table import Row as TableRow
from etac_ros.tables.terminal import show

_COLOURS = {
    Verdict.REPRODUCED: "green",
    Verdict.NEAR: "yellow",
    Verdict.NOT_REPRODUCED: "red",
    Verdict.NOT_TESTABLE: "dim",
}


def reproduce(
    names: Sequence[str],
    effort: Effort,
    overrides: Sequence[str],
    console: Console,
    page: Path | None = None,
    data: Path | None = None,
) -> list[Row]:
    """Run everything that has published figures, and show what became of them.

    Parameters
    ----------
    names
        Scenarios; none takes all.
    effort
        How much is run.
    overrides
        ``key=value`` assignments for all of them.
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
        published_variants(name, overrides)  # a mistake is found before anything runs
    for path in (page, data):
        if path is not None and not path.parent.is_dir():
            raise ScenarioError(str(path), f"there is no folder {path.parent}", "a folder that exists")
    rows: list[Row] = []
    with tempfile.TemporaryDirectory(prefix="etac_reproduce_") as folder:
        for name in chosen:
            with console.status(f"{name} ...") as status:
                found = _rows(name, effort, overrides, Path(folder), status)
            if not found:
                console.print(f"{name}: publishes no figures")
            for variant, of_variant in groupby(found, key=lambda row: row.variant):
                console.print(f"\n{name}, {variant or 'as the file stands'}", style="bold")
                _show(list(of_variant), console)
            rows += found
    console.print(f"\n{tally(rows)}")
    # The page names the command that writes it, with what differs from its defaults.
    words = ["etac", "reproduce", *names, *(f"--set {override}" for override in overrides)]
    for option, mine, usual in (("--runs", effort.runs, Effort.runs), ("--engine", effort.engine, Effort.engine)):
        words += [f"{option} {mine}"] if mine != usual else []
    if page is not None:
        page.write_text(markdown(rows, effort, " ".join([*words, f"--write {page}"])))
    if data is not None:
        data.write_text(as_json(rows, effort))
    return rows


def _rows(name: str, effort: Effort, overrides: Sequence[str], folder: Path, status: Status) -> list[Row]:
    rows: list[Row] = []
    for scenario in published_variants(name, overrides):
        try:
            rows += rows_of(scenario, effort, folder, overrides, lambda text: status.update(f"{text} ..."))
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
    show(
        replace(table, columns=table.columns[:-1], rows=lines, notes=notes, spare=frozenset({"runs", "where"})), console
    )
