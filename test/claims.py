"""Numbers in prose against the runs that give them: docs/claims.yaml. `scripts/claims` checks every one."""

from __future__ import annotations

import functools
import math
import re
import sys
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from decimal import Decimal
from pathlib import Path

import numpy as np
import yaml

from etac_ros.metrics.published import quantity
from etac_ros.parameters import square
from etac_ros.runs import Run, run_in_process
from etac_ros.scenario.load import load

ROOT = Path(__file__).resolve().parents[1]
NUMBER = re.compile(r"(?<![\w.])-?\d[\d,]*(?:\.\d+)?(?:e-?\d+)?(?![\w])")


@dataclass(frozen=True)
class Claim:
    """A text with numbers, where it stands, and what gives each of them."""

    says: str
    files: tuple[str, ...]
    scenario: str
    variants: tuple[str | None, ...]
    overrides: tuple[str, ...]
    gives: tuple[str, ...]
    slow: bool


def read() -> tuple[list[Claim], Mapping[str, Mapping[str, str]]]:
    """All claims, and what is quoted, by file."""
    content = yaml.safe_load((ROOT / "docs" / "claims.yaml").read_text(encoding="utf-8"))
    claims = []
    for one in content["claims"]:
        run = one["run"]
        variants = tuple(run.get("variants", [run.get("variant")]))
        claims.append(
            Claim(
                one["says"],
                tuple(one["files"]),
                run["scenario"],
                variants,
                tuple(run.get("overrides", ())),
                tuple(one["gives"]),
                bool(one.get("slow", False)),
            )
        )
    return claims, content["quotes"]


def numbers(text: str) -> list[str]:
    """Numbers of a text, as they stand there."""
    return [found.group() for found in NUMBER.finditer(text)]


def rounds_to(value: float, printed: str) -> bool:
    """Whether a value rounds to a number as it is printed."""
    exact = Decimal(printed.replace(",", ""))
    exponent = exact.as_tuple().exponent
    assert isinstance(exponent, int)
    half = 0.5 * 10.0**exponent
    return abs(value - float(exact)) <= half * (1.0 + 1e-9)


@functools.cache
def run(scenario: str, variant: str | None, overrides: tuple[str, ...]) -> Run:
    return run_in_process(load(scenario, variant, overrides))


def figure(name: str, one: Run) -> float:
    """A figure of a run by the name that a claim gives it."""
    word, _, rest = name.partition(" ")
    if word == "triggers" and rest:
        return float(one.summary.triggers[rest].count)
    if word == "published":
        return one.scenario.published[rest].value
    if name in OWN:
        return OWN[name](one)
    found = one.summary.value(name)
    if found is None:
        raise KeyError(f"{name} is no figure of {one.scenario.name}")
    return found


def values(claim: Claim) -> list[float | None]:
    """What the runs give for each number of a claim; None for one that is not checked."""
    runs = [run(claim.scenario, variant, claim.overrides) for variant in claim.variants]
    if len(runs) > 1 and claim.gives[0] in OF_SEVERAL:
        return [OF_SEVERAL[claim.gives[0]](runs)]
    names = claim.gives if len(runs) == 1 else claim.gives * len(runs)
    each = runs * len(claim.gives) if len(runs) == 1 else runs
    return [None if name == "skip" else figure(name, one) for name, one in zip(names, each, strict=True)]


def faults(claim: Claim) -> list[str]:
    """What is wrong with a claim, in words."""
    found = [
        f"{claim.says!r} does not stand in {name}"
        for name in claim.files
        if claim.says not in flowing((ROOT / name).read_text(encoding="utf-8"))
    ]
    printed = numbers(claim.says)
    given = values(claim)
    if len(printed) != len(given):
        return [*found, f"{claim.says!r} has the numbers {printed}, and {len(given)} are given"]
    return found + [
        f"{claim.says!r} says {text}, and the run gives {value:.8g}"
        for text, value in zip(printed, given, strict=True)
        if value is not None and not rounds_to(value, text)
    ]


