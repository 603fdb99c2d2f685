"""Two ends of a topic and whatever is between them: what a message costs on the wire, one measurement at a time.

A writer and its readers are ROS nodes in processes of their own, with the message types and the DDS settings of
etac_ros. The writer publishes with pauses that are longer than a heartbeat period, as events of a spacecraft come, and
only what is sent from the first message on is counted.
"""

from __future__ import annotations

import ctypes
import multiprocessing
import os
import re
import select
import socket
import tempfile
import time
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from importlib.resources import files
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Any

import numpy as np
import rclpy
from rclpy.context import Context
from rclpy.impl.implementation_singleton import rclpy_implementation as _rclpy
from rclpy.node import Node
from rclpy.signals import SignalHandlerOptions
from wire_path import LossyPath, open_tap

from etac_ros.capture import pcapng
from etac_ros.capture.account import TopicWire
from etac_ros.capture.attribute import attribute
from etac_ros.capture.live import Capture, ports_of
from etac_ros.engines.ros.endpoints import profile
from etac_ros.engines.ros.environment import SET_ASIDE, dds_environment
from etac_ros.engines.ros.messages import encode, message_type
from etac_ros.graph.graph import USUAL_QOS, Qos
from etac_ros.graph.wire import Wire

TOPIC = "/value"
DOMAIN = 1
"""In a network of one's own nobody else is there."""
HERE, THERE = "10.77.0.1", "10.77.0.2"
GROUP = "239.255.0.7"
_CLONE_NEWNET = 0x40000000
_JOIN_S, _SETTLE_S, _DRAIN_S = 20.0, 0.4, 20.0


@dataclass(frozen=True)
class Setting:
    """What is measured.

    Attributes
    ----------
    wire, qos, receivers, messages
        Of the topic.
    pause_s
        Between two messages.
    multicast
        Whether readers ask for multicast.
    piggyback
        Whether a heartbeat may ride on data.
    heartbeat_s
        Period of heartbeats while something is not acknowledged.
    loss, delay_s, rate_bit_s, seed
        Of the path; None is the loopback.
    """

    wire: Wire
    qos: Qos = USUAL_QOS
    receivers: int = 1
    messages: int = 20
    pause_s: float = 0.06
    multicast: bool = False
    piggyback: bool = True
    heartbeat_s: float = 0.02
    loss: float | None = None
    delay_s: float = 0.0
    rate_bit_s: float = 0.0
    seed: int = 1


@dataclass(frozen=True)
class Measured:
    """What came of it.

    Attributes
    ----------
    topic
        The account of the topic.
    delivered
        Messages that each reader got.
    delays_s
        Of all of them, from publishing to taking.
    dropped
        Datagrams that the path has lost.
    """

    topic: TopicWire
    delivered: tuple[int, ...]
    delays_s: tuple[float, ...]
    dropped: int = 0


def measure(setting: Setting) -> Measured:
    """Make one measurement, in the network namespace of this process."""
    with tempfile.TemporaryDirectory() as folder:
        rig = _Rig(setting, Path(folder))
        try:
            return rig.run()
        finally:
            rig.end()


