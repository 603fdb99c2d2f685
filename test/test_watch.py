"""Listening to a run of others: which one, what it is on its own word, and what only some of its nodes can be asked."""

from __future__ import annotations

from pathlib import Path

import pytest
from toy import toy

from etac_ros.cli import watch
from etac_ros.cli.nodes import _check_who_can
from etac_ros.engines.ros.domain import DomainLease, leased_domains
from etac_ros.engines.ros.listener import Told
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
