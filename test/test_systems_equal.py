"""Each of the papers' systems, in every reading: both engines give the same messages and states, to the last bit."""

from __future__ import annotations

from pathlib import Path

import pytest
from test_engines_equal import assert_same

from etac_ros.runs import RosOptions, run_in_process, run_over_ros
from etac_ros.scenario.load import load

CASES: list[tuple[str, str, list[str]]] = [
    ("flexible", "rho1e-6", ["duration_s=200"]),
    ("flexible", "rho1e-4", ["duration_s=300"]),
    ("flexible", "large-angle", ["duration_s=10"]),
    ("flexible", "periodic", ["duration_s=100"]),
    ("flexible", "smc", ["duration_s=20"]),
    ("flexible", "smc-sign", ["duration_s=5"]),
    ("shi2022", "fitted", []),
    ("shi2022", "printed", ["duration_s=20"]),
    ("shi2022", "rho-gradient", ["duration_s=20"]),
    ("shi2022", "rate-1.2", ["duration_s=30"]),
    ("shi2022", "rate-1.8-saturated", ["duration_s=10"]),
    ("shi2022", "periodic", ["duration_s=2"]),
    ("shi2022", "events", ["duration_s=30"]),
    ("shi2022", "events-1.8", ["duration_s=5"]),
    ("shi2022", "rate-1.8-magnitude", ["duration_s=10"]),
    ("shi2022", "events", ["duration_s=8", "links.torque_command.delay_ticks=3"]),
    ("xie2021", "case1", ["duration_s=15"]),
    ("xie2021", "case2", ["duration_s=15"]),
    ("xie2021", "held", ["duration_s=5"]),
    ("xie2021", "pull", ["duration_s=5"]),
    ("xie2021", "outage", ["duration_s=12"]),
    ("xie2021", "renewed", ["duration_s=10"]),
    ("xie2021", "renewed-case2", ["duration_s=5", "links.state.delay_ticks=4", "links.state.loss=0.3"]),
    ("qi2022", "unknown", ["duration_s=3"]),
    ("wu2018", "noise-gamma-4e-5", ["duration_s=100"]),
    ("xie2021", "continuous", ["duration_s=0.2"]),
    ("xie2021", "periodic", ["duration_s=3"]),
    ("xie2021", "case1", ["duration_s=5", "formation.n=8"]),
    ("xie2021", "case1", ["duration_s=5", "links.state.delay_ticks=4", "links.state.loss=0.3"]),
    # Who acts at known ticks, fires always alike or acts on arrival, behind links that keep it waiting.
    ("xie2021", "case1", ["duration_s=2", "links.torque_command.delay_ticks=7", "links.feedback.delay_ticks=2"]),
    ("shi2022", "fitted", ["duration_s=5", "links.torque_command.delay_ticks=2", "links.torque_command.loss=0.2"]),
    ("qi2022", "case1", ["duration_s=3", "links.relative.delay_ticks=2", "links.torque_p.delay_ticks=1"]),
    ("qi2022", "smc", ["duration_s=2", "links.feedback.loss=0.2"]),
    ("flexible", "periodic", ["duration_s=60", "links.feedback.delay_ticks=3", "links.feedback.loss=0.3"]),
    ("flexible", "periodic", ["duration_s=40", "links.torque_command.loss=0.5"]),
    # On a shared medium.
    (
        "xie2021",
        "case1",
        [
            "duration_s=3",
            "media={air: {rate_bit_s: 20000.0, access: {class: 'etac_ros.media.csma:Csma'}, queue: {full: replace}}}",
            "links.state={medium: air, loss: 0.1, jitter: {exponential_s: 0.01}}",
        ],
    ),
    ("qi2022", "radio", ["duration_s=2"]),
    ("xie2021", "bad-radio", ["duration_s=3"]),
    ("flexible", "bad-radio", ["duration_s=60"]),
    # Acknowledged, with and without a medium.
    ("qi2022", "case1", ["duration_s=2", "links.relative={delay_ticks: 1, loss: 0.2, acknowledged: {timeout_s: 0.1}}"]),
    (
        "wu2018",
        "bad-radio",
        [
            "duration_s=200",
            "links.filtered_error.acknowledged={timeout_s: 0.05}",
            "links.torque_command.acknowledged={timeout_s: 0.05}",
        ],
    ),
    # A hold that expires.
    ("shi2022", "fitted", ["duration_s=5", "links.torque_command.loss=0.3", "actuator.time_to_live_s=0.05"]),
    # Overtaken, twice, and in bursts.
    (
        "flexible",
        "periodic",
        [
            "duration_s=40",
            "links.feedback={delay_s: 0.013, jitter: {exponential_s: 2.0}, duplication: 0.4}",
            "links.torque_command={bursts: {good_s: 5.0, bad_s: 2.0}}",
        ],
    ),
]


def words(value: str | list[str]) -> str:
    return value if isinstance(value, str) else ",".join(value)


@pytest.mark.parametrize(("scenario", "variant", "overrides"), CASES, ids=words)
def test_same_bits(scenario: str, variant: str, overrides: list[str], tmp_path: Path) -> None:
    loaded = load(scenario, variant, overrides)
    processes = "namespace" if scenario == "xie2021" else "node"
    over_ros = run_over_ros(loaded, tmp_path / "bag", RosOptions(processes=processes))
    by_calls = run_in_process(loaded)
    assert_same(over_ros.recording, by_calls.recording)
    assert over_ros.summary.final_state == by_calls.summary.final_state
    assert over_ros.summary.triggers == by_calls.summary.triggers
    assert over_ros.summary.measured == by_calls.summary.measured
    assert over_ros.summary.links == by_calls.summary.links
    assert over_ros.summary.media == by_calls.summary.media
    assert over_ros.summary.holds == by_calls.summary.holds
