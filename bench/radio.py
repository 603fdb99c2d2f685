"""What an emulated radio costs a run: the loop with it beside the loop over ideal links.

    ./scripts/bench radio                     # in process and over DDS
    ./scripts/bench radio --runs 9 --no-dds

wu2018 as it stands, with a delay of one tick on both links (a radio has no less), and on its radio; and 32 spacecraft
of xie2021 for a second, ideal and on one CSMA medium. In process it is processor time, since machines are shared;
over DDS wall time. Rounds are interleaved, and the table gives the least of each.
"""

from __future__ import annotations

import tempfile
import time
from pathlib import Path
from typing import Annotated

import typer
from rich.table import Table

from etac_ros.cli.show import make_console
from etac_ros.engines.inprocess import InProcess
from etac_ros.runs import run_over_ros, warm_up
from etac_ros.scenario.load import Scenario, load

LATE = ["links.filtered_error.delay_ticks=1", "links.torque_command.delay_ticks=1"]
MANY = ["duration_s=1", "formation.n=32"]


def main(
    runs: Annotated[int, typer.Option(help="Rounds.")] = 9,
    dds: Annotated[bool, typer.Option(help="Over DDS, too.")] = True,
) -> None:
    """Measure and print."""
    console = make_console()
    groups = {
        "wu2018": {
            "ideal": load("wu2018"),
            "a tick late": load("wu2018", None, LATE),
            "radio": load("wu2018", "radio"),
        },
        "xie2021, n = 32": {"ideal": load("xie2021", None, MANY), "radio": load("xie2021", "radio", MANY)},
    }
    table = Table("scenario", "links", "in process [ms]", "against ideal", "over DDS [ms]", "against ideal")
    for group, scenarios in groups.items():
        calls: dict[str, list[float]] = {name: [] for name in scenarios}
        over_dds: dict[str, list[float]] = {name: [] for name in scenarios}
        for scenario in scenarios.values():
            warm_up(scenario)
        for _ in range(runs):
            for name, scenario in scenarios.items():
                calls[name].append(_by_calls(scenario))
        if dds and group == "wu2018":
            for _ in range(runs):
                for name, scenario in scenarios.items():
                    over_dds[name].append(_over_dds(scenario))
        for name in scenarios:
            row = [group, name]
            for found in (calls, over_dds):
                least = min(found[name], default=None)
                row += ["", ""] if least is None else [f"{1e3 * least:.1f}", f"{least / min(found['ideal']):.2f}"]
            table.add_row(*row)
    console.print(table)


def _by_calls(scenario: Scenario) -> float:
    engine = InProcess(scenario.build())
    began = time.process_time()
    engine.run()
    return time.process_time() - began


def _over_dds(scenario: Scenario) -> float:
    with tempfile.TemporaryDirectory() as folder:
        return run_over_ros(scenario, Path(folder, "bag")).summary.timing.loop_s


if __name__ == "__main__":
    typer.run(main)
