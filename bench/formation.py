"""How a formation scales over DDS: loop time, processor time, messages and memory against the number of spacecraft.

    ./scripts/bench formation                       # 4, 8, 16 and 32 spacecraft, 5 simulated seconds each
    ./scripts/bench formation --sizes 4,8 --runs 5 --duration 50
    ./scripts/bench formation --write

The spacecraft of xie2021 on a ring with as many further random edges, all in one process, and one process a namespace.
Rounds are interleaved over sizes and spreads. Where all share a process its processor time in the loop is measured,
too: on a machine that others use that is what the work takes, while the loop is what it took.
"""

from __future__ import annotations

import statistics
import tempfile
import time
from collections import defaultdict
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Annotated
from unittest.mock import patch

import typer
from rich.progress import Progress
from section import Section

from etac_ros.engines.ros.coordinator import CoordinatorNode
from etac_ros.metrics.summary import Summary
from etac_ros.runs import RosOptions, run_in_process, run_over_ros
from etac_ros.scenario.load import load
from etac_ros.tables.table import Row, Table
from etac_ros.tables.terminal import make_console

ONE, NAMESPACE = "one", "namespace"
SPREADS = (ONE, NAMESPACE)


@contextmanager
def processor_of_loop(kept: Path) -> Iterator[None]:
    """Writes into a file what processor time the coordinator's process has taken between start and end of the loop."""
    start, end = CoordinatorNode.on_start, CoordinatorNode.end
    began = 0.0

    def on_start(node: CoordinatorNode) -> None:
        nonlocal began
        began = time.process_time()
        start(node)

    def on_end(node: CoordinatorNode, fault: str) -> None:
        kept.write_text(str(time.process_time() - began))
        end(node, fault)

    with patch.object(CoordinatorNode, "on_start", on_start), patch.object(CoordinatorNode, "end", on_end):
        yield


def main(
    sizes: Annotated[str, typer.Option(help="How many spacecraft, with commas.")] = "4,8,16,32",
    duration: Annotated[float, typer.Option(help="Simulated seconds.")] = 5.0,
    runs: Annotated[int, typer.Option(help="Rounds.")] = 3,
    write: Annotated[bool, typer.Option(help="Write its section of docs/performance.md.")] = False,
) -> None:
    """Measure and print."""
    console = make_console()
    counts = [int(size) for size in sizes.split(",")]
    scenarios = {k: load("xie2021", None, [f"formation.n={k}", f"duration_s={duration}"]) for k in counts}
    found: dict[tuple[int, str], list[Summary]] = defaultdict(list)
    processor: dict[tuple[int, str], list[float]] = defaultdict(list)
    with tempfile.TemporaryDirectory() as folder, Progress(console=console, transient=True) as progress:
        task = progress.add_task("measuring", total=runs * len(counts) * len(SPREADS))
        kept = Path(folder, "processor")
        for number in range(runs):
            for k, scenario in scenarios.items():
                for spread in SPREADS:
                    with processor_of_loop(kept):
                        run = run_over_ros(scenario, Path(folder, f"{k}_{spread}_{number}"), RosOptions(spread))
                    found[k, spread].append(run.summary)
                    processor[k, spread].append(float(kept.read_text()))
                    progress.advance(task)
    section = Section("formation", "Formations", "./scripts/bench formation", console)
    section.say(
        f"The spacecraft of xie2021 on a ring with as many further random edges, {duration:g} simulated seconds, "
        f"{runs} rounds in turns over sizes and spreads. With more of them more neighbours hear each trigger, and each "
        "that hears one has to look again: so there are more messages a trigger."
    )
    rows = []
    for k, scenario in scenarios.items():
        summary = found[k, ONE][0]
        triggers = sum(figures.count for figures in summary.triggers.values())
        every = summary.network.messages + summary.internal.messages + summary.emulation.messages
        loops = [one.timing.loop_s for one in found[k, ONE]]
        apart = [one.timing.loop_s for one in found[k, NAMESPACE]]
        work = min(processor[k, ONE])
        rows.append(
            Row(
                (
                    str(k),
                    f"{triggers:,}",
                    f"{summary.network.deliveries:,}",
                    f"{every / triggers:.1f}",
                    f"{1e3 * min(loops) / triggers:.2f}",
                    f"{1e3 * statistics.median(loops) / triggers:.2f}",
                    f"{1e3 * work / triggers:.2f}",
                    f"{1e6 * work / every:.0f}",
                    f"{1e3 * min(apart) / triggers:.2f}",
                    f"{1e3 * run_in_process(scenario).summary.timing.loop_s / triggers:.2f}",
                )
            )
        )
    columns = (
        "spacecraft", "triggers", "delivered", "messages a trigger", "one process: least [ms a trigger]",
        "median [ms a trigger]", "its processor time [ms a trigger]", "[us a message]",
        "a process a namespace: least [ms a trigger]", "by calls [ms a trigger]",
    )  # fmt: skip
    section.show(Table("", columns, tuple(rows)))
    if write:
        section.write()


if __name__ == "__main__":
    typer.run(main)
