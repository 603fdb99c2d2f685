"""The state of every body as ROS tools expect it: attitude, transforms, rate, torque, and what is watched.

Computed of committed samples and of what actuators sent while both are recorded, thinned by simulated time. None of it
crosses a wire, and it is counted apart.

Orientation, said once: a message's ``orientation`` and ``rotation`` take components in the body frame to components
in the frame that its header names, as everywhere in ROS. That is ``q_BN`` of :mod:`etac_ros.maths` with its scalar
moved to the end: ``x, y, z, w = q1, q2, q3, q0``. Nothing is conjugated.
"""

from __future__ import annotations

import math
import re
import time
from collections import deque
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field, replace
from functools import partial
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from etac_ros.bag.markers import MARKERS_TYPE, arrow_tips, shape_mould, torque_mould
from etac_ros.bag.mould import Mould, mark, marked_stamp
from etac_ros.bag.topics import SHAPE, TopicDescription
from etac_ros.errors import RunError
from etac_ros.graph.channel import Way
from etac_ros.graph.graph import Graph
from etac_ros.graph.held import HeldInputs
from etac_ros.graph.ledger import Entry, Event
from etac_ros.graph.module import Arrival, Module, Window
from etac_ros.graph.plant import PlantModule
from etac_ros.graph.topics import TF, TF_STATIC, state_topic
from etac_ros.maths.quaternion import from_euler_321
from etac_ros.maths.ticks import nanoseconds
from etac_ros.maths.wall_clock import WallClock
from etac_ros.parameters import FloatArray
from etac_ros.plants.plant import Body, bodies_of, errors_of, has_attitude, watches_of
from etac_ros.plants.watch import Watch

WORLD = "world"
"""The root of all frames. The frames below it that are called references do not turn against it."""
SAMPLES = 500
"""So many samples a run are written, about, if no rate is asked for..."""
_OF_ALL_PLANTS = 4000
"""...and so many of all plants together: a large formation is shown more seldom, or it would be most of its bag."""
_AT_ONCE, WAITS_S = 4096, 1.0
"""Samples wait until there are so many, or for so long [wall s]: a batch costs hardly more than one, and no run should
be slower for it. When they are written says nothing of what is."""
_APART_M = 4.0
"""References of several plants stand apart by this in a view; their positions are not simulated."""
_ABOVE_M = 1.5
"""And a body whose attitude is relative to another stands above that."""
_POSE, _VECTOR, _NUMBER = "geometry_msgs/msg/PoseStamped", "geometry_msgs/msg/Vector3Stamped", "std_msgs/msg/Float64"
_TF = "tf2_msgs/msg/TFMessage"
_UPRIGHT = {"w": 1.0}
_Integers = npt.NDArray[np.int64]
_NO_WORD = re.compile(r"[^A-Za-z0-9]+")


class StateMessage(NamedTuple):
    """One message, with the tick that it tells of, and its number on its topic."""

    topic: str
    cdr: bytes
    tick: int
    sequence: int


class _Samples(NamedTuple):
    """What is known of a plant at some ticks."""

    ticks: _Integers
    states: FloatArray
    held: FloatArray
    watched: FloatArray
    """What modules beside the plant watch, one behind the other."""


@dataclass
class _Stream:
    """One topic: what its messages are made of."""

    topic: TopicDescription
    mould: Mould
    values: Callable[[_Samples], FloatArray]
    only_changes: bool = False
    late: bool = False
    """Whether it waits for the plant's ledger."""
    sent: int = 0
    last: FloatArray | None = field(default=None, repr=False)

    def messages(self, samples: _Samples, times_ns: _Integers) -> list[StateMessage]:
        values = np.asarray(self.values(samples), dtype=np.float64)
        ticks = samples.ticks
        if self.only_changes:
            before = np.full((1, values.shape[1]), np.nan) if self.last is None else self.last
            changed = (np.concatenate([before, values[:-1]]) != values).any(axis=1)
            self.last = values[-1:]
            ticks, values, times_ns = ticks[changed], values[changed], times_ns[changed]
        first = self.sent + 1
        self.sent += ticks.size
        cast = self.mould.cast(times_ns, values)
        name = self.topic.name
        return [
            StateMessage(name, cdr, tick, number)
            for number, (cdr, tick) in enumerate(zip(cast, ticks.tolist(), strict=True), start=first)
        ]


