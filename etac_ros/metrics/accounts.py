"""What became of every message of a link that is not ideal, and what every medium carried.

Messages are counted once for each receiver here, since a broadcast may reach one and miss another. The accounts are
those of the emulated air; what crossed DDS, each message once, is counted by topic.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from itertools import pairwise

import numpy as np
from pydantic import BaseModel, ConfigDict, Field

from etac_ros.errors import ProtocolError
from etac_ros.graph.acknowledged import End, Ended
from etac_ros.graph.channel import Way
from etac_ros.graph.graph import Graph, Link
from etac_ros.graph.recording import Message, Recording
from etac_ros.graph.replay import Delivery, conversation, deliveries
from etac_ros.maths.ticks import NANOSECONDS, nanoseconds, seconds
from etac_ros.media.frame import Fate, Outcome, landing_tick, link_and_place
from etac_ros.media.medium import Full


class _Model(BaseModel):
    model_config = ConfigDict(defer_build=True, extra="forbid")


class AcknowledgementAccount(_Model):
    """Of a link that is acknowledged."""

    acknowledged: int = Field(description="messages of which the sender knows that they arrived")
    retransmitted: int = Field(description="frames that were sent again, beside the first of each message")
    acknowledgements: int = Field(description="frames that acknowledge, on the air")
    acknowledgement_bytes: int = Field(description="of these")


class LinkAccount(_Model):
    """One link. sent = delivered + lost + dropped + given_up + superseded + under_way, each counted by itself."""

    medium: str | None = Field(description="the shared medium that it crosses")
    sent: int = Field(description="messages times receivers")
    delivered: int = Field(description="of them, those that arrived, however often")
    lost: int = Field(description="in the channel: by chance, in a burst or outage, or to a receiver that was down")
    dropped: int = Field(description="from a queue of the medium")
    given_up: int = Field(description="after the last collision, or the last try that was not acknowledged")
    superseded: int = Field(description="not sent again, since a newer message took their place")
    under_way: int = Field(description="at the end: in a queue, on the air, delayed, or to be sent again")
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
    acknowledgement: AcknowledgementAccount | None = Field(description="null where nothing is acknowledged")


class HoldAccount(_Model):
    """A zero-order hold with a time to live."""

    time_to_live_s: float
    expired: int = Field(description="commands that outlived it")
    safe_s: float = Field(description="during which the safe command was applied")


class MediumAccount(_Model):
    """One shared medium."""

    frames: int = Field(description="on the air, each try counted")
    collided: int = Field(description="of them, those that were not alone there")
    given_up: int = Field(description="frames after whose collision nothing was tried any more")
    dropped: int = Field(description="frames that never were on the air, for want of a place in a queue")
    payload_bytes: int = Field(description="of frames that were alone on the air, those sent again included")
    overhead_bytes: int = Field(description="of the same")
    acknowledgement_bytes: int = Field(description="of acknowledgements that were alone on the air")
    collided_bytes: int = Field(description="of all others, payload and overhead")
    air_time_s: float = Field(description="during which somebody sent")
    utilisation: float = Field(description="the same as a part of the run")
    energy_j: float | None = Field(
        description="of senders and receivers while frames last, collided ones included; null without powers"
    )
    overflow_s: float | None = Field(description="when a frame was dropped first; null for never")
    overflow_of: str | None = Field(
        description="whose queue passed its length then; null for nobody's, as where only the latest value waits"
    )


_CONSERVED = ("delivered", "lost", "dropped", "given_up", "superseded", "under_way")
_AT_THE_END = {
    None: "under_way",
    End.GIVEN_UP: "given_up",
    End.SUPERSEDED: "superseded",
    End.ACKNOWLEDGED: "lost",  # by others, who were enough
}
"""What became of a message that did not reach a receiver, by how the wait for its acknowledgement ended."""


def link_accounts(graph: Graph, recording: Recording) -> dict[str, LinkAccount]:
    """The account of each link that is not ideal.

    Raises
    ------
    ProtocolError
        If messages are missing in the account, or are more than were sent.
    """
    return {name: _of_link(graph, recording, link) for name, link in graph.links.items() if not link.is_ideal}


def overflows(media: Mapping[str, MediumAccount], ticks_per_second: int) -> tuple[str, ...]:
    """In words: which queue passed its length, and at which tick."""
    found = []
    for name, account in media.items():
        if account.overflow_of is not None and account.overflow_s is not None:
            tick = landing_tick(round(account.overflow_s * NANOSECONDS), ticks_per_second)
            when = f"at {account.overflow_s:.6g} s (tick {tick})"
            found.append(f"medium {name}: the queue of {account.overflow_of} passed its length {when}")
    return tuple(found)


def medium_accounts(graph: Graph, recording: Recording) -> dict[str, MediumAccount]:
    """The account of each medium, up to the end of the run."""
    return {name: _of_medium(graph, recording, name) for name in graph.media}


def hold_accounts(graph: Graph, recording: Recording) -> dict[str, HoldAccount]:
    """The account of each hold that has a time to live."""
    return {
        name: _of_hold(graph, recording, name, module.hold_ticks)
        for name, module in graph.modules.items()
        if module.hold_ticks is not None
    }


def _of_hold(graph: Graph, recording: Recording, name: str, hold_ticks: int) -> HoldAccount:
    links = graph.sends[name]
    sent = recording.messages[links[0].name] if links else []
    safe = _outlived([message.tick for message in sent], hold_ticks)
    ticks = [*(message.tick for message in sent), _until(graph, recording)]
    lasts = [until - tick for tick, until in pairwise(ticks)]
    return HoldAccount(
        time_to_live_s=hold_ticks / graph.ticks_per_second,
        expired=sum(safe),
        safe_s=sum(stay for stay, is_safe in zip(lasts, safe, strict=True) if is_safe) / graph.ticks_per_second,
    )


def _until(graph: Graph, recording: Recording) -> int:
    """The first tick that was not acted on: a run that a watch has ended is over behind its last sample."""
    last = [first + len(samples) - 1 for first, samples in map(recording.samples, graph.plants) if len(samples)]
    return min([graph.end_tick, *(tick + 1 for tick in last)])


def _outlived(ticks: Sequence[int], hold_ticks: int) -> list[bool]:
    """Which of the torques of a hold are safe ones: the first behind a time to live, until the next command.

    Told by their times alone, since in real time there are no steps.
    """
    found: list[bool] = []
    command: int | None = None
    for tick in ticks:
        outlived = command is not None and tick - command > hold_ticks and not found[-1]
        if not outlived:
            command = tick
        found.append(outlived)
    return found


def _of_link(graph: Graph, recording: Recording, link: Link) -> LinkAccount:
    messages, until = recording.messages[link.name], _until(graph, recording)
    known = {message.sequence for message in messages}
    final = {
        fate.sequence: fate
        for fate in recording.air
        if fate.link == link.name and fate.outcome is not Outcome.COLLIDED and fate.sequence in known
    }
    counts: Counter[str] = Counter()
    delays: list[int] = []
    ages: list[tuple[float, int]] = []
    ends = {} if link.acknowledged is None else _ends(graph, recording, link, until)
    for receiver in link.receivers:
        found = [one for one in deliveries(graph, recording, link, receiver) if one.tick < until]
        arrived = {one.message.sequence for one in found}
        counts["delivered"] += len(arrived)
        counts["duplicated"] += len(found) - len(arrived)
        counts["overtaken"] += _overtaken(found)
        if link.acknowledged is None:
            way = Way(link.channel, receiver)
            fates = [_fate(graph, link, way, message, final.get(message.sequence), until) for message in messages]
            counts.update(fates)
        else:
            counts.update(_AT_THE_END[ends.get(n)] for n in known - arrived)
        first: dict[int, int] = {}
        for one in found:
            first[one.message.sequence] = min(one.tick - one.message.tick, first.get(one.message.sequence, one.tick))
        delays += first.values()
        if found:
            ages.append(_ages(found, until))
    sent = len(messages) * len(link.receivers)
    accounted = sum(counts[name] for name in _CONSERVED)
    if accounted != sent:
        raise ProtocolError(
            f"link {link.name}",
            f"{sent} messages were sent to its receivers, and {accounted} are accounted for",
            "sent = delivered + lost + dropped + given up + superseded + under way",
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
        superseded=counts["superseded"],
        under_way=counts["under_way"],
        duplicated=counts["duplicated"],
        overtaken=counts["overtaken"],
        least_delay_s=float(late[0]) if late.size else None,
        median_delay_s=quantiles[0],
        p99_delay_s=quantiles[1],
        most_delay_s=float(late[-1]) if late.size else None,
        mean_age_s=None if mean is None else mean / graph.ticks_per_second,
        peak_age_s=None if peak is None else peak / graph.ticks_per_second,
        acknowledgement=None if link.acknowledged is None else _acknowledgement(graph, recording, link, ends),
    )


def _ends(graph: Graph, recording: Recording, link: Link, until: int) -> dict[int, End]:
    """How the wait for the acknowledgement of each message ended, if it did before the run."""
    return {
        event.sequence: event.end
        for event in conversation(graph, recording, link)
        if isinstance(event, Ended) and landing_tick(event.at_ns, graph.ticks_per_second) < until
    }


def _acknowledgement(graph: Graph, recording: Recording, link: Link, ends: dict[int, End]) -> AcknowledgementAccount:
    assert link.acknowledged is not None
    on_air = [fate for fate in recording.air if fate.outcome in (Outcome.SENT, Outcome.GIVEN_UP)]
    answers = [fate for fate in on_air if fate.link in link.acknowledged.by.values()]
    lines = graph.media[link.medium].lines if link.medium else {}
    own = link.acknowledged.frame_bytes
    size = {line: lines[line].frame_bytes if lines else own for line in link.acknowledged.by.values()}
    return AcknowledgementAccount(
        acknowledged=sum(end is End.ACKNOWLEDGED for end in ends.values()),
        retransmitted=sum(fate.link == link.name and fate.attempt > 1 for fate in on_air),
        acknowledgements=len(answers),
        acknowledgement_bytes=sum(size[fate.link] for fate in answers),
    )


def _fate(graph: Graph, link: Link, way: Way, message: Message, fate: Fate | None, until: int) -> str:
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
        if tick >= until:
            return "under_way"
    arrivals = way.arrivals(message.sequence, tick)
    if not arrivals:
        return "lost"
    return "under_way" if min(arrivals) >= until else ""


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
    messages = [line for line in alone if not line.answers]
    collided = [fate for fate in fates if fate.outcome in (Outcome.COLLIDED, Outcome.GIVEN_UP)]
    end = nanoseconds(_until(graph, recording), graph.ticks_per_second)
    on_air = [fate for fate in fates if fate.outcome is not Outcome.DROPPED and fate.start_ns < end]
    powers = graph.media[name].powers_w
    busy: dict[int, int] = {}  # only frames that collide overlap, and they begin together
    for fate in on_air:
        busy[fate.start_ns] = max(busy.get(fate.start_ns, 0), min(fate.end_ns, end) - fate.start_ns)
    air_time = sum(busy.values())
    first = next((fate for fate in fates if fate.outcome is Outcome.DROPPED), None)
    overflows = first is not None and graph.media[name].queue_full is not Full.REPLACE
    return MediumAccount(
        frames=len(alone) + len(collided),
        collided=len(collided),
        given_up=counts[Outcome.GIVEN_UP],
        dropped=counts[Outcome.DROPPED],
        payload_bytes=sum(line.payload_bytes for line in messages),
        overhead_bytes=sum(line.frame_bytes - line.payload_bytes for line in messages),
        acknowledgement_bytes=sum(line.frame_bytes for line in alone if line.answers),
        collided_bytes=sum(lines[fate.link].frame_bytes for fate in collided),
        air_time_s=air_time / NANOSECONDS,
        utilisation=air_time / end,
        energy_j=None if powers is None else _energy(graph, on_air, powers, end),
        overflow_s=None if first is None else first.end_ns / NANOSECONDS,
        overflow_of=lines[first.link].sender if first is not None and overflows else None,
    )


def _energy(graph: Graph, on_air: Sequence[Fate], powers_w: tuple[float, float], end_ns: int) -> float:
    """Energy of sender and receivers over the time of each frame, up to the end of the run [J]; idling is free."""
    send, receive = powers_w
    total = 0.0
    for fate in on_air:
        lasts = (min(fate.end_ns, end_ns) - fate.start_ns) / NANOSECONDS
        link, answers = link_and_place(fate.link)
        listeners = 1 if answers else len(graph.links[link].receivers)
        total += lasts * (send + receive * listeners)
    return total
