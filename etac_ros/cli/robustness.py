"""``etac robustness``: what loss and delay do to a loop, event-triggered beside periodic."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from rich.console import Console

from etac_ros.cli.outputs import check_output, write_output
from etac_ros.cli.progress import steps
from etac_ros.errors import ScenarioError
from etac_ros.robustness.grid import robustness
from etac_ros.robustness.write import furthest_table, map_table, page
from etac_ros.scenario.places import available
from etac_ros.tables.terminal import show


def robustness_and_show(
    names: Sequence[str],
    losses: str,
    delays: str,
    factor: float,
    overrides: Sequence[str],
    console: Console,
    write: Path | None,
) -> None:
    """Run the grids, show the maps, and write the page.

    Raises
    ------
    ScenarioError
        If a scenario cannot be loaded, or the grid is none.
    """
    check_output("--write", write)
    rows, columns = _numbers("--losses", losses), _numbers("--delays", delays)
    found = []
    for name in names or available():
        with steps(console, name) as say:
            done = robustness(name, rows, columns, factor, overrides, say)
        found.append(done)
        for which in done.maps:
            console.print()
            show(map_table(done, which), console)
    console.print()
    show(furthest_table(found), console)
    if write is not None:
        write_output("--write", write, page(found))
        console.print(f"page: {write}", soft_wrap=True)


def _numbers(option: str, text: str) -> list[float]:
    try:
        return [float(part) for part in text.split(",")]
    except ValueError:
        raise ScenarioError(option, f"found '{text}'", "numbers with commas between them") from None
