"""The description of a run that its bag carries, so that nobody has to import a class to read it: ``run.json``.

It says which nodes there were and which links joined them, what the components of a plant's state are called, and
where in the bag stands what only the classes of the run could compute of the samples (:mod:`etac_ros.bag.derived`).
A bag may come from a stranger, so every value is checked when it is read.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import asdict
from typing import Annotated, Literal

from pydantic import BaseModel, ConfigDict, Field, ValidationError

from etac_ros.graph.channel import Bursts, Channel, Jitter
from etac_ros.graph.faults import Fault, FaultKind
from etac_ros.graph.graph import Acknowledgement, AfterLast, Graph, Link, LinkKind
from etac_ros.graph.module import Module
from etac_ros.graph.plant import PlantModule
from etac_ros.graph.wire import WireFormat
from etac_ros.media.frame import Line
from etac_ros.media.medium import Full, MediumPlan
from etac_ros.plants.plant import Plant, has_attitude, modes_slice_of

DESCRIPTION_ATTACHMENT = "run.json"
VERSION = 1
"""Of what :class:`RunDescription` says; a reader refuses any other."""

_MOST_BYTES = 16 * 1024 * 1024
_MOST_COLUMNS = 100_000
_Index = Annotated[int, Field(ge=0, le=_MOST_COLUMNS)]
_Span = tuple[_Index, _Index]
Quantity = Literal["errors", "attitude angle", "euler angles", "rates", "watch"]


class _Model(BaseModel):
    model_config = ConfigDict(defer_build=True, extra="forbid", frozen=True, allow_inf_nan=False)


class Columns(_Model):
    """Neighbouring columns of what was derived of a node's samples."""

    quantity: Quantity = Field(description="errors: states less reference; a watch: what has to stay within bounds")
    of: str = Field(default="", description="name of the body or of the watch")
    unit: str = ""
    span: _Span = Field(description="first column, and the one behind the last")
    axes: tuple[str, ...] = ()
    bound: float | None = Field(default=None, description="of a watch: leaving it ends the run")
    notice: float | None = Field(default=None, description="of a watch: a bound that is only reported")


class PlantDescription(_Model):
    """What the state of a plant means."""

    labels: tuple[str, ...] = Field(description="name and unit of each component of the state")
    attitude: _Span | None = Field(default=None, description="where the attitude error stands; null without any")
    rate: _Span | None = Field(default=None, description="where the angular velocity error stands [rad/s]")
    modes: _Span = Field(description="where modal coordinates stand; empty without any")


class NodeDescription(_Model):
    """One module."""

    cls: str = Field(alias="class", description="of the module, or of the plant that it simulates; only words here")
    inputs: dict[str, _Index] = Field(description="ports and their sizes")
    outputs: dict[str, _Index]
    reads: str | None = Field(default=None, description="the plant whose samples it sees")
    answers: bool = False
    passive: bool = False
    triggers: str = Field(default="", description="output port whose messages are triggering instants")
    senses: bool = False
    external: bool = False
    hold_ticks: Annotated[int, Field(ge=1)] | None = Field(default=None, description="how long it holds at most")
    plant: PlantDescription | None = None


class AcknowledgementDescription(_Model):
    """How the messages of a link were acknowledged."""

    timeout_ns: Annotated[int, Field(ge=0)]
    retries: Annotated[int, Field(ge=0)]
    by: dict[str, str] = Field(description="receivers that acknowledge, and the line over which each does")
    any_suffices: bool
    frame_bytes: _Index
    after_last: AfterLast
    told: bool = Field(description="whether the sender's trigger rule compared with what was acknowledged")


class LinkDescription(_Model):
    """One link, with all that decides what becomes of its messages."""

    topic: str
    kind: LinkKind
    sender: str
    port: str
    receivers: dict[str, str] = Field(description="receiving node to its input port")
    wire: WireFormat
    size: _Index = Field(description="components of a value")
    seed: int
    delay_ticks: Annotated[int, Field(ge=0)] | Annotated[float, Field(ge=0.0)]
    loss: Annotated[float, Field(ge=0.0, le=1.0)]
    outages: dict[str, tuple[tuple[int, int], ...]]
    medium: str | None = None
    jitter: Jitter | None = None
    bursts: Bursts | None = None
    duplication: Annotated[float, Field(ge=0.0, le=1.0)] | None = Field(default=None, description="null for none")
    acknowledged: AcknowledgementDescription | None = None


