"""What crossed the links of a run, and how well the spacecraft pointed meanwhile: the summary of a run.

The models below are the machine-readable summary that ``--json`` writes; ``summary.schema.json`` is made from them.
"""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from typing import Literal

import numpy as np
from pydantic import BaseModel, ConfigDict, Field, JsonValue

from etac_ros.capture.account import WireAccount
from etac_ros.capture.model import data_frames
from etac_ros.graph.graph import Graph, Link, LinkKind
from etac_ros.graph.plant import PlantModule
from etac_ros.graph.recording import Recording
from etac_ros.graph.replay import deliveries, energy, trigger_ticks
from etac_ros.maths.norms import row_norms
from etac_ros.maths.ticks import seconds
from etac_ros.metrics.accounts import (
    HoldAccount,
    LinkAccount,
    MediumAccount,
    hold_accounts,
    link_accounts,
    medium_accounts,
)
from etac_ros.metrics.curves import last_tick
from etac_ros.metrics.fault_account import FaultAccount, fault_accounts
from etac_ros.metrics.figures import INTERVALS, FigureKey, key_of, label
from etac_ros.metrics.latency import RealTimeAccount, real_time_account
from etac_ros.metrics.published import measure, published_figures, stands_beside_paper, sum_of_sent, watches_of_module
from etac_ros.metrics.stored import StoredSweep, declared, differs, stored_sweep
from etac_ros.metrics.verdict import Judgement, Paper, Spread, judge
from etac_ros.plants.plant import errors_of, has_attitude
from etac_ros.plants.watch import Watch
from etac_ros.scenario.load import Scenario
from etac_ros.scenario.schema import FigureKind, PublishedFigure

Kind = Literal["network", "internal", "emulation"]
_LAST_PART = 0.4
"""Steady figures are taken over this last part of a run, unless the scenario says from when on."""


class _Model(BaseModel):
    model_config = ConfigDict(defer_build=True, extra="forbid")


class Triggers(_Model):
    """Triggering instants of one sensor."""

    count: int
    min_interval_s: float | None = Field(description="shortest inter-event time; null below two triggers")
    mean_interval_s: float | None
    max_interval_s: float | None
    steady_mean_interval_s: float | None = Field(description="mean inter-event time of the steady part")
    sum_of_sent: float = Field(description="norms of what was sent at these instants, added up, in its unit")
    times_s: list[float]


class Totals(_Model):
    """Messages and bytes."""

    messages: int
    deliveries: int = Field(description="messages that reached a receiver: a broadcast counts once for each")
    payload_bytes: int = Field(
        description="components alone: 4 bytes of float32, as the papers count, 8 of float64; 0 on the emulation plane"
    )
    cdr_bytes: int = Field(description="length of the serialized messages, each with its 4-byte header")


class Topic(Totals):
    """What one topic carried."""

    kind: Kind
    type: str
    model_wire_bytes: int | None = Field(
        default=None,
        description="of a link: a model of its data in Ethernet frames to its receivers, each in a process of its own; "
        "with heartbeats and acknowledgements it is more, which the captured account has",
    )
    first_s: float | None = Field(description="simulated time of the first message; null if unknown or none")
    last_s: float | None


class Performance(_Model):
    """How well one plant pointed."""

    attitude_error_deg: float | None = Field(description="at the end; null of a plant that has no attitude")
    rate_deg_s: float | None = Field(description="at the end; likewise")
    max_attitude_error_deg: float | None = Field(description="over the steady part of the run; likewise")
    max_rate_deg_s: float | None = Field(description="over the steady part of the run; likewise")
    energy_n2m2s: float = Field(description="integral of the held torque's square [N^2 m^2 s]")
    of_torque: bool = Field(
        default=True,
        description="whether the plant's inputs are torques; if not, the energy is the integral of their square all "
        "the same, in the units of the inputs",
    )


class Watched(_Model):
    """A quantity that has to stay within bounds."""

    name: str
    unit: str
    largest: float = Field(description="largest magnitude over the run")
    axis: str
    at_s: float
    steady: float = Field(description="largest magnitude over the steady part of the run")
    final: float = Field(description="largest magnitude at the end")
    notice: float | None = Field(description="a bound that is only reported")
    bound: float | None = Field(description="leaving it ends the run")


class Timing(_Model):
    """Wall time."""

    startup_s: float = Field(description="until the first window: processes, discovery, ready barrier")
    loop_s: float = Field(description="from the first window to the last report")
    total_s: float = Field(description="start to summary")


