"""The topics of the emulation plane: their names and types, for bags and for the ros engine.

What is below ``/emulation`` exists only because hardware is simulated here, and is never added to the network figures.
"""

from __future__ import annotations

from collections.abc import Iterator

from etac_ros.graph.graph import Graph
from etac_ros.graph.wire import CLOCK_TYPE, NOTE_TYPE, TABLE_TYPE

EMULATION = "/emulation"
"""Prefix of all topics that exist only because hardware is simulated here."""

CLOCK = "/clock"
SCENARIO = f"{EMULATION}/scenario"
"""The complete parameters of the run, for who listens."""
JOIN = f"{EMULATION}/join"
START = f"{EMULATION}/start"
STOP = f"{EMULATION}/stop"
END = f"{EMULATION}/end"
LEAVE = f"{EMULATION}/leave"
FAULT = f"{EMULATION}/fault"
ADMITTED = f"{EMULATION}/admitted"
"""Who was let in again in real time, after a fault of the scenario had killed it."""
MESSAGE_LOG = f"{EMULATION}/message_log"
RECORDED = f"{EMULATION}/recorded"
AIR = f"{EMULATION}/air"
"""What became of frames on shared media; only in bags."""

STATE = "/state"
"""Prefix of what a bag shows of every body, computed of committed samples while they are recorded."""
TF, TF_STATIC = "/tf", "/tf_static"
"""The same as transforms; their names are ROS's."""

_WINDOW, _TRUTH, _NEXT, _GO, _LEDGER = "window", "truth", "next", "go", "ledger"


def window_topic(plant: str) -> str:
    """Samples ahead, from a plant to its readers."""
    return f"{EMULATION}{plant}/{_WINDOW}"


def truth_topic(plant: str) -> str:
    """Committed samples, from a plant to the recorder."""
    return f"{EMULATION}{plant}/{_TRUTH}"


def is_truth(topic: str) -> bool:
    """Whether a topic carries committed samples, which the recorder alone hears, in simulated and in real time."""
    return topic.startswith(f"{EMULATION}/") and topic.endswith(f"/{_TRUTH}")


def next_topic(module: str) -> str:
    """Reports of a module to the coordinator."""
    return f"{EMULATION}{module}/{_NEXT}"


def go_topic(module: str) -> str:
    """Orders of the coordinator to a module."""
    return f"{EMULATION}{module}/{_GO}"


def ledger_topic(node: str) -> str:
    """What a node of a real-time run noted down of its own doing (:mod:`etac_ros.graph.ledger`)."""
    return f"{EMULATION}{node}/{_LEDGER}"


def node_of_ledger(topic: str) -> str | None:
    """The node whose ledger a topic is: the inverse of :func:`ledger_topic`; None for any other topic."""
    begins, ends = topic.startswith(f"{EMULATION}/"), topic.endswith(f"/{_LEDGER}")
    return topic.removeprefix(EMULATION).removesuffix(f"/{_LEDGER}") if begins and ends else None


def derived_topic(node: str) -> str:
    """What was computed of committed samples while they were recorded; only in bags."""
    return f"{EMULATION}{node}/derived"


def state_topic(plant: str, *words: str) -> str:
    """What a bag shows of a plant, in words; only in bags."""
    return "/".join([f"{STATE}{plant}", *words])


def is_taken(topic: str) -> bool:
    """Whether a topic has a meaning of its own, so that no link may have it."""
    return topic in (TF, TF_STATIC) or topic.startswith(f"{STATE}/")


def type_of(topic: str) -> str:
    """Message type of a topic of the emulation plane that is no link, for instance ``std_msgs/msg/String``."""
    if topic == CLOCK:
        return CLOCK_TYPE
    return TABLE_TYPE if topic == AIR or topic.rpartition("/")[2] in (_WINDOW, _TRUTH, _LEDGER) else NOTE_TYPE


def emulation_topics(graph: Graph) -> Iterator[str]:
    """Every topic that the nodes of a run have beside its links, and ``/clock``."""
    yield from (CLOCK, SCENARIO, JOIN, START, STOP, END, LEAVE, FAULT, MESSAGE_LOG, RECORDED)
    for name in graph.modules:
        yield from (window_topic(name), truth_topic(name), next_topic(name), go_topic(name), ledger_topic(name))