def period_ticks(graph: Graph, rate_hz: float | None) -> int:
    """Ticks from one sample to the next: never more samples than there are ticks, nor than asked for.

    Parameters
    ----------
    graph
        What runs.
    rate_hz
        Samples a simulated second; None takes about five hundred over the run, fewer of more than eight plants.
    """
    samples = min(SAMPLES, _OF_ALL_PLANTS / max(1, len(graph.plants)))
    ticks = graph.end_tick / samples if rate_hz is None else graph.ticks_per_second / rate_hz
    return max(1, math.ceil(ticks))


class StateStreams:
    """Makes the messages of a run's state, as truth and messages come.

    Parameters
    ----------
    graph
        What runs; only what its plants are is asked of it.
    rate_hz
        As for :func:`period_ticks`.
    wall
        The instants of ticks in a run in real time; of such a run torques are shown later than the rest: when they
        arrived only the plant's ledger tells.
    waits_s
        How long samples may wait for each other before they are handed out [wall s].
    watch_with
        A graph of the same scenario that no engine runs, and in which laws with memory are folded over the samples: it
        tells what modules watch. None shows what plants watch alone.
    """

    def __init__(
        self,
        graph: Graph,
        rate_hz: float | None = None,
        wall: WallClock | None = None,
        waits_s: float = WAITS_S,
        watch_with: Graph | None = None,
    ) -> None:
        period = period_ticks(graph, rate_hz)
        self._ticks_per_second = graph.ticks_per_second
        self._plants = {
            name: _Plant(graph, name, period, wall is not None, waits_s, watch_with) for name in graph.plants
        }
        self._wall = wall
        self._fixed = [shape for plant in self._plants.values() for shape in plant.shapes]
        references = [plant.references for plant in self._plants.values()]
        placed = [
            (WORLD, frame, (0.0, _APART_M * place, 0.0)) for place, some in enumerate(references) for frame in some
        ]
        if placed:
            self._fixed.insert(0, (TopicDescription(TF_STATIC, _TF, "state"), _once(_transforms_mould(placed, False))))
        self._fixed_sent = False
        self._tf_sent = 0
        topics = [topic for topic, _ in self._fixed]
        topics += [stream.topic for plant in self._plants.values() for stream in plant.streams]
        self.topics: tuple[TopicDescription, ...] = tuple(dict.fromkeys(topics))
        """What there will be."""

    def take_message(self, link: str, sequence: int, tick: int, step: int, value: FloatArray) -> None:
        """Take note of a message of a link that leads to a plant, in the order of sending."""
        for plant in self._plants.values():
            plant.take_message(link, sequence, tick, step, value)

    def take_ledger(self, plant: str, entries: list[Entry]) -> None:
        """Take note of what a plant of a run in real time noted down, in its order."""
        self._plants[plant].take_ledger(entries)

    def hears(self, link: str) -> bool:
        """Whether a link leads to a plant."""
        return any(link in plant.ways for plant in self._plants.values())

    def take_truth(self, plant: str, first: int, samples: FloatArray) -> None:
        """Take note of committed samples, from tick ``first`` on."""
        self._plants[plant].take_truth(first, samples)

    def _time_ns(self, tick: int) -> int:
        return nanoseconds(tick, self._ticks_per_second) if self._wall is None else self._wall.instant_ns(tick)

    def ready(self, until: int, everything: bool = False) -> Iterator[StateMessage]:
        """Messages that can be written, the topics of one plant after the other, each in the order of time.

        Parameters
        ----------
        until
            Up to this tick all that was sent has been taken.
        everything
            Whether to give what there is, be it little.

        Raises
        ------
        RunError
            If the plant is of a user's class, and cannot say what its samples mean.
        """
        for plant in self._plants.values():
            samples = plant.due(until, everything)
            if samples is not None:
                if not self._fixed_sent:
                    self._fixed_sent = True
                    yield from (StateMessage(topic.name, cdr, 0, 1) for topic, cdr in self._fixed)
                yield from self._messages(plant, samples, [one for one in plant.streams if not one.late])
            later = plant.due_later(everything)
            if later is not None:
                yield from self._messages(plant, later, [one for one in plant.streams if one.late])

    def _messages(self, plant: _Plant, samples: _Samples, streams: list[_Stream]) -> Iterator[StateMessage]:
        times = np.array([self._time_ns(tick) for tick in samples.ticks.tolist()])
        for stream in streams:
            try:
                messages = stream.messages(samples, times)
            except Exception as error:  # a user's class can fail in any way
                shows = f"what topic {stream.topic.name} shows"
                raise _speechless(plant.name, int(samples.ticks[0]), shows, error) from error
            if stream.topic.name == TF:  # one topic of all plants
                messages = [one._replace(sequence=self._tf_sent + 1 + place) for place, one in enumerate(messages)]
                self._tf_sent += len(messages)
            yield from messages