class _Figure(_Model):
    figure: str = Field(description="which figure")
    node: str | None = Field(description="whose; null for the whole run, the only sensor or the only plant")
    value: float

    @property
    def key(self) -> FigureKey:
        """What identifies it."""
        return FigureKey(self.figure, self.node)


class MeasuredValue(_Figure):
    """A figure of the run."""

    label: str = Field(default="", description="what the scenario calls it, where its name does not say it")


class SampleFigures(_Model):
    """All of a summary that follows from committed samples: what a bag keeps that does not keep these."""

    final_state: dict[str, list[float]]
    performance: dict[str, Performance]
    watches: dict[str, list[Watched]]
    samples: dict[str, int]
    faults: dict[str, FaultAccount]
    own: list[MeasuredValue]
    ended_s: float | None = None
    """None in a bag of before this was kept."""


class PublishedValue(_Figure):
    """A figure of the paper."""

    printed: str = Field(description="its digits as the paper prints them")
    kind: FigureKind = Field(description="what it says when it is met")
    fitted_to: str = Field(description="what was chosen so that it is met; only where it was")
    spread: Spread | None = Field(description="over runs with dispersed starts; null where none are stored")
    changed: str = Field(description="in what it is declared otherwise than when its spread was stored")
    label: str = Field(description="what it is called, where its name does not say it")
    where: str = Field(description="where the paper prints it")
    reason: str = Field(description="why it is not reproduced, where it is not")

    @property
    def is_limit(self) -> bool:
        """Whether it is a limit that the paper says is kept."""
        return self.kind is FigureKind.LIMIT

    def judge(self, measured: float | None) -> Judgement:
        """What becomes of it, by the one rule."""
        return judge(Paper(self.printed, self.kind, self.changed), measured, self.spread)


class Summary(_Model):
    """The summary of one run."""

    format: Literal[3] = Field(
        default=3, description="of this summary; 3 has printed digits, kind and spread of figures"
    )
    scenario: str
    variant: str | None
    engine: Literal["ros", "inprocess"]
    overrides: dict[str, JsonValue]
    seed: int
    duration_s: float = Field(description="simulated time that the scenario asks for")
    ended_s: float = Field(description="simulated time at the end: earlier than asked for where a watch ended the run")
    steady_from_s: float = Field(description="simulated time from which steady figures are taken")
    halted: str = Field(description="why a watch ended the run early; empty otherwise")
    triggers: dict[str, Triggers] = Field(description="by the sensor's full name")
    topics: dict[str, Topic]
    links: dict[str, LinkAccount] = Field(
        default={}, description="what became of the messages of each link that is not ideal, on the emulated air"
    )
    media: dict[str, MediumAccount] = Field(default={}, description="what each shared medium carried")
    holds: dict[str, HoldAccount] = Field(default={}, description="zero-order holds with a time to live, by node")
    faults: dict[str, FaultAccount] = Field(
        default={}, description="what each fault of the scenario cost, in the order in which they began"
    )
    network: Totals
    internal: Totals
    emulation: Totals
    wire: WireAccount | None = Field(default=None, description="what was captured; null where nothing was")
    final_state: dict[str, list[float]] = Field(description="by plant; the digits restore the very bits")
    performance: dict[str, Performance] = Field(description="by plant")
    watches: dict[str, list[Watched]] = Field(description="by node: what is watched, with bounds where it has to stay")
    samples: dict[str, int] = Field(description="committed samples that a module took inside itself, without a message")
    timing: Timing
    memory_kib: dict[str, int] = Field(description="peak memory of the process of each node")
    strangers: dict[str, int] = Field(description="messages by topic that were not of this run, and were ignored")
    real_time: RealTimeAccount | None = Field(default=None, description="of a run in real time; null in simulated time")
    bag: str | None
    published: list[PublishedValue] = Field(description="the paper's figures, where they stand beside this run")
    published_not: str = Field(description="why none of the paper's figures stand beside this run; empty if they do")
    own: list[MeasuredValue] = Field(description="figures that only this scenario defines")
    measured: list[MeasuredValue] = Field(description="all figures that may stand beside published ones")
    baseline: Summary | None = Field(default=None, description="the same of the baseline, where it was run")

    @property
    def figures(self) -> dict[FigureKey, float]:
        """All measured figures."""
        return {one.key: one.value for one in self.measured}

    @property
    def paper(self) -> dict[FigureKey, PublishedValue]:
        """The paper's figures."""
        return {one.key: one for one in self.published}

    def label_of(self, key: FigureKey) -> str:
        """What a figure is called in a table, in the scenario's words where it has some."""
        words = {one.key: one.label for one in self.own} | {one.key: one.label for one in self.published}
        return label(key, words.get(key, ""))

    def value(self, figure: str, node: str | None = None) -> float | None:
        """A measured figure; None where the run does not have it."""
        return self.figures.get(FigureKey(figure, node))


