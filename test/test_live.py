"""A run is shown while it is recorded: a viewer gets what is written, and a late one learns what was said once."""

from __future__ import annotations

import asyncio
import json
import socket
import struct
from pathlib import Path
from typing import Any

import pytest
from tornado.websocket import WebSocketClientConnection, websocket_connect

from etac_ros.bag.contents import Contents
from etac_ros.bag.definitions import typestore
from etac_ros.bag.from_recording import write_recording
from etac_ros.bag.live import LiveView, check_live
from etac_ros.bag.run_bag import RunBag
from etac_ros.bag.state import StateStreams
from etac_ros.bag.topics import TopicDescription
from etac_ros.errors import ScenarioError
from etac_ros.runs import run_in_process
from etac_ros.scenario.load import load

pytest.importorskip("foxglove", reason="foxglove-sdk is not installed")
_DATA = struct.Struct("<BIQ")  # of Foxglove's WebSocket protocol: opcode, subscription, time


async def advertised(connection: WebSocketClientConnection, count: int) -> dict[str, Any]:
    """Channels by topic, as the server says them."""
    found: dict[str, Any] = {}
    while len(found) < count:
        message = await connection.read_message()
        if isinstance(message, str):
            found |= {channel["topic"]: channel for channel in json.loads(message).get("channels", [])}
    return found


async def watched(view: LiveView, topics: int) -> tuple[dict[str, Any], list[tuple[int, int, bytes]]]:
    """Channels, and the messages that a late viewer of a latched topic and of a common one gets."""
    connection = await websocket_connect(f"ws://127.0.0.1:{view.port}", subprotocols=["foxglove.sdk.v1"])
    channels = await advertised(connection, topics)
    got = []
    for number, topic in enumerate(("/state/plant/shape", "/filtered_error"), start=1):
        asked = {"op": "subscribe", "subscriptions": [{"id": number, "channelId": channels[topic]["id"]}]}
        await connection.write_message(json.dumps(asked))
        if number == 2:
            await said_to_be_there(view, topic)
            view.show(topic, b"\0\1\0\0" + struct.pack("<3f", 1.0, 2.0, 3.0), 42)
        while True:
            message = await connection.read_message()
            if isinstance(message, bytes) and message[0] == 1:
                _, subscription, time_ns = _DATA.unpack_from(message)
                got.append((subscription, time_ns, message[_DATA.size :]))
                break
    connection.close()
    return channels, got


async def said_to_be_there(view: LiveView, topic: str) -> None:
    while not view._channels[topic].has_sinks():
        await asyncio.sleep(0)


def test_a_late_viewer_gets_what_was_said_once_and_then_what_is_said() -> None:
    scenario = load("wu2018")
    state = StateStreams(scenario.graph)
    point = TopicDescription("/filtered_error", "geometry_msgs/msg/Point32", "network", link="filtered_error")
    truth = TopicDescription("/emulation/plant/truth", "std_msgs/msg/Float64MultiArray", "emulation", plant="/plant")
    view = LiveView([*state.topics, point, truth], "wu2018", 0)
    try:
        shape = next(cdr for topic, cdr in state._fixed if topic.name == "/state/plant/shape")
        view.show("/state/plant/shape", shape, 7)
        view.show("/emulation/plant/truth", b"", 8)
        channels, (first, second) = asyncio.run(asyncio.wait_for(watched(view, len(state.topics) + 1), 60))
    finally:
        view.close()
    assert set(channels) == {topic.name for topic in state.topics} | {"/filtered_error"}
    assert {channel["encoding"] for channel in channels.values()} == {"cdr"}
    assert channels["/tf"]["schemaName"] == "tf2_msgs/msg/TFMessage"
    assert channels["/tf"]["schemaEncoding"] == "ros2msg"
    assert first == (1, 7, shape)
    assert (second[0], second[1]) == (2, 42)
    error = typestore().deserialize_cdr(second[2], "geometry_msgs/msg/Point32")
    assert (error.x, error.y, error.z) == (1.0, 2.0, 3.0)


class Recorded:
    """A view that only remembers."""

    def __init__(self) -> None:
        self.shown: list[tuple[str, bytes, int]] = []
        self.closed = 0

    def show(self, topic: str, cdr: bytes, log_time_ns: int) -> None:
        self.shown.append((topic, cdr, log_time_ns))

    def close(self) -> None:
        self.closed += 1


def test_all_that_is_written_is_shown(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    view = Recorded()
    scenario = load("wu2018", None, ["duration_s=20"])
    run = run_in_process(scenario)
    made = RunBag.__init__

    def with_view(self: RunBag, *arguments: Any, **named: Any) -> None:
        made(self, *arguments, **named, live=lambda topics: view)

    monkeypatch.setattr(RunBag, "__init__", with_view)
    write_recording(
        tmp_path / "bag", scenario.graph, run.recording, {}, {}, state=StateStreams(scenario.graph, waits_s=0.0)
    )
    written = [(m.topic.name, m.cdr, m.log_time_ns) for m in Contents(tmp_path / "bag" / "bag_0.mcap").messages()]
    assert view.shown == written
    assert view.closed == 1
    assert {"/filtered_error", "/state/plant/attitude"} <= {topic for topic, _, _ in written}


def test_a_port_that_is_taken_is_named_before_anything_starts() -> None:
    with socket.socket() as other:
        other.bind(("127.0.0.1", 0))
        other.listen()
        port = other.getsockname()[1]
        with pytest.raises(ScenarioError, match=f"--live-port {port}: cannot be served"):
            check_live(port)
