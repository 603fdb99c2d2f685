"""What became of every message of a link that is not ideal, and what every medium carried.

Messages are counted once for each receiver here, since a broadcast may reach one and miss another. The accounts are
those of the emulated air; what crossed DDS, each message once, is counted by topic.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence

import numpy as np
from pydantic import BaseModel, ConfigDict, Field

from etac_ros.errors import ProtocolError
from etac_ros.graph.channel import Way
from etac_ros.graph.graph import Graph, Link
from etac_ros.graph.recording import Message, Recording
from etac_ros.graph.replay import Delivery, deliveries
from etac_ros.maths.ticks import NANOSECONDS, nanoseconds, seconds
from etac_ros.media.frame import Fate, Outcome, landing_tick


class _Model(BaseModel):
    model_config = ConfigDict(extra="forbid")


class LinkAccount(_Model):
    """One link. sent = delivered + lost + dropped + given_up + under_way, each counted by itself."""

    medium: str | None = Field(description="the shared medium that it crosses")
    sent: int = Field(description="messages times receivers")
    delivered: int = Field(description="of them, those that arrived, however often")
    lost: int = Field(description="in the channel: by chance, in a burst or in an outage")
    dropped: int = Field(description="from a queue of the medium")
    given_up: int = Field(description="after the last collision")
    under_way: int = Field(description="at the end: in a queue, on the air or delayed")
    duplicated: int = Field(description="arrivals beyond the first of each message")
    overtaken: int = Field(description="arrived after one that was sent later")
    least_delay_s: float | None = Field(description="of the first arrivals; null where nothing arrived")
    median_delay_s: float | None
    p99_delay_s: float | None = Field(description="99 % of the messages came no later")
    most_delay_s: float | None
    mean_age_s: float | None = Field(
        description="age of the newest information at a receiver, from its first arrival on; mean of all receivers"
    )
    peak_age_s: float | None = Field(description="the largest age at any receiver")


class MediumAccount(_Model):
    """One shared medium."""

    frames: int = Field(description="on the air, each try counted")
    collided: int = Field(description="of them, those that were not alone there")
    given_up: int = Field(description="frames after whose collision nothing was tried any more")
    dropped: int = Field(description="frames that never were on the air, for want of a place in a queue")
    payload_bytes: int = Field(description="of frames that were alone on the air")
    overhead_bytes: int = Field(description="of the same")
    collided_bytes: int = Field(description="of all others, payload and overhead")
    air_time_s: float = Field(description="during which somebody sent")
    utilisation: float = Field(description="the same as a part of the run")
    energy_j: float | None = Field(
        description="of senders and receivers while frames last, collided ones included; null without powers"
    )
    overflow_s: float | None = Field(description="when a frame was dropped first; null for never")


def link_accounts(graph: Graph, recording: Recording) -> dict[str, LinkAccount]:
    """The account of each link that is not ideal.

    Raises
    ------
    ProtocolError
        If messages are missing in the account, or are more than were sent.
    """
    return {
        name: _of_link(graph, recording, link)
        for name, link in graph.links.items()
        if link.medium or not link.channel.ideal
    }


def medium_accounts(graph: Graph, recording: Recording) -> dict[str, MediumAccount]:
    """The account of each medium, up to the end of the run."""
    return {name: _of_medium(graph, recording, name) for name in graph.media}


def _of_link(graph: Graph, recording: Recording, link: Link) -> LinkAccount:
    messages = recording.messages[link.name]
    known = {message.sequence for message in messages}
    final = {
        fate.sequence: fate
        for fate in recording.air
        if fate.link == link.name and fate.outcome is not Outcome.COLLIDED and fate.sequence in known
    }
    counts: Counter[str] = Counter()
    delays: list[int] = []
    ages: list[tuple[float, int]] = []
    for receiver in link.receivers:
        found = deliveries(graph, recording, link, receiver)
        arrived = {one.message.sequence for one in found}
        counts["delivered"] += len(arrived)
        counts["duplicated"] += len(found) - len(arrived)
        counts["overtaken"] += _overtaken(found)
        way = Way(link.channel, receiver)
        for message in messages:
            counts[_fate(graph, link, way, message, final.get(message.sequence))] += 1
        first: dict[int, int] = {}
        for one in found:
            first[one.message.sequence] = min(one.tick - one.message.tick, first.get(one.message.sequence, one.tick))
        delays += first.values()
        if found:
            ages.append(_ages(found, graph.end_tick))
    sent = len(messages) * len(link.receivers)
    accounted = sum(counts[name] for name in ("delivered", "lost", "dropped", "given_up", "under_way"))
    if accounted != sent:
        raise ProtocolError(
            f"link {link.name}",
            f"{sent} messages were sent to its receivers, and {accounted} are accounted for",
            "sent = delivered + lost + dropped + given up + under way",
            "this is a fault of etac_ros: please report it with the bag",
        )
    late = seconds(np.array(sorted(delays), dtype=np.int64), graph.ticks_per_second)
    # The nearest rank: a delay that some message had, and no mean of two.
    quantiles = [float(late[max(0, -(-late.size * percent // 100) - 1)]) if late.size else None for percent in (50, 99)]
    mean, peak = (sum(one for one, _ in ages) / len(ages), max(one for _, one in ages)) if ages else (None, None)
    return LinkAccount(
        medium=link.medium or None,
        sent=sent,
        delivered=counts["delivered"],
        lost=counts["lost"],
        dropped=counts["dropped"],
        given_up=counts["given_up"],
        under_way=counts["under_way"],
        duplicated=counts["duplicated"],
        overtaken=counts["overtaken"],
        least_delay_s=float(late[0]) if late.size else None,
        median_delay_s=quantiles[0],
        p99_delay_s=quantiles[1],
        most_delay_s=float(late[-1]) if late.size else None,
        mean_age_s=None if mean is None else mean / graph.ticks_per_second,
        peak_age_s=None if peak is None else peak / graph.ticks_per_second,
    )


def _fate(graph: Graph, link: Link, way: Way, message: Message, fate: Fate | None) -> str:
    """What became of a message that was not delivered to a receiver, in the words of the account; or ''."""
    tick = message.tick
    if link.medium:
        if fate is None:
            return "under_way"
        if fate.outcome is Outcome.DROPPED:
            return "dropped"
        if fate.outcome is Outcome.GIVEN_UP:
            return "given_up"
        tick = landing_tick(fate.landed_ns, graph.ticks_per_second)
        if tick >= graph.end_tick:
            return "under_way"
    arrivals = way.arrivals(message.sequence, tick)
    if not arrivals:
        return "lost"
    return "under_way" if min(arrivals) >= graph.end_tick else ""


def _overtaken(found: Sequence[Delivery]) -> int:
    """Messages whose first arrival came after that of one sent later; given in order of sequence number."""
    first: dict[int, tuple[int, int]] = {}
    for one in found:
        when = (one.tick, one.step)
        first[one.message.sequence] = min(when, first.get(one.message.sequence, when))
    earliest, count = None, 0
    for when in reversed(first.values()):
        count += earliest is not None and when > earliest
        earliest = when if earliest is None else min(earliest, when)
    return count


def _ages(found: Sequence[Delivery], end_tick: int) -> tuple[float, int]:
    """Mean and peak age of the newest information at a receiver [ticks], from its first arrival to the end."""
    in_time = sorted((one.tick, one.message.tick) for one in found)
    begin, area, peak = in_time[0][0], 0.0, 0
    newest = in_time[0][1]
    for (tick, made), following in zip(in_time, [*(tick for tick, _ in in_time[1:]), end_tick], strict=True):
        newest = max(newest, made)
        stay, young = following - tick, tick - newest
        area += stay * young + 0.5 * stay * stay
        peak = max(peak, young + stay)
    return area / (end_tick - begin), peak


def _of_medium(graph: Graph, recording: Recording, name: str) -> MediumAccount:
    lines = graph.media[name].lines
    fates = [fate for fate in recording.air if fate.link in lines]
    counts = Counter(fate.outcome for fate in fates)
    alone = [lines[fate.link] for fate in fates if fate.outcome is Outcome.SENT]
    collided = [fate for fate in fates if fate.outcome in (Outcome.COLLIDED, Outcome.GIVEN_UP)]
    end = nanoseconds(graph.end_tick, graph.ticks_per_second)
    on_air = [fate for fate in fates if fate.outcome is not Outcome.DROPPED and fate.start_ns < end]
    powers = graph.media[name].powers_w
    busy: dict[int, int] = {}  # only frames that collide overlap, and they begin together
    for fate in on_air:
        busy[fate.start_ns] = max(busy.get(fate.start_ns, 0), min(fate.end_ns, end) - fate.start_ns)
    air_time = sum(busy.values())
    drops = [fate.end_ns for fate in fates if fate.outcome is Outcome.DROPPED]
    return MediumAccount(
        frames=len(alone) + len(collided),
        collided=len(collided),
        given_up=counts[Outcome.GIVEN_UP],
        dropped=counts[Outcome.DROPPED],
        payload_bytes=sum(line.payload_bytes for line in alone),
        overhead_bytes=sum(line.frame_bytes - line.payload_bytes for line in alone),
        collided_bytes=sum(lines[fate.link].frame_bytes for fate in collided),
        air_time_s=air_time / NANOSECONDS,
        utilisation=air_time / end,
        energy_j=None if powers is None else _energy(graph, on_air, powers, end),
        overflow_s=min(drops) / NANOSECONDS if drops else None,
    )


def _energy(graph: Graph, on_air: Sequence[Fate], powers_w: tuple[float, float], end_ns: int) -> float:
    """Energy of sender and receivers over the time of each frame, up to the end of the run [J]; idling is free."""
    send, receive = powers_w
    total = 0.0
    for fate in on_air:
        lasts = (min(fate.end_ns, end_ns) - fate.start_ns) / NANOSECONDS
        total += lasts * (send + receive * len(graph.links[fate.link].receivers))
    return total
