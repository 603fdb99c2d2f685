"""``etac compare --clock wall``: a run in real time beside simulated ones with delays."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from rich.console import Console

from etac_ros.bag.reserve import release
from etac_ros.errors import ScenarioError
from etac_ros.metrics.cells import energy_heading, performance_cells, steady_note
from etac_ros.metrics.clocks import Agreement, states_apart
from etac_ros.metrics.latency_tables import real_time_tables
from etac_ros.metrics.summary import Summary
from etac_ros.runs import RosOptions, free_bag_directory, run_over_ros, simulate_delayed
from etac_ros.scenario.load import load
from etac_ros.tables.numbers import number
from etac_ros.tables.table import Row, Table
from etac_ros.tables.terminal import show

MOST_TICKS = 6
"""Of delay that are tried at most."""


def compare_clocks(
    name: str, variant: str | None, overrides: Sequence[str], options: RosOptions, bag: Path | None, console: Console
) -> Agreement:
    """Run a scenario in real time and lay simulated runs beside it.

    Parameters
    ----------
    name, variant, overrides
        The scenario.
    options
        With a rate.
    bag
        Of the run in real time; None takes a new one in bags/.
    console
        Where to.

    Raises
    ------
    ScenarioError
        If the scenario has foreign nodes: nothing of ours could simulate them.
    """
    scenario = load(name, variant, overrides)
    if scenario.graph.external:
        foreign = ", ".join(sorted(scenario.graph.external))
        raise ScenarioError(f"{scenario.path}: {foreign}", "is foreign, and cannot be simulated", "nodes of etac_ros")
    folder = bag or free_bag_directory(scenario)
    try:
        with console.status(f"{scenario.name}: {scenario.run.duration_s / (options.rate or 1.0):.0f} s in real time"):
            real = run_over_ros(scenario, folder, options)
    finally:
        release(folder)
    account = real.summary.real_time
    assert account is not None
    longest = max((loop.ticks.median for loop in account.loops.values()), default=0.0)
    simulated = [simulate_delayed(scenario, ticks) for ticks in range(min(MOST_TICKS, int(longest) + 2) + 1)]
    agreement = Agreement([states_apart(scenario.graph, real.recording, one.recording) for one in simulated])
    console.print(f"\n{scenario.run.title or scenario.name}: real time beside simulated time", style="bold")
    show(clocks_table(real.summary, [one.summary for one in simulated], agreement), console)
    console.print()
    for table in real_time_tables(account):
        show(table, console)
        console.print()
    console.print(f"bag: {folder}   (etac info, etac report)", soft_wrap=True)
    return agreement


def clocks_table(real: Summary, simulated: Sequence[Summary], agreement: Agreement) -> Table:
    """Figures of a run in real time, and of simulated ones with 0, 1, ... ticks of delay."""
    runs = [real, *simulated]
    rows = [
        Row((f"triggering instants, {sensor}", *(f"{run.triggers[sensor].count:,}" for run in runs)))
        for sensor in real.triggers
    ]
    rows.append(Row(("network messages", *(f"{run.network.messages:,}" for run in runs))))
    rows.append(Row(("network payload [bytes]", *(f"{run.network.payload_bytes:,}" for run in runs)), ends=True))
    for plant in real.performance:
        cells = [performance_cells(run.performance[plant]) for run in runs]
        energy = energy_heading([real.performance[plant]])
        for place, what in enumerate(
            ("error [deg]", "largest error* [deg]", "rate [deg/s]", "largest rate* [deg/s]", energy)
        ):
            if any(cell[place] for cell in cells):
                rows.append(Row((f"{plant}: {what}", *(cell[place] for cell in cells))))
    rows.append(Row(("states apart", "", *(number(apart) for apart in agreement.apart)), strong=True))
    tick = "" if real.real_time is None else f" of {real.real_time.tick_ms * real.real_time.rate:.4g} ms"
    best = f"{agreement.best} tick{'s' if agreement.best != 1 else ''}"
    notes = (
        f"agrees best with a delay of {best} from sample to torque",
        f"delays in ticks{tick} of simulated time; {steady_note(real.steady_from_s, real.ended_s)}",
        "states apart: root mean square of the difference, each state in units of its standard deviation",
    )
    columns = ("", "real time", *(f"simulated, {delay}" for delay in range(len(simulated))))
    return Table("", columns, tuple(rows), notes)
