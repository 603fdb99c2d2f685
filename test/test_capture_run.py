"""A run that is captured: its account agrees with a reading of the kept file by another program, and with the model.

scapy takes the frames apart here: it has dissectors of its own for pcapng, Ethernet, IP, UDP and RTPS.
"""

from __future__ import annotations

import errno
import json
import socket
from collections import Counter
from pathlib import Path
from typing import Any

import pytest
from scapy.contrib.rtps import RTPS, RTPSMessage
from scapy.layers.inet import UDP
from scapy.layers.l2 import Ether
from scapy.utils import RawPcapNgReader
from typer.testing import CliRunner

from etac_ros.bag.metadata import read_custom_data
from etac_ros.capture.account import Cause
from etac_ros.capture.kept import read_from_bag
from etac_ros.capture.live import CannotCapture, Capture, open_socket, ports_of
from etac_ros.cli.main import app
from etac_ros.errors import BagError, RunError
from etac_ros.metrics.summary import Summary
from etac_ros.report.source import read_run
from etac_ros.runs import RosOptions, run_over_ros
from etac_ros.scenario.load import load

LINKS = {"wu2018": ("/filtered_error", "/torque_command"), "qi2022": ("/pm/relative", "/sm/torque_s")}
NAMES = {Cause.DATA: "DATA", Cause.HEARTBEAT: "HEARTBEAT", Cause.ACKNACK: "ACKNACK"}


def may_capture() -> str:
    """Why this process may not capture; empty if it may."""
    try:
        open_socket(range(1, 2)).close()
    except CannotCapture as error:
        return f"{error.found}; needs {error.expected}"
    return ""


captures = pytest.mark.skipif(bool(may_capture()), reason=may_capture())


class Independent:
    """What scapy says of a file: frames and their bytes by topic and first submessage, without the recorder's."""

    def __init__(self, path: Path) -> None:
        frames = [frame for frame, _ in RawPcapNgReader(str(path))]
        self.total, self.frames = sum(map(len, frames)), len(frames)
        self.found: Counter[tuple[str, str]] = Counter()
        self.bytes: Counter[tuple[str, str]] = Counter()
        # Announcements of participants are most of it, take scapy a millisecond each, and are not needed here.
        taken = [(frame, *self._take_apart(frame)) for frame in frames if b"\x00\x01\x00\xc2" not in frame]
        topics: dict[bytes, str] = {}
        places: dict[int, bytes] = {}
        for _, _, _, submessages in taken:
            for submessage in submessages:
                self._learn(submessage, topics, places)
        recorder = {guid[:12] for guid, topic in topics.items() if topic.endswith("/truth") and guid[15] == 4}
        for frame, port, prefix, submessages in taken:
            first = next((one for one in submessages if {"writer_id", "writerEntityIdKey"} & set(one.fields)), None)
            if first is None or recorder & {prefix, places.get(port)}:
                continue
            kind = type(first).__name__.removeprefix("RTPSSubMessage_")
            if kind == "DATA":
                entity = (first.writerEntityIdKey << 8 | first.writerEntityIdKind).to_bytes(4, "big")
            else:
                entity = first.reader_id if kind == "ACKNACK" else first.writer_id
            topic = topics.get(prefix + entity, "").removeprefix("rt")
            self.found[topic, kind] += 1
            self.bytes[topic, kind] += len(frame)

    @staticmethod
    def _take_apart(frame: bytes) -> tuple[int, bytes, list[Any]]:
        datagram = Ether(frame)[UDP]
        message = RTPS(bytes(datagram.payload))
        return datagram.dport, bytes(message.guidPrefix), message.getlayer(RTPSMessage).submessages

    @staticmethod
    def _learn(submessage: Any, topics: dict[bytes, str], places: dict[int, bytes]) -> None:
        topic, guid, ports = "", b"", []
        for part in getattr(submessage, "data", None) or []:
            for parameter in getattr(getattr(part, "parameterList", None), "parameterValues", []):
                if type(parameter).__name__ == "PID_ENDPOINT_GUID":
                    guid = bytes(parameter.guid)
                elif type(parameter).__name__ == "PID_TOPIC_NAME":
                    topic = parameter.parameterData[4:].rstrip(b"\0").decode()
                elif type(parameter).__name__ == "PID_UNICAST_LOCATOR":
                    ports.append(parameter.locator.port)
        if topic:
            topics[guid] = topic
            places.update(dict.fromkeys(ports, guid[:12]))


@captures
@pytest.mark.parametrize(("scenario", "duration_s"), [("wu2018", 100), ("qi2022", 0.5)])
def test_account_agrees_with_an_independent_reading(scenario: str, duration_s: float, tmp_path: Path) -> None:
    file, summary_file = tmp_path / "run.pcapng", tmp_path / "summary.json"
    arguments = ["run", scenario, "--set", f"duration_s={duration_s}", "--capture", str(file)]
    done = CliRunner().invoke(app, [*arguments, "--json", str(summary_file), "--bag", str(tmp_path / "bag")])
    assert done.exit_code == 0, done.output
    summary = Summary.model_validate_json(summary_file.read_text())
    wire = summary.wire
    assert wire is not None
    assert wire.missed_frames == 0
    independent = Independent(file)
    assert (wire.frames, wire.total_bytes) == (independent.frames, independent.total)
    assert (wire.attributed.frames, wire.attributed.total_bytes) == (independent.frames, independent.total)
    assert wire.other == {}
    for name in LINKS[scenario]:
        topic, counted = wire.topics[name], summary.topics[name]
        assert topic.messages == counted.messages > 0
        sent = topic.causes[Cause.DATA]
        assert sent.payload_bytes == counted.payload_bytes
        assert sent.payload_bytes + sent.cdr_bytes == counted.cdr_bytes
        assert sent.total_bytes == counted.model_wire_bytes
        for cause, kind in NAMES.items():
            assert topic.causes[cause].frames == independent.found[name, kind]
        assert topic.all_causes.total_bytes == sum(independent.bytes[name, kind] for kind in NAMES.values())
    assert "On the wire" in done.output
    assert read_from_bag(tmp_path / "bag") == wire
    shown = CliRunner().invoke(app, ["info", str(tmp_path / "bag")])
    assert "all that was captured" in shown.output
    assert read_run(tmp_path / "bag").summary.wire == wire  # which the report shows


