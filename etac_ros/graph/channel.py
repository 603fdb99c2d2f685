"""The channel of a link: what becomes of a message, as a pure function of (seed, link, sequence number).

This is the one file that knows when a message arrives. Whoever needs to know asks :meth:`Channel.arrival`: the time
master, and whoever replays a recording. Another effect, jitter for instance, is a change of this file alone.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from etac_ros.maths.noise import stream_key, uniforms


@dataclass(frozen=True, slots=True)
class Channel:
    """Delay in whole ticks, independent loss, and outages.

    Since everybody can compute the outcome, nobody ever waits for a message that was lost, and both engines lose
    the same ones.

    Parameters
    ----------
    seed, link
        Key of the draws.
    delay_ticks
        0 delivers at the tick of sending.
    loss
        Probability of loss, per receiver.
    outages
        By receiver: ticks ``(from, until)`` of sending between which nothing gets through, ``until`` excluded.
    """

    seed: int
    link: str
    delay_ticks: int = 0
    loss: float = 0.0
    outages: Mapping[str, tuple[tuple[int, int], ...]] = field(default_factory=dict)

    @property
    def told_by_message(self) -> bool:
        """Whether a receiver can tell by itself, from a message alone, whether and when it arrives.

        It can where :meth:`drops` is all that may become of it: then what is not dropped arrives at the tick of
        sending. Delay and outages depend on that tick, which a message need not tell.
        """
        return self.delay_ticks == 0 and not self.outages

    def arrival(self, receiver: str, sequence: int, tick: int) -> int | None:
        """Tick at which a message arrives at a receiver; None if it is lost on its way.

        Parameters
        ----------
        receiver
            Full name of the module.
        sequence
            Number of the message on its link: 1, 2, ...
        tick
            When it was sent. A message that arrives at a later tick comes in the first step of that tick.
        """
        down = any(start <= tick < end for start, end in self.outages.get(receiver, ()))
        return None if down or self.drops(receiver, sequence) else tick + self.delay_ticks

    def drops(self, receiver: str, sequence: int) -> bool:
        """Whether chance takes a message, whatever the tick; the receiver can tell that much by itself."""
        if self.loss == 0.0:
            return False
        key = stream_key(self.seed, f"channel/{self.link}/{receiver}")
        return bool(uniforms(key, sequence, 1, 1)[0, 0] < self.loss)