def flowing(text: str) -> str:
    """A text with its lines joined, comment marks left out."""
    return re.sub(r"\s*\n\s*(?:# ?)?", " ", text)


def reasons(name: str) -> list[str]:
    """Every reason in a scenario file."""
    return re.findall(r'reason: "([^"]*)"', (ROOT / name).read_text(encoding="utf-8"))


def unfounded(name: str, claims: Sequence[Claim], quotes: Mapping[str, str]) -> list[str]:
    """Numbers in a file's reasons that no claim and no quotation accounts for."""
    found = []
    for reason in reasons(name):
        rest = reason
        for claim in claims:
            if name in claim.files:
                rest = rest.replace(claim.says, "")
        found += [f"{name}: {number} in {reason!r}" for number in numbers(rest) if number not in quotes]
    return found


def prose(text: str) -> str:
    """What a page says in words of its own: without blocks of output, code, comments and the targets of links."""
    for left_out in (r"```.*?```", r"<!--.*?-->", r"`[^`\n]*`"):
        text = re.sub(left_out, "", text, flags=re.DOTALL)
    return flowing(re.sub(r"\]\([^)]*\)", "]", text))


def unfounded_in_prose(name: str, claims: Sequence[Claim], quotes: Mapping[str, str]) -> list[str]:
    """Numbers in a page's prose that no claim and no quotation accounts for."""
    rest = prose((ROOT / name).read_text(encoding="utf-8"))
    for claim in claims:
        if name in claim.files:
            rest = rest.replace(prose(claim.says), "")
    return [
        f"{name}: {found.group()} in {rest[max(0, found.start() - 40) : found.end() + 20]!r}"
        for found in NUMBER.finditer(rest)
        if found.group().rstrip(",") not in quotes
    ]


def of_file(name: str) -> Callable[[str, Sequence[Claim], Mapping[str, str]], list[str]]:
    """What looks for unfounded numbers in a file: in a scenario in its reasons, on a page in its prose."""
    return unfounded if name.endswith(".yaml") else unfounded_in_prose


def _modes_settled_s(one: Run) -> float:
    """First whole second from which |eta| stays below the paper's 2.6e-4."""
    _, found = quantity(one.scenario.build(), one.recording, "/plant", "modal coordinates")
    above = np.flatnonzero(np.linalg.norm(found, axis=1) > 2.6e-4)
    return float(math.ceil((above[-1] + 1) / one.scenario.run.ticks_per_second))


def _largest_disturbance(one: Run) -> float:
    d = one.scenario.nodes["/plant"]["dynamics"]["disturbance"]
    sizes = zip(d["constant_nm"], d["sine_nm"], d["cosine_nm"], strict=True)
    return max(abs(constant) + math.hypot(sine, cosine) for constant, sine, cosine in sizes)


def _settled(one: Run, bound: float) -> float:
    graph = one.scenario.build()
    first, angles = quantity(graph, one.recording, "/sim/plant", "angle between the modules")
    outside = np.flatnonzero(np.abs(angles).max(axis=1) > bound)
    return (first + float(outside[-1]) + 1.0) / one.scenario.run.ticks_per_second


def _pm_slow_pole(one: Run) -> float:
    """Of ``J s^2 + K_d s + K_p / 2`` about the axis that is slowest."""
    law = one.scenario.nodes["/pm/controller"]["law"]
    inertia = np.diag(square(tuple(law["inertia_pm_kg_m2"])))
    poles = [
        max(np.roots([j, d, 0.5 * p]).real)
        for j, d, p in zip(inertia, law["rate_gain_nms"], law["attitude_gain_nm"], strict=True)
    ]
    return -float(max(poles))


