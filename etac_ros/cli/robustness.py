"""``etac robustness``: what loss and delay do to a loop, event-triggered beside periodic."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from rich.console import Console

from etac_ros.cli.outputs import check_output, write_output
from etac_ros.cli.progress import steps
from etac_ros.errors import ScenarioError
from etac_ros.robustness.crowd import crowd
from etac_ros.robustness.draw import picture
from etac_ros.robustness.grid import robustness
from etac_ros.robustness.retransmission import retransmission
from etac_ros.robustness.write import (
    crowd_table,
    furthest_table,
    map_table,
    page,
    picture_name,
    retransmission_table,
    suffers_table,
)
from etac_ros.scenario.places import available
from etac_ros.tables.table import Table
from etac_ros.tables.terminal import show


def robustness_and_show(
    names: Sequence[str],
    losses: str,
    delays: str,
    factor: float,
    overrides: Sequence[str],
    sizes: str,
    console: Console,
    write: Path | None,
) -> None:
    """Run grids, retransmissions and formations, show them, and write the page with its pictures.

    Raises
    ------
    ScenarioError
        If a scenario cannot be loaded, or the grid is none.
    """
    check_output("--write", write)
    rows, columns = _numbers("--losses", losses), _numbers("--delays", delays)
    spacecraft = [int(size) for size in _numbers("--spacecraft", sizes)] if sizes else []
    found, tried, crowds = [], {}, {}
    for name in names or available():
        with steps(console, name) as say:
            done = robustness(name, rows, columns, factor, overrides, say)
            again = retransmission(name, done.losses, factor, overrides, say)
            crowded = crowd(name, spacecraft, factor, overrides, say) if spacecraft else ()
        found.append(done)
        tables = [map_table(done, which) for which in done.maps]
        if again:
            tried[done.scenario.name] = again
            tables.append(retransmission_table(done.scenario.name, again))
        if crowded:
            crowds[done.scenario.name] = crowded
            tables.append(crowd_table(done.scenario.name, crowded))
        _show(tables, console)
    _show([furthest_table(found), suffers_table(found)], console)
    if write is not None:
        for done in found:
            _write_picture(write.with_name(picture_name(done.scenario.name)), picture(done))
        write_output("--write", write, page(found, tried, crowds, _command(names, write)))
        console.print(f"page: {write}", soft_wrap=True)


def _show(tables: Sequence[Table], console: Console) -> None:
    for table in tables:
        if table.rows:
            console.print()
            show(table, console)


def _command(names: Sequence[str], write: Path) -> str:
    return " ".join(["etac robustness", *names, f"--write {write}"])


def _write_picture(path: Path, content: bytes) -> None:
    try:
        path.write_bytes(content)
    except OSError as error:
        raise ScenarioError(f"--write {path}", f"cannot be written ({error.strerror or error})") from None


def _numbers(option: str, text: str) -> list[float]:
    try:
        return [float(part) for part in text.split(",")]
    except ValueError:
        raise ScenarioError(option, f"found '{text}'", "numbers with commas between them") from None