def summary_schema() -> str:
    """The JSON schema of a summary: the text of ``summary.schema.json``."""
    schema = {"$schema": "https://json-schema.org/draft/2020-12/schema", **Summary.model_json_schema()}
    return json.dumps(schema, indent=2) + "\n"


def summarise(
    scenario: Scenario,
    graph: Graph,
    recording: Recording,
    engine: Literal["ros", "inprocess"],
    timing: Timing,
    *,
    plane: Mapping[str, tuple[str, int, int]] | None = None,
    measured_cdr: Mapping[str, int] | None = None,
    memory_kib: Mapping[str, int] | None = None,
    strangers: Mapping[str, int] | None = None,
    wire: WireAccount | None = None,
    halted: str = "",
    bag: str | None = None,
    stepped_s: float = 0.0,
    of_samples: SampleFigures | None = None,
) -> Summary:
    """The summary of a recorded run.

    Parameters
    ----------
    scenario, graph
        What was run.
    recording
        What came of it.
    engine, timing, memory_kib, strangers, wire, halted, bag
        Taken over.
    plane
        Topics of the emulation plane: type, messages, CDR bytes.
    measured_cdr
        CDR bytes of each link's topic as raw subscriptions measured them; without it they are computed.
    stepped_s
        How far the wall clock was set during a run in real time [s].
    of_samples
        What follows from committed samples, where the recording does not have all of them.
    """
    topics = _link_topics(graph, recording, measured_cdr)
    for name, (kind, messages, size) in (plane or {}).items():
        if name not in topics:
            topics[name] = Topic(
                kind="emulation", type=kind, messages=messages, deliveries=messages, payload_bytes=0, cdr_bytes=size,
                first_s=None, last_s=None,
            )  # fmt: skip
    published, reason = published_figures(scenario, graph), stands_beside_paper(scenario) or ""
    from_s = steady_from_s(scenario)
    steady = round(from_s * graph.ticks_per_second)
    figures = of_samples or sample_figures(scenario, graph, recording)
    summary = Summary(
        scenario=scenario.name,
        variant=scenario.variant,
        engine=engine,
        overrides=dict(scenario.overrides),
        seed=scenario.run.seed,
        duration_s=scenario.run.duration_s,
        ended_s=scenario.run.duration_s if figures.ended_s is None else figures.ended_s,
        steady_from_s=from_s,
        halted=halted,
        triggers=_triggers(graph, recording, steady),
        topics=topics,
        links=link_accounts(graph, recording),
        media=medium_accounts(graph, recording),
        holds=hold_accounts(graph, recording),
        faults=figures.faults,
        network=_totals(topics, "network"),
        internal=_totals(topics, "internal"),
        emulation=_totals(topics, "emulation"),
        wire=wire,
        final_state=figures.final_state,
        performance=figures.performance,
        watches=figures.watches,
        samples=figures.samples,
        timing=timing,
        memory_kib=dict(memory_kib or {}),
        strangers=dict(strangers or {}),
        real_time=real_time_account(graph, recording, stepped_s),
        bag=bag,
        published=[] if reason else list(published_values(scenario, graph).values()),
        published_not=reason if published else "",
        own=figures.own,
        measured=[],
    )
    return with_measured(summary, None)


def sample_figures(scenario: Scenario, graph: Graph, recording: Recording) -> SampleFigures:
    """What follows from the committed samples of a run, which have to be all there.

    Raises
    ------
    BagError
        If they are not.
    """
    steady = round(steady_from_s(scenario) * graph.ticks_per_second)
    return SampleFigures(
        final_state={name: recording.final(name).tolist() for name in graph.plants},
        performance={name: _performance(graph, recording, name, steady) for name in graph.plants},
        watches={name: found for name in graph.modules if (found := _watches(graph, recording, name, steady))},
        samples={name: _samples(graph, recording, name) for name, module in graph.modules.items() if module.senses},
        faults=fault_accounts(graph, recording),
        own=_own_figures(published_figures(scenario, graph), graph, recording),
        ended_s=float(seconds(last_tick(graph, recording), graph.ticks_per_second)) if graph.plants else None,
    )