def _speechless(plant: str, tick: int, wanted: str, error: Exception) -> RunError:
    found = f"its class failed to say what they mean ({type(error).__name__}: {error})"
    return RunError(f"{plant}: samples from tick {tick} on", found, f"{wanted}, one row a sample")


class _Plant:
    def __init__(
        self, graph: Graph, name: str, period: int, in_real_time: bool, waits_s: float, watch_with: Graph | None
    ) -> None:
        module = graph.modules[name]
        assert isinstance(module, PlantModule)
        self.name = name
        self._plant = module.plant
        self._period = period
        self._in_real_time = in_real_time
        self._waits_s = waits_s
        hears = graph.hears[name]
        # What an acknowledged link brings follows from a conversation, not from the message alone.
        self._with_torque = all(link.acknowledged is None for link in hears)
        self._order = {link.name: number for number, link in enumerate(hears)}
        self._ports = {link.name: link.receivers[name] for link in hears}
        self.ways = {link.name: Way(link.channel, name) for link in hears}
        self._end_tick = graph.end_tick
        self._hold = HeldInputs(module.inputs, list(self._order))
        self._arrivals: list[tuple[int, int, int, int, Arrival]] = []
        # In real time: what was taken when, in the order of the ledger; values that were sent, with the tick of
        # sending; ticks whose torque is not shown yet; and up to which tick all that counts has been taken.
        self._links = list(graph.links)
        self._taken: deque[tuple[int, str, int]] = deque()
        self._sent: dict[tuple[str, int], tuple[int, FloatArray]] = {}
        self._later: list[int] = []
        self._settled = -1
        self._watchers = {} if watch_with is None else watchers_of(watch_with, name)
        self._width = module.state.size
        self._waiting: list[tuple[int, FloatArray]] = []
        """First tick and samples, already thinned."""
        self._waiting_rows = 0
        self._since = self._since_later = time.monotonic()
        self.references: tuple[str, ...] = ()
        """Frames that do not turn."""
        self.shapes: list[tuple[TopicDescription, bytes]] = []
        """What is said once."""
        try:
            self.streams = list(self._all_streams(module))
        except Exception as error:  # a user's class can fail in any way
            raise _speechless(name, 0, "angles, rates and watched quantities", error) from error

    def take_message(self, link: str, sequence: int, tick: int, step: int, value: FloatArray) -> None:
        way = self.ways.get(link)
        if way is None:
            return
        if self._in_real_time:
            self._sent[link, sequence] = tick, value
            return
        arrival = Arrival(self._ports[link], link, value)
        for when in way.arrivals(sequence, tick):
            if when < self._end_tick:
                self._arrivals.append((when, 1 if when > tick else step + 1, self._order[link], sequence, arrival))

    def take_ledger(self, entries: list[Entry]) -> None:
        taken = (entry for entry in entries if entry.event is Event.TAKEN)
        self._taken += ((entry.tick, self._links[entry.link], entry.sequence) for entry in taken)

    def take_truth(self, first: int, samples: FloatArray) -> None:
        skipped = -first % self._period
        thinned = samples[skipped :: self._period]
        if self._watchers:
            try:
                beside = [self._watched_by(node, first, samples) for node in self._watchers]
            except Exception as error:  # a user's class can fail in any way
                raise _speechless(self.name, first, "what modules watch", error) from error
            thinned = np.hstack([thinned, *(values[skipped :: self._period] for values in beside)])
        if thinned.shape[0]:
            self._waiting.append((first + skipped, thinned.copy()))
            self._waiting_rows += thinned.shape[0]

    def due(self, until: int, everything: bool) -> _Samples | None:
        """The samples up to a tick, if they are worth the while."""
        if not self._waiting or not (everything or self._waiting_rows >= _AT_ONCE or self._have_waited()):
            return None
        waiting = self._waiting
        ticks = [first + self._period * row for first, samples in waiting for row in range(samples.shape[0])]
        count = sum(tick <= until for tick in ticks)
        if count == 0:
            return None
        self._since = time.monotonic()
        states = np.concatenate([samples for _, samples in waiting])
        self._waiting = [(ticks[count], states[count:])] if count < len(ticks) else []
        self._waiting_rows -= count
        own, beside = states[:count, : self._width], states[:count, self._width :]
        if self._in_real_time:
            self._later += ticks[:count]
        held = np.empty((count, 0)) if self._in_real_time else self._held(ticks[:count])
        return _Samples(np.array(ticks[:count]), np.ascontiguousarray(own), held, beside)

    def due_later(self, everything: bool) -> _Samples | None:
        """In real time: ticks whose torque is known. The ledger tells in order, so an entry settles all before it."""
        while self._taken and self._taken[0][1:] in self._sent:
            tick, link, sequence = self._taken.popleft()
            self._arrives(tick, link, sequence, self._sent.pop((link, sequence))[1])
            self._settled = tick - 1
        if everything:  # of what no ledger tells: as a replay has it (:mod:`etac_ros.graph.replay`)
            for (link, sequence), (sent, value) in self._sent.items():
                self._arrives(sent + 1, link, sequence, value)
            self._sent.clear()
            self._settled = self._end_tick
        count = sum(tick <= self._settled for tick in self._later)
        if count == 0 or not (everything or count >= _AT_ONCE or self._have_waited_longer()):
            return None
        self._since_later = time.monotonic()
        ticks, self._later = self._later[:count], self._later[count:]
        return _Samples(np.array(ticks), np.empty((count, 0)), self._held(ticks), np.empty((count, 0)))

    def _have_waited_longer(self) -> bool:
        return time.monotonic() - self._since_later > self._waits_s

    def _arrives(self, tick: int, link: str, sequence: int, value: FloatArray) -> None:
        if tick < self._end_tick:
            arrival = Arrival(self._ports[link], link, value)
            self._arrivals.append((tick, 1, self._order[link], sequence, arrival))

    def _watched_by(self, node: str, first: int, samples: FloatArray) -> FloatArray:
        """What a module watches at each of the samples that follow those that it was shown before."""
        module, window = self._watchers[node], Window(self.name, 1, first, np.ascontiguousarray(samples))
        values = [np.asarray(watch.values, dtype=np.float64) for watch in module.watches(window)]
        module.advance(first + samples.shape[0] - 1, window)
        return np.hstack(values)

    def _have_waited(self) -> bool:
        return time.monotonic() - self._since > self._waits_s

    def _held(self, ticks: list[int]) -> FloatArray:
        """What the plant holds after all that arrived at each tick."""
        self._arrivals.sort(key=lambda entry: entry[:4])
        rows, taken = [], 0
        total = self._hold.total()
        for tick in ticks:
            before = taken
            while taken < len(self._arrivals) and self._arrivals[taken][0] <= tick:
                taken += 1
            if taken > before:
                total = self._hold.take(tuple(entry[4] for entry in self._arrivals[before:taken]))
            rows.append(total)
        del self._arrivals[:taken]
        return np.array(rows)

    def _all_streams(self, module: PlantModule) -> Iterator[_Stream]:
        state = module.state[np.newaxis]
        start = _Samples(
            np.zeros(1, dtype=np.int64), state, np.zeros((1, sum(module.inputs.values()))), np.empty((1, 0))
        )
        own, slices = self.name.strip("/"), _ports(module)
        bodies = tuple(body for body in bodies_of(self._plant) if _is_turned(body, start.states))
        frames = {body.frame: f"{own}/{body.frame}" if body.frame else own for body in bodies}
        parents = {body.frame: frames.get(body.parent, f"{own}/{body.parent}") for body in bodies}
        self.references = tuple(dict.fromkeys(parent for parent in parents.values() if parent not in frames.values()))
        if bodies:
            heights = {name: 0.0 if parent in self.references else _ABOVE_M for name, parent in parents.items()}
            turning = [(parents[name], frame, (0.0, 0.0, heights[name])) for name, frame in frames.items()]
            yield _Stream(TopicDescription(TF, _TF, "state"), _transforms_mould(turning, True), self._attitudes(bodies))
        for body in bodies:
            frame, parent, topic = frames[body.frame], parents[body.frame], partial(self._topic, body.frame)
            port = slices.get(body.port or next(iter(slices), ""), slice(0, 0))
            torque = partial(_held, port)
            yield _Stream(topic(_POSE, "attitude"), _pose_mould(parent), self._attitudes((body,)))
            yield _vectors(topic(_VECTOR, "rate"), frame, partial(_rates, body))
            yield _vectors(topic(_VECTOR, "euler_error_deg"), parent, partial(self._euler_errors, body))
            self.shapes.append((topic(MARKERS_TYPE, SHAPE), _once(shape_mould(frame))))
            if self._with_torque and port.stop - port.start == 3:
                arrows = partial(_arrows, torque)
                late = self._in_real_time
                yield replace(_vectors(topic(_VECTOR, "torque"), frame, torque), late=late)
                yield _Stream(topic(MARKERS_TYPE, "torque_arrow"), torque_mould(frame), arrows, True, late)
        if has_attitude(self._plant):
            yield _numbers(self._topic("", _NUMBER, "attitude_error_deg"), self._angle_errors)
        frame = next(iter(frames.values()), own)
        for number, watch in enumerate(watches_of(self._plant, start.states)):
            yield from _watched_streams(self.name, frame, watch, partial(self._watched, number))
        column = 0
        for node, watcher in self._watchers.items():
            for watch in watcher.watches(Window(self.name, 1, 0, state)):
                columns = slice(column, column + len(watch.axes))
                column = columns.stop
                yield from _watched_streams(node, frame, watch, partial(_beside, columns))

    def _topic(self, body: str, type_name: str, *words: str) -> TopicDescription:
        """A topic of the plant, or of one of its bodies where these have names."""
        return TopicDescription(state_topic(self.name, *((body,) if body else ()), *words), type_name, "state")

    def _errors(self, samples: _Samples) -> FloatArray:
        """States less reference; the reference is asked tick by tick, since samples are thinned."""
        if self._period == 1 or not hasattr(self._plant, "errors"):
            return errors_of(self._plant, samples.states, int(samples.ticks[0]))
        pairs = zip(samples.ticks.tolist(), samples.states, strict=True)
        return np.concatenate([errors_of(self._plant, state[np.newaxis], tick) for tick, state in pairs])

    def _euler_errors(self, body: Body, samples: _Samples) -> FloatArray:
        return np.degrees(body.euler_angles(self._errors(samples)))

    def _angle_errors(self, samples: _Samples) -> FloatArray:
        assert has_attitude(self._plant)
        return np.degrees(self._plant.attitude_angle(self._errors(samples)))[:, np.newaxis]

    def _watched(self, number: int, samples: _Samples) -> FloatArray:
        return watches_of(self._plant, samples.states)[number].values

    def _attitudes(self, bodies: tuple[Body, ...]) -> Callable[[_Samples], FloatArray]:
        last: dict[int, FloatArray] = {}

        def values(samples: _Samples) -> FloatArray:
            parts = []
            for place, body in enumerate(bodies):
                q = quaternions_of(body, samples.states)
                joined = np.concatenate([last.get(place, q[:1]), q])
                turns = np.einsum("ij,ij->i", joined[1:], joined[:-1]) < 0.0
                q = np.where(np.cumsum(turns)[:, np.newaxis] % 2, -q, q)  # one attitude: curves should not jump
                last[place] = q[-1:]
                parts.append(np.roll(q, -1, axis=1))
            return np.hstack(parts)

        return values


