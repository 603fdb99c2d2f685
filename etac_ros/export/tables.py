"""The tables of a bag: what stands in each, and in which columns.

Tables of samples are tidy: a row is one number, with its time, whose it is, what it is, which component, and its unit.
Tables of events have a row an event.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property, partial
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import pyarrow as pa

from etac_ros.errors import BagError
from etac_ros.graph import replay
from etac_ros.graph.graph import Graph
from etac_ros.graph.recording import Recording
from etac_ros.maths.ticks import seconds
from etac_ros.metrics import curves
from etac_ros.metrics.curves import Curve
from etac_ros.parameters import FloatArray
from etac_ros.plants.plant import Body, Plant, bodies_of
from etac_ros.report.source import ReportedRun, read_run

_XYZ = ("x", "y", "z")
_LONGEST_PERIOD = 2.0**62
"""More ticks than any run has, in an int64."""
_PartsOf = Callable[[str], Iterator[Recording]]
"""The recording in parts, by plant, as :meth:`Recording.parts` gives it."""
_LABEL = re.compile(r"(.*?)(?: \[(.*)\])?")


@dataclass(frozen=True)
class Series:
    """One quantity of a node over time.

    Attributes
    ----------
    node
        Of a plant's bodies, that under which ``/state`` shows them: ``/plant``, ``/sim/plant/pm``.
    quantity, unit
        What it is, and in what unit; ``1`` for none.
    components
        Names of the columns.
    ticks
        Shape (n,), ascending.
    values
        Shape (n, components).
    """

    node: str
    quantity: str
    unit: str
    components: tuple[str, ...]
    ticks: npt.NDArray[np.int64]
    values: FloatArray


class BagTables:
    """The tables of one bag. :func:`open_bag` makes it.

    Tables of samples have the columns ``time_s``, ``tick``, ``node``, ``quantity``, ``component``, ``value``, ``unit``:

    ``attitude``
        ``quaternion`` of every body, scalar first, body relative to reference (no conjugate of what ROS has);
        ``euler error`` (3-2-1: roll, pitch, yaw) [deg]; of a plant, ``error``: all of it as one angle [deg].
    ``rate``
        Angular velocity error, in the body frame [rad/s].
    ``torque``
        What the inputs of plants hold, where it changes, and at the end [N m]; inputs of other kinds of plants, too.
    ``state``
        Every component of every committed sample.
    ``watched``
        Quantities that have to stay within bounds, or are only reported.

    Tables of events have a row an event:

    ``triggers``
        ``time_s``, ``tick``, ``node``, ``number`` from 1 on, ``interval_s`` since the one before.
    ``messages``
        ``time_s``, ``tick``, ``step`` within the tick, ``link``, ``topic``, ``kind``, ``node`` that sent it,
        ``sequence``, ``payload_bytes``, ``payload``: its numbers.

    Attributes
    ----------
    path
        Directory of the bag.
    """

    def __init__(self, path: Path, run: ReportedRun, rate_hz: float | None = None) -> None:
        self.path = path
        self._run = run
        # However low the rate, the sample at tick 0 is kept; a period beyond all ticks has to stay an int64.
        periods = 1.0 if rate_hz is None else min(run.graph.ticks_per_second / rate_hz, _LONGEST_PERIOD)
        self._period = max(1, math.ceil(periods))
        self._samples: dict[str, Callable[[_PartsOf], Iterator[Series]]] = {
            "attitude": self._attitude,
            "rate": self._rate,
            "torque": self._torque,
            "state": self._state,
            "watched": self._watched,
        }
        every = run.recording.every
        lacking = {0: self._samples.keys(), 1: ()}.get(every, ("watched",))
        kept = "no committed samples" if every == 0 else f"only every {every}th committed sample"
        self.left_out = dict.fromkeys(lacking, f"the bag keeps {kept} (--truth)")
        """Tables that the bag is not enough for, each with the reason."""
        self._samples = {name: make for name, make in self._samples.items() if name not in self.left_out}
        self._apart = frozenset({"attitude", "rate", "state"}) & self._samples.keys()
        """Tables whose rows follow from one sample each."""
        self._events = {"triggers": self._triggers, "messages": self._messages}

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the tables."""
        return (*self._samples, *self._events)

    @property
    def metadata(self) -> dict[str, str]:
        """What the bag says of its run: scenario, variant, overrides, seed, engine, version."""
        return dict(self._run.metadata)

    @property
    def ticks_per_second(self) -> int:
        """Rate of the tick grid [1/s]."""
        return self._run.graph.ticks_per_second

    def no_table(self, name: str) -> BagError:
        """The error that says that there is no such table, and why if the bag is not enough for it."""
        found = f"there is none: {self.left_out[name]}" if name in self.left_out else "there is none"
        return BagError(f"{self.path}: table '{name}'", found, f"one of: {', '.join(self.names)}")

    def table(self, name: str) -> pa.Table:
        """One of the tables.

        Parameters
        ----------
        name
            One of :attr:`names`.

        Returns
        -------
        pyarrow.Table
            ``.to_pandas()`` makes a data frame of it, ``.column("value").to_numpy()`` an array.

        Raises
        ------
        BagError
            If there is no such table.
        """
        if name in self._events:
            return self._events[name]()
        return _tidy(self.series(name), self.ticks_per_second)

    def series(self, name: str) -> tuple[Series, ...]:
        """The same as arrays, a quantity of a node each; of tables of samples only.

        Raises
        ------
        BagError
            If there is no such table.
        """
        if name not in self._samples:
            raise self.no_table(name)
        return tuple(self._samples[name](self._run.recording.parts))

    def pieces(self, name: str) -> Iterator[pa.Table]:
        """One of the tables as several, which together are it: of a very long run, so that each fits into memory.

        Of other runs it is one. Rows come in another order than those of :meth:`table`.

        Raises
        ------
        BagError
            If there is no such table.
        """
        recording = self._run.recording
        parts = {plant: recording.parts(plant) for plant in self._run.graph.plants}
        if name not in self._apart or all(recording.is_one_part(plant) for plant in parts):
            yield self.table(name)
            return
        for plant, some in parts.items():
            for part in some:
                yield _tidy(self._samples[name](_only(plant, part)), self.ticks_per_second)

    def _attitude(self, parts_of: _PartsOf) -> Iterator[Series]:
        graph = self._run.graph
        for node, plant, body in self._bodies():
            if body.quaternions is not None:
                turned = partial(_quaternions, body.quaternions, plant)
                yield self._kept(parts_of, node, plant, "quaternion", "1", ("q0", "q1", "q2", "q3"), turned)
            angles = partial(_curve, curves.attitude, graph, self._rows[node])
            yield self._kept(parts_of, node, plant, "euler error", "deg", None, angles)
        for plant in curves.attitude_plants(graph):
            angle = partial(_curve, curves.attitude_angle, graph, plant)
            yield self._kept(parts_of, plant, plant, "error", "deg", ("angle",), angle)

    def _rate(self, parts_of: _PartsOf) -> Iterator[Series]:
        for node, plant, body in self._bodies():
            rates = partial(_rates, body, curves.dynamics(self._run.graph, plant), plant)
            yield self._kept(parts_of, node, plant, "rate", "rad/s", None, rates)

    def _torque(self, parts_of: _PartsOf) -> Iterator[Series]:
        run = self._run
        for plant in run.graph.plants:
            last = sum(run.recording.span(plant)) - 1
            for port, held in replay.held_inputs(run.graph, run.recording, plant).items():
                until = int(np.searchsorted(held.ticks, last, side="right"))
                ticks, values = held.ticks[:until], held.values[:until]
                if ticks[-1] < last:
                    ticks, values = np.append(ticks, last), np.concatenate([values, values[-1:]])
                unit = "N m" if "torque" in port else ""
                yield Series(plant, port, unit, _axes(values.shape[1]), ticks, values)

    def _state(self, parts_of: _PartsOf) -> Iterator[Series]:
        for plant in self._run.graph.plants:
            ticks, states = self._thinned(parts_of, plant, lambda part, plant=plant: part.kept(plant)[1])  # type: ignore[misc]
            if not ticks.size:
                continue
            for place, label in enumerate(curves.dynamics(self._run.graph, plant).labels):
                found = _LABEL.fullmatch(label)
                assert found is not None
                yield Series(plant, found[1], found[2] or "1", (found[1],), ticks, states[:, place : place + 1])

    def _watched(self, parts_of: _PartsOf) -> Iterator[Series]:
        for node, (first, watches) in self._run.watches.items():
            for watch in watches:
                ticks = np.arange(first, first + watch.values.shape[0], dtype=np.int64)
                due = ticks % self._period == 0
                yield Series(node, watch.name, watch.unit or "1", tuple(watch.axes), ticks[due], watch.values[due])

    def _triggers(self) -> pa.Table:
        run = self._run
        parts = []
        for node in run.summary.triggers:
            ticks = replay.trigger_ticks(run.graph, run.recording, node)
            times = np.asarray(seconds(ticks, self.ticks_per_second), dtype=np.float64)
            gaps = np.asarray(seconds(np.diff(ticks), self.ticks_per_second), dtype=np.float64)
            parts.append((node, ticks, times, np.concatenate([[np.nan], gaps])[: times.size]))
        sizes = [ticks.size for _, ticks, _, _ in parts]
        return pa.table(
            {
                "time_s": _joined([times for _, _, times, _ in parts], np.float64),
                "tick": _joined([ticks for _, ticks, _, _ in parts], np.int64),
                "node": _repeated([node for node, _, _, _ in parts], sizes),
                "number": _joined([np.arange(1, size + 1) for size in sizes], np.int64),
                "interval_s": pa.array(_joined([gaps for _, _, _, gaps in parts], np.float64), from_pandas=True),
            }
        )

    def _messages(self) -> pa.Table:
        run = self._run
        sent = [(link, message) for link in run.graph.links.values() for message in run.recording.messages[link.name]]
        sent.sort(key=lambda item: (item[1].tick, item[1].step))
        ticks = np.array([message.tick for _, message in sent], dtype=np.int64)
        links = [link for link, _ in sent]
        return pa.table(
            {
                "time_s": np.asarray(seconds(ticks, self.ticks_per_second), dtype=np.float64),
                "tick": ticks,
                "step": pa.array([message.step for _, message in sent], pa.int64()),
                "link": pa.array([link.name for link in links], pa.string()).dictionary_encode(),
                "topic": pa.array([link.topic for link in links], pa.string()).dictionary_encode(),
                "kind": pa.array([link.kind.value for link in links], pa.string()).dictionary_encode(),
                "node": pa.array([link.sender for link in links], pa.string()).dictionary_encode(),
                "sequence": pa.array([message.sequence for _, message in sent], pa.int64()),
                "payload_bytes": pa.array([link.wire.payload_bytes for link in links], pa.int64()),
                "payload": pa.array([message.value.tolist() for _, message in sent], pa.list_(pa.float64())),
            }
        )

    @cached_property
    def _rows(self) -> dict[str, str]:
        """By node, what :mod:`etac_ros.metrics.curves` calls a body."""
        rows = curves.bodies(self._run.graph)
        return {_node(plant, body): row for row, (plant, body) in rows.items()}

    def _bodies(self) -> Iterator[tuple[str, str, Body]]:
        for plant in self._run.graph.plants:
            for body in bodies_of(curves.dynamics(self._run.graph, plant)):
                yield _node(plant, body), plant, body

    def _thinned(
        self, parts_of: _PartsOf, plant: str, values: Callable[[Recording], FloatArray]
    ) -> tuple[npt.NDArray[np.int64], FloatArray]:
        """Ticks, and values at them, of those samples that are kept."""
        ticks, rows = [np.empty(0, dtype=np.int64)], []
        for part in parts_of(plant):
            known, _ = part.kept(plant)
            due = known % self._period == 0
            ticks.append(known[due])
            rows.append(values(part)[due])
        return np.concatenate(ticks), np.concatenate(rows) if rows else np.empty((0, 0))

    def _kept(
        self,
        parts_of: _PartsOf,
        node: str,
        plant: str,
        quantity: str,
        unit: str,
        components: tuple[str, ...] | None,
        values: Callable[[Recording], FloatArray],
    ) -> Series:
        """A quantity at the samples that are kept; angles and rates name their components by how many there are."""
        ticks, kept = self._thinned(parts_of, plant, values)
        if components is None:
            turned = quantity == "euler error" and kept.shape[1] == 3
            components = ("roll", "pitch", "yaw") if turned else _axes_of(quantity, kept.shape[1])
        return Series(node, quantity, unit, components, ticks, kept)