class LineDescription(_Model):
    """What every frame of a link on a medium has in common."""

    sender: str
    payload_bytes: _Index
    frame_bytes: _Index = Field(description="payload and overhead")
    duration_ns: Annotated[int, Field(ge=1)]
    answers: bool | None = Field(default=None, description="true of acknowledgements, else null")


class MediumDescription(_Model):
    """One shared medium, as far as it takes to account for what it carried."""

    rate_bit_s: Annotated[float, Field(gt=0.0)]
    propagation_ns: Annotated[int, Field(ge=0)]
    queue_length: Annotated[int, Field(ge=1)]
    queue_full: Full
    powers_w: tuple[Annotated[float, Field(gt=0.0)], Annotated[float, Field(gt=0.0)]] | None = None
    lines: dict[str, LineDescription]


class FaultDescription(_Model):
    """What happened to the process of a node, at the ticks from one to before another."""

    name: str
    node: str
    kind: FaultKind
    from_tick: Annotated[int, Field(ge=0)]
    until_tick: Annotated[int, Field(ge=1)]


class RunDescription(_Model):
    """A run: its graph, and what stands in the bag beside messages and truth."""

    version: Literal[1]
    ticks_per_second: Annotated[int, Field(ge=1)]
    end_tick: Annotated[int, Field(ge=0)]
    nodes: dict[str, NodeDescription]
    links: dict[str, LinkDescription]
    media: dict[str, MediumDescription] | None = Field(default=None, description="null for none")
    faults: tuple[FaultDescription, ...] | None = Field(default=None, description="in order; null for none")
    derived: dict[str, tuple[Columns, ...]] = Field(
        default={}, description="by node: columns of its topic /emulation/NODE/derived"
    )


def describe_run(graph: Graph, derived: Mapping[str, tuple[Columns, ...]]) -> RunDescription:
    """Describe a graph, given the columns that are derived of its nodes' samples."""
    return RunDescription(
        version=VERSION,
        ticks_per_second=graph.ticks_per_second,
        end_tick=graph.end_tick,
        nodes={name: _node(graph, name, module) for name, module in graph.modules.items()},
        links={name: _link(link) for name, link in graph.links.items()},
        media={name: _medium(plan) for name, plan in graph.media.items()} or None,
        faults=tuple(_fault(fault) for fault in graph.faults) or None,
        derived=dict(derived),
    )


def to_json(description: RunDescription) -> bytes:
    """Write the attachment."""
    return (description.model_dump_json(by_alias=True, indent=1, exclude_none=True) + "\n").encode()


def from_json(data: bytes) -> RunDescription:
    """Read the attachment, and make sure that it fits together.

    Raises
    ------
    ValueError
        If it is none, or not of this version.
    """
    if len(data) > _MOST_BYTES:
        raise ValueError(f"it has {len(data)} bytes, more than {_MOST_BYTES}")
    try:
        found = RunDescription.model_validate_json(data)
    except ValidationError as error:
        first = error.errors(include_url=False, include_context=False)[0]
        where = ".".join(str(part) for part in first["loc"])
        raise ValueError(f"{where}: {first['msg']}" if where else str(first["msg"])) from None
    for fault in _faults(found):
        raise ValueError(fault)
    return found


def json_schema() -> str:
    """The JSON schema of the attachment."""
    return json.dumps(RunDescription.model_json_schema(), indent=2) + "\n"


def _node(graph: Graph, name: str, module: Module) -> NodeDescription:
    plant = module.plant if isinstance(module, PlantModule) else None
    kind = type(module if plant is None else plant)
    return NodeDescription(
        **{"class": f"{kind.__module__}:{kind.__qualname__}"},
        inputs=dict(module.inputs),
        outputs=dict(module.outputs),
        reads=graph.reads.get(name),
        answers=module.answers,
        passive=module.passive,
        triggers=module.triggers,
        senses=module.senses,
        external=name in graph.external,
        hold_ticks=module.hold_ticks,
        plant=None if plant is None else _plant(plant),
    )