def figures_of_samples(summary: Summary) -> SampleFigures:
    """Those of a summary."""
    return SampleFigures(**{name: getattr(summary, name) for name in SampleFigures.model_fields})


def published_values(scenario: Scenario, graph: Graph) -> dict[FigureKey, PublishedValue]:
    """The figures of the paper as the summary holds them, each with its stored spread."""
    sweep = stored_sweep(scenario)
    same = sweep is not None and sweep.digest == scenario.content_digest
    return {
        key: _published_value(key, figure, sweep, same) for key, figure in published_figures(scenario, graph).items()
    }


def _published_value(key: FigureKey, figure: PublishedFigure, sweep: StoredSweep | None, same: bool) -> PublishedValue:
    here, changed = declared(figure, key.name), ""
    there = None
    if sweep is not None:
        there = sweep.figures.get(str(key))
        changed = "it was not declared then" if there is None else differs(here, there)
    return PublishedValue(
        figure=key.name,
        node=key.node,
        value=figure.value,
        printed=here.printed,
        kind=here.kind if there is None else there.kind,
        fitted_to=figure.fitted_to,
        spread=None if there is None or changed or not same else there.spread,
        changed=changed,
        label=figure.label,
        where=figure.where,
        reason=figure.reason,
    )


def with_measured(summary: Summary, baseline: Summary | None) -> Summary:
    """The summary with the figures that stand beside the paper's, and with its baseline."""
    found: dict[FigureKey, float] = {}
    for name, triggers in summary.triggers.items():
        found[key_of("triggers", name, summary.triggers)] = float(triggers.count)
        for figure in INTERVALS:
            value = getattr(triggers, figure)
            if value is not None:
                found[key_of(figure, name, summary.triggers)] = value
    found.update({one.key: one.value for one in summary.own})
    found[FigureKey("energy_n2m2s")] = _energy(summary)
    found[FigureKey("network_messages")] = float(summary.network.messages)
    found[FigureKey("network_deliveries")] = float(summary.network.deliveries)
    found[FigureKey("network_payload_bytes")] = float(summary.network.payload_bytes)
    if baseline is not None:
        found.update(_against(summary, baseline))
    measured = [MeasuredValue(figure=key.name, node=key.node, value=value) for key, value in found.items()]
    return summary.model_copy(update={"measured": measured, "baseline": baseline})


def _against(summary: Summary, baseline: Summary) -> dict[FigureKey, float]:
    """What a baseline needs more, in messages, bytes, triggering instants and energy."""
    found = {
        "baseline_messages": float(baseline.network.messages),
        "baseline_payload_bytes": float(baseline.network.payload_bytes),
        **_less("message_reduction_percent", summary.network.messages, baseline.network.messages),
        **_less("reduction_percent", summary.network.payload_bytes, baseline.network.payload_bytes),
    }
    sizes = _content_sizes(summary, baseline)
    own, other = _payload_of(summary, sizes), _payload_of(baseline, sizes)
    if own != summary.network.payload_bytes or other != baseline.network.payload_bytes:
        found |= _less("equal_content_reduction_percent", own, other)
    if len(summary.triggers) == len(baseline.triggers) == 1:
        (mine,), (its,) = summary.triggers.values(), baseline.triggers.values()
        found["baseline_more_triggers"] = float(its.count - mine.count)
    found["baseline_more_energy_n2m2s"] = _energy(baseline) - _energy(summary)
    found |= _less("energy_reduction_percent", _energy(summary), _energy(baseline))
    keys = {FigureKey(name): value for name, value in found.items()}
    for name, triggers in summary.triggers.items():
        if name in baseline.triggers:
            less = _less("trigger_reduction_percent", triggers.count, baseline.triggers[name].count)
            less |= _less("sent_reduction_percent", triggers.sum_of_sent, baseline.triggers[name].sum_of_sent)
            keys |= {key_of(figure, name, summary.triggers): value for figure, value in less.items()}
    return keys


def _less(name: str, own: float, other: float) -> dict[str, float]:
    """By how much less [%] of something there is than at the baseline; nothing where that has none."""
    return {name: 100.0 * (1.0 - own / other)} if other > 0.0 else {}


