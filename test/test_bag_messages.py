"""Definitions that are kept and messages that are serialized without the library, held against the library."""

from __future__ import annotations

from importlib.resources import files
from typing import Any

import numpy as np
import pytest

from etac_ros.bag import definitions
from etac_ros.bag.definitions import KEPT_TYPES, definitions_text, fields_of, schema_text, type_hash, typestore
from etac_ros.bag.message import serialized
from etac_ros.bag.mould import Mould
from etac_ros.errors import BagError
from etac_ros.runs import recorded_topics, state_streams
from etac_ros.scenario.load import load

SCENARIOS = ("flexible", "qi2022", "shi2022", "wu2018", "xie2021")


def test_the_kept_definitions_are_those_of_the_library() -> None:
    kept = files("etac_ros.bag").joinpath(definitions.FILE_NAME).read_text(encoding="utf-8")
    assert kept == definitions_text(KEPT_TYPES)


@pytest.mark.parametrize("name", SCENARIOS)
def test_what_a_run_records_is_kept_and_its_templates_are_what_the_library_writes(
    name: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    made: list[tuple[str, bytes]] = []
    make = Mould.__init__

    def noted(self: Mould, type_name: str, template: Any, columns: int) -> None:
        make(self, type_name, template, columns)
        made.append((type_name, serialized(type_name, template)))

    monkeypatch.setattr(Mould, "__init__", noted)
    scenario = load(name)
    state = state_streams(scenario)
    assert state is not None
    types = {topic.type_name for topic in (*recorded_topics(scenario.graph), *state.topics)}
    assert types <= set(KEPT_TYPES)
    store = typestore()
    assert {type_name for type_name, _ in made} == {topic.type_name for topic in state.topics}
    for type_name, data in made:
        assert bytes(store.serialize_cdr(store.deserialize_cdr(data, type_name), type_name)) == data


def test_another_type_comes_from_the_library() -> None:
    assert next(iter(fields_of("sensor_msgs/msg/Range"))) == "header"
    assert "std_msgs/Header header" in schema_text("sensor_msgs/msg/Range")
    assert type_hash("sensor_msgs/msg/Range").startswith("RIHS01_")
    for ask in (fields_of, schema_text, type_hash):
        with pytest.raises(BagError, match="no such message type"):
            ask("nobody_msgs/msg/Nothing")


def test_kinds_of_fields() -> None:
    values: dict[str, Any] = {
        "header": {"stamp": {"sec": 7, "nanosec": 9}, "frame_id": "an"},
        "orientation": {"w": 0.5},
        "orientation_covariance": [1.0, 2.0],
        "linear_acceleration": {"z": -3.0},
    }
    message = typestore().deserialize_cdr(serialized("sensor_msgs/msg/Imu", values), "sensor_msgs/msg/Imu")
    assert (message.header.stamp.sec, message.header.stamp.nanosec, message.header.frame_id) == (7, 9, "an")
    assert (message.orientation.x, message.orientation.w, message.linear_acceleration.z) == (0.0, 0.5, -3.0)
    assert np.array_equal(message.orientation_covariance, [1.0, 2.0, *[0.0] * 7])
    mixed: dict[str, Any] = {"name": ["a", "bcd"], "position": [1.5], "effort": []}
    state = typestore().deserialize_cdr(serialized("sensor_msgs/msg/JointState", mixed), "sensor_msgs/msg/JointState")
    assert (state.name, state.position.tolist(), state.effort.size) == (["a", "bcd"], [1.5], 0)


def test_a_field_that_there_is_not_is_named() -> None:
    with pytest.raises(ValueError, match="geometry_msgs/msg/Point has no field"):
        serialized("geometry_msgs/msg/Point", {"w": 1.0})
