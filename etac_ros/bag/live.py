"""A run as it happens, for Foxglove: what the recorder writes is served over a WebSocket at the same time."""

from __future__ import annotations

import importlib.util
import socket
from collections.abc import Sequence
from typing import Any, Protocol

from etac_ros.bag.definitions import schema_text
from etac_ros.bag.topics import TopicDescription
from etac_ros.errors import ScenarioError

HOST = "127.0.0.1"
PORT = 8765
"""Where Foxglove looks for a connection unless it is told otherwise."""
LIVE_WAITS_S = 0.05
"""How long samples of the state may wait for each other [wall s]."""


class Viewer(Protocol):
    """Who is shown messages while they are recorded."""

    def show(self, topic: str, cdr: bytes, log_time_ns: int) -> None:
        """Show a message."""
        ...

    def close(self) -> None:
        """Show no more."""
        ...


class Viewers:
    """Several of them."""

    def __init__(self, viewers: Sequence[Viewer]) -> None:
        self._viewers = viewers

    def show(self, topic: str, cdr: bytes, log_time_ns: int) -> None:
        """Show all of them a message."""
        for viewer in self._viewers:
            viewer.show(topic, cdr, log_time_ns)

    def close(self) -> None:
        """Show no more."""
        for viewer in self._viewers:
            viewer.close()


def check_live(port: int) -> None:
    """Make sure that a run can be served, and start nothing.

    Raises
    ------
    ScenarioError
        If the package that serves is not installed, or something else listens on the port.
    """
    if importlib.util.find_spec("foxglove") is None:
        found = "needs the package foxglove-sdk, which is not installed here"
        raise ScenarioError("--live", found, "", "install etac_ros with its extra 'live', or foxglove-sdk itself")
    with socket.socket() as probe:
        probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        try:
            probe.bind((HOST, port))
        except OSError as error:
            found = f"cannot be served on {HOST}: {error.strerror or error}"
            raise ScenarioError(f"--live-port {port}", found, "a port that nobody listens on") from None


class LiveView:
    """Serves messages to whoever is connected; nobody has to be.

    A slow viewer loses messages, and slows nobody down.

    Parameters
    ----------
    topics
        What may be shown: of these, the emulation's and those for our own readers are left out.
    name
        What the viewer shows as the source.
    port
        Where to listen, on this machine only.
    """

    def __init__(self, topics: Sequence[TopicDescription], name: str, port: int) -> None:
        import foxglove  # only where a run is watched: it brings a server of its own

        self._said: dict[str, tuple[bytes, int]] = {}
        self._latched = {topic.name for topic in topics if topic.latched}
        self._context = foxglove.Context()
        self._channels: dict[str, Any] = {
            topic.name: foxglove.Channel(
                topic.name,
                schema=foxglove.Schema(
                    name=topic.type_name, encoding="ros2msg", data=schema_text(topic.type_name).encode()
                ),
                message_encoding="cdr",
                context=self._context,
            )
            for topic in topics
            if topic.kind in ("network", "internal", "state")
        }
        self._server = foxglove.start_server(
            name=name, host=HOST, port=port, server_listener=_Listener(self), context=self._context
        )

    @property
    def port(self) -> int:
        """Where it listens."""
        return int(self._server.port)

    def show(self, topic: str, cdr: bytes, log_time_ns: int) -> None:
        """Show a message to all who want to see its topic."""
        channel = self._channels.get(topic)
        if channel is None:
            return
        if topic in self._latched:
            self._said[topic] = cdr, log_time_ns
        channel.log(cdr, log_time=log_time_ns)

    def say_again(self, topic: str) -> None:
        """What is said but once, for somebody who has just come."""
        said = self._said.get(topic)
        if said is not None:
            self._channels[topic].log(said[0], log_time=said[1])

    def close(self) -> None:
        """Take leave of all viewers."""
        self._server.stop()


class _Listener:
    def __init__(self, view: LiveView) -> None:
        self._view = view

    def on_subscribe(self, client: Any, channel: Any) -> None:
        self._view.say_again(channel.topic)

    def __getattr__(self, name: str) -> Any:
        """Nothing else of what viewers do concerns us."""
        if not name.startswith("on_"):
            raise AttributeError(name)
        return lambda *arguments: None
