"""One long run over DDS: a million messages on network links, counted, recorded, and compared with a run by calls.

    ./scripts/bench soak                          # 1,000,000 messages: wu2018, sampled and sent at every tick
    ./scripts/bench soak --messages 50000
    ./scripts/bench soak --write docs/soak.md

What is looked for is what only shows in a long run: a message too few or too many, a bit that drifts, memory or open
files that grow. The exit code says whether anything was found.
"""

from __future__ import annotations

import os
import sys
import tempfile
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated

import psutil
import typer

from etac_ros.engines.ros.plan import COORDINATOR, RECORDER
from etac_ros.graph.graph import LinkKind
from etac_ros.runs import RosOptions, Run, run_in_process, run_over_ros
from etac_ros.scenario.load import Scenario, load

SETTLED = 0.25
"""Part of a run after which a process has what it needs: from there on its memory should not grow."""
GROWTH_MIB = 8.0
"""By how much the memory of a process may grow from then on; a byte kept for each message would be a part of it."""


@dataclass
class Watch:
    """Memory and open files of each process while a run goes on."""

    end_tick: int
    pids: dict[str, int] = field(default_factory=dict)
    early: dict[str, tuple[float, int]] = field(default_factory=dict)
    late: dict[str, tuple[float, int]] = field(default_factory=dict)

    def on_start(self, pids: dict[str, int]) -> None:
        self.pids = {name: pid for name, pid in pids.items() if name != COORDINATOR}

    def on_progress(self, tick: int, fired: object) -> None:
        if tick < SETTLED * self.end_tick:
            return
        found = {}
        for name, pid in self.pids.items():
            try:
                process = psutil.Process(pid)
                found[name] = process.memory_info().rss / 2**20, process.num_fds()
            except psutil.NoSuchProcess:
                return  # it has left: the run is over
        self.early = self.early or found
        self.late = found


def scenario_of(messages: int) -> Scenario:
    """wu2018, time-triggered at every tick, long enough for so many messages on its network links."""
    overrides = ["sensor.trigger.period_s=0.03125", "baseline=null"]
    graph = load("wu2018", "periodic", overrides).graph
    links = sum(link.kind is LinkKind.NETWORK for link in graph.links.values())
    ticks = -(-messages // links)
    return load("wu2018", "periodic", [*overrides, f"duration_s={ticks / graph.ticks_per_second}"])


def page(run: Run, watch: Watch, same: bool) -> str:
    """The outcome as Markdown."""
    summary = run.summary
    recorded = sum(topic.messages for topic in summary.topics.values())
    lines = [
        "# Soak",
        "",
        f"Written by `./scripts/bench soak --write docs/soak.md`, on {os.cpu_count()} cores beside other work.",
        "",
        f"`wu2018`, time-triggered at every tick, {summary.duration_s:,.0f} simulated seconds over DDS, a process a "
        f"node: {summary.network.messages:,} messages on the network links, {recorded:,} on all topics, in "
        f"{summary.timing.loop_s:,.0f} s of wall time ({summary.network.messages / summary.timing.loop_s:,.0f} network "
        "messages a second).",
        "",
        "- Senders, recorder, coordinator and bag agree on the count of every topic, and on the digests of all values "
        "and acts; else the run had failed.",
        f"- All messages and all committed samples are {'the same bits as' if same else 'NOT the same as'} by calls "
        f"(`{run.recording.digest()}`).",
        "- No process grew. Each begins with what the launcher holds, which has made the run by calls just before.",
        "",
        f"| process | memory [MiB] at {SETTLED:.0%} | at the end | open files | at the end |",
        "| --- | --- | --- | --- | --- |",
    ]
    for name in watch.late:
        (before, files), (after, more) = watch.early[name], watch.late[name]
        lines.append(f"| {name} | {before:.1f} | {after:.1f} | {files} | {more} |")
    return "\n".join(lines) + "\n"


def soak(
    messages: Annotated[int, typer.Option(min=100, help="On the network links.")] = 1_000_000,
    write: Annotated[Path | None, typer.Option(help="Where the page goes.")] = None,
) -> None:
    """Run once, compare, and print what came of it."""
    scenario = scenario_of(messages)
    watch = Watch(scenario.graph.end_tick)
    by_calls = run_in_process(scenario).recording.digest()
    with tempfile.TemporaryDirectory() as folder:
        run = run_over_ros(scenario, Path(folder, "bag"), RosOptions(), watch.on_progress, watch.on_start)
    text = page(run, watch, same=run.recording.digest() == by_calls)
    print(text)
    faults = []
    if run.summary.network.messages < messages:
        faults.append(f"{run.summary.network.messages} messages where {messages} were wanted")
    if run.recording.digest() != by_calls:
        faults.append("not the same bits as by calls")
    for name, (after, files) in watch.late.items():
        before, few = watch.early[name]
        # The recorder counts too: what it keeps is in the bag, not in its memory.
        if after - before > GROWTH_MIB or files > few:
            faults.append(f"{name} grew from {before:.1f} MiB and {few} files to {after:.1f} MiB and {files} files")
    if RECORDER not in watch.late:
        faults.append("the processes were not seen: the run was too short")
    for words in faults:
        print(words, file=sys.stderr)
    if write is not None and not faults:
        write.write_text(text, encoding="utf-8")
    raise typer.Exit(bool(faults))


if __name__ == "__main__":
    typer.run(soak)
