"""Both engines agree also where links delay and lose at random, windows are odd and nodes are spread anyhow.

The cases are drawn, but always the same: a failure names its number. To search for more, raise CASES for a while.
"""

from __future__ import annotations

import random
from collections.abc import Callable
from pathlib import Path

import pytest
from test_engines_equal import assert_same

from etac_ros.errors import RunHalted
from etac_ros.graph.graph import LinkKind
from etac_ros.runs import RosOptions, Run, run_in_process, run_over_ros
from etac_ros.scenario.load import Scenario, load

CASES = 10
SYSTEMS: dict[str, tuple[float, tuple[str | None, ...]]] = {
    "wu2018": (60.0, (None, "periodic", "noise")),
    "qi2022": (2.0, (None, "site-sm", "smc", "measurement", "heartbeat")),
    "flexible": (30.0, (None, "periodic", "large-angle")),
    "shi2022": (2.0, (None, "periodic", "printed")),
    "xie2021": (1.0, (None, "held", "pull", "case2", "periodic")),
}


def drawn(number: int) -> tuple[Scenario, RosOptions]:
    draw = random.Random(number)
    name = list(SYSTEMS)[number % len(SYSTEMS)]
    duration, variants = SYSTEMS[name]
    variant = draw.choice(variants)
    overrides = [f"duration_s={duration}", f"seed={draw.randrange(99)}"]
    for link, section in load(name, variant).run.links.items():
        if section.kind is LinkKind.PHYSICAL and draw.random() < 0.8:
            continue
        if draw.random() < 0.35:
            overrides.append(f"links.{link}.delay_ticks={draw.randrange(1, 6)}")
        if draw.random() < 0.3:
            overrides.append(f"links.{link}.loss={draw.choice([0.1, 0.5, 0.9])}")
    if draw.random() < 0.5:
        first = draw.choice([1, 2, 7, 64])
        overrides.append(f"windows={{first: {first}, longest: {first * draw.choice([1, 8])}}}")
    return load(name, variant, overrides), RosOptions(draw.choice(["node", "namespace", "one"]))


@pytest.mark.parametrize("number", range(CASES))
def test_same_bits(number: int, tmp_path: Path) -> None:
    scenario, options = drawn(number)
    by_calls = ended(lambda: run_in_process(scenario))
    over_ros = ended(lambda: run_over_ros(scenario, tmp_path / "bag", options))
    if isinstance(by_calls, str) or isinstance(over_ros, str):
        assert over_ros == by_calls
    else:
        assert_same(over_ros.recording, by_calls.recording)
        assert over_ros.summary.measured == by_calls.summary.measured


def ended(run: Callable[[], Run]) -> Run | str:
    """A run, or why a watch ended it."""
    try:
        return run()
    except RunHalted as halted:
        return str(halted)
