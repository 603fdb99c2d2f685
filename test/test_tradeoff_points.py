"""Points of a trade-off: means over runs, what fails, and what the curves say together."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from conftest import SmallScenario
from hypothesis import given
from hypothesis import strategies as st

from etac_ros.runs import simulate
from etac_ros.scenario.load import load
from etac_ros.sweep.run import sweep
from etac_ros.sweep.workers import here
from etac_ros.tradeoff.curves import Tradeoff, envelope, run_tradeoff, values_of
from etac_ros.tradeoff.layout import PERIODIC, lay_out
from etac_ros.tradeoff.points import TradePoint, points_of
from etac_ros.tradeoff.zeno import shortest_of, zeno_words

PERTURB = "    dispersion: {plant.dynamics.rate_deg_s: {normal: 20.0}}\n"
SECTION = """\
    tradeoff:
      curves:
        alpha: {vary: {sensor.trigger.alpha: [0.2, 0.8]}}
      periodic: {variant: clocked, vary: {sensor.trigger.period_s: [0.2, 0.5, 2.5]}}
"""
OWN = """\
    published:
      held_error:
        {value: 1, label: "mean rate [rad/s]",
         measure: {statistic: mean, quantity: rate in rad/s, from_s: 10.0}}
"""


def written(small: SmallScenario, *parts: str) -> Path:
    return small(("    variants:\n", f"{''.join(parts)}    variants:\n"))


def ran(path: Path | str, runs: int) -> Tradeoff:
    return run_tradeoff(lay_out(str(path), runs), here, lambda finished, planned: None)


def point(payload_bytes: float, error: float, **others: object) -> TradePoint:
    values: Mapping[str, float] = {}
    made = TradePoint(None, "made", values, 1, 1.0, 1.0, payload_bytes, error, 0.0, 1.0, 1.0, "")
    return replace(made, **others)  # type: ignore[arg-type]


def test_a_point_is_the_mean_of_its_runs(small: SmallScenario) -> None:
    path = written(small, PERTURB, SECTION)
    layout = lay_out(str(path), 3)
    result = sweep(layout.plan, here)
    summaries = [simulate(layout.plan.scenario_of(run * len(layout.places))).summary for run in range(3)]
    first = points_of(layout, result)[0]
    errors = [summary.performance["/plant"].max_attitude_error_deg for summary in summaries]
    assert len(set(errors)) == 3
    assert first.error == pytest.approx(np.mean(errors), rel=1e-12)
    assert first.error_sd == pytest.approx(np.std(errors, ddof=1), rel=1e-12)
    assert first.triggers == np.mean([summary.triggers["/sensor"].count for summary in summaries])
    assert first.payload_bytes == np.mean([summary.network.payload_bytes for summary in summaries])
    assert first.messages == np.mean([summary.network.messages for summary in summaries])
    assert first.energy == pytest.approx(np.mean([one.performance["/plant"].energy_n2m2s for one in summaries]))
    intervals = [summary.triggers["/sensor"].min_interval_s or 99.0 for summary in summaries]
    assert len(set(intervals)) > 1
    assert first.shortest_s == min(intervals)
    assert first.runs == 3


@pytest.mark.filterwarnings("ignore:overflow")
@pytest.mark.parametrize(
    ("period", "said"),
    [("2.5", "does not settle: "), ("5.0", "1 of 1 runs ended by a watch: /plant: the state is no number")],
)
def test_what_does_not_hold_is_no_point_of_its_curve(small: SmallScenario, period: str, said: str) -> None:
    done = ran(written(small, SECTION.replace("2.5", period)), 1)
    *held, lost = done.curve(PERIODIC)
    assert all(one.counts for one in held)
    assert lost.failed.startswith(said)
    assert done.periodic_errors is not None
    assert len(done.periodic_errors.values) == 2
    assert any(f"does not hold with {values_of(lost)}" in words for words in done.words())
    assert done.answer(lost) is None


def test_what_a_watch_ends_is_marked(tmp_path: Path) -> None:
    text = Path(load("qi2022").path).read_text()
    start = text.index("    tradeoff:")
    section = """\
    tradeoff:
      curves: {delta: {vary: {pm/relative_sensor.trigger.delta: [1.1]}}}
      periodic: {variant: periodic, vary: {pm/relative_sensor.trigger.period_s: [1.0]}}

