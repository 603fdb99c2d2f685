"""A neighbour's trigger may renew the torque: a receipt alone commands, and is no triggering instant."""

from __future__ import annotations

import functools

import numpy as np
import pytest

from etac_ros.errors import ScenarioError
from etac_ros.laws.xie2021 import CoordinationTorque, CoordinationTorqueParameters
from etac_ros.runs import Run, run_in_process
from etac_ros.scenario.load import load

HEARS = {"sc1": ("sc3",), "sc2": ("sc1", "sc3"), "sc3": ("sc1", "sc2"), "sc4": ("sc1",)}


@functools.cache
def run(variant: str) -> Run:
    return run_in_process(load("xie2021", variant, ("duration_s=5",)))


def ticks(name: str) -> set[int]:
    return {message.tick for message in run("renewed").recording.messages[name]}


@pytest.mark.parametrize("craft", HEARS)
def test_the_torque_is_renewed_when_a_heard_neighbour_triggers_and_at_no_other_time(craft: str) -> None:
    own = ticks(f"{craft}_feedback")
    heard = set().union(*(ticks(f"{other}_state") for other in HEARS[craft]))
    assert ticks(f"{craft}_renewal") == heard - own
    assert heard - own
    assert ticks(f"{craft}_torque_command") == own | heard


@pytest.mark.parametrize("craft", HEARS)
def test_a_renewal_is_no_trigger_and_nothing_is_broadcast(craft: str) -> None:
    found = run("renewed")
    assert found.summary.triggers[f"/{craft}/sensor"].count == len(ticks(f"{craft}_feedback"))
    if craft != "sc4":  # nobody hears the fourth
        assert ticks(f"{craft}_state") == ticks(f"{craft}_feedback")


def test_a_renewal_is_the_signal_with_the_new_message_in_it() -> None:
    """The command that follows is that of the signal which was formed at the neighbour's instant."""
    found = run("renewed")
    messages = found.recording.messages
    renewal = messages["sc4_renewal"][3]
    command = next(one for one in messages["sc4_torque_command"] if one.tick == renewal.tick)
    own = found.scenario.nodes["/sc4/controller"]["law"]
    parameters = CoordinationTorqueParameters.model_validate({key: own[key] for key in own if key != "class"})
    torque = CoordinationTorque(parameters, 1000).command(renewal.value)
    assert np.array_equal(command.value, torque.astype(np.float32))


def test_without_it_only_own_triggers_command() -> None:
    messages = run("case1").recording.messages
    assert {one.tick for one in messages["sc2_torque_command"]} == {one.tick for one in messages["sc2_feedback"]}


def test_renewal_goes_with_broadcasts_only() -> None:
    with pytest.raises(ScenarioError, match="renewed_by: neighbours goes with exchange: broadcast"):
        load("xie2021", "renewed", ("*/sensor.exchange=continuous",))
