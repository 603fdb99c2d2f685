"""``etac contract``: what a foreign node has to subscribe to and publish in the place of one of a scenario."""

from __future__ import annotations

from dataclasses import dataclass

from rich.console import Console

from etac_ros.errors import ScenarioError
from etac_ros.graph.graph import Graph, Link
from etac_ros.graph.plant import PlantModule
from etac_ros.graph.topics import CLOCK, START, STOP, window_topic
from etac_ros.graph.wire import ARRAY_DTYPES, NOTE_TYPE, SCALAR_FIELDS, TABLE_TYPE, Wire
from etac_ros.scenario.load import Scenario
from etac_ros.tables.numbers import bracketed, type_words
from etac_ros.tables.table import Row, Table
from etac_ros.tables.terminal import show

_RELIABLE = "reliable, volatile"
_LATCHED = "reliable, transient local"


@dataclass(frozen=True)
class Contract:
    """What a foreign node has to keep to.

    Attributes
    ----------
    node
        Full name of the node in whose place it stands.
    topics
        What it subscribes to and publishes.
    examples
        A message of each topic that it publishes, as text that `ros2 topic pub` understands.
    duties
        What it has to do, in sentences.
    """

    node: str
    topics: Table
    examples: dict[str, str]
    duties: tuple[str, ...]


def contract(scenario: Scenario, name: str) -> Contract:
    """What a foreign node has to keep to in the place of one of a scenario.

    Raises
    ------
    ScenarioError
        If there is no such node.
    """
    graph = scenario.graph
    name = "/" + name.strip("/")
    if name not in graph.modules:
        raise ScenarioError(str(scenario.path), f"has no node '{name}'", f"one of: {', '.join(graph.modules)}")
    module = graph.modules[name]
    rows = [_row("subscribes", link, _content(graph, link), _RELIABLE) for link in graph.hears[name]]
    reads = graph.reads.get(name)
    if reads is not None:
        rows.append(_plane("subscribes", window_topic(reads), TABLE_TYPE, _RELIABLE, _states(graph, reads), "ahead"))
    if isinstance(module, PlantModule) or reads is not None or not (module.answers or module.passive):
        rows.append(_plane("subscribes", START, NOTE_TYPE, _LATCHED, "JSON: t0_ns, ticks_per_second, rate", "once"))
        rows.append(_plane("subscribes", STOP, NOTE_TYPE, _LATCHED, "JSON: the run is over", "once"))
    examples = {}
    for link in graph.sends[name]:
        rows.append(_row("publishes", link, _content(graph, link), _RELIABLE, _rate(graph, name)))
        examples[link.topic] = example(link.wire)
    if isinstance(module, PlantModule):
        topic = window_topic(name)
        rows.append(_plane("publishes", topic, TABLE_TYPE, _RELIABLE, _states(graph, name), "each tick, or ahead"))
        examples[topic] = window_example(module)
    columns = ("", "topic", "type", "QoS", "what", "rate")
    table = Table("", columns, tuple(rows), texts=frozenset(columns[1:]))
    return Contract(name, table, examples, tuple(_duties(graph, name)))


def show_contract(scenario: Scenario, name: str, console: Console) -> None:
    """Print the contract of a node."""
    found = contract(scenario, name)
    console.print(f"{scenario.name}: what a foreign node has to do in the place of {found.node}\n", style="bold")
    show(found.topics, console)
    for topic, text in found.examples.items():
        console.print(f"\nan example message on {topic}:\n  {text}", soft_wrap=True, highlight=False, markup=False)
    console.print()
    for duty in found.duties:
        console.print(f"- {duty}", soft_wrap=True, highlight=False, markup=False)


def window_example(plant: PlantModule) -> str:
    """A window of one sample, the state at tick 0: number of the window, tick of the first sample, -1, and samples."""
    width = plant.state.size
    head = f"label: tick, size: 1, stride: {width}", f"label: state, size: {width}, stride: {width}"
    dimensions = ", ".join(f"{{{words}}}" for words in head)
    data = ", ".join(f"{value:.6g}" for value in (1.0, 0.0, -1.0, *plant.state))
    return f"{{layout: {{dim: [{dimensions}], data_offset: 3}}, data: [{data}]}}"