def quaternions_of(body: Body, states: FloatArray) -> FloatArray:
    """Attitude of a body at states as unit quaternions ``q_BN``, scalar first, shape (n, 4)."""
    if body.quaternions is not None:
        return np.asarray(body.quaternions(states), dtype=np.float64)
    return np.array([from_euler_321(angles) for angles in np.asarray(body.euler_angles(states)).tolist()])


def _is_turned(body: Body, states: FloatArray) -> bool:
    """Whether a body turns in space: what turns about fewer axes has no attitude to show."""
    shapes = {np.shape(body.euler_angles(states)), np.shape(body.rates(states))}
    return shapes == {(states.shape[0], 3)}


def watchers_of(graph: Graph, plant: str) -> dict[str, Module]:
    """The modules beside a plant that watch something of it, and what that is follows from its samples.

    It does not where a rule compares with what was acknowledged.
    """
    readers = [
        name
        for name, read in graph.reads.items()
        if read == plant
        and name not in graph.plants
        and all(link.acknowledged is None for link in graph.sends.get(name, ()))
    ]
    return {name: graph.modules[name] for name in readers if type(graph.modules[name]).watches is not Module.watches}


def _watched_streams(
    node: str, frame: str, watch: Watch, values: Callable[[_Samples], FloatArray]
) -> Iterator[_Stream]:
    """A vector where the axes are those of a body, else a number an axis."""
    words = ("watched", _word(watch.name))
    if watch.axes == ("x", "y", "z"):
        yield _vectors(TopicDescription(state_topic(node, *words), _VECTOR, "state"), frame, values)
        return
    for column, axis in enumerate(watch.axes):
        more = (_word(axis),) if len(watch.axes) > 1 else ()
        topic = TopicDescription(state_topic(node, *words, *more), _NUMBER, "state")
        yield _numbers(topic, partial(_column, column, values))


