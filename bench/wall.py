"""The highest rate at which each scenario runs in real time without a missed tick, and its latencies there.

Rates are tried in ascending order until one is not held; each for some seconds, as often as asked, and a rate counts as
held when no try of it had an overrun. Other programs on the machine count: the load stands beside the figures.

  scripts/bench wall                     all five scenarios
  scripts/bench wall wu2018 --seconds 20 --tries 3
"""

from __future__ import annotations

import argparse
import contextlib
import io
import os
import sys
from pathlib import Path
from tempfile import TemporaryDirectory

from etac_ros.errors import RunError
from etac_ros.metrics.latency import RealTimeAccount
from etac_ros.runs import RosOptions, run_over_ros
from etac_ros.scenario.load import load
from etac_ros.tables.markdown import markdown_lines
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


def row(name: str, seconds: float, tries: int, priority: int) -> tuple[Row, Row]:
    """The highest rate held, with what was measured at it; and the overruns at each rate."""
    held: tuple[float, RealTimeAccount] | None = None
    told = []
    for rate in (rate for rate in RATES if rate >= FIRST.get(name, 1.0)):
        try:
            accounts = [measure(name, rate, seconds, SCENARIOS[name], priority) for _ in range(tries)]
        except RunError as error:
            told.append(f"{rate:g}: {error.found}")
            break
        overruns = [account.overruns for account in accounts]
        told.append(f"{rate:g}: {', '.join(map(str, overruns))}")
        print(f"{name} at {rate:g}: overruns {overruns}", file=sys.stderr, flush=True)
        if any(overruns):
            break
        held = rate, max(accounts, key=lambda account: max(loop.ms.most for loop in account.loops.values()))
    if held is None:
        return Row((name, "none", "", "", "", "", "")), Row((name, "; ".join(told)))
    rate, account = held
    topics = account.latency_ms.values()
    loops = account.loops.values()
    wakes = [node.wakes.p99 for node in account.nodes.values() if node.wakes is not None]
    cells = (
        name,
        f"{rate:g}",
        f"{account.tick_ms:.4g}",
        f"{max(one.median for one in topics):.3f} / {max(one.p99 for one in topics):.3f}",
        f"{max(one.ms.median for one in loops):.3f} / {max(one.ms.most for one in loops):.3f}",
        f"{max(one.ticks.most for one in loops):g}",
        f"{max(wakes, default=0.0):.3f}",
    )
    return Row(cells), Row((name, "; ".join(told)))


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("scenarios", nargs="*", default=list(SCENARIOS))
    parser.add_argument("--seconds", type=float, default=5.0, help="wall time of a try")
    parser.add_argument("--tries", type=int, default=3)
    parser.add_argument("--priority", type=int, default=0, help="as of etac run")
    given = parser.parse_args()
    before = os.getloadavg()[0]
    pairs = [row(name, given.seconds, given.tries, given.priority) for name in given.scenarios]
    columns = (
        "scenario", "highest rate held", "tick [ms]", "slowest topic, median / 99 % [ms]",
        "sample to torque, median / most [ms]", "most [ticks]", "woke late, 99 % [ms]",
    )  # fmt: skip
    told = ("scenario", "overruns of each try, by rate")
    for table in (
        Table("", columns, tuple(held for held, _ in pairs)),
        Table("", told, tuple(tries for _, tries in pairs), texts=frozenset(told[1:])),
    ):
        print("\n".join(markdown_lines(table)), end="\n\n")
    loads = f"load of the machine {before:.1f} before, {os.getloadavg()[0]:.1f} after, {os.cpu_count()} cores"
    print(f"{given.tries} tries of {given.seconds:g} s each, priority {given.priority}; {loads}")


if __name__ == "__main__":
    main()
