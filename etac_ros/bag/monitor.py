"""A run as it happens, in figures for people: what was sent so far, how large the error is, what happened on the air.

The recorder shows it every message that it writes; whoever shows the figures may be another process, which gets
pictures of them now and then. Nothing of it comes back: no result depends on somebody looking.
"""

from __future__ import annotations

import contextlib
import pickle
import socket
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

import numpy as np

from etac_ros.bag.codec import decode_truth
from etac_ros.graph.air import from_rows
from etac_ros.graph.graph import Graph, Link
from etac_ros.graph.plant import PlantModule
from etac_ros.graph.topics import AIR, truth_topic
from etac_ros.maths.ticks import NANOSECONDS
from etac_ros.maths.wall_clock import WallClock
from etac_ros.media.frame import Fate, Outcome, link_and_place
from etac_ros.parameters import FloatArray
from etac_ros.plants.plant import errors_of, has_attitude

PLACES = 120
"""Of the history of an error: so many over the whole run, so that a curve also tells how far the run is."""
EVERY_S = 0.1
"""Wall time between two pictures."""
_MOST_BYTES = 1 << 20


@dataclass
class Flow:
    """What was sent on a link.

    Attributes
    ----------
    messages, payload_bytes, cdr_bytes
        So far.
    last_tick
        Of sending; negative before the first.
    """

    messages: int = 0
    payload_bytes: int = 0
    cdr_bytes: int = 0
    last_tick: int = -1


@dataclass
class AirTraffic:
    """What happened on a shared medium so far.

    Attributes
    ----------
    frames, collided, lost
        That were on the air alone, that met another, and that never came through: given up, or dropped from a queue.
    busy_ns
        During which somebody sent [ns].
    waited_ns
        From the offer to the air, of the newest frame that was sent [ns].
    waiting
        Messages that were sent and whose fate is not told yet: in queues, or on the air.
    """

    frames: int = 0
    collided: int = 0
    lost: int = 0
    busy_ns: int = 0
    waited_ns: int = 0
    waiting: int = 0


@dataclass
class Picture:
    """A run at one moment.

    Attributes
    ----------
    tick
        How far it is.
    from_tick
        From where on it has been seen: what happened on the air before, and histories, are not known.
    flows
        By link, in the order of the graph.
    fired
        Triggering instants of each module that triggers.
    errors_deg
        Attitude error by plant that has one: the newest, NaN before the first.
    histories_deg
        The same over the run: :data:`PLACES` places from its first tick to its end, NaN where nothing is known.
    air
        By medium.
    """

    tick: int = 0
    from_tick: int = 0
    flows: dict[str, Flow] = field(default_factory=dict)
    fired: dict[str, int] = field(default_factory=dict)
    errors_deg: dict[str, float] = field(default_factory=dict)
    histories_deg: dict[str, FloatArray] = field(default_factory=dict)
    air: dict[str, AirTraffic] = field(default_factory=dict)