def _column(column: int, values: Callable[[_Samples], FloatArray], samples: _Samples) -> FloatArray:
    return values(samples)[:, column : column + 1]


def _beside(columns: slice, samples: _Samples) -> FloatArray:
    return samples.watched[:, columns]


def _numbers(topic: TopicDescription, values: Callable[[_Samples], FloatArray]) -> _Stream:
    return _Stream(topic, Mould(_NUMBER, {"data": mark(0)}, 1), values)


def _vectors(topic: TopicDescription, frame: str, values: Callable[[_Samples], FloatArray]) -> _Stream:
    return _Stream(topic, _vector_mould(frame), values)


def _rates(body: Body, samples: _Samples) -> FloatArray:
    return body.rates(samples.states)


def _held(port: slice, samples: _Samples) -> FloatArray:
    return samples.held[:, port]


def _arrows(torques: Callable[[_Samples], FloatArray], samples: _Samples) -> FloatArray:
    return arrow_tips(torques(samples))


def _ports(module: PlantModule) -> dict[str, slice]:
    places, start = {}, 0
    for port, size in module.inputs.items():
        places[port] = slice(start, start + size)
        start += size
    return places


def _word(text: str) -> str:
    """A name as a part of a topic."""
    word = _NO_WORD.sub("_", text).strip("_").lower()
    return word if word[:1].isalpha() else f"n{word}"


