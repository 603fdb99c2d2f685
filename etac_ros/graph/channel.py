"""The channel of a link: what becomes of a message on its way to one receiver.

Every draw is a pure function of (seed, link, receiver, sequence number), and whether a burst lasts one of the same
key and the tick. So both engines lose the same messages, nobody waits for one that was lost, and who replays a
recording finds what happened. This is the one file that knows when a message arrives: the time master and the replay
ask :class:`Way`, which adds the memory that order needs.
"""

from __future__ import annotations

import math
from bisect import bisect_right
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import lru_cache

from pydantic import Field, PositiveFloat, model_validator

from etac_ros.graph.faults import Fault, reaches
from etac_ros.maths.noise import stream_key, uniform, uniforms
from etac_ros.parameters import Parameters, exactly_one

_COPIES = 2
"""Of a message that is duplicated."""
_BLOCK = 64
"""Stays in a state of the loss process that are drawn at once; results do not depend on it."""


class Jitter(Parameters):
    """A delay that is drawn for each message beside the fixed one. The sum is rounded up to whole ticks."""

    uniform_s: PositiveFloat | None = Field(default=None, description="up to so much more, all alike likely [s]")
    normal_s: PositiveFloat | None = Field(
        default=None, description="standard deviation around the fixed delay; the sum is cut at 0 [s]"
    )
    exponential_s: PositiveFloat | None = Field(default=None, description="mean of what is added [s]")
    overtaking: bool = Field(default=True, description="false: who would overtake waits for those before")

    @model_validator(mode="after")
    def _one_kind(self) -> Jitter:
        exactly_one(self, "uniform_s", "normal_s", "exponential_s")
        return self

    def seconds(self, uniform: float) -> float:
        """What is added to the fixed delay [s], by the inverse distribution of a uniform deviate in (0, 1)."""
        if self.uniform_s is not None:
            return self.uniform_s * uniform
        if self.exponential_s is not None:
            return -self.exponential_s * math.log1p(-uniform)
        from scipy.special import ndtri  # here, because it takes a fifth of a second to load

        assert self.normal_s is not None
        return self.normal_s * float(ndtri(uniform))


class Bursts(Parameters):
    """Losses in bursts (Gilbert-Elliott): a channel that is good or bad in turn, each for a random while.

    The stays are exponential, so that at ticks this is the Markov chain of E. N. Gilbert (1960) and E. O. Elliott
    (1963), whatever the tick: it leaves a state within a tick of length T with probability close to T / mean stay.
    """

    good_s: PositiveFloat = Field(description="mean stay in the good state [s]")
    bad_s: PositiveFloat = Field(description="mean stay in the bad state [s]")
    loss_good: float = Field(default=0.0, ge=0.0, lt=1.0, description="probability of loss in the good state")
    loss_bad: float = Field(default=1.0, gt=0.0, le=1.0, description="probability of loss in the bad state")

    @property
    def mean_loss(self) -> float:
        """Probability of loss over a long time."""
        return (self.good_s * self.loss_good + self.bad_s * self.loss_bad) / (self.good_s + self.bad_s)


