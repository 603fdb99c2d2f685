"""From the sections ``media`` of a scenario to media that can be run."""

from __future__ import annotations

import math
from collections.abc import Mapping
from fractions import Fraction
from typing import Any

from etac_ros.errors import ScenarioError
from etac_ros.graph.graph import Link
from etac_ros.maths.ticks import NANOSECONDS, ticks_in
from etac_ros.media.access import Access
from etac_ros.media.frame import Line
from etac_ros.media.medium import MediumPlan
from etac_ros.media.overhead import OVERHEADS
from etac_ros.scenario.classes import check_methods, import_class, made, validated, with_parameters
from etac_ros.scenario.document import EVERYWHERE, choice, shown
from etac_ros.scenario.schema import MediumSection, RunSection


def media_of(run: RunSection, links: Mapping[str, Link], file: str) -> dict[str, MediumPlan]:
    """The media of a scenario with the links that join them.

    Raises
    ------
    ScenarioError
        If a link joins a medium that there is not, nobody joins one, or one cannot carry what joins it.
    """
    for name, link in links.items():
        if link.medium and link.medium not in run.media:
            where = f"{file}: {EVERYWHERE}.links.{name}.medium"
            others = choice(link.medium, list(run.media)) if run.media else "a section 'media' with it"
            raise ScenarioError(where, f"there is no medium '{link.medium}'", others)
    found = {}
    for name, section in run.media.items():
        joined = {link.name: link for link in links.values() if link.medium == name}
        where = f"{file}: {EVERYWHERE}.media.{name}"
        if not joined:
            raise ScenarioError(where, "no link joins it", f"medium: {name} in a link, or no such medium")
        found[name] = _medium(name, section, joined, run.seed, where)
    return found


def _medium(name: str, section: MediumSection, links: Mapping[str, Link], seed: int, where: str) -> MediumPlan:
    lines = {link.name: _line(link, section) for link in links.values()}
    for joined in links.values():
        lines |= _answers(joined, section, where)
    for link, line in lines.items():
        if line.duration_ns > NANOSECONDS:
            raise ScenarioError(
                f"{where}.rate_bit_s",
                f"{section.rate_bit_s:g} bit/s cannot carry one frame of {link} a second ({line.frame_bytes} bytes)",
                f"{8 * line.frame_bytes} or more",
            )
    return MediumPlan(
        name,
        seed,
        section.rate_bit_s,
        math.ceil(ticks_in(section.propagation_s, NANOSECONDS)),
        section.queue.length,
        section.queue.full,
        lines,
        _access(section.access, lines, f"{where}.access"),
        None if section.transmit_w is None or section.receive_w is None else (section.transmit_w, section.receive_w),
    )


def _line(link: Link, section: MediumSection) -> Line:
    overhead = OVERHEADS[section.overhead]
    carried = link.wire.cdr_bytes if overhead.serialized else link.wire.payload_bytes
    size = max(carried + overhead.frame_bytes, overhead.smallest_bytes, section.smallest_bytes)
    duration = math.ceil(Fraction(8 * size * NANOSECONDS) / Fraction(section.rate_bit_s))
    return Line(link.sender, link.wire.payload_bytes, size, duration + overhead.preamble_ns)


def _answers(link: Link, section: MediumSection, where: str) -> dict[str, Line]:
    """The lines of a link's acknowledgements."""
    if link.acknowledged is None:
        return {}
    overhead = OVERHEADS[section.overhead]
    size = link.acknowledged.frame_bytes or overhead.acknowledgement_bytes
    if not size:
        raise ScenarioError(
            f"{where}.overhead",
            f"'{section.overhead}' has no acknowledgements, and {link.name} is acknowledged",
            f"links.{link.name}.acknowledged.bytes: what the whole frame of one has",
        )
    size = max(size, overhead.smallest_bytes, section.smallest_bytes)
    duration = math.ceil(Fraction(8 * size * NANOSECONDS) / Fraction(section.rate_bit_s)) + overhead.preamble_ns
    return {line: Line(receiver, 0, size, duration, True) for receiver, line in link.acknowledged.by.items()}


def _access(given: Mapping[str, Any], lines: Mapping[str, Line], where: str) -> Any:
    if "class" not in given:
        raise ScenarioError(where, f"found {shown(dict(given))}", "a mapping with 'class' (package.module:Class)")
    values = {key: value for key, value in given.items() if key != "class"}
    kind = with_parameters(import_class(str(given["class"]), f"{where}.class"), f"{where}.class")
    check_methods(kind, (Access,), f"{where}.class")
    return made(kind, where, validated(kind.Parameters, values, where), lines)
