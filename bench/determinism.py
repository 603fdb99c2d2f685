"""Many runs of each system over DDS beside other work, each compared to the last bit with the run by calls.

    ./scripts/bench determinism                       # 200 runs of each of the five, beside four busy loops
    ./scripts/bench determinism --runs 20 --systems qi2022

A run that fails, or that is not the same, is printed; the exit code says whether there was one.
"""

from __future__ import annotations

import argparse
import multiprocessing
import os
import random
import sys
import tempfile
import time
from collections import Counter
from pathlib import Path

from etac_ros.errors import EtacError
from etac_ros.runs import RosOptions, run_in_process, run_over_ros
from etac_ros.scenario.load import load

SYSTEMS = {
    "wu2018": (None, 200.0),
    "qi2022": (None, 3.0),
    "flexible": (None, 100.0),
    "shi2022": (None, 10.0),
    "xie2021": (None, 1.0),
}
SPREADS = ("node", "namespace", "one")


def busy() -> None:
    while True:
        pass


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--runs", type=int, default=200, help="of each system")
    parser.add_argument("--load", type=int, default=4, help="busy processes beside them")
    parser.add_argument("--systems", default=",".join(SYSTEMS), help="some of them, separated by commas")
    arguments = parser.parse_args()
    print(f"{os.cpu_count()} cores, {arguments.load} busy loops beside the runs")
    print(f"{'system':<10} {'runs':>5} {'same':>5} {'other':>6} {'failed':>7} {'s a run':>8}  digest")
    others = [multiprocessing.Process(target=busy, daemon=True) for _ in range(arguments.load)]
    failures = 0
    try:
        for process in others:
            process.start()
        for name in arguments.systems.split(","):
            failures += runs_of(name, arguments.runs)
    finally:
        for process in others:
            process.kill()
            process.join()
    return int(failures > 0)


def runs_of(name: str, runs: int) -> int:
    variant, duration_s = SYSTEMS[name]
    scenario = load(name, variant, [f"duration_s={duration_s}"])
    wanted = run_in_process(scenario).recording.digest()
    found: Counter[str] = Counter()
    draw = random.Random(name)
    began = time.perf_counter()
    for _ in range(runs):
        options = RosOptions(processes=draw.choice(SPREADS))
        with tempfile.TemporaryDirectory() as folder:
            try:
                digest = run_over_ros(scenario, Path(folder) / "bag", options).recording.digest()
            except EtacError as error:
                digest = "failed"
                print(f"    {options.processes}: {error}", file=sys.stderr)
        if digest not in (wanted, "failed"):
            print(f"    {options.processes}: {digest}", file=sys.stderr)
        found[digest] += 1
    failed = found.pop("failed", 0)
    other = sum(found.values()) - found[wanted]
    each = (time.perf_counter() - began) / runs
    print(f"{name:<10} {runs:>5} {found[wanted]:>5} {other:>6} {failed:>7} {each:>8.2f}  {wanted}", flush=True)
    return other + failed


if __name__ == "__main__":
    sys.exit(main())
