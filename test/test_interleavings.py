"""Whatever order messages of different topics arrive in, a run does the same: every interleaving is driven."""

from __future__ import annotations

import random
from collections.abc import Callable, Mapping
from itertools import permutations
from pathlib import Path
from typing import Any

import pytest
from network import Network, Queue, every_interleaving, run, starved
from test_engines_equal import assert_same
from toy import toy

from etac_ros.engines.inprocess import InProcess
from etac_ros.runs import windows_of
from etac_ros.scenario.load import Scenario, load
from etac_ros.timing.windows import WindowPolicy

SYSTEMS: Mapping[str, tuple[str, str | None, list[str]]] = {
    "wu2018": ("wu2018", None, ["duration_s=20"]),
    "wu2018 periodic": ("wu2018", "periodic", ["duration_s=3"]),
    "wu2018 delay": ("wu2018", None, ["duration_s=20", "links.filtered_error={delay_ticks: 3, loss: 0.3}"]),
    "wu2018 periodic, lossy": (
        "wu2018",
        "periodic",
        ["duration_s=6", "links.filtered_error.loss=0.5", "links.torque_command.delay_ticks=40"],
    ),
    "qi2022": ("qi2022", None, ["duration_s=0.5"]),
    "qi2022 site-sm": ("qi2022", "site-sm", ["duration_s=0.5"]),
    "qi2022 smc": ("qi2022", "smc", ["duration_s=0.5", "links.feedback.loss=0.2"]),
    "qi2022 measurement": ("qi2022", "measurement", ["duration_s=0.5", "links.relative.delay_ticks=2"]),
    "flexible": ("flexible", None, ["duration_s=20"]),
    "shi2022": ("shi2022", None, ["duration_s=2"]),
    "xie2021": ("xie2021", None, ["duration_s=0.2"]),
    "xie2021 delay": (
        "xie2021",
        None,
        ["duration_s=0.2", *(f"links.sc{n}_feedback={{delay_ticks: 2, loss: 0.4}}" for n in (1, 2, 3, 4))],
    ),
    "xie2021 short windows": ("xie2021", None, ["duration_s=0.1", "windows={first: 1, longest: 2}"]),
    "xie2021 pull": ("xie2021", "pull", ["duration_s=0.2"]),
    "wu2018 on the air": (
        "wu2018",
        None,
        [
            "duration_s=20",
            "media={air: {rate_bit_s: 1000.0, overhead: ccsds-proximity-1}}",
            "links.filtered_error={medium: air, loss: 0.2}",
            "links.torque_command={medium: air, duplication: 0.5}",
        ],
    ),
    "xie2021 on the air": (
        "xie2021",
        "held",
        [
            "duration_s=0.2",
            "media={air: {rate_bit_s: 20000.0, access: {class: 'etac_ros.media.csma:Csma'}, queue: {full: replace}}}",
            "links.state.medium=air",
        ],
    ),
    "wu2018 jitter": (
        "wu2018",
        None,
        [
            "duration_s=20",
            "links.filtered_error={jitter: {exponential_s: 0.5}, duplication: 0.5}",
            "links.torque_command={bursts: {good_s: 2.0, bad_s: 1.0}}",
        ],
    ),
    "wu2018 acknowledged on the air": (
        "wu2018",
        None,
        [
            "duration_s=20",
            "media={air: {rate_bit_s: 1000.0, overhead: ieee-802.15.4, access: {class: 'etac_ros.media.csma:Csma'}}}",
            "links.filtered_error={medium: air, loss: 0.3, acknowledged: {timeout_s: 0.2}}",
            "links.torque_command={medium: air, loss: 0.3, acknowledged: {timeout_s: 0.2}}",
        ],
    ),
    "qi2022 acknowledged": (
        "qi2022",
        None,
        ["duration_s=0.5", "links.relative={delay_ticks: 1, loss: 0.2, acknowledged: {timeout_s: 0.1}}"],
    ),
    "xie2021 acknowledged on the air": (
        "xie2021",
        None,
        [
            "duration_s=0.1",
            "media={air: {rate_bit_s: 100000.0, overhead: ieee-802.15.4, queue: {full: replace}}}",
            "links.state={medium: air, loss: 0.3, acknowledged: {timeout_s: 0.01, by: all}}",
        ],
    ),
    "wu2018 time to live": (
        "wu2018",
        None,
        ["duration_s=20", "links.torque_command={loss: 0.4, delay_ticks: 1}", "actuator.time_to_live_s=0.5"],
    ),
    "xie2021 outage": ("xie2021", "held", ["duration_s=0.2", "links.sc1_state.outages={sc2/sensor: [0.01, 0.1]}"]),
}


def network_of(scenario: Scenario) -> Callable[[], Network]:
    return lambda: Network(scenario.build(), windows_of(scenario))


def assert_as_in_process(network: Network, scenario: Scenario) -> None:
    by_calls = InProcess(scenario.build(), windows_of(scenario)).run()
    assert_same(network.recording(), by_calls)


