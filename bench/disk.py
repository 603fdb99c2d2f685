"""What a bag takes on disk, and what that costs: chunks compressed or not, samples thinned out or not.

    ./scripts/bench disk                               # five scenarios, five rounds
    ./scripts/bench disk --scenarios wu2018 --runs 9
    ./scripts/bench disk --write

Rounds are interleaved: each way of keeping a bag has its turn in each, so a machine that changes its speed changes it
for all alike. Beside the loop stands the processor time of all processes of the run, from their start to their end,
which a busy machine blurs less.
"""

from __future__ import annotations

import resource
import statistics
import tempfile
from pathlib import Path
from typing import Annotated

import typer
from rich.progress import track
from section import Section

from etac_ros.runs import RosOptions, run_over_ros
from etac_ros.scenario.load import load
from etac_ros.tables.table import Row, Table
from etac_ros.tables.terminal import make_console

SCENARIOS = "wu2018,qi2022,flexible,shi2022,xie2021"
WAYS = {
    "not compressed": ["bag_compression=none"],
    "lz4 (usual)": [],
    "zstd": ["bag_compression=zstd"],
    "--truth 10": ["truth_every=10"],
    "--truth none --state-rate 0": ["truth_every=0", "state_rate_hz=0"],
}


def main(
    scenarios: Annotated[str, typer.Option(help="Which, with commas.")] = SCENARIOS,
    runs: Annotated[int, typer.Option(help="Rounds.")] = 5,
    write: Annotated[bool, typer.Option(help="Write its section of docs/performance.md.")] = False,
) -> None:
    """Measure and print."""
    console = make_console()
    rows: list[Row] = []
    for name in track(scenarios.split(","), "measuring", console=console, transient=True):
        rows += rows_of(name, runs)
    command = f"./scripts/bench disk --scenarios {scenarios} --runs {runs}"
    section = Section("disk", "Bags on disk", command, console, packages=("mcap", "lz4", "zstandard"))
    section.say(
        f"Runs over DDS with a process a node, {runs} rounds in turns. The recorder has a process of its own and a "
        "lower priority, so what it does with a chunk shows in the processor time of all processes, and in the loop "
        "only where others wait for the processor."
    )
    columns = ("scenario", "bag", "size [MiB]", "of not compressed", "loop, least [s]", "loop, median [s]",
               "processor, least [s]")  # fmt: skip
    section.show(Table("", columns, tuple(rows), texts=frozenset({"bag"})))
    if write:
        section.write()


def rows_of(name: str, runs: int) -> list[Row]:
    """One scenario, its bag kept in each way."""
    ways = {way: load(name, None, ["baseline=null", *overrides]) for way, overrides in WAYS.items()}
    loops: dict[str, list[float]] = {way: [] for way in ways}
    spent: dict[str, list[float]] = {way: [] for way in ways}
    sizes: dict[str, int] = {}
    for number in range(runs + 1):
        for way, scenario in ways.items():
            with tempfile.TemporaryDirectory() as folder:
                before = _processor_s()
                run = run_over_ros(scenario, Path(folder, "bag"), RosOptions())
                if number:  # the first finds what is to be compiled
                    loops[way].append(run.summary.timing.loop_s)
                    spent[way].append(_processor_s() - before)
                sizes[way] = sum(path.stat().st_size for path in Path(folder, "bag").glob("*.mcap"))
    whole = sizes[next(iter(ways))]
    return [
        Row(
            (
                name,
                f"`{way}`" if way.startswith("-") else way,
                f"{sizes[way] / 2**20:.2f}",
                f"{sizes[way] / whole:.2f}",
                f"{min(loops[way]):.3f}",
                f"{statistics.median(loops[way]):.3f}",
                f"{min(spent[way]):.2f}",
            ),
            ends=way == list(ways)[-1],
        )
        for way in ways
    ]


def _processor_s() -> float:
    """Processor time of all processes that have ended [s]."""
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime


if __name__ == "__main__":
    typer.run(main)
