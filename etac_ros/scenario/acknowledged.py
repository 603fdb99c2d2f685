"""From the key ``acknowledged`` of a link to how its messages are acknowledged."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from fractions import Fraction

from etac_ros.errors import ScenarioError
from etac_ros.graph.channel import Channel
from etac_ros.graph.graph import Acknowledgement
from etac_ros.graph.module import Module
from etac_ros.maths.ticks import NANOSECONDS, nanoseconds
from etac_ros.media.frame import Line, answering_line
from etac_ros.media.medium import MediumPlan
from etac_ros.scenario.document import choice
from etac_ros.scenario.schema import AcknowledgedSection, ComparesWith, LinkSection


def why_not_told(module: Module, port: str) -> str:
    """Why the trigger rule of a module cannot compare with what was acknowledged on a port; empty where it can."""
    if port != module.triggers:
        return f"no trigger rule decides on what goes out on the port '{port}'"
    if module.every is not None:
        return "its rule goes by the time, and compares with nothing"
    if module.concludes or not module.hears_acknowledgements:
        return f"{type(module).__name__} cannot wait for an acknowledgement"
    return ""


def tells(section: LinkSection, module: Module, port: str, where: str) -> bool:
    """Whether the sender of a link is told what was acknowledged.

    Raises
    ------
    ScenarioError
        If the scenario wants that, and it cannot be.
    """
    acknowledged = section.acknowledged
    if acknowledged is None or acknowledged.compares_with is ComparesWith.SENT:
        return False
    reason = why_not_told(module, port)
    if reason and acknowledged.compares_with is ComparesWith.ACKNOWLEDGED:
        raise ScenarioError(f"{where}.acknowledged.compares_with", reason, "compares_with: sent")
    return not reason


def acknowledgement(
    name: str, section: AcknowledgedSection, receivers: Sequence[str], told: bool, where: str
) -> Acknowledgement:
    """What the section says, made sure that it fits the receivers.

    Raises
    ------
    ScenarioError
        If it does not say who has to acknowledge a broadcast, or names somebody else.
    """
    by = section.by
    if by is None:
        if len(receivers) > 1:
            raise ScenarioError(
                f"{where}.by",
                f"is missing, and {', '.join(receivers)} receive this link",
                "all, any, or a list of those that have to acknowledge",
            )
        by = "all"
    if isinstance(by, str) and by not in ("all", "any"):
        by = (by,)
    named = list(receivers) if isinstance(by, str) else ["/" + node.strip("/") for node in by]
    for node in named:
        if node not in receivers:
            others = [*receivers, "all", "any"]
            raise ScenarioError(f"{where}.by", f"{node} does not receive this link", choice(node, others))
    if not named:
        raise ScenarioError(f"{where}.by", "names nobody", "all, any, or a list of receivers")
    return Acknowledgement(
        timeout_ns=int(Fraction(repr(section.timeout_s)) * NANOSECONDS),
        retries=section.retries,
        by={node: answering_line(name, place) for place, node in enumerate(receivers, 1) if node in named},
        any_suffices=by == "any",
        frame_bytes=section.bytes or 0,
        after_last=section.after_last,
        told=told,
    )


def check_timeout(
    wanted: Acknowledgement, channel: Channel, medium: MediumPlan | None, ticks_per_second: int, where: str
) -> None:
    """Refuse a time in which no acknowledgement can have come back: every message would go out again for nothing.

    Raises
    ------
    ScenarioError
        With the least time.
    """
    delay = nanoseconds(int(channel.delay_ticks), ticks_per_second) if channel.jitter is None else 0
    lines: Mapping[str, Line] = {} if medium is None else medium.lines
    answers = [lines[line].duration_ns for line in wanted.by.values() if line in lines]
    on_air = min(answers, default=0) if wanted.any_suffices else sum(answers)
    least = 2 * delay + on_air + (0 if medium is None else 2 * medium.propagation_ns)
    if wanted.timeout_ns < least:
        found, needed = wanted.timeout_ns / NANOSECONDS, least / NANOSECONDS
        raise ScenarioError(
            f"{where}.timeout_s", f"found {found:g}, and an acknowledgement takes {needed:g} s", "that time or more"
        )