class _Rig:
    def __init__(self, setting: Setting, folder: Path) -> None:
        self._setting = setting
        self._folder = folder
        self._fork = multiprocessing.get_context("fork")
        self._processes: list[Any] = []
        self._taps: list[int] = []
        self._path: LossyPath | None = None
        self._capture: Capture | None = None

    def run(self) -> Measured:
        setting = self._setting
        addresses = ("127.0.0.1", "127.0.0.1") if setting.loss is None else (HERE, THERE)
        readers = []
        if setting.loss is None:
            self._capture = Capture(self._folder / "rig.pcapng", ports_of(DOMAIN))
            readers = [self._start(_read, addresses, None) for _ in range(setting.receivers)]
        else:
            ours, theirs = socket.socketpair()
            self._taps.append(open_tap("etac0", HERE))
            readers = [self._start(_read, addresses[::-1], theirs)]
            theirs.close()
            self._taps.append(socket.recv_fds(ours, 1, 1)[1][0])
            ours.close()
            ends = (self._taps[0], self._taps[1])
            self._path = LossyPath(
                ends, ports_of(DOMAIN), setting.loss, setting.delay_s, setting.rate_bit_s, setting.seed
            )
        writer = self._start(_write, addresses, None)
        for end in (writer, *readers):
            self._hear(end, "matched", _JOIN_S)
        self._wait(_SETTLE_S)
        began, began_monotonic = time.time(), time.monotonic()
        if self._path is not None:
            self._path.lossy = True
        writer.send("go")
        sent = self._hear(writer, "sent", _DRAIN_S + 2 * setting.messages * setting.pause_s)
        self._wait(_SETTLE_S)
        for end in readers:
            end.send("stop")
        got = [self._hear(end, "got", _JOIN_S) for end in readers]
        if self._path is not None:
            kept, since, missed = self._path.frames, began_monotonic, 0
        else:
            assert self._capture is not None
            missed = self._capture.stop()
            kept, since = list(pcapng.read(self._capture.path)), began
        account = attribute(
            [frame for when, frame in kept if when >= since],
            {TOPIC: setting.wire.payload_bytes},
            missed,
            [frame for when, frame in kept if when < since],
        )
        if missed or account.other:
            raise RuntimeError(f"{missed} frames were missed, and {account.other} is unexplained")
        delays = tuple(when - sent[number - 1] for times in got for number, when in times.items())
        dropped = 0 if self._path is None else self._path.dropped
        return Measured(account.topics[TOPIC], tuple(len(times) for times in got), delays, dropped)

    def end(self) -> None:
        for process in self._processes:
            process.kill()
            process.join()
        for tap in self._taps:
            os.close(tap)
        if self._capture is not None:
            self._capture.abandon()

    def _start(self, role: Callable[..., None], addresses: tuple[str, str], door: socket.socket | None) -> Connection:
        ours, theirs = self._fork.Pipe()
        arguments = (role, self._setting, self._profile(*addresses), theirs, door)
        process = self._fork.Process(target=_play, args=arguments, daemon=True)
        process.start()
        theirs.close()
        self._processes.append(process)
        return ours

    def _hear(self, end: Connection, word: str, seconds: float) -> Any:
        deadline = time.monotonic() + seconds
        while not end.poll():
            if time.monotonic() > deadline:
                raise RuntimeError(f"nobody said '{word}' within {seconds:g} s")
            self._wait(0.05, end.fileno())
        said, content = end.recv()
        if said != word:
            raise RuntimeError(f"'{word}' was expected, and '{said}' came: {content}")
        return content

    def _wait(self, seconds: float, *others: int) -> None:
        if self._path is not None:
            self._path.carry(seconds, *others)
        else:
            select.select(others, [], [], seconds)

    def _profile(self, own: str, other: str) -> Path:
        """The settings of a run of etac_ros, with other addresses and what is varied here."""
        text = files("etac_ros.engines.ros").joinpath("fastdds_profile_launched.xml").read_text()
        text = text.replace("<interfaceWhiteList><address>127.0.0.1<", f"<interfaceWhiteList><address>{own}<")
        # The first address is sought at many ports, one for each process of a machine.
        text = text.replace("<udpv4><address>127.0.0.1<", f"<udpv4><address>{other}<")
        peers = 12 if self._setting.loss is None else 2
        text = text.replace("<maxInitialPeersRange>110<", f"<maxInitialPeersRange>{peers}<")
        text = re.sub(
            r"<heartbeatPeriod>.*?</heartbeatPeriod>",
            f"<heartbeatPeriod><sec>{int(self._setting.heartbeat_s)}</sec>"
            f"<nanosec>{round(self._setting.heartbeat_s % 1 * 1e9)}</nanosec></heartbeatPeriod>",
            text,
        )
        writer = "" if self._setting.piggyback else "<disable_heartbeat_piggyback>true</disable_heartbeat_piggyback>"
        text = text.replace("</times>\n", f"</times>\n<qos>{writer}</qos>\n") if writer else text
        if self._setting.multicast:
            port = ports_of(DOMAIN).start + 1  # 9.6.2.3: that of a domain's user multicast
            locator = f"<locator><udpv4><port>{port}</port><address>{GROUP}</address></udpv4></locator>"
            reader = (
                '<data_reader profile_name="r" is_default_profile="true">'
                f"<multicastLocatorList>{locator}</multicastLocatorList></data_reader>"
            )
            text = text.replace("</profiles>", f"{reader}</profiles>")
        path = self._folder / f"{len(self._processes)}.xml"
        path.write_text(text)
        return path


def _play(
    role: Callable[..., None], setting: Setting, settings_file: Path, pipe: Connection, door: socket.socket | None
) -> None:
    """What a process does: enter its network, and play its role."""
    try:
        if door is not None:
            if ctypes.CDLL(None, use_errno=True).unshare(_CLONE_NEWNET):
                raise OSError(ctypes.get_errno(), "no network namespace")
            tap = open_tap("etac1", THERE)
            socket.send_fds(door, [b"t"], [tap])
            os.close(tap)
        for name in SET_ASIDE:
            os.environ.pop(name, None)
        os.environ.update(dds_environment(DOMAIN, private=True), FASTRTPS_DEFAULT_PROFILES_FILE=str(settings_file))
        context = Context()
        rclpy.init(
            args=["--ros-args", "--disable-external-lib-logs"],
            context=context,
            signal_handler_options=SignalHandlerOptions.NO,
        )
        node = Node(role.__name__.strip("_") + str(os.getpid()), context=context, enable_rosout=False,
                    start_parameter_services=False)  # fmt: skip
        role(setting, node, pipe, context)
    except BaseException as error:
        with suppress(OSError):
            pipe.send(("failed", f"{type(error).__name__}: {error}"))
    os._exit(0)


def _write(setting: Setting, node: Node, pipe: Connection, context: Context) -> None:
    publisher = node.create_publisher(message_type(setting.wire), TOPIC, profile(setting.qos))
    while publisher.get_subscription_count() < setting.receivers:
        time.sleep(0.01)
    pipe.send(("matched", None))
    pipe.recv()
    sent = []
    for number in range(setting.messages):
        value = setting.wire.rounded(np.linspace(0.1, 1.0, setting.wire.size) * (number + 1))
        serialized = encode(setting.wire, value, 0)
        sent.append(time.monotonic())
        publisher.publish(serialized)
        time.sleep(setting.pause_s)
    publisher.wait_for_all_acked(rclpy.duration.Duration(seconds=_DRAIN_S))
    pipe.send(("sent", sent))
    pipe.recv()


def _read(setting: Setting, node: Node, pipe: Connection, context: Context) -> None:
    kind = message_type(setting.wire)
    subscription = node.create_subscription(kind, TOPIC, lambda _: None, profile(setting.qos), raw=True)
    while not node.count_publishers(TOPIC):
        time.sleep(0.01)
    pipe.send(("matched", None))
    wait_set = _rclpy.WaitSet(1, 0, 0, 0, 0, 0, context.handle)
    times: dict[int, float] = {}
    while not pipe.poll():
        wait_set.clear_entities()
        wait_set.add_subscription(subscription.handle)
        wait_set.wait(20_000_000)
        while (taken := subscription.handle.take_message(kind, True)) is not None:
            times[int(taken[1]["publication_sequence_number"])] = time.monotonic()
    pipe.send(("got", times))
    pipe.recv()