def _axes_of(quantity: str, count: int) -> tuple[str, ...]:
    return _numbered(count) if quantity == "euler error" else _axes(count)


def _quaternions(of_states: Callable[[FloatArray], FloatArray], plant: str, part: Recording) -> FloatArray:
    return np.asarray(of_states(part.kept(plant)[1]), dtype=np.float64)


def _curve(make: Callable[[Graph, Recording, str], Curve], graph: Graph, row: str, part: Recording) -> FloatArray:
    return make(graph, part, row).values


def _rates(body: Body, dynamics: Plant, plant: str, part: Recording) -> FloatArray:
    ticks, states = part.kept(plant)
    return np.asarray(body.rates(curves.errors_at(dynamics, ticks, states)))


def _only(plant: str, part: Recording) -> _PartsOf:
    """As if there were nothing but this part of this plant."""
    return lambda name: iter([part] if name == plant else [])


def open_bag(path: Path | str, *, rate_hz: float | None = None, trust: bool = False) -> BagTables:
    """Open a bag to get tables from it.

    Parameters
    ----------
    path
        Directory of the bag.
    rate_hz
        Samples a simulated second at most, in tables of samples; None keeps every one. Events are never thinned.
    trust
        Whether to import classes that are not of etac_ros, if the scenario in the bag names any: their code is run.

    Raises
    ------
    BagError
        If it is no whole bag of etac_ros, or holds no samples.

    Examples
    --------
    >>> import etac_ros
    >>> frame = etac_ros.open_bag("bags/BAG").table("attitude").to_pandas()  # doctest: +SKIP
    """
    directory = Path(path)
    if rate_hz is not None and not rate_hz > 0.0:
        raise BagError(f"{directory}: rate_hz", f"found {rate_hz:g}", "a rate above 0, or None for all samples")
    return BagTables(directory, read_run(directory, trust), rate_hz)


