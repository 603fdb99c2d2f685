"""What it costs to send again: a scenario on its radio, with and without acknowledgements, at several losses."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

from etac_ros.metrics.summary import Summary
from etac_ros.robustness.grid import holds, largest_error, network_links
from etac_ros.runs import simulate, warm_up
from etac_ros.scenario.load import Scenario, load
from etac_ros.scenario.schema import AcknowledgedSection, LinkSection

RADIO = "radio"
"""The variant that says what radio a scenario has."""
TIMEOUT_S = 0.005
"""From the end of a try to the next: three acknowledgements of IEEE 802.15.4 at 250 kbit/s take 1.1 ms."""
RETRIES = 3


@dataclass(frozen=True)
class Tried:
    """One run on the radio.

    Attributes
    ----------
    loss
        Of every network link on the medium, and of its acknowledgements.
    acknowledged
        Whether messages are acknowledged and sent again.
    messages
        That the modules sent over the network.
    again, acknowledgements
        Frames that were sent again, and frames that acknowledge.
    air_bytes
        Of all frames: payload, overhead, acknowledgements, and what collided.
    delivered
        Part of the messages that arrived, each counted for each receiver.
    error_deg, halted, holds
        As of a cell of the maps.
    """

    loss: float
    acknowledged: bool
    messages: int
    again: int
    acknowledgements: int
    air_bytes: int
    delivered: float
    error_deg: float | None
    halted: str
    holds: bool


def retransmission(
    name: str,
    losses: Sequence[float],
    factor: float,
    overrides: Sequence[str] = (),
    tell: Callable[[str], None] = lambda words: None,
) -> tuple[Tried, ...]:
    """Run a scenario's variant ``radio`` at several losses, with and without acknowledgements; nothing without one.

    Parameters
    ----------
    name, factor, overrides, tell
        As for :func:`~etac_ros.robustness.grid.robustness`.
    losses
        Those of the grid; 0 among them.
    """
    ideal = load(name, None, overrides)
    if RADIO not in ideal.variants:
        return ()
    warm_up(ideal)
    usual = simulate(ideal).summary
    radio = load(name, RADIO, overrides)
    found = []
    for loss in losses:
        for acknowledged in (False, True):
            tell(f"{name} {RADIO}: loss {loss:g}{', acknowledged' if acknowledged else ''}")
            summary = simulate(on_radio(radio, loss, acknowledged)).summary
            found.append(_tried(loss, acknowledged, summary, usual, factor))
    return tuple(found)


def on_radio(radio: Scenario, loss: float, acknowledged: bool) -> Scenario:
    """The variant with this loss on all its network links that cross a medium, acknowledged or not."""
    links = dict(radio.run.links)
    for name in network_links(radio):
        if links[name].medium is not None:
            changed = {**links[name].model_dump(by_alias=True), "loss": loss, "bursts": None, "acknowledged": None}
            if acknowledged:
                by = "all" if len(links[name].to) > 1 else None
                changed["acknowledged"] = AcknowledgedSection(timeout_s=TIMEOUT_S, retries=RETRIES, by=by)
            links[name] = LinkSection.model_validate(changed)
    return replace(radio, run=radio.run.model_copy(update={"links": links}))


def _tried(loss: float, acknowledged: bool, summary: Summary, ideal: Summary, factor: float) -> Tried:
    accounts = [account for account in summary.links.values() if account.medium]
    told = [account.acknowledgement for account in accounts if account.acknowledgement is not None]
    sent = sum(account.sent for account in accounts)
    return Tried(
        loss,
        acknowledged,
        summary.network.messages,
        sum(one.retransmitted for one in told),
        sum(one.acknowledgements for one in told),
        sum(
            one.payload_bytes + one.overhead_bytes + one.acknowledgement_bytes + one.collided_bytes
            for one in summary.media.values()
        ),
        sum(account.delivered for account in accounts) / sent if sent else 1.0,
        largest_error(summary),
        summary.halted,
        holds(summary, ideal, factor),
    )