def example(wire: Wire) -> str:
    """A message of a wire, with its components 0.1, 0.2, ... as YAML."""
    values = [f"{0.1 * (place + 1):.1f}" for place in range(wire.size)]
    if wire.type_name in ARRAY_DTYPES:
        return f"{{data: [{', '.join(values)}]}}"
    fields: dict[str, list[str]] = {}
    for field, value in zip(SCALAR_FIELDS[wire.type_name], values, strict=True):
        part, _, last = field.rpartition(".")
        fields.setdefault(part, []).append(f"{last}: {value}")
    text = ""
    if "" in fields:
        text = ", ".join(fields[""])
    else:
        outer: dict[str, list[str]] = {}
        for part, inner in fields.items():
            head, _, rest = part.partition(".")
            body = f"{{{', '.join(inner)}}}"
            outer.setdefault(head, []).append(f"{rest}: {body}" if rest else body)
        text = ", ".join(
            f"{head}: {parts[0]}" if not parts[0][0].isalpha() else f"{head}: {{{', '.join(parts)}}}"
            for head, parts in outer.items()
        )
        text = f"header: {{stamp: {{sec: 1, nanosec: 500000000}}}}, {text}"
    return f"{{{text}}}"


def _row(does: str, link: Link, content: str, qos: str, rate: str = "at events") -> Row:
    return Row((does, link.topic, type_words(link.wire.type_name), qos, content, rate))


def _plane(does: str, topic: str, kind: str, qos: str, content: str, rate: str) -> Row:
    return Row((does, topic, type_words(kind), qos, content, rate))


def _rate(graph: Graph, name: str) -> str:
    module = graph.modules[name]
    if module.answers:
        return "one a message"
    if module.every is not None:
        return f"every {module.every / graph.ticks_per_second:g} s"
    return "at triggers"


def _content(graph: Graph, link: Link) -> str:
    """What a link carries: symbol, unit and frame as far as the classes say."""
    sender = graph.modules[link.sender]
    size = link.wire.size
    if link.port == sender.triggers:
        symbol = str(getattr(sender, "watched_label", link.port))
        return f"{symbol}{bracketed(str(getattr(sender, 'watched_unit', '')))}, {size} numbers"
    torque = any("torque" in port for port in (link.port, *link.receivers.values())) or link.port == "command"
    return f"{link.port}{' [N m], body axes' if torque else ''}, {size} numbers"


def _labels(graph: Graph, plant: str) -> tuple[str, ...]:
    module = graph.modules[plant]
    assert isinstance(module, PlantModule)
    return tuple(module.plant.labels)


def _states(graph: Graph, plant: str) -> str:
    return f"states, {len(_labels(graph, plant))} numbers a tick"


def _duties(graph: Graph, name: str) -> list[str]:
    module = graph.modules[name]
    found = [f"in the scenario: --set {name.strip('/')}.external=true, and a domain of your choice with --domain"]
    if module.answers and graph.acts_on_arrival(name):
        found.append("answer each message with exactly one on each topic, and publish nothing by itself")
        found.append("it needs no clock, and can play in simulated time as well")
    else:
        found.append(
            "only in real time (--clock wall): in simulated time a node in this place has to know the protocol"
        )
    if isinstance(module, PlantModule):
        found.append("publish the state of each tick from tick 0 to the last, without a gap, at its instant or ahead")
        found.append("a later window replaces samples of an earlier one from its first tick on")
        found.append("hold the newest torque of each topic from the first tick after it has come")
    plant = name if isinstance(module, PlantModule) else graph.reads.get(name)
    if plant is not None:
        found.append(f"a state of {plant}: {', '.join(_labels(graph, plant))}")
    if name in graph.reads:
        found.append("a window brings samples ahead: take that of a tick at its instant, from the newest window")
    found.append(f"{graph.ticks_per_second} ticks a second of simulated time; {CLOCK} tells it to who asks for it")
    if any(link.wire.format == "stamped" for link in graph.sends[name]):
        found.append("stamps are simulated time; who behind it needs none ignores them")
    return found