@captures
def test_recorder_is_apart_in_real_time_too(tmp_path: Path) -> None:
    """Its nodes have other topics of the emulation plane; a message to one receiver is one frame of data."""
    arguments = ["run", "wu2018", "--set", "duration_s=5", "--clock", "wall", "--rate", "20", "--capture"]
    done = CliRunner().invoke(app, [*arguments, "--json", str(tmp_path / "a.json"), "--bag", str(tmp_path / "bag")])
    assert done.exit_code == 0, done.output
    wire = Summary.model_validate_json((tmp_path / "a.json").read_text()).wire
    assert wire is not None
    assert wire.other == {}
    topic = wire.topics["/torque_command"]
    assert topic.causes[Cause.DATA].frames - topic.resent == topic.messages > 0
    assert topic.recorder.payload_bytes >= 12 * topic.messages


def test_model_stands_where_nothing_was_captured(tmp_path: Path) -> None:
    """84 messages of 12 bytes, each a frame of 174 to its one receiver, the recorder being another."""
    arguments = ["run", "wu2018", "--engine", "inprocess", "--bag", str(tmp_path / "bag")]
    for command in (arguments, ["info", str(tmp_path / "bag")]):
        shown = CliRunner().invoke(app, command, env={"COLUMNS": "160"})
        assert shown.exit_code == 0, shown.output
        (row,) = [line.split() for line in shown.output.splitlines() if line.startswith("/torque_command")]
        assert row[2:6] == ["84", "1,008", "1,344", f"{84 * 174:,}"]
        assert "on Ethernet*" in shown.output
        assert "* a model" in shown.output


@captures
def test_only_the_domain_is_captured_and_each_datagram_once(tmp_path: Path) -> None:
    file = tmp_path / "some.pcapng"
    with pytest.raises(CannotCapture, match="no such interface"):
        open_socket(range(1, 2), "nosuch0")
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as inside, socket.socket(type=socket.SOCK_DGRAM) as outside:
        inside.bind(("127.0.0.1", 0))
        outside.bind(("127.0.0.1", 0))
        port = inside.getsockname()[1]
        capture = Capture(file, range(port, port + 1))
        for text in (b"one", b"two"):
            inside.sendto(text, inside.getsockname())
            inside.sendto(text, outside.getsockname())
        assert capture.stop() == 0
    payloads = [bytes(Ether(bytes(packet))[UDP].payload) for packet, _ in RawPcapNgReader(str(file))]
    assert payloads == [b"one", b"two"]


def test_run_goes_on_where_nothing_may_be_captured(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    def refuse(*arguments: Any) -> None:
        raise PermissionError(errno.EPERM, "Operation not permitted")

    monkeypatch.setattr("etac_ros.capture.live.socket.socket", refuse)
    with pytest.raises(CannotCapture, match="CAP_NET_RAW"):
        open_socket(ports_of(7))
    monkeypatch.undo()
    monkeypatch.setattr("etac_ros.capture.live.open_socket", _not_here)
    run = run_over_ros(load("wu2018", None, ["duration_s=10"]), tmp_path / "bag", RosOptions(capture=True))
    assert run.summary.wire is None
    assert run.summary.topics["/filtered_error"].messages > 0
    assert "the run goes on, and nothing is captured" in capfd.readouterr().err
    assert "wire" not in read_custom_data(tmp_path / "bag")


def _not_here(ports: range, interface: str) -> None:
    raise CannotCapture("--capture", "not on this machine")


@captures
def test_file_that_cannot_be_written_is_named(tmp_path: Path) -> None:
    with pytest.raises(RunError, match=r"run\.pcapng: cannot be written"):
        Capture(tmp_path / "nowhere" / "run.pcapng", range(1, 2))


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["--engine", "inprocess", "--capture"], "by calls nothing is on a wire"),
        (["--capture", "nowhere/run.pcapng"], "nowhere/run.pcapng: may not be written to"),
    ],
)
def test_request_that_makes_no_sense_starts_nothing(arguments: list[str], words: str) -> None:
    done = CliRunner().invoke(app, ["run", "wu2018", *arguments])
    assert words in str(done.exception)


def test_account_in_a_bag_that_is_none(tmp_path: Path) -> None:
    metadata = {"rosbag2_bagfile_information": {"topics_with_message_count": [], "custom_data": {"wire": "{}"}}}
    (tmp_path / "metadata.yaml").write_text(json.dumps(metadata))
    with pytest.raises(BagError, match=r"custom_data\.wire"):
        read_from_bag(tmp_path)