"""
    path = tmp_path / "cut.yaml"
    text = text[:start] + section + text[text.index("    published:", start) :]
    path.write_text(text.replace("duration_s: 100.0", "duration_s: 2.0"))
    done = ran(path, 2)
    (lost,) = done.curve(PERIODIC)
    assert lost.failed.startswith("2 of 2 runs ended by a watch: /sim/plant: angle between the modules")
    assert "state" not in lost.failed
    assert all("no answer" in words for words in done.words()[: len(done.papers)])
    # The loop inside the PM is no traffic: only what goes on the air is counted.
    assert done.layout.deciders == ("/pm/relative_sensor",)
    assert done.papers[0].triggers == done.papers[0].messages < 40


def test_a_figure_of_its_own_is_measured_in_every_variant(small: SmallScenario) -> None:
    path = written(small, OWN, SECTION.replace("curves:", "error: held_error\n      curves:", 1))
    done = ran(path, 1)
    assert done.layout.error_label == "mean rate [rad/s]"
    clocked = load(str(path), "clocked", ["sensor.trigger.period_s=0.2"])
    first, states = simulate(clocked).recording.samples("/plant")
    expected = np.linalg.norm(states[100 - first :, 4:7], axis=1).mean()
    assert done.curve(PERIODIC)[0].error == pytest.approx(expected, rel=1e-12)


def test_the_worst_plant_of_a_formation_counts_and_all_its_triggers(tmp_path: Path) -> None:
    text = Path(load("xie2021").path).read_text()
    path = tmp_path / "short.yaml"
    path.write_text(
        text.replace("duration_s: 50.0", "duration_s: 2.0")
        .replace("steady_from_s: 15.0 ", "steady_from_s: 1.0 ")
        .replace("[3.0e-4, 1.0e-3, 3.0e-3, 1.0e-2, 3.0e-2]", "[1.0e-2]")
        .replace("[0.1, 0.5, 1.0, 2.0, 4.0]", "[1.0]")
        .replace("[0.02, 0.05, 0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.8, 1.6]", "[0.1]")
        .replace("      paper: [case1, case2]\n", "")
    )
    layout = lay_out(str(path), 1)
    first = points_of(layout, sweep(layout.plan, here))[0]
    summary = simulate(layout.plan.scenario_of(0)).summary
    assert len(summary.performance) == 4
    assert first.error == max(one.max_attitude_error_deg for one in summary.performance.values())
    assert first.triggers == sum(one.count for one in summary.triggers.values())
    assert first.energy == pytest.approx(sum(one.energy_n2m2s for one in summary.performance.values()))


@given(st.lists(st.tuples(st.integers(1, 9), st.integers(1, 9), st.booleans()), max_size=12))
def test_nothing_lies_left_of_and_below_the_envelope(made: list[tuple[int, int, bool]]) -> None:
    points = [point(x, y, failed="" if counts else "lost") for x, y, counts in made]
    found = envelope(points)
    for one in found:
        assert one.counts
        assert not any(
            other.counts and other.payload_bytes <= one.payload_bytes and other.error <= one.error and (
                other.payload_bytes < one.payload_bytes or other.error < one.error
            )
            for other in points
        )  # fmt: skip
    for other in points:
        if other.counts:
            assert any(one.payload_bytes <= other.payload_bytes and one.error <= other.error for one in found)


def test_the_shortest_interval_of_each_curve_stands_beside_the_bound(small: SmallScenario) -> None:
    done = ran(written(small, PERTURB, SECTION), 3)
    found = shortest_of(done.layout, done.points)
    assert [one.point.label for one in found] == ["alpha", "as the file stands"]
    first = found[0]
    intervals = [one.shortest_s or 99.0 for one in done.curve("alpha")]
    assert len(set(intervals)) > 1
    assert first.seconds == min(intervals)
    assert first.ticks == round(10 * first.seconds)
    for one in found:
        assert one.bound is not None
        assert one.bound.seconds is not None
        assert one.bound.seconds < one.seconds
    words = zeno_words(found, 10)
    assert f"{min(one.seconds for one in found):g} s" in words
    assert "shorter than a tick" in words


def test_the_zeno_check_says_what_the_numbers_say(small: SmallScenario) -> None:
    done = ran(written(small, SECTION), 1)
    first, *_ = shortest_of(done.layout, done.points)
    assert first.bound is not None
    one_tick = replace(first, seconds=0.1, ticks=1)
    assert "as short as this grid allows" in zeno_words([one_tick], 10)
    assert "as short as this grid allows" not in zeno_words([replace(first, seconds=0.2, ticks=2)], 10)
    broken = replace(first, bound=replace(first.bound, seconds=2.0 * first.seconds))
    assert "is not kept in 1 of the 2 rows" in zeno_words([first, broken], 10)
    assert "cannot be evaluated" in zeno_words([replace(first, bound=replace(first.bound, seconds=None))], 10)
    assert "bound" not in zeno_words([replace(first, bound=None)], 10)
    assert "no inter-event time" in zeno_words([], 10)


def test_values_as_text() -> None:
    values = {"sensor.trigger.alpha": 0.5, "sensor.trigger.period_s": 2.0}
    assert values_of(point(1.0, 1.0, values=values)) == "alpha 0.5, period 2 s"
