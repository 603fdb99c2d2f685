"""What trigger rules were shown, recomputed from committed samples and messages, and how near they were to firing."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from etac_ros.graph.faults import FaultKind
from etac_ros.graph.graph import Graph, LinkKind
from etac_ros.graph.module import Window
from etac_ros.graph.recording import Recording
from etac_ros.graph.replay import arrivals_by_tick, sent_at_triggers
from etac_ros.maths.ticks import seconds
from etac_ros.metrics.curves import Curve
from etac_ros.modules.sensing_controller import SensingController
from etac_ros.modules.triggering import Triggering
from etac_ros.parameters import FloatArray


@dataclass(frozen=True)
class Part:
    """One of the quantities that a trigger rule is shown.

    Attributes
    ----------
    symbol, unit
        In the paper's words; the unit may be empty.
    columns
        Where it stands in what the rule is shown.
    """

    symbol: str
    unit: str
    columns: slice


@dataclass(frozen=True)
class Decisions:
    """What the trigger rule of a module was shown and what it held meanwhile.

    Attributes
    ----------
    parts
        The quantities that are compared with what is held.
    first
        Tick of the first row.
    rows
        What the rule was shown at each tick, shape (n, m).
    ticks
        Triggering instants.
    held
        What was held from each of them on, shape (len(ticks), k): compared with the first k columns of the rows.
    """

    parts: tuple[Part, ...]
    first: int
    rows: FloatArray
    ticks: npt.NDArray[np.int64]
    held: FloatArray

    def signal(self, part: Part, ticks_per_second: int) -> Curve:
        """A quantity at every tick."""
        ticks = np.arange(self.first, self.first + self.rows.shape[0])
        return Curve(np.asarray(seconds(ticks, ticks_per_second)), self.rows[:, part.columns])

    def sent(self, part: Part, ticks_per_second: int) -> Curve:
        """What of a quantity was sent at the triggering instants."""
        return Curve(np.asarray(seconds(self.ticks, ticks_per_second)), self.held[:, part.columns])


@dataclass(frozen=True)
class Margins:
    """How near a module was to triggering, at every tick after its first transmission.

    Attributes
    ----------
    ticks
        Ticks at which the rule was asked, ascending.
    errors, thresholds
        What it compared: it fires where the error has reached the threshold.
    fired
        Whether the tick is a triggering instant.
    """

    ticks: npt.NDArray[np.int64]
    errors: FloatArray
    thresholds: FloatArray
    fired: npt.NDArray[np.bool_]


def sends_over_network(graph: Graph, name: str) -> bool:
    """Whether anything that a module sends goes over the network."""
    return any(link.kind is LinkKind.NETWORK for link in graph.sends[name])


def decisions(graph: Graph, recording: Recording, name: str) -> Decisions | None:
    """What the trigger rule of a module was shown, and what it held.

    Parameters
    ----------
    graph
        No engine has run it: its modules measure once more, through the same noise and filter.
    recording
        Of the same scenario.
    name
        Full name of a module.

    Returns
    -------
    Decisions or None
        None where nothing can be recomputed: the module has no trigger rule, it was not asked at every tick, it
        has sent nothing, it was restarted, so that another one went on without its memory, or not all samples that it
        saw are there.
    """
    module = graph.modules[name]
    restarted = any(fault.kind is FaultKind.RESTART for fault in graph.faults_of(name))
    blind = not recording.is_whole and name in graph.reads
    if not isinstance(module, Triggering) or restarted or blind:
        return None
    window = _samples(graph, recording, name)
    # Nobody acts at the end tick any more, so the last sample of a complete run is not asked about.
    end = graph.end_tick if window is None else window.last + 1
    sent = [message for message in sent_at_triggers(graph, recording, name) if message.tick < end]
    owner = graph.modules[name]
    if isinstance(owner, SensingController) and name in graph.told:
        owner.events = frozenset(message.tick for message in sent)
    heard = {tick: some for tick, some in arrivals_by_tick(graph, recording, name).items() if tick < end}
    rows = module.watched(window, heard)
    if rows is None or not sent:
        return None
    held = np.array([module.held_by(message.value, message.tick) for message in sent])
    ticks = np.array([message.tick for message in sent], dtype=np.int64)
    parts = parts_of(module.watched_label, module.watched_unit, held.shape[1])
    return Decisions(parts, 0 if window is None else window.start, rows, ticks, held)


def margins(graph: Graph, found: Decisions, name: str) -> Margins | None:
    """What a trigger rule compared; None where it goes by time, and compares nothing.

    Also None where it compares with what was acknowledged: what is held here is what was sent.
    """
    if name in graph.told:
        return None
    rule = graph.modules[name].trigger  # type: ignore[attr-defined]  # it is Triggering: there are decisions of it
    end = found.first + found.rows.shape[0]
    parts = []
    for tick, until, held in zip(found.ticks, [*found.ticks[1:], end - 1], found.held, strict=True):
        between = np.ascontiguousarray(found.rows[tick + 1 - found.first : until + 1 - found.first])
        pair = rule.margin(between, int(tick) + 1, held)
        if pair is None:
            return None
        parts.append(pair)
    ticks = np.arange(found.ticks[0] + 1, end)
    return Margins(
        ticks,
        np.concatenate([errors for errors, _ in parts]),
        np.concatenate([thresholds for _, thresholds in parts]),
        np.isin(ticks, found.ticks),
    )


def parts_of(label: str, unit: str, size: int) -> tuple[Part, ...]:
    """The quantities of a signal: ``[a, b]`` of six components are two of three each."""
    symbols = [symbol.strip() for symbol in label.strip("[]").split(",")]
    if size % len(symbols):
        return (Part(label, unit, slice(0, size)),)
    units = [part.strip() for part in unit.split(",")]
    if len(units) != len(symbols):
        units = [unit] * len(symbols)
    each = size // len(symbols)
    return tuple(
        Part(symbol, its_unit, slice(place * each, (place + 1) * each))
        for place, (symbol, its_unit) in enumerate(zip(symbols, units, strict=True))
    )


def _samples(graph: Graph, recording: Recording, name: str) -> Window | None:
    plant = graph.reads.get(name)
    if plant is None:
        return None
    first, states = recording.samples(plant)
    return Window(plant, 1, first, np.ascontiguousarray(states[: max(graph.end_tick - first, 0)]))
