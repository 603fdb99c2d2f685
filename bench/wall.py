"""The highest rate at which each scenario runs in real time without a missed tick, and its latencies there.

Rates are tried in ascending order until one is not held; each for some seconds, as often as asked, and a rate counts as
held when no try of it had an overrun. Other programs on the machine count: the load stands beside the figures.

  ./scripts/bench wall --write                       all five scenarios, into docs/wallclock.md
  ./scripts/bench wall wu2018 --seconds 20 --tries 3
  ./scripts/bench wall --keep measured.json          goes on where it was ended; to measure in pieces
"""

from __future__ import annotations

import argparse
import contextlib
import io
import json
import os
import sys
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from section import Section

from etac_ros.errors import RunError
from etac_ros.metrics.latency import RealTimeAccount
from etac_ros.runs import RosOptions, run_over_ros
from etac_ros.scenario.load import load
from etac_ros.tables.table import Row, Table

RATES = (0.5, 1.0, 2.0, 5.0, 10.0, 20.0, 50.0, 100.0)
SCENARIOS = {"wu2018": "node", "qi2022": "node", "flexible": "node", "shi2022": "node", "xie2021": "namespace"}
FIRST = {"xie2021": 0.5}
"""Where to begin; 1 elsewhere."""


def measure(name: str, rate: float, seconds: float, processes: str, priority: int) -> RealTimeAccount:
    """One run of so many seconds of wall time."""
    grid = load(name).run
    ticks = round(min(grid.duration_s, seconds * rate) * grid.ticks_per_second)
    scenario = load(name, None, [f"duration_s={ticks / grid.ticks_per_second:.12g}"])
    with TemporaryDirectory() as folder, contextlib.redirect_stderr(io.StringIO()):
        options = RosOptions(processes, rate=rate, priority=priority)
        account = run_over_ros(scenario, Path(folder, "bag"), options).summary.real_time
    assert account is not None
    return account


def measured(name: str, seconds: float, tries: int, priority: int) -> dict[str, Any]:
    """The highest rate held, with what was measured at it; the overruns at each rate; and the load meanwhile."""
    held: tuple[float, RealTimeAccount] | None = None
    told = []
    load_before = os.getloadavg()[0]
    for rate in (rate for rate in RATES if rate >= FIRST.get(name, 1.0)):
        accounts: list[RealTimeAccount] = []
        try:
            while len(accounts) < tries and not any(account.overruns for account in accounts):
                accounts.append(measure(name, rate, seconds, SCENARIOS[name], priority))
        except RunError as error:
            told.append(f"{rate:g}: {error.found.partition('; state')[0]}")
            break
        overruns = [account.overruns for account in accounts]
        told.append(f"{rate:g}: {', '.join(map(str, overruns))}")
        print(f"{name} at {rate:g}: overruns {overruns}", file=sys.stderr, flush=True)
        if any(overruns):
            break
        held = rate, max(accounts, key=lambda account: max(loop.ms.most for loop in account.loops.values()))
    return {
        "cells": [name if SCENARIOS[name] == "node" else f"{name}, a process a {SCENARIOS[name]}", *cells_of(held)],
        "told": [name, "; ".join(told)],
        "loads": [load_before, os.getloadavg()[0]],
    }


def cells_of(held: tuple[float, RealTimeAccount] | None) -> list[str]:
    """What was measured at the highest rate that was held."""
    if held is None:
        return ["none", "", "", "", "", ""]
    rate, account = held
    topics = account.latency_ms.values()
    loops = account.loops.values()
    wakes = [node.wakes.p99 for node in account.nodes.values() if node.wakes is not None]
    return [
        f"{rate:g}",
        f"{account.tick_ms:.4g}",
        f"{max(one.median for one in topics):.3f} / {max(one.p99 for one in topics):.3f}",
        f"{max(one.ms.median for one in loops):.3f} / {max(one.ms.most for one in loops):.3f}",
        f"{max(one.ticks.most for one in loops):g}",
        f"{max(wakes, default=0.0):.3f}",
    ]


def main() -> None:
    """Measure and print, and write if asked to."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("scenarios", nargs="*", default=list(SCENARIOS))
    parser.add_argument("--seconds", type=float, default=3.0, help="wall time of a try")
    parser.add_argument("--tries", type=int, default=2)
    parser.add_argument("--priority", type=int, default=10, help="as of etac run; 0: none")
    parser.add_argument("--keep", type=Path, help="file for what was measured; what stands there is not measured again")
    parser.add_argument("--write", action="store_true", help="write its section of docs/wallclock.md")
    given = parser.parse_args()
    how = {"seconds": given.seconds, "tries": given.tries, "priority": given.priority}
    kept: dict[str, Any] = {"how": how, "found": {}}
    if given.keep is not None and given.keep.exists():
        kept = json.loads(given.keep.read_text(encoding="utf-8"))
        if kept["how"] != how:
            sys.exit(f"{given.keep}: was measured with {kept['how']}, and is now asked for with {how}")
    for name in given.scenarios:
        if name not in kept["found"]:
            kept["found"][name] = measured(name, **how)
            if given.keep is not None:
                given.keep.write_text(json.dumps(kept, indent=2), encoding="utf-8")
    found = [kept["found"][name] for name in SCENARIOS if name in kept["found"]]
    section = Section("wall", "What was measured here", "./scripts/bench wall")
    loads = [load for one in found for load in one["loads"]]
    section.say(
        "The highest of the rates 1, 2, 5, 10, 20, 50 and 100 (of xie2021 from 0.5 on) at which no try had an overrun, "
        f"and what was measured there: {given.tries} tries of {given.seconds:g} s each, with --priority "
        f"{given.priority}, while the load of the machine was {min(loads):.1f} to {max(loads):.1f}."
    )
    columns = (
        "scenario", "highest rate held", "tick [ms]", "slowest topic, median / 99 % [ms]",
        "sample to torque, median / most [ms]", "most [ticks]", "woke late, 99 % [ms]",
    )  # fmt: skip
    section.show(Table("", columns, tuple(Row(tuple(one["cells"])) for one in found)))
    section.say("Overruns of each try, by rate; a rate that is not held ends the search:")
    told = ("scenario", "overruns")
    section.show(Table("", told, tuple(Row(tuple(one["told"])) for one in found), texts=frozenset(told)))
    if given.write:
        section.write()


if __name__ == "__main__":
    main()