def _tidy(series: Iterable[Series], ticks_per_second: int) -> pa.Table:
    several = list(series)
    lengths = [one.values.size for one in several]
    ticks = [np.repeat(one.ticks, len(one.components)) for one in several]
    joined = _joined(ticks, np.int64)
    components = list(dict.fromkeys(name for one in several for name in one.components))
    places = {name: place for place, name in enumerate(components)}
    which = [np.tile([places[name] for name in one.components], one.ticks.size) for one in several]
    return pa.table(
        {
            "time_s": np.asarray(seconds(joined, ticks_per_second), dtype=np.float64),
            "tick": joined,
            "node": _repeated([one.node for one in several], lengths),
            "quantity": _repeated([one.quantity for one in several], lengths),
            "component": pa.DictionaryArray.from_arrays(_joined(which, np.int32), pa.array(components, pa.string())),
            "value": _joined([one.values.ravel() for one in several], np.float64),
            "unit": _repeated([one.unit for one in several], lengths),
        }
    )


def _joined(parts: Sequence[npt.NDArray[Any]], dtype: type[np.generic]) -> npt.NDArray[Any]:
    return np.concatenate(parts).astype(dtype) if parts else np.empty(0, dtype=dtype)


def _repeated(words: list[str], counts: list[int]) -> pa.DictionaryArray:
    """Each word so many times."""
    known = list(dict.fromkeys(words))
    places = np.repeat(np.array([known.index(word) for word in words], dtype=np.int32), counts)
    return pa.DictionaryArray.from_arrays(places, pa.array(known, pa.string()))


def _node(plant: str, body: Body) -> str:
    word = body.frame or body.name
    return f"{plant}/{word}" if word else plant


def _axes(count: int) -> tuple[str, ...]:
    return _XYZ if count == len(_XYZ) else _numbered(count)


def _numbered(count: int) -> tuple[str, ...]:
    return tuple(str(place) for place in range(count))
