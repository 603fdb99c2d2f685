"""The channel of a link: what becomes of a message, as a pure function of (seed, link, sequence number)."""

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
    def ideal(self) -> bool:
        """True if every message arrives at the tick at which it was sent."""
        return self.delay_ticks == 0 and self.loss == 0.0 and not self.outages

    def loses(self, receiver: str, sequence: int, tick: int) -> bool:
        """Whether a message is lost on its way to the receiver.

        Parameters
        ----------
        receiver
            Full name of the module.
        sequence
            Number of the message on its link: 1, 2, ...
        tick
            When it was sent.
        """
        down = any(start <= tick < end for start, end in self.outages.get(receiver, ()))
        return down or self.drops(receiver, sequence)

    def drops(self, receiver: str, sequence: int) -> bool:
        """Whether chance takes a message, whatever the tick; the receiver can tell that much by itself."""
        if self.loss == 0.0:
            return False
        key = stream_key(self.seed, f"channel/{self.link}/{receiver}")
        return bool(uniforms(key, sequence, 1, 1)[0, 0] < self.loss)
