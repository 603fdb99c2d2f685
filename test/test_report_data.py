"""The numbers behind the figures, held against the run that was recorded and against independent computations."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from matplotlib.figure import Figure

from etac_ros.graph.module import Window
from etac_ros.metrics import curves
from etac_ros.metrics.curves import Curve
from etac_ros.metrics.decisions import Margins, decisions, margins
from etac_ros.parameters import FloatArray
from etac_ros.report.figures.decimate import decimated
from etac_ros.report.figures.panels import Panel
from etac_ros.report.source import ReportedRun, read_run
from etac_ros.report.view import View
from etac_ros.runs import run_in_process
from etac_ros.scenario.load import load

PLANT, SENSOR = "/plant", "/sensor"


def reported(folder: Path, *overrides: str, variant: str | None = None) -> ReportedRun:
    scenario = load("wu2018", variant, ["duration_s=100", *overrides])
    run_in_process(scenario, folder / "bag")
    return read_run(folder / "bag")


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> ReportedRun:
    return reported(tmp_path_factory.mktemp("plain"))


def compared(run: ReportedRun) -> Margins:
    return View(run).margins[SENSOR]


def instants(run: ReportedRun) -> FloatArray:
    return np.array(run.summary.triggers[SENSOR].times_s)


@pytest.mark.parametrize("variant", [None, "noise", "filtered-noise"])
def test_error_reaches_the_threshold_at_the_triggering_instants_and_nowhere_between(
    variant: str | None, tmp_path: Path
) -> None:
    run = reported(tmp_path, variant=variant)
    found = compared(run)
    np.testing.assert_array_equal(found.errors >= found.thresholds, found.fired)
    # The first transmission is not asked for by the rule.
    np.testing.assert_array_equal(found.ticks[found.fired] / 32, instants(run)[1:])
    assert found.fired.sum() > 15


def test_margins_are_those_of_the_printed_rule(run: ReportedRun) -> None:
    found = compared(run)
    _, states = run.recording.samples(PLANT)
    s = states[:, 4:7] + 0.08 * states[:, 1:4]
    held = {message.tick: message.value for message in run.recording.messages["filtered_error"]}
    last = [max(tick for tick in held if tick < now) for now in found.ticks.tolist()]
    e = np.array([held[tick] for tick in last]) - s[found.ticks]
    np.testing.assert_allclose(found.errors, np.linalg.norm(e, axis=1), rtol=1e-12)
    threshold = 0.5 * np.linalg.norm(s[found.ticks], axis=1) + 1e-6
    np.testing.assert_allclose(found.thresholds, threshold, rtol=1e-12)


def test_margins_cover_every_tick_on_which_the_sensor_could_act(run: ReportedRun) -> None:
    np.testing.assert_array_equal(compared(run).ticks, np.arange(1, run.graph.end_tick))


def test_a_rule_that_goes_by_time_has_no_margins(tmp_path: Path) -> None:
    run = reported(tmp_path, variant="periodic")
    shown = decisions(run.graph, run.recording, SENSOR)
    assert shown is not None
    assert margins(run.graph, shown, SENSOR) is None


def test_a_module_that_does_not_decide_has_been_shown_nothing(run: ReportedRun) -> None:
    assert decisions(run.graph, run.recording, "/controller") is None


@pytest.mark.parametrize("links", [[], ["links.torque.delay_ticks=3", "links.torque.loss=0.3"]])
def test_held_torque_moves_the_plant_along_its_recorded_samples(links: list[str], tmp_path: Path) -> None:
    run = reported(tmp_path, *links)
    held = curves.held_inputs(run.graph, run.recording, PLANT)["torque"]
    _, states = run.recording.samples(PLANT)
    ticks = (held.times_s * 32).round().astype(int)
    assert (ticks[0], ticks[-1]) == (0, run.graph.end_tick)
    plant = curves.dynamics(run.graph, PLANT)
    for start, end, torque in zip(ticks[:-1], ticks[1:], held.values, strict=False):
        if end > start:
            moved = plant.propagate(states[start], int(start), int(end - start), torque)
            np.testing.assert_array_equal(moved, states[start + 1 : end + 1])
    if links:
        sent = len(run.recording.messages["torque"])
        assert ticks[1] >= 3
        assert ticks.size - 2 < sent


def test_cumulative_bytes_rise_by_a_message_at_a_time_up_to_the_total(run: ReportedRun) -> None:
    curve = curves.cumulative_bytes(run.graph, run.recording)
    assert curve.values[-1, 0] == run.summary.network.payload_bytes > 0
    assert curve.times_s[-1] == run.end_s == 100.0
    # At each instant s and u, three components of four bytes each.
    np.testing.assert_array_equal(curve.times_s[:-1], instants(run))
    np.testing.assert_array_equal(curve.values[:-1, 0], 24.0 * np.arange(1, instants(run).size + 1))


def test_cumulative_bytes_of_a_silent_network_stay_zero(run: ReportedRun) -> None:
    silent = type(run.recording)({name: [] for name in run.recording.messages}, run.recording.truth)
    curve = curves.cumulative_bytes(run.graph, silent)
    assert curve.times_s.tolist() == [0.0, 100.0]
    assert curve.values.ravel().tolist() == [0.0, 0.0]


def test_energy_ends_at_that_of_the_summary_and_never_falls(run: ReportedRun) -> None:
    curve = run.energy[PLANT]
    assert curve.values[-1, 0] == pytest.approx(run.summary.performance[PLANT].energy_n2m2s, rel=1e-12)
    assert (np.diff(curve.values[:, 0]) >= 0.0).all()


def test_energy_is_the_integral_of_the_held_torque(run: ReportedRun) -> None:
    held = curves.held_inputs(run.graph, run.recording, PLANT)["torque"]
    ticks = (held.times_s * 32).round().astype(int)
    every_tick = np.repeat(held.values[:-1], np.diff(ticks), axis=0)
    curve = run.energy[PLANT]
    summed = np.concatenate([[0.0], np.cumsum((every_tick**2).sum(axis=1)) / 32])
    np.testing.assert_allclose(curve.values[:, 0], summed[(curve.times_s * 32).round().astype(int)], rtol=1e-9)


def test_intervals_stand_at_the_instants_that_end_them() -> None:
    curve = curves.intervals(np.array([0.0, 1.5, 2.0]))
    assert curve.times_s.tolist() == [1.5, 2.0]
    assert curve.values.ravel().tolist() == [1.5, 0.5]
    assert curves.intervals(np.array([3.0])).times_s.size == 0


def test_attitude_and_rate_are_in_degrees(run: ReportedRun) -> None:
    euler = curves.attitude(run.graph, run.recording, PLANT)
    np.testing.assert_allclose(euler.values[0], [10.0, 5.0, -5.0], atol=1e-12)
    angle = curves.attitude_angle(run.graph, run.recording, PLANT)
    assert angle.values[-1, 0] == pytest.approx(run.summary.performance[PLANT].attitude_error_deg)
    speed = np.linalg.norm(curves.rate(run.graph, run.recording, PLANT).values, axis=1)
    assert speed[-1] == pytest.approx(run.summary.performance[PLANT].rate_deg_s)
    # The body turns as fast as its attitude changes.
    assert speed.max() == pytest.approx(-np.gradient(angle.values[:, 0], 1 / 32).min(), rel=0.02)


def test_a_sensor_is_shown_what_it_fired_on(run: ReportedRun) -> None:
    sensor = run.scenario.build().modules[SENSOR]
    first, states = run.recording.samples(PLANT)
    watched = sensor.watched(Window(PLANT, 1, first, states))  # type: ignore[attr-defined]
    for message in run.recording.messages["filtered_error"]:
        np.testing.assert_array_equal(watched[message.tick].astype(np.float32), message.value.astype(np.float32))


def test_a_part_of_a_curve_has_both_its_ends() -> None:
    curve = Curve(np.array([0.0, 1.0, 2.0, 3.0]), np.arange(4.0)[:, np.newaxis])
    assert curve.between(1.0, 2.0).times_s.tolist() == [1.0, 2.0]
    assert curve.between(0.5, 2.5).times_s.tolist() == [1.0, 2.0]
    assert curve.between(2.0, 9.0).values.ravel().tolist() == [2.0, 3.0]


def test_a_part_of_a_staircase_begins_with_what_held_before() -> None:
    stairs = Curve(np.array([0.0, 1.0, 4.0, 5.0]), np.array([[7.0], [8.0], [9.0], [9.0]]))
    part = Panel(Figure().subplots(), 0, 2.0, 4.5).held_part(stairs)
    assert part.times_s.tolist() == [2.0, 4.0, 4.5]
    assert part.values.ravel().tolist() == [8.0, 9.0, 9.0]
    # A step right at the start replaces what held before.
    assert Panel(Figure().subplots(), 0, 4.0, 5.0).held_part(stairs).values[0, 0] == 9.0


def exponential(time_constant_s: float, floor: float, end_s: float = 1000.0) -> Curve:
    times = np.linspace(0.0, end_s, 2001)
    return Curve(times, (10.0 * np.exp(-times / time_constant_s) + floor)[:, np.newaxis])


def test_the_steady_state_begins_where_the_error_stays_within_twice_its_late_size() -> None:
    # 10 exp(-t / 20) falls to 0.1 at t = 92.1; then a round twentieth of the run.
    assert curves.transient_end_s([exponential(20.0, 0.1)], 600.0) == 100.0
    assert curves.transient_end_s([exponential(20.0, 0.1), exponential(40.0, 0.1)], 600.0) == 200.0


def test_late_is_what_the_scenario_says() -> None:
    # Between 300 and 500 s the error is ten times as large as before and behind.
    curve = exponential(20.0, 0.1)
    curve.values[(curve.times_s >= 300.0) & (curve.times_s < 500.0)] = 1.0
    assert curves.transient_end_s([curve], 600.0) == 500.0
    # Seen from 450 s on, the late size is 1, and 10 exp(-t / 20) falls to 2 less 0.1 at t = 33.2; but it falls on.
    assert curves.transient_end_s([curve], 450.0) is None


@pytest.mark.parametrize(
    "curve",
    [
        exponential(20.0, 20.0),  # never far from its late size
        exponential(200.0, 0.0),  # still falling at the end
        exponential(150.0, 0.01),  # the same above a floor
    ],
)
def test_a_run_without_both_parts_stays_whole(curve: Curve) -> None:
    assert curves.transient_end_s([curve], 600.0) is None


def test_a_run_that_ended_before_its_steady_part_stays_whole() -> None:
    assert curves.transient_end_s([exponential(20.0, 0.1, 500.0)], 600.0) is None
    assert curves.transient_end_s([exponential(20.0, 0.1, 500.0)], 300.0) == 100.0


@st.composite
def any_curves(draw: st.DrawFn) -> tuple[FloatArray, FloatArray]:
    """Samples at any ascending times, and values among which many are equal."""
    size = draw(st.integers(1, 400))
    gaps = draw(arrays(np.float64, size, elements=st.sampled_from([0.5, 0.5, 0.5, 1e-3, 70.0])))
    values = draw(arrays(np.float64, size, elements=st.one_of(st.floats(-1e3, 1e3), st.sampled_from([0.0, 1.0]))))
    return np.cumsum(gaps), values


@given(any_curves(), st.integers(1, 40))
def test_thinning_leaves_out_only_what_a_column_of_pixels_hides(
    curve: tuple[FloatArray, FloatArray], columns: int
) -> None:
    times, values = curve
    kept_times, kept = decimated(times, values, columns)
    assert (np.diff(kept_times) > 0.0).all()
    np.testing.assert_array_equal(kept, values[np.searchsorted(times, kept_times)])
    assert kept.size <= 4 * (columns + 1)
    if values.size <= 4 * columns:
        assert kept.size == values.size
        return
    # What is left out has kept neighbours on both sides within its column of pixels, and does not stick out of it.
    width = (times[-1] - times[0]) / columns * (1.0 + 1e-9)
    for time, value in zip(times, values, strict=True):
        if time not in kept_times:
            before = (kept_times < time) & (kept_times >= time - width)
            after = (kept_times > time) & (kept_times <= time + width)
            assert before.any()
            assert after.any()
            assert kept[before | after].min() <= value <= kept[before | after].max()


def test_thinning_keeps_a_single_sample_that_sticks_out() -> None:
    values = np.sin(np.linspace(0.0, 20.0, 50_000))
    for place in (1, 777, 49_998):
        spiked = values.copy()
        spiked[place] = -1.5
        times, kept = decimated(np.arange(50_000.0), spiked, 500)
        assert kept.size <= 2004
        assert place in times
        assert kept.min() == -1.5


def test_thinning_a_staircase_keeps_what_is_held_long() -> None:
    # Ten thousand steps within a second, then one that holds for a thousand.
    times = np.concatenate([np.linspace(0.0, 1.0, 10_000, endpoint=False), [1.0, 500.0, 1000.0]])
    values = np.concatenate([np.tile([0.0, 5.0], 5_000), [2.0, 3.0, 3.0]])
    kept_times, kept = decimated(times, values, 100)
    assert kept.size < 20
    assert [kept[np.searchsorted(kept_times, now, side="right") - 1] for now in (250.0, 499.9, 501.0)] == [
        2.0,
        2.0,
        3.0,
    ]