def _content_sizes(summary: Summary, baseline: Summary) -> dict[str, float]:
    """Payload of one message of each network topic, that of the run where both have it [bytes].

    A baseline may send something larger over the same link, the measurement instead of a torque: the bytes saved by
    that are not saved by sending more seldom.
    """
    return {
        name: topic.payload_bytes / topic.messages
        for of_one in (baseline, summary)
        for name, topic in of_one.topics.items()
        if topic.kind == "network" and topic.messages
    }


def _payload_of(summary: Summary, sizes: Mapping[str, float]) -> float:
    """What the network would have carried with messages of these sizes [bytes]."""
    return sum(sizes[name] * topic.messages for name, topic in summary.topics.items() if topic.kind == "network"
               and topic.messages)  # fmt: skip


def _energy(summary: Summary) -> float:
    return sum(figures.energy_n2m2s for figures in summary.performance.values())


def traffic_by_namespace(graph: Graph, summary: Summary) -> dict[str, Totals]:
    """Totals of the network links, as ``network FROM -> TO``, and of each namespace's internal ones."""
    totals: dict[str, Totals] = {}
    for link in graph.links.values():
        if link.kind is LinkKind.PHYSICAL:
            continue
        sender = link.sender.rpartition("/")[0] or "/"
        name = f"inside {sender}"
        if link.kind is LinkKind.NETWORK:
            receivers = sorted({receiver.rpartition("/")[0] or "/" for receiver in link.receivers})
            name = f"network {sender} -> {', '.join(receivers)}"
        topic = summary.topics[link.topic]
        before = totals.get(name, Totals(messages=0, deliveries=0, payload_bytes=0, cdr_bytes=0))
        totals[name] = Totals(
            messages=before.messages + topic.messages,
            deliveries=before.deliveries + topic.deliveries,
            payload_bytes=before.payload_bytes + topic.payload_bytes,
            cdr_bytes=before.cdr_bytes + topic.cdr_bytes,
        )
    return totals


def steady_from_s(scenario: Scenario) -> float:
    """Simulated time from which steady figures are taken."""
    said = scenario.run.steady_from_s
    return (1.0 - _LAST_PART) * scenario.run.duration_s if said is None else said


def _own_figures(
    published: Mapping[FigureKey, PublishedFigure], graph: Graph, recording: Recording
) -> list[MeasuredValue]:
    found = []
    for key, figure in published.items():
        value = None if figure.measure is None else measure(figure.measure, graph, recording)
        if value is not None:
            found.append(MeasuredValue(figure=key.name, node=key.node, value=value, label=figure.label))
    return found


def _samples(graph: Graph, recording: Recording, module: str) -> int:
    """Samples that a module sensed until its last chance to act, which nobody has at the end tick."""
    first, count = recording.span(graph.reads[module])
    return min(first + count, graph.end_tick) - first


def _triggers(graph: Graph, recording: Recording, steady: int) -> dict[str, Triggers]:
    found = {}
    for name in graph.reporters:
        if not graph.modules[name].triggers:
            continue
        ticks = trigger_ticks(graph, recording, name)
        gaps = seconds(np.diff(ticks), graph.ticks_per_second)
        late = seconds(np.diff(ticks[ticks >= steady]), graph.ticks_per_second)
        found[name] = Triggers(
            count=ticks.size,
            min_interval_s=float(gaps.min()) if gaps.size else None,
            mean_interval_s=float(gaps.mean()) if gaps.size else None,
            max_interval_s=float(gaps.max()) if gaps.size else None,
            steady_mean_interval_s=float(late.mean()) if late.size else None,
            sum_of_sent=sum_of_sent(graph, recording, name),
            times_s=seconds(ticks, graph.ticks_per_second).tolist(),
        )
    return found


def _link_topics(graph: Graph, recording: Recording, measured_cdr: Mapping[str, int] | None) -> dict[str, Topic]:
    topics = {}
    for link in graph.links.values():
        messages = recording.messages[link.name]
        times = [seconds(message.tick, graph.ticks_per_second) for message in messages]
        physical = link.kind is LinkKind.PHYSICAL
        computed = len(messages) * link.wire.cdr_bytes
        topics[link.topic] = Topic(
            kind="emulation" if physical else link.kind.value,
            type=link.wire.type_name,
            messages=len(messages),
            deliveries=sum(len(deliveries(graph, recording, link, receiver)) for receiver in link.receivers),
            payload_bytes=0 if physical else len(messages) * link.wire.payload_bytes,
            cdr_bytes=computed if measured_cdr is None else measured_cdr.get(link.topic, 0),
            model_wire_bytes=None if physical else len(messages) * _wire_bytes(link),
            first_s=min(times, default=None),
            last_s=max(times, default=None),
        )
    return topics


