"""How many spacecraft share a medium: a formation of growing size on its radio, event-triggered and periodic."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

from etac_ros.metrics.summary import Summary
from etac_ros.robustness.grid import EVENTS, PERIODIC, holds, largest_error
from etac_ros.robustness.retransmission import RADIO
from etac_ros.runs import simulate, warm_up
from etac_ros.scenario.document import EVERYWHERE, FORMATION, read_sections
from etac_ros.scenario.load import Scenario, load

_HALVINGS = 6
"""How often the rate is halved in search of the slowest that will do."""


@dataclass(frozen=True)
class Crowded:
    """A formation on one medium.

    Attributes
    ----------
    loop
        Event-triggered, or the variant ``periodic``.
    spacecraft
        How many.
    rate_bit_s
        Of the medium.
    messages, frames, collided
        Messages that were sent, frames on the air, and those of them that collided.
    utilisation
        Part of the time in which somebody sends.
    delay_s
        99 % of the messages of any link came no later; None where nothing came.
    error_deg, ideal_deg
        Largest steady error, and that over ideal links.
    halted, holds, ideal_holds
        As of a cell of the maps, measured by the smallest formation over ideal links: a large one may not hold even
        there.
    slowest_bit_s
        The slowest medium on which it holds, of the rate and its halves down to the first on which it does not; None
        where it does not hold at the rate.
    """

    loop: str
    spacecraft: int
    rate_bit_s: float
    messages: int
    frames: int
    collided: int
    utilisation: float
    delay_s: float | None
    error_deg: float | None
    ideal_deg: float | None
    halted: str
    holds: bool
    ideal_holds: bool
    slowest_bit_s: float | None


def crowd(
    name: str,
    sizes: Sequence[int],
    factor: float,
    overrides: Sequence[str] = (),
    tell: Callable[[str], None] = lambda words: None,
) -> tuple[Crowded, ...]:
    """Run a formation in several sizes on its variant ``radio``; nothing of a scenario that is no formation on one.

    The backoff of an access rule with slots is as many bits long at each rate, as standards have it.

    Parameters
    ----------
    name, factor, overrides, tell
        As for :func:`~etac_ros.robustness.grid.robustness`.
    sizes
        Numbers of spacecraft.
    """
    plain = load(name, None, overrides)
    if RADIO not in plain.variants or FORMATION not in read_sections(plain.path)[EVERYWHERE]:
        return ()
    loops = [EVENTS, *([PERIODIC] if PERIODIC in plain.variants else [])]
    found = []
    for loop in loops:
        smallest: Summary | None = None
        for size in sorted(sizes):
            keys = [*overrides, f"formation.n={size}"]
            ideal = load(name, None if loop == EVENTS else loop, keys)
            tell(f"{name} {loop}: {size} spacecraft")
            warm_up(ideal)
            usual = simulate(ideal).summary
            smallest = smallest or usual
            radio = load(name, RADIO, keys)
            run = ideal.run.model_copy(update={"media": radio.run.media, "links": radio.run.links})
            on_air = replace(ideal, run=run)
            found.append(_crowded(loop, size, on_air, usual, partial(holds, ideal=smallest, factor=factor), tell))
    return tuple(found)


def at_rate(scenario: Scenario, divisor: int) -> Scenario:
    """The scenario with all its media so many times slower."""
    media = {}
    for name, section in scenario.run.media.items():
        access: dict[str, Any] = dict(section.access)
        if "slot_s" in access or access["class"].endswith(":Csma"):
            access["slot_s"] = divisor * access.get("slot_s", 320.0e-6)
        media[name] = section.model_copy(update={"rate_bit_s": section.rate_bit_s / divisor, "access": access})
    return replace(scenario, run=scenario.run.model_copy(update={"media": media}))


def _crowded(
    loop: str,
    size: int,
    scenario: Scenario,
    ideal: Summary,
    well: Callable[[Summary], bool],
    tell: Callable[[str], None],
) -> Crowded:
    summary = simulate(scenario).summary
    held = well(summary)
    rate = max(section.rate_bit_s for section in scenario.run.media.values())
    slowest = rate if held else None
    for halving in range(1, _HALVINGS + 1):
        if slowest is None:
            break
        divisor = 2**halving
        tell(f"{loop}: {size} spacecraft at {rate / divisor:g} bit/s")
        if not well(simulate(at_rate(scenario, divisor)).summary):
            break
        slowest = rate / divisor
    delays = [account.p99_delay_s for account in summary.links.values() if account.p99_delay_s is not None]
    return Crowded(
        loop,
        size,
        rate,
        summary.network.messages,
        sum(one.frames for one in summary.media.values()),
        sum(one.collided for one in summary.media.values()),
        max(one.utilisation for one in summary.media.values()),
        max(delays, default=None),
        largest_error(summary),
        largest_error(ideal),
        summary.halted,
        held,
        well(ideal),
        slowest,
    )