class Monitor:
    """Adds up what is recorded of a run.

    Parameters
    ----------
    graph
        What runs; only what its links and plants are is asked of it.
    wall
        The instants of ticks in a run in real time; None of one in simulated time.
    tell
        Given a picture now and then, and a last one.
    clock
        Wall time [s].
    """

    def __init__(
        self,
        graph: Graph,
        wall: WallClock | None = None,
        tell: Callable[[Picture], None] = lambda picture: None,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        self._graph = graph
        self._wall = wall
        self._tell = tell
        self._clock = clock
        self._told = clock()
        self._links = {link.topic: link for link in graph.links.values()}
        self._plants = {truth_topic(plant): plant for plant in graph.plants}
        self._mediums = {line: name for name, plan in graph.media.items() for line in plan.lines}
        self._settled = dict.fromkeys(graph.links, 0)
        self._busy_until_ns = dict.fromkeys(graph.media, 0)
        triggering = [name for name, module in graph.modules.items() if module.triggers]
        self._of_trigger = {
            name: [link.name for link in graph.sends[name] if link.port == graph.modules[name].triggers]
            for name in triggering
        }
        with_attitude = [name for name in graph.plants if self._module(name) is not None]
        self.picture = Picture(
            flows={name: Flow() for name in graph.links},
            fired=dict.fromkeys(triggering, 0),
            errors_deg=dict.fromkeys(with_attitude, np.nan),
            histories_deg={name: np.full(PLACES, np.nan) for name in with_attitude},
            air={name: AirTraffic() for name in graph.media},
        )

    def show(self, topic: str, cdr: bytes, log_time_ns: int) -> None:
        """Take note of a message that was recorded."""
        link = self._links.get(topic)
        if link is not None:
            flow = self.picture.flows[link.name]
            self.sent(link, flow.messages + 1, len(cdr), self._tick(log_time_ns))
        elif topic in self._plants:
            self.committed(self._plants[topic], *decode_truth(cdr))
        elif topic == AIR:
            for fate in from_rows(decode_truth(cdr)[1], list(self._graph.links)):
                self.landed(fate)
        else:
            return
        now = self._clock()
        if now - self._told >= EVERY_S:
            self._told = now
            self._tell(self.picture)

    def close(self) -> None:
        """The run is over."""
        self._tell(self.picture)

    def sent(self, link: Link, messages: int, cdr_bytes: int, tick: int) -> None:
        """Take note of a message of a link, which makes so many; all of a link are of one size."""
        flow = self.picture.flows[link.name]
        flow.messages = messages
        flow.payload_bytes = messages * link.wire.payload_bytes
        flow.cdr_bytes = messages * cdr_bytes
        flow.last_tick = tick
        self.reached(tick)
        if link.name in self._of_trigger.get(link.sender, ()):
            counts = [self.picture.flows[name].messages for name in self._of_trigger[link.sender]]
            self.picture.fired[link.sender] = max(counts)  # one message a link and instant
        if link.medium:
            self._count_waiting(link.medium)

    def committed(self, plant: str, first: int, samples: FloatArray) -> None:
        """Take note of committed samples of a plant, from tick ``first`` on."""
        if not samples.shape[0]:
            return
        last = first + samples.shape[0] - 1
        self.reached(last)
        if plant not in self.picture.errors_deg:
            return
        # The last sample of each place of the history is all that is kept.
        ends = {self._place(tick): tick for tick in range(first, last + 1, max(1, self._graph.end_tick // PLACES // 2))}
        ends[self._place(last)] = last
        for place, tick in ends.items():
            error = self._error_deg(plant, samples[tick - first], tick)
            self.picture.histories_deg[plant][place] = error
            if tick == last:
                self.picture.errors_deg[plant] = error

    def landed(self, fate: Fate) -> None:
        """Take note of what became of a frame on a medium."""
        medium = self._mediums.get(fate.link)
        if medium is None:
            return
        traffic = self.picture.air[medium]
        # Who meets another is on the air with it: that time counts once.
        traffic.busy_ns += max(0, fate.end_ns - max(fate.start_ns, self._busy_until_ns[medium]))
        self._busy_until_ns[medium] = max(self._busy_until_ns[medium], fate.end_ns)
        if fate.outcome is Outcome.COLLIDED:
            traffic.collided += 1
            return
        if fate.outcome is Outcome.SENT:
            traffic.frames += 1
            traffic.waited_ns = fate.start_ns - fate.offered_ns
        else:
            traffic.lost += 1
        name, answers = link_and_place(fate.link)
        if not answers:
            self._settled[name] = max(self._settled[name], fate.sequence)
            self._count_waiting(medium)

    def _count_waiting(self, medium: str) -> None:
        links = (link.name for link in self._graph.links.values() if link.medium == medium)
        waiting = (self.picture.flows[name].messages - self._settled[name] for name in links)
        self.picture.air[medium].waiting = sum(max(0, count) for count in waiting)

    def _tick(self, log_time_ns: int) -> int:
        if self._wall is not None:
            return max(0, self._wall.tick_at(log_time_ns))
        # Times of ticks are rounded down to a nanosecond, and steps within a tick are nanoseconds behind it.
        return (log_time_ns + 1) * self._graph.ticks_per_second // NANOSECONDS

    def reached(self, tick: int) -> None:
        """Take note of how far the run is."""
        self.picture.tick = max(self.picture.tick, min(tick, self._graph.end_tick))

    def _place(self, tick: int) -> int:
        return min(PLACES - 1, tick * PLACES // max(1, self._graph.end_tick))

    def _module(self, plant: str) -> PlantModule | None:
        module = self._graph.modules[plant]
        assert isinstance(module, PlantModule)
        return module if has_attitude(module.plant) else None

    def _error_deg(self, plant: str, state: FloatArray, tick: int) -> float:
        module = self._module(plant)
        assert module is not None
        assert has_attitude(module.plant)
        with contextlib.suppress(Exception):  # a user's class can fail in any way; who computes with it says so
            errors = errors_of(module.plant, np.ascontiguousarray(state[np.newaxis]), tick)
            return float(np.degrees(module.plant.attitude_angle(errors)[0]))
        return float("nan")


class Outlet:
    """A way for pictures from the process that takes them to the one that shows them, which it has been forked of.

    Where they are not taken out they are lost, and nobody waits for that.

    Parameters
    ----------
    on_picture
        Who wants them; None for nobody, and then there is no way.
    """

    def __init__(self, on_picture: Callable[[Picture], None] | None) -> None:
        self._on_picture = on_picture
        self._ends: tuple[socket.socket, ...] = ()
        self.take: Callable[[Picture], None] | None = None
        """Takes a picture, in the other process; None where nobody wants them."""
        if on_picture is not None:
            self._ends = socket.socketpair(socket.AF_UNIX, socket.SOCK_DGRAM)
            for end in self._ends:
                end.setblocking(False)
            self.take = self._send

    def after(self, on_progress: Callable[[int, Mapping[str, int]], None]) -> Callable[[int, Mapping[str, int]], None]:
        """What does the same, and then hands on pictures."""
        if self._on_picture is None:
            return on_progress

        def both(tick: int, fired: Mapping[str, int]) -> None:
            on_progress(tick, fired)
            self.hand_on()

        return both

    def hand_on(self) -> None:
        """Hand on the newest picture, if one has come."""
        found: Picture | None = None
        if self._ends:
            with contextlib.suppress(BlockingIOError):
                while True:
                    found = pickle.loads(self._ends[0].recv(_MOST_BYTES))
        if found is not None and self._on_picture is not None:
            self._on_picture(found)

    def close(self) -> None:
        """No more."""
        for end in self._ends:
            end.close()

    def _send(self, picture: Picture) -> None:
        with contextlib.suppress(OSError):
            self._ends[1].send(pickle.dumps(picture))