def _wire_bytes(link: Link) -> int:
    """One message of a link on Ethernet, beside a recorder that gets it, too."""
    return data_frames(link.wire.cdr_bytes, link.wire.payload_bytes, len(link.receivers), others=1).total_bytes


def _totals(topics: Mapping[str, Topic], kind: Kind) -> Totals:
    chosen = [topic for topic in topics.values() if topic.kind == kind]
    return Totals(
        messages=sum(topic.messages for topic in chosen),
        deliveries=sum(topic.deliveries for topic in chosen),
        payload_bytes=sum(topic.payload_bytes for topic in chosen),
        cdr_bytes=sum(topic.cdr_bytes for topic in chosen),
    )


def _performance(graph: Graph, recording: Recording, name: str, steady: int) -> Performance:
    module = graph.modules[name]
    assert isinstance(module, PlantModule)
    first, count = recording.span(name)
    late = first + min(max(steady - first, 0), count - 1)  # a run that was halted may have no steady part
    used = energy(graph, recording, name, first, first + count - 1)
    of_torque = all("torque" in port for port in module.inputs)
    if not has_attitude(module.plant):
        return Performance(
            attitude_error_deg=None, rate_deg_s=None, max_attitude_error_deg=None, max_rate_deg_s=None,
            energy_n2m2s=used, of_torque=of_torque,
        )  # fmt: skip
    largest_angle = largest_rate = -math.inf
    for part in recording.parts(name):
        begin, states = part.samples(name)
        skipped = max(late - begin, 0)
        if skipped >= states.shape[0]:
            continue
        errors = errors_of(module.plant, states[skipped:], begin + skipped)
        angles = np.degrees(module.plant.attitude_angle(errors))
        rates = np.degrees(row_norms(errors[:, module.plant.rate_slice]))
        largest_angle = float(np.maximum(largest_angle, angles.max()))  # which keeps what is no number
        largest_rate = float(np.maximum(largest_rate, rates.max()))
    return Performance(
        attitude_error_deg=float(angles[-1]),
        rate_deg_s=float(rates[-1]),
        max_attitude_error_deg=largest_angle,
        max_rate_deg_s=largest_rate,
        energy_n2m2s=used,
        of_torque=of_torque,
    )


def _watches(graph: Graph, recording: Recording, name: str, steady: int) -> list[Watched]:
    plant = name if name in graph.plants else graph.reads.get(name)
    if plant is None:
        return []
    first, count = recording.span(plant)
    late = first + min(max(steady - first, 0), count - 1)
    found: list[Watched] = []
    # What a plant watches follows from each sample by itself; what a law with memory watches from all before, too.
    for part in recording.parts(plant) if name in graph.plants else (recording,):
        begin, watches = watches_of_module(graph, part, name)
        these = [_watched(watch, begin, late, graph.ticks_per_second) for watch in watches]
        found = [_going_on(before, one) for before, one in zip(found, these, strict=True)] if found else these
    return found


def _watched(watch: Watch, first: int, late: int, rate: int) -> Watched:
    magnitudes = np.abs(watch.values)
    row, column = np.unravel_index(int(np.argmax(magnitudes)), magnitudes.shape)
    steady = magnitudes[max(late - first, 0) :]
    return Watched(
        name=watch.name,
        unit=watch.unit,
        largest=float(magnitudes[row, column]),
        axis=watch.axes[column],
        at_s=float(seconds(first + int(row), rate)),
        steady=float(steady.max()) if steady.size else 0.0,
        final=float(magnitudes[-1].max()),
        notice=watch.notice,
        bound=watch.bound,
    )


def _going_on(before: Watched, later: Watched) -> Watched:
    """The same quantity over a part of the run and the next; what is no number once is none."""
    larger = not (later.largest <= before.largest) and not math.isnan(before.largest)
    top = later if larger else before
    steady = float(np.maximum(before.steady, later.steady))
    return later.model_copy(update={"largest": top.largest, "axis": top.axis, "at_s": top.at_s, "steady": steady})
