"""``etac tradeoff``: what traffic buys, event-triggered against periodic."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from string import ascii_lowercase

from rich.console import Console

from etac_ros.cli.progress import steps
from etac_ros.errors import ScenarioError
from etac_ros.sweep.run import usual_workers
from etac_ros.tables.terminal import show
from etac_ros.tradeoff.curves import Tradeoff, run_tradeoff
from etac_ros.tradeoff.layout import lay_out, with_tradeoffs
from etac_ros.tradeoff.write import markdown, picture_name, points_table, remarks, zeno_table
from etac_ros.tradeoff.zeno import Shortest, shortest_of, zeno_words

USUAL_RUNS = 5
_PAGE = "tradeoffs.md"


def tradeoff(
    names: Sequence[str],
    runs: int,
    console: Console,
    folder: Path | None = None,
    workers: int | None = None,
) -> None:
    """Run the trade-offs of scenarios, show them, and write pictures and a page.

    Parameters
    ----------
    names
        Scenarios; none takes all that have a section ``tradeoff``.
    runs
        Perturbed runs at each point.
    console
        Where to.
    folder
        Of the pictures and ``tradeoffs.md``; None writes nothing.
    workers
        Processes; None takes every core.

    Raises
    ------
    EtacError
        If a scenario cannot be loaded or run, or a file not be written.
    """
    if folder is not None and not folder.is_dir():
        raise ScenarioError(f"--write {folder}", "there is no such folder", "a folder that exists")
    with steps(console, "preparing"):
        layouts = [lay_out(name, runs) for name in names or with_tradeoffs()]  # a mistake is found before anything runs
    found: list[tuple[Tradeoff, list[Shortest]]] = []
    for layout in layouts:
        name = layout.scenario.name
        with steps(console, name) as say:
            done = run_tradeoff(
                layout,
                usual_workers(workers),
                lambda finished, planned, name=name, say=say: say(  # type: ignore[misc]
                    f"{name}: {finished} of {planned} runs"
                ),
            )
            shortest = shortest_of(layout, done.points)
        found.append((done, shortest))
        _show(done, shortest, console)
    if folder is not None:
        words = ["etac", "tradeoff", *names, *([f"--runs {runs}"] if runs != USUAL_RUNS else []), f"--write {folder}"]
        _write(found, runs, " ".join(words), folder)
        console.print(f"\n{folder / _PAGE}: {len(found)} trade-offs with their pictures", soft_wrap=True)


def _show(done: Tradeoff, shortest: Sequence[Shortest], console: Console) -> None:
    scenario = done.layout.scenario
    console.print(f"\n{scenario.run.title or scenario.name}: what traffic buys", style="bold")
    console.print(f"steady error: {done.layout.error_label}")
    _show_points(done, console)
    for words in done.words():
        console.print(words, soft_wrap=True)
    console.print(f"\nZeno check: {zeno_words(shortest, scenario.run.ticks_per_second)}", soft_wrap=True)
    if shortest:
        show(zeno_table(shortest), console)
    for remark in remarks(shortest):
        console.print(remark, soft_wrap=True)


def _show_points(done: Tradeoff, console: Console) -> None:
    """All points, and below them why some do not count, each reason once."""
    distinct = dict.fromkeys(point.failed for point in done.points if point.failed)
    reasons = {reason: f"({letter})" for letter, reason in zip(ascii_lowercase, distinct, strict=False)}
    table = points_table(done)
    rows = tuple(replace(row, cells=(*row.cells[:-1], reasons.get(row.cells[-1], row.cells[-1]))) for row in table.rows)
    notes = tuple(f"{letter} {reason}" for reason, letter in reasons.items())
    columns = (*table.columns[:-1], "not counted")
    shown = replace(table, columns=columns, rows=rows, notes=notes, texts=frozenset({columns[1], columns[-1]}))
    show(shown.without_empty_columns(), console)


def _write(found: Sequence[tuple[Tradeoff, Sequence[Shortest]]], runs: int, command: str, folder: Path) -> None:
    from etac_ros.tradeoff.draw import picture  # only here: matplotlib costs a second

    try:
        for done, _ in found:
            (folder / picture_name(done.layout.scenario.name)).write_bytes(picture(done))
        (folder / _PAGE).write_text(markdown(found, runs, command), encoding="utf-8")
    except OSError as error:
        raise ScenarioError(f"--write {folder}", f"cannot be written ({error})", "a folder to write to") from None
