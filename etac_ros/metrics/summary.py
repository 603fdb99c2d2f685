"""What crossed the links of a run, and how well the spacecraft pointed meanwhile: the summary of a run.

The models below are the machine-readable summary that ``--json`` writes; ``summary.schema.json`` is made from them.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from typing import Literal

import numpy as np
from pydantic import BaseModel, ConfigDict, Field, JsonValue

from etac_ros.graph.graph import Graph, LinkKind
from etac_ros.graph.plant import PlantModule
from etac_ros.graph.recording import Recording
from etac_ros.graph.replay import deliveries, energy, trigger_ticks
from etac_ros.maths.ticks import seconds
from etac_ros.metrics.published import measure, watches_of_module
from etac_ros.plants.plant import errors_of, has_attitude
from etac_ros.scenario.load import Scenario

Kind = Literal["network", "internal", "emulation"]
_LAST_PART = 0.4
"""Steady figures are taken over this last part of a run, unless the scenario says from when on."""


class _Model(BaseModel):
    model_config = ConfigDict(extra="forbid")


class Triggers(_Model):
    """Triggering instants of one sensor."""

    count: int
    min_interval_s: float | None = Field(description="shortest inter-event time; null below two triggers")
    mean_interval_s: float | None
    max_interval_s: float | None
    steady_mean_interval_s: float | None = Field(description="mean inter-event time of the steady part")
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
    first_s: float | None = Field(description="simulated time of the first message; null if unknown or none")
    last_s: float | None


class Performance(_Model):
    """How well one plant pointed."""

    attitude_error_deg: float | None = Field(description="at the end; null of a plant that has no attitude")
    rate_deg_s: float | None = Field(description="at the end; likewise")
    max_attitude_error_deg: float | None = Field(description="over the steady part of the run; likewise")
    max_rate_deg_s: float | None = Field(description="over the steady part of the run; likewise")
    energy_n2m2s: float = Field(description="integral of the held torque's square [N^2 m^2 s]")


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


class PublishedValue(_Model):
    """A figure of the paper."""

    value: float
    low: float
    high: float
    label: str = Field(description="what it is called, where its name does not say it")
    where: str = Field(description="where the paper prints it")
    reason: str = Field(description="why it is not reproduced, where it is not")


class Summary(_Model):
    """The summary of one run."""

    scenario: str
    variant: str | None
    engine: Literal["ros", "inprocess"]
    overrides: dict[str, JsonValue]
    seed: int
    duration_s: float = Field(description="simulated")
    steady_from_s: float = Field(description="simulated time from which steady figures are taken")
    halted: str = Field(description="why a watch ended the run early; empty otherwise")
    triggers: dict[str, Triggers] = Field(description="by the sensor's full name")
    topics: dict[str, Topic]
    network: Totals
    internal: Totals
    emulation: Totals
    final_state: dict[str, list[float]] = Field(description="by plant; the digits restore the very bits")
    performance: dict[str, Performance] = Field(description="by plant")
    watches: dict[str, list[Watched]] = Field(description="by node: what is watched, with bounds where it has to stay")
    samples: dict[str, int] = Field(description="committed samples that a module took inside itself, without a message")
    timing: Timing
    memory_kib: dict[str, int] = Field(description="peak memory of the process of each node")
    bag: str | None
    published: dict[str, PublishedValue]
    own: dict[str, float] = Field(description="figures that only this scenario defines")
    measured: dict[str, float] = Field(description="all figures that may stand beside published ones")
    baseline: Summary | None = Field(default=None, description="the same of the baseline, where it was run")


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
    halted: str = "",
    bag: str | None = None,
) -> Summary:
    """The summary of a recorded run.

    Parameters
    ----------
    scenario, graph
        What was run.
    recording
        What came of it.
    engine, timing, memory_kib, halted, bag
        Taken over.
    plane
        Topics of the emulation plane: type, messages, CDR bytes.
    measured_cdr
        CDR bytes of each link's topic as raw subscriptions measured them; without it they are computed.
    """
    topics = _link_topics(graph, recording, measured_cdr)
    for name, (kind, messages, size) in (plane or {}).items():
        if name not in topics:
            topics[name] = Topic(
                kind="emulation", type=kind, messages=messages, deliveries=messages, payload_bytes=0, cdr_bytes=size,
                first_s=None, last_s=None,
            )  # fmt: skip
    from_s = steady_from_s(scenario)
    steady = round(from_s * graph.ticks_per_second)
    summary = Summary(
        scenario=scenario.name,
        variant=scenario.variant,
        engine=engine,
        overrides=dict(scenario.overrides),
        seed=scenario.run.seed,
        duration_s=scenario.run.duration_s,
        steady_from_s=from_s,
        halted=halted,
        triggers=_triggers(graph, recording, steady),
        topics=topics,
        network=_totals(topics, "network"),
        internal=_totals(topics, "internal"),
        emulation=_totals(topics, "emulation"),
        final_state={name: recording.samples(name)[1][-1].tolist() for name in graph.plants},
        performance={name: _performance(graph, recording, name, steady) for name in graph.plants},
        watches={name: found for name in graph.modules if (found := _watches(graph, recording, name, steady))},
        samples={name: _samples(graph, recording, name) for name, module in graph.modules.items() if module.senses},
        timing=timing,
        memory_kib=dict(memory_kib or {}),
        bag=bag,
        published={
            name: PublishedValue(**figure.model_dump(exclude={"measure"}))
            for name, figure in scenario.published.items()
        },
        own=_own_figures(scenario, graph, recording),
        measured={},
    )
    return with_measured(summary, None)


def with_measured(summary: Summary, baseline: Summary | None) -> Summary:
    """The summary with the figures that stand beside the paper's, and with its baseline.

    A figure of one sensor bears its name: ``triggers_pm_relative_sensor``; where there is one sensor only, it is
    ``triggers`` and ``max_interval_s``.
    """
    measured = {}
    for name, triggers in summary.triggers.items():
        suffix = "" if len(summary.triggers) == 1 else name.replace("/", "_")
        measured[f"triggers{suffix}"] = float(triggers.count)
        for figure in ("min_interval_s", "mean_interval_s", "steady_mean_interval_s", "max_interval_s"):
            value = getattr(triggers, figure)
            if value is not None:
                measured[f"{figure}{suffix}"] = value
    measured.update(summary.own)
    energy_used = sum(figures.energy_n2m2s for figures in summary.performance.values())
    measured["energy_n2m2s"] = energy_used
    measured["network_messages"] = float(summary.network.messages)
    measured["network_deliveries"] = float(summary.network.deliveries)
    measured["network_payload_bytes"] = float(summary.network.payload_bytes)
    if baseline is not None:
        measured["baseline_messages"] = float(baseline.network.messages)
        measured["baseline_payload_bytes"] = float(baseline.network.payload_bytes)
        if baseline.network.messages:
            measured["message_reduction_percent"] = 100.0 * (1.0 - summary.network.messages / baseline.network.messages)
        if baseline.network.payload_bytes:
            ratio = summary.network.payload_bytes / baseline.network.payload_bytes
            measured["reduction_percent"] = 100.0 * (1.0 - ratio)
        measured.update(_against(summary, energy_used, baseline))
    return summary.model_copy(update={"measured": measured, "baseline": baseline})


def _against(summary: Summary, energy_used: float, baseline: Summary) -> dict[str, float]:
    """What a baseline needs more, in triggering instants and energy."""
    found = {}
    if len(summary.triggers) == len(baseline.triggers) == 1:
        (own,), (other,) = summary.triggers.values(), baseline.triggers.values()
        found["baseline_more_triggers"] = float(other.count - own.count)
    for name, triggers in summary.triggers.items():
        of_baseline = baseline.triggers.get(name)
        if of_baseline is not None and of_baseline.count:
            suffix = "" if len(summary.triggers) == 1 else name.replace("/", "_")
            found[f"trigger_reduction_percent{suffix}"] = 100.0 * (1.0 - triggers.count / of_baseline.count)
    energy_of_baseline = sum(figures.energy_n2m2s for figures in baseline.performance.values())
    found["baseline_more_energy_n2m2s"] = energy_of_baseline - energy_used
    if energy_of_baseline > 0.0:
        found["energy_reduction_percent"] = 100.0 * (1.0 - energy_used / energy_of_baseline)
    return found


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


def _own_figures(scenario: Scenario, graph: Graph, recording: Recording) -> dict[str, float]:
    found = {}
    for name, figure in scenario.published.items():
        value = None if figure.measure is None else measure(figure.measure, graph, recording)
        if value is not None:
            found[name] = value
    return found


def _samples(graph: Graph, recording: Recording, module: str) -> int:
    """Samples that a module sensed until its last chance to act, which nobody has at the end tick."""
    first, states = recording.samples(graph.reads[module])
    return min(first + int(states.shape[0]), graph.end_tick) - first


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
            first_s=min(times, default=None),
            last_s=max(times, default=None),
        )
    return topics


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
    first, states = recording.samples(name)
    late = min(max(steady - first, 0), states.shape[0] - 1)  # a run that was halted may have no steady part
    used = energy(graph, recording, name, first, first + states.shape[0] - 1)
    if not has_attitude(module.plant):
        return Performance(
            attitude_error_deg=None, rate_deg_s=None, max_attitude_error_deg=None, max_rate_deg_s=None,
            energy_n2m2s=used,
        )  # fmt: skip
    errors = errors_of(module.plant, states[late:], first + late)
    angles = np.degrees(module.plant.attitude_angle(errors))
    rates = np.degrees(np.linalg.norm(errors[:, module.plant.rate_slice], axis=1))
    return Performance(
        attitude_error_deg=float(angles[-1]),
        rate_deg_s=float(rates[-1]),
        max_attitude_error_deg=float(angles.max()),
        max_rate_deg_s=float(rates.max()),
        energy_n2m2s=used,
    )


def _watches(graph: Graph, recording: Recording, name: str, steady: int) -> list[Watched]:
    first, watches = watches_of_module(graph, recording, name)
    found = []
    for watch in watches:
        magnitudes = np.abs(watch.values)
        row, column = np.unravel_index(int(np.argmax(magnitudes)), magnitudes.shape)
        late = min(max(steady - first, 0), magnitudes.shape[0] - 1)
        found.append(
            Watched(
                name=watch.name,
                unit=watch.unit,
                largest=float(magnitudes[row, column]),
                axis=watch.axes[column],
                at_s=float(seconds(first + int(row), graph.ticks_per_second)),
                steady=float(magnitudes[late:].max()),
                final=float(magnitudes[-1].max()),
                notice=watch.notice,
                bound=watch.bound,
            )
        )
    return found