def _once(mould: Mould) -> bytes:
    return mould.cast(np.zeros(1, dtype=np.int64), np.empty((1, 0)))[0]


def _header(frame: str) -> dict[str, Any]:
    return {"stamp": marked_stamp(), "frame_id": frame}


def _marks(names: str, first: int = 0) -> dict[str, float]:
    return {name: mark(first + number) for number, name in enumerate(names)}


def _pose_mould(frame: str) -> Mould:
    return Mould(_POSE, {"header": _header(frame), "pose": {"orientation": _marks("xyzw")}}, 4)


def _vector_mould(frame: str) -> Mould:
    return Mould(_VECTOR, {"header": _header(frame), "vector": _marks("xyz")}, 3)


def _transforms_mould(joined: list[tuple[str, str, tuple[float, float, float]]], turning: bool) -> Mould:
    """Transforms of frames within frames: parent, child and where the child stands [m]."""
    transforms = [
        {
            "header": _header(parent),
            "child_frame_id": child,
            "transform": {
                "translation": dict(zip("xyz", at, strict=True)),
                "rotation": _marks("xyzw", 4 * place) if turning else _UPRIGHT,
            },
        }
        for place, (parent, child, at) in enumerate(joined)
    ]
    return Mould(_TF, {"transforms": transforms}, 4 * len(joined) if turning else 0)
