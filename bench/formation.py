"""How a formation scales over DDS: loop time, messages and memory against the number of spacecraft.

    ./scripts/bench formation                       # 4, 8, 16 and 32 spacecraft, 5 simulated seconds each
    ./scripts/bench formation --sizes 4,8 --runs 5 --duration 50

The spacecraft of xie2021 on a ring with as many further random edges, one process a namespace, and all in one
process. Rounds are interleaved over sizes and spreads, and the table gives the least of each: machines are shared.
"""

from __future__ import annotations

import tempfile
from pathlib import Path
from typing import Annotated

import typer
from rich.progress import Progress
from rich.table import Table

from etac_ros.cli.show import make_console
from etac_ros.runs import RosOptions, Run, run_in_process, run_over_ros
from etac_ros.scenario.load import load

SPREADS = ("namespace", "one")


def main(
    sizes: Annotated[str, typer.Option(help="How many spacecraft, with commas.")] = "4,8,16,32",
    duration: Annotated[float, typer.Option(help="Simulated seconds.")] = 5.0,
    runs: Annotated[int, typer.Option(help="Rounds.")] = 3,
) -> None:
    """Measure and print."""
    console = make_console()
    counts = [int(size) for size in sizes.split(",")]
    scenarios = {k: load("xie2021", None, [f"formation.n={k}", f"duration_s={duration}"]) for k in counts}
    found: dict[tuple[int, str], list[Run]] = {}
    with tempfile.TemporaryDirectory() as folder, Progress(console=console, transient=True) as progress:
        task = progress.add_task("measuring", total=runs * len(counts) * len(SPREADS))
        for number in range(runs):
            for k, scenario in scenarios.items():
                for spread in SPREADS:
                    bag = Path(folder) / f"{k}_{spread}_{number}"
                    found.setdefault((k, spread), []).append(run_over_ros(scenario, bag, RosOptions(spread)))
                    progress.advance(task)
    calls = {k: run_in_process(scenario).summary.timing.loop_s for k, scenario in scenarios.items()}
    table = Table("spacecraft", "edges", "triggers", "delivered", "messages a trigger")
    for spread in SPREADS:
        table.add_column(f"loop, {spread} [s]")
        table.add_column("ms a trigger")
        table.add_column("MiB")
    table.add_column("in process [s]")
    for k, scenario in scenarios.items():
        summary = found[k, SPREADS[0]][0].summary
        triggers = sum(figures.count for figures in summary.triggers.values())
        network = [link for link in scenario.build().links.values() if link.kind.value == "network"]
        every = summary.network.messages + summary.internal.messages + summary.emulation.messages
        row = [
            str(k),
            str(sum(len(link.receivers) for link in network)),
            f"{triggers:,}",
            f"{summary.network.deliveries:,}",
            f"{every / triggers:.1f}",
        ]
        for spread in SPREADS:
            some = [run.summary for run in found[k, spread]]
            loop = min(one.timing.loop_s for one in some)
            largest = max(kib for one in some for kib in one.memory_kib.values())
            row += [f"{loop:.2f}", f"{1e3 * loop / triggers:.2f}", f"{largest / 1024:.0f}"]
        table.add_row(*row, f"{calls[k]:.2f}")
    console.print(f"\n{duration:g} simulated seconds, least of {runs} rounds; MiB: peak of the largest process")
    console.print(table)


if __name__ == "__main__":
    typer.run(main)
