"""``etac check``: whether the classes of a scenario keep what both engines rely on."""

from __future__ import annotations

import sys

from rich.console import Console

from etac_ros.check import check
from etac_ros.scenario.load import Scenario
from etac_ros.tables.table import Row, Table
from etac_ros.tables.terminal import show


def check_and_show(scenario: Scenario, ticks: int, console: Console) -> bool:
    """Run a scenario in windows of several lengths and show what came of it.

    Returns
    -------
    bool
        Whether all is well.
    """
    checked = check(scenario, ticks)
    bits = "bits of messages and states"
    rows = tuple(Row((f"{run.length}", f"{run.triggers:,}", f"{run.messages:,}", run.digest)) for run in checked.runs)
    table = Table("", ("windows of", "triggering instants", "messages", bits), rows, texts=frozenset({bits}))
    seconds = checked.ticks / scenario.run.ticks_per_second
    console.print(
        f"{scenario.run.title or scenario.name}: the first {checked.ticks:,} ticks ({seconds:g} s) in process"
    )
    show(table, console)
    if not checked.faults:
        console.print("the same bits in all windows; no class keeps a hidden state")
    for fault in checked.faults:
        print(f"etac: {fault}", file=sys.stderr)
    return not checked.faults