def _plant(plant: Plant) -> PlantDescription:
    size = len(plant.labels)
    return PlantDescription(
        labels=tuple(plant.labels),
        attitude=_span(plant.attitude_slice, size) if has_attitude(plant) else None,
        rate=_span(plant.rate_slice, size) if has_attitude(plant) else None,
        modes=_span(modes_slice_of(plant), size),
    )


def _span(where: slice, size: int) -> tuple[int, int]:
    start, stop, _ = where.indices(size)
    return start, max(start, stop)


def _link(link: Link) -> LinkDescription:
    channel: Channel = link.channel
    return LinkDescription(
        topic=link.topic,
        kind=link.kind,
        sender=link.sender,
        port=link.port,
        receivers=dict(link.receivers),
        wire=link.wire.format,
        size=link.wire.size,
        seed=channel.seed,
        delay_ticks=channel.delay_ticks,
        loss=channel.loss,
        outages=dict(channel.outages),
        medium=link.medium or None,
        jitter=channel.jitter,
        bursts=channel.bursts,
        duplication=channel.duplication or None,
        acknowledged=None if link.acknowledged is None else _acknowledgement(link.acknowledged),
    )


def _acknowledgement(found: Acknowledgement) -> AcknowledgementDescription:
    return AcknowledgementDescription(**{**asdict(found), "by": dict(found.by)})


def _medium(plan: MediumPlan) -> MediumDescription:
    return MediumDescription(
        rate_bit_s=plan.rate_bit_s,
        propagation_ns=plan.propagation_ns,
        queue_length=plan.queue_length,
        queue_full=plan.queue_full,
        powers_w=plan.powers_w,
        lines={name: _line(line) for name, line in plan.lines.items()},
    )


def _fault(fault: Fault) -> FaultDescription:
    return FaultDescription(**asdict(fault))


def _line(line: Line) -> LineDescription:
    return LineDescription(**{**line._asdict(), "answers": line.answers or None})


def _faults(found: RunDescription) -> list[str]:
    faults = []
    plants = {name for name, node in found.nodes.items() if node.plant is not None}
    if not plants:
        faults.append("nodes: none of them is a plant")
    for name, node in found.nodes.items():
        if node.reads is not None and node.reads not in plants:
            faults.append(f"nodes.{name}.reads: '{node.reads}' is no plant")
    for name, link in found.links.items():
        for end, port, ports in [
            (link.sender, link.port, "outputs"),
            *((receiver, port, "inputs") for receiver, port in link.receivers.items()),
        ]:
            joined = found.nodes.get(end)
            if joined is None or getattr(joined, ports).get(port) != link.size:
                faults.append(f"links.{name}: {end}:{port} is none of the {ports} of a node, of size {link.size}")
        if link.medium is not None and name not in _lines(found, link.medium):
            faults.append(f"links.{name}.medium: '{link.medium}' does not carry it")
        if link.acknowledged is not None and not link.acknowledged.by.keys() <= link.receivers.keys():
            faults.append(f"links.{name}.acknowledged.by: {sorted(link.acknowledged.by)} do not all receive it")
    for fault in found.faults or ():
        if fault.node not in found.nodes or fault.from_tick >= fault.until_tick:
            faults.append(f"faults: '{fault.name}' is none of a node")
    for name, columns in found.derived.items():
        if name not in found.nodes:
            faults.append(f"derived: there is no node '{name}'")
        place = 0
        for part in columns:
            if part.span[0] != place or part.span[1] < place:
                faults.append(f"derived.{name}: columns {part.span} do not follow column {place}")
            if part.quantity == "watch" and len(part.axes) != part.span[1] - part.span[0]:
                faults.append(f"derived.{name}: {len(part.axes)} axes of columns {part.span}")
            place = part.span[1]
    return faults


def _lines(found: RunDescription, medium: str) -> Mapping[str, LineDescription]:
    return found.media[medium].lines if found.media and medium in found.media else {}
