"""From validated sections to a graph of modules."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from dataclasses import replace
from itertools import pairwise
from typing import Any

from etac_ros.errors import ScenarioError
from etac_ros.graph.channel import Channel
from etac_ros.graph.faults import Fault
from etac_ros.graph.graph import Graph, Link, LinkKind, Qos
from etac_ros.graph.module import Context, Module
from etac_ros.graph.plant import PlantModule
from etac_ros.graph.topics import EMULATION, STATE, is_taken
from etac_ros.graph.wire import Wire, WireFormat
from etac_ros.maths.ticks import ticks_in, whole_ticks
from etac_ros.modules.actuator import Actuator
from etac_ros.modules.controller import Controller
from etac_ros.modules.sensor import Sensor
from etac_ros.scenario.acknowledged import acknowledgement, check_timeout, tells
from etac_ros.scenario.classes import (
    Interface,
    check_methods,
    check_module,
    component,
    import_class,
    interface,
    made,
    parameters_of,
    validated,
    with_parameters,
)
from etac_ros.scenario.document import EVERYWHERE, choice, nearest, shown
from etac_ros.scenario.faults import field_names, unknown_key
from etac_ros.scenario.media import media_of
from etac_ros.scenario.process_faults import check_faults, faults_of, spares_of
from etac_ros.scenario.schema import LinkSection, NodeSection, RunSection
from etac_ros.scenario.trust import foreign_classes

_SHORT_NAMES: dict[str, type[Module]] = {
    "plant": PlantModule,
    "sensor": Sensor,
    "controller": Controller,
    "actuator": Actuator,
}
_COMPONENT = "a mapping with the key 'class' (package.module:Class)"
_TOPIC = re.compile(r"(/[A-Za-z_][A-Za-z0-9_]*)+")


def node_parameters(section: NodeSection, where: str) -> dict[str, Any]:
    """All parameters of a node, checked against its classes and complete with their defaults.

    Raises
    ------
    ScenarioError
        With file, node and key of what is wrong.
    """
    module = _module_class(section.module, where)
    given = dict(section.__pydantic_extra__ or {})
    complete: dict[str, Any] = section.model_dump(
        mode="json", include={"module", "reads", "external"}, exclude_defaults=True
    )
    # Unknown keys first: a mistyped component is both, unknown and missing.
    _check_keys(module, given, where)
    for name in module.components:
        if name not in given:
            raise ScenarioError(f"{where}.{name}", "is missing", _COMPONENT)
        complete[name] = _component_parameters(given.pop(name), interface(module, name), f"{where}.{name}")
    own = validated(module.Parameters, given, where)
    complete.update(own.model_dump(mode="json", exclude_none=True))
    return complete


def _check_keys(module: type[Module], given: Mapping[str, Any], where: str) -> None:
    if module.Parameters.model_config.get("extra") == "allow":
        return
    own = [*module.components, *field_names(module.Parameters)]
    for key in given:
        if key not in own:
            raise unknown_key(key, [*own, *field_names(NodeSection)], f"{where}.{key}")


def _component_parameters(given: Any, wanted: Interface, where: str) -> dict[str, Any]:
    if not isinstance(given, dict) or "class" not in given:
        raise ScenarioError(where, f"found {shown(given)}", _COMPONENT)
    values = {key: value for key, value in given.items() if key != "class"}
    kind = with_parameters(import_class(str(given["class"]), f"{where}.class"), f"{where}.class")
    check_methods(kind, wanted, f"{where}.class")
    checked = validated(parameters_of(kind, wanted), values, where)
    return {"class": given["class"], **checked.model_dump(mode="json", exclude_none=True)}


def _module_class(name: str, where: str) -> type[Module]:
    if name in _SHORT_NAMES:
        return _SHORT_NAMES[name]
    if ":" not in name:
        best = nearest(name, _SHORT_NAMES)
        hint = f"'{best}'? " if best else ""
        raise ScenarioError(
            f"{where}.module",
            f"found '{name}'",
            f"{hint}one of: {', '.join(_SHORT_NAMES)}, or package.module:Class",
        )
    found = import_class(name, f"{where}.module")
    if not issubclass(found, Module):
        raise ScenarioError(f"{where}.module", f"{name} is no module", "a subclass of etac_ros.graph.module:Module")
    with_parameters(found, f"{where}.module")
    return found


def build(run: RunSection, nodes: Mapping[str, Mapping[str, Any]], end_tick: int, file: str) -> Graph:
    """Build the modules and links of a scenario.

    Parameters
    ----------
    run, nodes
        From :func:`node_parameters` and the schema: complete and valid one by one.
    end_tick
        First tick that is not acted on.
    file
        For messages.

    Raises
    ------
    ScenarioError
        If they do not fit together: an unknown node or port, sizes that differ, an input that nobody feeds.
    """
    ends = {name: _ends(link, nodes, _link_key(file, name)) for name, link in run.links.items()}
    formats: dict[str, dict[str, WireFormat]] = {name: {} for name in nodes}
    for name, section in run.links.items():
        node, port = ends[name][0]
        # A value goes out once: where a port has several links, it is rounded to the coarsest of them.
        wire = _format(section, run)
        if wire is WireFormat.COMPACT or port not in formats[node]:
            formats[node][port] = wire
    modules: dict[str, Module] = {}
    # Plants first: their readers are told of them when they are built.
    plants = [
        name
        for name, section in nodes.items()
        if issubclass(_module_class(section["module"], f"{file}: {name}"), PlantModule)
    ]
    for name in dict.fromkeys([*plants, *nodes]):
        incoming = tuple(link for link, (_, receivers) in ends.items() if any(node == name for node, _ in receivers))
        given = (name, run, nodes, modules, formats[name], incoming)
        modules[name] = _module(*given, frozenset(), f"{file}: {name}")
        told = _told(name, run, ends, modules[name], file)
        if told:  # whether it can be told, only the module itself could tell
            modules[name] = _module(*given, told, f"{file}: {name}")
    modules = {name: modules[name] for name in nodes}
    faults = faults_of(run, modules, end_tick, file)
    for fault in faults:
        context = modules[fault.node].context
        spans = (*context.down, (fault.from_tick, fault.until_tick))
        modules[fault.node].context = replace(context, down=spans)
    down = {node: tuple(fault for fault in faults if fault.node == node) for node in {fault.node for fault in faults}}
    links = {
        name: _link(name, section, run, ends[name], modules, down, _link_key(file, name))
        for name, section in run.links.items()
    }
    external = frozenset(name for name, section in nodes.items() if section.get("external"))
    reads = {name: section["reads"] for name, section in nodes.items() if "reads" in section}
    media = media_of(run, links, file)
    for name, link in links.items():
        if link.acknowledged is not None:
            where = f"{_link_key(file, name)}.acknowledged"
            check_timeout(link.acknowledged, link.channel, media.get(link.medium), run.ticks_per_second, where)

    def spare(name: str) -> Module:
        incoming = tuple(link for link, (_, receivers) in ends.items() if any(node == name for node, _ in receivers))
        told = modules[name].context.acknowledged
        return _module(name, run, nodes, modules, formats[name], incoming, told, f"{file}: {name}")

    spares = spares_of(faults, spare)
    own = not foreign_classes(nodes)
    graph = Graph(modules, reads, links, run.ticks_per_second, end_tick, external, media, faults, spares, own)
    _check(graph, file)
    check_faults(graph, file)
    return graph


def _link_key(file: str, link: str) -> str:
    return f"{file}: {EVERYWHERE}.links.{link}"


def _module(
    name: str,
    run: RunSection,
    nodes: Mapping[str, Mapping[str, Any]],
    built: Mapping[str, Module],
    formats: Mapping[str, WireFormat],
    incoming: tuple[str, ...],
    acknowledged: frozenset[str],
    where: str,
) -> Module:
    section = dict(nodes[name])
    kind = _module_class(section.pop("module"), where)
    section.pop("external", None)
    reads = section.pop("reads", None)
    plant = None
    if reads is not None:
        source = built.get(reads)
        if not isinstance(source, PlantModule):
            plants = [name for name, module in built.items() if isinstance(module, PlantModule)]
            raise ScenarioError(f"{where}.reads", f"'{reads}' is no plant", f"one of: {', '.join(plants)}")
        plant = source.plant
    components: dict[str, Any] = {}
    for part in kind.components:
        values = dict(section.pop(part))
        named = import_class(values.pop("class"), f"{where}.{part}.class")
        wanted = interface(kind, part)
        parameters = validated(parameters_of(named, wanted), values, f"{where}.{part}")
        components[part] = component(named, wanted, parameters, run.ticks_per_second, f"{where}.{part}")
    context = Context(name, run.ticks_per_second, run.seed, plant, formats, incoming, acknowledged)
    module: Module = made(kind, where, context, validated(kind.Parameters, section, where), **components)
    check_module(module, where)
    return module


def _told(
    name: str,
    run: RunSection,
    ends: Mapping[str, tuple[tuple[str, str], list[tuple[str, str]]]],
    module: Module,
    file: str,
) -> frozenset[str]:
    """Ports of a module of whose messages it is told whether they were acknowledged."""
    found: dict[str, str] = {}
    for link, section in run.links.items():
        node, wanted = ends[link][0]
        if node != name or section.acknowledged is None:
            continue
        port = _port(wanted, module.outputs, f"{_link_key(file, link)}.from", f"output of {name}")
        if not tells(section, module, port, _link_key(file, link)):
            continue
        if port in found:
            raise ScenarioError(
                f"{_link_key(file, link)}.acknowledged.compares_with",
                f"the port '{port}' of {name} has another acknowledged link, {found[port]}",
                "compares_with: sent in all of them but one",
            )
        found[port] = link
    return frozenset(found)


def _ends(
    section: LinkSection, nodes: Mapping[str, Mapping[str, Any]], where: str
) -> tuple[tuple[str, str], list[tuple[str, str]]]:
    def end(text: str, key: str) -> tuple[str, str]:
        name, _, port = text.partition(":")
        name = "/" + name.strip("/")
        if name not in nodes:
            raise ScenarioError(f"{where}.{key}", f"there is no node '{name}'", choice(name, nodes))
        return name, port

    return end(section.sender, "from"), [end(text, "to") for text in section.to]


def _format(section: LinkSection, run: RunSection) -> WireFormat:
    return WireFormat.DOUBLE if section.kind is LinkKind.PHYSICAL else section.wire or run.wire


def _link(
    name: str,
    section: LinkSection,
    run: RunSection,
    ends: tuple[tuple[str, str], list[tuple[str, str]]],
    modules: Mapping[str, Module],
    down: Mapping[str, tuple[Fault, ...]],
    where: str,
) -> Link:
    sender, port = ends[0]
    port = _port(port, modules[sender].outputs, f"{where}.from", f"output of {sender}")
    size = modules[sender].outputs[port]
    receivers: dict[str, str] = {}
    for node, wanted in ends[1]:
        if node in receivers:
            raise ScenarioError(f"{where}.to", f"{node} stands there twice", "another link for its other input")
        inputs = modules[node].inputs
        receivers[node] = _port(wanted, inputs, f"{where}.to", f"input of {node}")
        if inputs[receivers[node]] != size:
            raise ScenarioError(
                f"{where}.to",
                f"{node}:{receivers[node]} takes {inputs[receivers[node]]} components, {sender}:{port} sends {size}",
                "equal sizes",
            )
    namespace = EMULATION if section.kind is LinkKind.PHYSICAL else ""
    topic = section.topic or f"{namespace}{sender.rpartition('/')[0]}/{name}"
    if not _TOPIC.fullmatch(topic):
        raise ScenarioError(f"{where}.topic", f"'{topic}' is no ROS topic", "letters, digits and _ between /")
    if is_taken(topic):
        found = f"{topic} is where a bag shows the state of bodies"
        raise ScenarioError(
            f"{where}.topic", found, f"a topic that is not below {STATE}, and neither /tf nor /tf_static"
        )
    try:
        wire = Wire(_format(section, run), size)
    except ValueError as error:
        raise ScenarioError(f"{where}.wire", str(error)) from None
    outages = _outages(section, receivers, run.ticks_per_second, f"{where}.outages")
    channel = Channel(
        run.seed,
        name,
        _delay_ticks(section, run.ticks_per_second),
        section.loss,
        outages,
        section.jitter,
        section.bursts,
        section.duplication,
        run.ticks_per_second,
        {node: down[node] for node in receivers if node in down},
    )
    if section.medium is not None and section.kind is LinkKind.PHYSICAL:
        raise ScenarioError(f"{where}.medium", "a physical link carries light or torque, no frames", "no key 'medium'")
    acknowledged = None
    if section.acknowledged is not None:
        told = port in modules[sender].context.acknowledged and tells(section, modules[sender], port, where)
        acknowledged = acknowledgement(name, section.acknowledged, list(receivers), told, f"{where}.acknowledged")
    qos = Qos(section.reliability, section.history)
    return Link(
        name, topic, section.kind, sender, port, receivers, wire, channel, section.medium or "", acknowledged, qos
    )


def _delay_ticks(section: LinkSection, ticks_per_second: int) -> float:
    """The fixed delay; a part of a tick stays where jitter is added to it, before the sum is rounded up."""
    if section.delay_s is None:
        return section.delay_ticks
    exact = ticks_in(section.delay_s, ticks_per_second)
    return math.ceil(exact) if section.jitter is None else float(exact)


def rounded_delays(run: RunSection) -> list[str]:
    """In words: what is no whole number of ticks, and what became of it."""
    found = []
    for name, section in run.links.items():
        if section.jitter is not None:
            found.append(f"links.{name}: delay and jitter are added, and the sum is rounded up to whole ticks")
        elif section.delay_s is not None:
            exact = ticks_in(section.delay_s, run.ticks_per_second)
            ticks = math.ceil(exact)
            if ticks != exact:
                late = ticks / run.ticks_per_second
                found.append(
                    f"links.{name}.delay_s: {section.delay_s:g} s is {float(exact):.6g} ticks, "
                    f"rounded up to {ticks} ({late:.6g} s)"
                )
    return found


def _outages(
    section: LinkSection, receivers: Mapping[str, str], ticks_per_second: int, where: str
) -> dict[str, tuple[tuple[int, int], ...]]:
    found = {}
    for name, times in section.outages.items():
        node = "/" + name.strip("/")
        if node not in receivers:
            raise ScenarioError(where, f"{node} does not receive this link", choice(node, receivers))
        if not times or len(times) % 2 or any(b <= a for a, b in pairwise(times)) or times[0] < 0.0:
            raise ScenarioError(f"{where}.{name}", f"found {list(times)}", "[from, until, ...] in seconds, ascending")
        try:
            ticks = [0 if time == 0.0 else whole_ticks(time, ticks_per_second) for time in times]
        except ValueError as error:
            raise ScenarioError(f"{where}.{name}", str(error)) from None
        found[node] = tuple(zip(ticks[::2], ticks[1::2], strict=True))
    return found


def _port(wanted: str, ports: Mapping[str, int], where: str, what: str) -> str:
    if not wanted and len(ports) == 1:
        return next(iter(ports))
    if wanted in ports:
        return wanted
    if not ports:
        raise ScenarioError(where, f"there is no {what}")
    found = f"'{wanted}' is no {what}" if wanted else f"which {what} is not said"
    raise ScenarioError(where, found, f"NODE:PORT with one of: {', '.join(ports)}")


def check_foreign(graph: Graph, file: str) -> None:
    """Refuse foreign nodes in roles that they cannot play in simulated time, where a node has to know the protocol.

    Raises
    ------
    ScenarioError
        Naming the node.
    """
    for name in sorted(graph.external):
        if not (graph.modules[name].answers and graph.acts_on_arrival(name)):
            raise ScenarioError(
                f"{file}: {name}.external",
                f"a foreign node cannot play {name} in simulated time",
                "a module that answers each message at once, over one input link without delay",
                "real time, in which a foreign node can play any role: --clock wall",
            )


def _check(graph: Graph, file: str) -> None:
    """What only the whole graph can tell."""
    topics = [link.topic for link in graph.links.values()]
    for topic in topics:
        if topics.count(topic) > 1:
            users = " and ".join(link.name for link in graph.links.values() if link.topic == topic)
            raise ScenarioError(
                f"{file}: {EVERYWHERE}.links",
                f"topic {topic} is used by {users}",
                "a topic of its own for each",
            )
    if not graph.plants:
        raise ScenarioError(file, "no node is a plant", "at least one node with module: plant")
    for name, module in graph.modules.items():
        fed = {link.receivers[name] for link in graph.hears[name]}
        for port in module.inputs:
            if port not in fed:
                raise ScenarioError(f"{file}: {name}", f"input '{port}' is fed by no link", "a link to it")
        if module.answers and name in graph.reads:
            raise ScenarioError(f"{file}: {name}.reads", "a module that only answers sees no plant", "no key 'reads'")