def _pm_limits_held(one: Run) -> float:
    """The next multiple of ten seconds from which both accuracies of the PM hold."""
    graph = one.scenario.build()
    last = 0
    for name, limit in (("attitude of PM to orbit", 2.0e-4), ("rate of PM to orbit", 5.0e-6)):
        _, found = quantity(graph, one.recording, "/sim/plant", name)
        last = max(last, int(np.flatnonzero(np.abs(found).max(axis=1) > limit)[-1]) + 1)
    return 10.0 * math.ceil(last / one.scenario.run.ticks_per_second / 10.0)


def _fewer(one: Run) -> list[float]:
    """Fewer triggers than the 500 of 10 Hz [%], of each spacecraft."""
    return [100.0 * (1.0 - found.count / 500.0) for found in one.summary.triggers.values()]


def _ticks_of_triggers(one: Run) -> list[int]:
    recording = one.recording
    return [message.tick for name in one.summary.triggers for message in recording.messages[_feedback_link(one, name)]]


def _feedback_link(one: Run, sensor: str) -> str:
    links = one.scenario.build().links
    return next(name for name, link in links.items() if link.sender == sensor and link.port == "feedback")


def _ticks_with_several(one: Run) -> float:
    return float(sum(count > 1 for count in Counter(_ticks_of_triggers(one)).values()))


def _each(one: Run, what: str) -> float:
    topic = one.summary.topics["/filtered_error"]
    return float(getattr(topic, what)) / topic.messages


OWN: dict[str, Callable[[Run], float]] = {
    "measurement_size": lambda one: float(one.scenario.build().links["relative"].wire.size),
    "saved_percent": lambda one: (
        100.0
        * (1.0 - one.summary.value("network_payload_bytes") / one.scenario.published["baseline_payload_bytes"].value)
    ),
    "triggers_in_all": lambda one: float(sum(found.count for found in one.summary.triggers.values())),
    "ticks_with_several": _ticks_with_several,
    "payload_a_message": lambda one: _each(one, "payload_bytes"),
    "cdr_a_message": lambda one: _each(one, "cdr_bytes"),
    "wire_a_message": lambda one: _each(one, "model_wire_bytes"),
    "duration_s": lambda one: one.scenario.run.duration_s,
    "modes_settled_s": _modes_settled_s,
    "largest_disturbance_axis_nm": _largest_disturbance,
    "law_settled_s": lambda one: _settled(one, 0.03),
    "pm_slow_pole_1_s": _pm_slow_pole,
    "pm_limits_held_s": _pm_limits_held,
    "minus_delta": lambda one: -float(one.scenario.nodes["/controller"]["trigger"]["delta"]),
    "threshold_at_the_end_nm": lambda one: (
        math.floor(
            100.0 * math.exp(-one.scenario.nodes["/controller"]["trigger"]["delta"] * one.scenario.run.duration_s)
        )
        / 100.0
    ),
    "robust_norm_nm": lambda one: float(np.linalg.norm(one.scenario.nodes["/controller"]["law"]["robust_nm"])),
    "printed_fewer_percent": lambda one: 100.0 * (1.0 - one.scenario.published["triggers_sc4_sensor"].value / 500.0),
    "least_fewer_percent": lambda one: min(_fewer(one)),
    "most_fewer_percent": lambda one: max(_fewer(one)),
}
"""Figures that no summary has."""


def _largest_count_error(runs: Sequence[Run]) -> float:
    counts = [next(iter(one.summary.triggers.values())).count for one in runs]
    printed = [one.scenario.published["triggers"].value for one in runs]
    return 100.0 * max(abs(count / paper - 1.0) for count, paper in zip(counts, printed, strict=True))


OF_SEVERAL: dict[str, Callable[[Sequence[Run]], float]] = {"largest_count_error_percent": _largest_count_error}
"""Figures of several runs together."""


def main() -> int:
    """Check every claim; the exit code says whether all hold."""
    claims, quotes = read()
    wrong = [fault for claim in claims for fault in faults(claim)]
    wrong += [fault for name, quoted in quotes.items() for fault in of_file(name)(name, claims, quoted)]
    print("\n".join(wrong) or f"{len(claims)} claims hold")
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())