SHORT = {
    # A passive sensor beside a loop at every tick: windows of one sample, reports before they are asked for.
    "qi2022": ("qi2022", None, ["duration_s=0.2"]),
    "qi2022 site-sm": ("qi2022", "site-sm", ["duration_s=0.2"]),
    "wu2018": ("wu2018", None, ["duration_s=6"]),
    "wu2018 acknowledged": (
        "wu2018",
        None,
        ["duration_s=6", "links.filtered_error={loss: 0.4, acknowledged: {timeout_s: 0.1, retries: 1}}"],
    ),
    "shi2022": ("shi2022", None, ["duration_s=0.3"]),
}


@pytest.mark.parametrize("case", list(SHORT))
def test_every_interleaving_of_a_real_system(case: str) -> None:
    name, variant, overrides = SHORT[case]
    scenario = load(name, variant, overrides)
    runs = 0
    for network in every_interleaving(network_of(scenario), most=4000):
        assert_as_in_process(network, scenario)
        runs += 1
    assert runs


TOYS: Mapping[str, dict[str, Any]] = {
    "both at once, then one": {"a": {"at": [0, 2]}, "b": {"at": [0, 1, 2]}},
    "one answers": {"a": {"at": [0, 2]}, "b": {"at": [1], "echo": True}},
    "answered late": {"a": {"at": [0, 1]}, "b": {"echo": True}, "a_says": {"delay_ticks": 1}},
    "answered twice, late": {
        "a": {"at": [0, 1]},
        "b": {"echo": True},
        "a_says": {"jitter": {"uniform_s": 0.15}, "duplication": 0.9},
    },
    "lost in a burst": {
        "a": {"at": [0, 1, 2]},
        "b": {"echo": True},
        "a_says": {"bursts": {"good_s": 0.1, "bad_s": 0.1}},
    },
    "lost for one of two": {"a": {"at": [0, 1, 2]}, "b": {"echo": True}, "a_says": {"loss": 0.5}},
    "acknowledged": {
        "a": {"at": [0, 1]},
        "b": {"echo": True},
        "a_says": {"loss": 0.5, "acknowledged": {"timeout_s": 0.1, "by": "all"}},
    },
    "above a bound that grows": {"a": {"above": 0.5}, "b": {"at": [1]}},
}


ON_THE_AIR = {"air": {"rate_bit_s": 1000.0, "access": {"class": "etac_ros.media.csma:Csma", "slot_s": 0.01}}}
TOYS_ON_THE_AIR: Mapping[str, dict[str, Any]] = {
    "both wait": {"a": {"at": [0]}, "b": {"at": [0]}, "a_says": {"medium": "air"}, "b_says": {"medium": "air"}},
    "answered over the air": {"a": {"at": [0]}, "b": {"echo": True}, "a_says": {"medium": "air", "duplication": 0.9}},
}


@pytest.mark.parametrize("case", list(TOYS_ON_THE_AIR))
@pytest.mark.parametrize("longest", [1, 4])
def test_every_interleaving_of_two_plants_on_a_medium(case: str, longest: int, tmp_path: Path) -> None:
    links = dict(TOYS_ON_THE_AIR[case])
    sensors = {name: links.pop(name) for name in ("a", "b")}
    scenario = toy(tmp_path, sensors, duration_ticks=3, media=ON_THE_AIR, **links)
    windows = WindowPolicy(1, longest)
    by_calls = InProcess(scenario.build(), windows).run()
    assert by_calls.air
    runs = 0
    for network in every_interleaving(lambda: Network(scenario.build(), windows), most=4000):
        assert_same(network.recording(), by_calls)
        runs += 1
    assert runs


@pytest.mark.parametrize("case", list(TOYS))
@pytest.mark.parametrize("longest", [1, 4])
def test_every_interleaving_of_two_plants(case: str, longest: int, tmp_path: Path) -> None:
    links = dict(TOYS[case])
    sensors = {name: links.pop(name) for name in ("a", "b")}
    scenario = toy(tmp_path, sensors, duration_ticks=3, **links)
    windows = WindowPolicy(1, longest)
    by_calls = InProcess(scenario.build(), windows).run()
    runs = 0
    for network in every_interleaving(lambda: Network(scenario.build(), windows), most=4000):
        assert_same(network.recording(), by_calls)
        runs += 1
    assert runs


def schedules(queues: list[Queue], number: int) -> list[list[str]]:
    """Each receiver and each topic starved alone, then by twos and threes, in an order that is always the same."""
    names = sorted({name for queue in queues for name in queue})
    several = [list(pair) for pair in permutations(names, 2)] + [list(three) for three in permutations(names, 3)]
    random.Random(1).shuffle(several)
    return [[name] for name in names] + several[: number - len(names)]


@pytest.mark.parametrize("case", list(SYSTEMS))
def test_whoever_is_starved_nothing_changes(case: str) -> None:
    name, variant, overrides = SYSTEMS[case]
    scenario = load(name, variant, overrides)
    build = network_of(scenario)
    usual = run(build, lambda waiting: waiting[0])
    assert_as_in_process(usual, scenario)
    for victims in schedules(list(usual.delivered), 150):
        network = run(build, starved(victims))
        assert network.master.done == usual.master.done, victims
        assert {name: worker.done for name, worker in network.workers.items()} == network.master.done
        assert network.delivered.keys() == usual.delivered.keys()