@dataclass(frozen=True, slots=True)
class Channel:
    """Delay and jitter, loss one by one or in bursts, outages, and duplication.

    Parameters
    ----------
    seed, link
        Key of the draws.
    delay_ticks
        0 delivers at the tick of sending. A part of a tick counts together with the jitter.
    loss
        Probability of loss of each message by itself, per receiver.
    outages
        By receiver: ticks ``(from, until)`` of sending between which nothing gets through, ``until`` excluded.
    jitter, bursts
        None for none.
    duplication
        Probability that a message which is not lost arrives twice.
    ticks_per_second
        Rate of the tick grid [1/s], for jitter and bursts.
    down
        By receiver: the faults of its process, in order. What arrives meanwhile is lost, or waits.
    """

    seed: int
    link: str
    delay_ticks: float = 0
    loss: float = 0.0
    outages: Mapping[str, tuple[tuple[int, int], ...]] = field(default_factory=dict)
    jitter: Jitter | None = None
    bursts: Bursts | None = None
    duplication: float = 0.0
    ticks_per_second: int = 1
    down: Mapping[str, tuple[Fault, ...]] = field(default_factory=dict)

    @property
    def ideal(self) -> bool:
        """Whether every message arrives at the tick of sending, once."""
        return self.told_by_message and self.loss == 0.0

    @property
    def told_by_message(self) -> bool:
        """Whether a receiver can tell by itself, from a message alone, whether and when it arrives.

        It can where :meth:`drops` is all that may become of it: then what is not dropped arrives at the tick of
        sending. All else depends on that tick, which a message need not tell, or brings a message twice.
        """
        return (
            self.delay_ticks == 0
            and not self.outages
            and self.jitter is None
            and self.bursts is None
            and self.duplication == 0.0
            and not self.down
        )

    def arrivals(
        self, receiver: str, sequence: int, tick: int, attempt: int = 1, *, back: bool = False
    ) -> tuple[int, ...]:
        """Ticks at which a message would arrive at a receiver if it were the only one; none if it is lost.

        Whether the receiver is there then is asked by :class:`Way`.

        Parameters
        ----------
        receiver
            Full name of the module.
        sequence
            Number of the message on its link: 1, 2, ...
        tick
            When it was sent. A message that arrives at a later tick comes in the first step of that tick.
        attempt
            1, 2, ...: of a message that is sent again, each has luck of its own.
        back
            Of the acknowledgement on its way from the receiver: as late, lost as often, in the same bursts and outages.
        """
        if self.takes(receiver, sequence, tick, attempt, back=back):
            return ()
        copies = self.copies(receiver, sequence)
        if self.jitter is None:
            return (tick + math.ceil(self.delay_ticks),) * copies
        drawn = uniforms(self._key(f"jitter/{receiver}{_which(attempt, back)}"), sequence, 1, _COPIES)[0]
        delays = [self.delay_ticks + self.jitter.seconds(float(u)) * self.ticks_per_second for u in drawn[:copies]]
        return tuple(sorted(tick + max(0, math.ceil(delay)) for delay in delays))

    def takes(self, receiver: str, sequence: int, tick: int, attempt: int = 1, *, back: bool = False) -> bool:
        """Whether a message is lost: in an outage, in a burst, or by chance."""
        if self.outages and any(start <= tick < end for start, end in self.outages.get(receiver, ())):
            return True
        if self.bursts is None and self.loss == 0.0:
            return False
        loss = self.loss
        if self.bursts is not None:
            loss = self.bursts.loss_bad if self.is_bad(receiver, tick) else self.bursts.loss_good
        return self._draw(f"{receiver}{_which(attempt, back)}", sequence) < loss

    def drops(self, receiver: str, sequence: int) -> bool:
        """Whether chance takes a message, whatever the tick; the receiver can tell that much by itself."""
        return self.loss != 0.0 and self._draw(receiver, sequence) < self.loss

    def copies(self, receiver: str, sequence: int) -> int:
        """How often a message arrives that is not lost; the receiver can tell that by itself, too."""
        if self.duplication == 0.0:
            return 1
        return _COPIES if uniform(self._key(f"duplication/{receiver}"), sequence) < self.duplication else 1

    def is_bad(self, receiver: str, tick: int) -> bool:
        """Whether a burst lasts at a tick."""
        assert self.bursts is not None
        stays = _stays(self._key(f"bursts/{receiver}"), self.bursts.good_s, self.bursts.bad_s)
        return stays.is_bad(tick / self.ticks_per_second)

    def _draw(self, receiver: str, sequence: int) -> float:
        return uniform(self._key(receiver), sequence)

    def _key(self, stream: str) -> int:
        return stream_key(self.seed, f"channel/{self.link}/{stream}")


def _which(attempt: int, back: bool) -> str:
    """The part of a stream's name that tells attempts and directions apart; empty of what is sent once."""
    return f"{' back' if back else ''}{f' again {attempt}' if attempt > 1 else ''}"


class Way:
    """The way of a link's messages to one receiver: the channel, and the order of what has gone before.

    Parameters
    ----------
    channel
        Of the link.
    receiver
        Full name of the module.
    back
        The way of acknowledgements from it.
    """

    def __init__(self, channel: Channel, receiver: str, *, back: bool = False) -> None:
        self._channel = channel
        self._receiver = receiver
        self._back = back
        self._in_order = channel.jitter is not None and not channel.jitter.overtaking
        self._latest = 0
        self._down = () if back else channel.down.get(receiver, ())

    def arrivals(self, sequence: int, tick: int, attempt: int = 1) -> tuple[int, ...]:
        """Ticks at which the next message arrives, as :meth:`Channel.arrivals`; to be asked in order of sending."""
        found = self._channel.arrivals(self._receiver, sequence, tick, attempt, back=self._back)
        if self._in_order and found:
            found = tuple(max(self._latest, when) for when in found)
            self._latest = found[-1]
        if self._down:
            found = tuple(when for one in found if (when := reaches(self._down, one)) is not None)
        return found


class _Stays:
    """The stays of a two-state process from time 0 on, as far as anybody has asked; a memo of a pure function."""

    def __init__(self, key: int, good_s: float, bad_s: float) -> None:
        self._key = key
        self._means = (good_s, bad_s)
        # The process has been going on for ever: it is bad at time 0 as often as at any other.
        self._first_bad = uniform(key, 0) < bad_s / (good_s + bad_s)
        self._ends: list[float] = []

    def is_bad(self, time_s: float) -> bool:
        """Whether it is bad at a time [s]."""
        while not self._ends or self._ends[-1] <= time_s:
            self._extend()
        return self._first_bad ^ (bisect_right(self._ends, time_s) % 2 == 1)

    def _extend(self) -> None:
        first = len(self._ends)
        for place, drawn in enumerate(uniforms(self._key, 1 + first, _BLOCK, 1)[:, 0].tolist(), first):
            mean = self._means[self._first_bad ^ (place % 2 == 1)]
            before = self._ends[-1] if self._ends else 0.0
            self._ends.append(before - mean * math.log1p(-drawn))


@lru_cache(maxsize=4096)  # a formation has a process for each pair of sender and receiver
def _stays(key: int, good_s: float, bad_s: float) -> _Stays:
    return _Stays(key, good_s, bad_s)
