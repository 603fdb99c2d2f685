"""Listening to a run of others: which one, what it is on its own word, and what only some of its nodes can be asked."""

from __future__ import annotations

from pathlib import Path

import pytest
from toy import toy

from etac_ros.bag.monitor import Monitor
from etac_ros.cli import watch
from etac_ros.cli.nodes import _check_who_can
from etac_ros.engines.ros.domain import DomainLease, leased_domains
from etac_ros.engines.ros.listener import RunListener, Told
from etac_ros.engines.ros.plan import Plan
from etac_ros.errors import ScenarioError
from etac_ros.scenario.load import Scenario, load
from etac_ros.timing.windows import USUAL_WINDOWS


def told_by(scenario: Scenario) -> Told:
    return Told("token", scenario.name, scenario.digest, "", scenario.told)


def test_a_run_tells_what_it_is() -> None:
    for scenario in (load("xie2021", "radio", ["duration_s=3"]), load("qi2022", None, ["duration_s=2", "seed=7"])):
        assert watch._scenario_of(told_by(scenario), None).digest == scenario.digest
        assert watch._scenario_of(told_by(scenario), scenario) is scenario


def test_what_is_no_scenario_is_refused() -> None:
    for text in ("{", "[]", "{}", '{"/**": {"scenario": 1}}'):
        with pytest.raises(ScenarioError, match="the run of 'x'"):
            watch._scenario_of(Told("token", "x", "", "", text), None)


def test_another_scenario_is_refused() -> None:
    with pytest.raises(ScenarioError, match="is not what runs there: 'wu2018'"):
        watch._scenario_of(told_by(load("wu2018", None, ["seed=2"])), load("wu2018"))


def test_classes_of_others_are_not_imported_on_its_word(tmp_path: Path) -> None:
    run = toy(tmp_path, {"a": {"at": [3]}})
    with pytest.raises(ScenarioError, match="has classes of others, which are not imported on a run's word"):
        watch._scenario_of(told_by(run), None)
    assert watch._scenario_of(told_by(run), run) is run


def test_runs_of_this_machine_are_found(lease: DomainLease, monkeypatch: pytest.MonkeyPatch) -> None:
    assert lease.domain in leased_domains()
    for there, found in (([7], 7), ([], 5)):
        monkeypatch.setattr(watch, "leased_domains", lambda there=there: there)
        assert watch._found(5 if not there else None) == found
    monkeypatch.setattr(watch, "leased_domains", lambda: [7, 9])
    with pytest.raises(ScenarioError, match="in ROS domains 7, 9 are runs on this machine"):
        watch._found(None)
    assert watch._may_come(3, 3)
    assert watch._may_come(7, None)
    assert not watch._may_come(3, None)


def test_who_can_be_asked_to_slow_down_and_to_show(tmp_path: Path) -> None:
    one, two = load("wu2018"), toy(tmp_path, {"a": {"at": [3]}, "b": {"at": [4]}})
    for scenario, keeper in ((one, "/plant"), (two, "/coordinator")):
        plan = Plan(scenario.name, scenario.digest, scenario.build(), USUAL_WINDOWS)
        _check_who_can(plan, keeper, 5.0, None)
        with pytest.raises(ScenarioError, match=f"give it to {keeper}"):
            _check_who_can(plan, "/recorder", 5.0, None)
        with pytest.raises(ScenarioError, match="is no rate"):
            _check_who_can(plan, keeper, 0.0, None)
        with pytest.raises(ScenarioError, match="give it to /recorder"):
            _check_who_can(plan, keeper, None, 8765)


class Heard(RunListener):
    """A listener that is told what others would hear over DDS."""

    def __init__(self, scenario: Scenario, clock: str) -> None:
        self._told = told_by(scenario)
        self._links = dict(scenario.graph.links)
        self._by_topic = {link.topic: link for link in self._links.values()}
        self._wall = None
        self._over = None
        self._logs = 0


def test_in_simulated_time_the_message_log_tells_of_all_and_who_comes_late_says_so() -> None:
    scenario = load("xie2021", "radio", ["duration_s=3"])
    heard, monitor = Heard(scenario, ""), Monitor(scenario.graph)
    air = {"tick": 500, "fates": [["sc1_state", 4, 1, 499_000_000, 500_000_000, 500_320_000, 500_320_000]]}
    transits = [["sc1_state", 4, 499, 0], ["sc1_state", 5, 700, 0], ["sc1_feedback", 5, 700, 0]]
    heard._on_message_log(monitor, {"log": 7, "transits": transits, "air": air})
    flow = monitor.picture.flows["sc1_state"]
    assert (flow.messages, flow.payload_bytes, flow.cdr_bytes, flow.last_tick) == (5, 120, 200, 700)
    assert monitor.picture.from_tick == 499
    assert monitor.picture.fired["/sc1/sensor"] == 5
    (traffic,) = monitor.picture.air.values()
    assert (traffic.frames, traffic.waiting, traffic.busy_ns, traffic.waited_ns) == (1, 1, 320_000, 1_000_000)
    heard._on_stop(monitor, {"fault": "", "sent": {"sc1_state": 6, "sc2_state": 2}, "tick": 3000})
    assert (flow.messages, monitor.picture.flows["sc2_state"].messages, monitor.picture.tick) == (6, 2, 3000)


def test_in_real_time_numbers_and_times_of_messages_tell() -> None:
    scenario = load("wu2018", None, ["duration_s=10"])
    heard, monitor = Heard(scenario, "wall"), Monitor(scenario.graph)
    link = scenario.graph.links["filtered_error"]
    heard._on_start({"t0_ns": 10**9, "ticks_per_second": 32, "rate": "2"})
    heard._on_message(monitor, link, b"", 3, 10**9 + 500_000_000)
    flow = monitor.picture.flows["filtered_error"]
    assert (flow.messages, flow.cdr_bytes, flow.last_tick) == (3, 48, 32)
    heard._on_leave(monitor, {"sent": {"/filtered_error": [4, 64], "/emulation/x": [9, 9]}})
    assert (flow.messages, flow.last_tick) == (4, 32)
    heard._on_stop(monitor, {"fault": "it burns", "tick": 40})
    assert heard._fault == "it burns"
    assert heard._over is not None
