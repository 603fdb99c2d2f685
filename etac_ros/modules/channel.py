"""The channel of a link: what becomes of a message, as a pure function of (seed, link, sequence number)."""

from __future__ import annotations

from dataclasses import dataclass

from etac_ros.maths.noise import stream_key, uniforms


@dataclass(frozen=True, slots=True)
class Channel:
    """Delay in whole ticks and independent loss.

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
    """

    seed: int
    link: str
    delay_ticks: int = 0
    loss: float = 0.0

    @property
    def ideal(self) -> bool:
        """True if every message arrives at the tick at which it was sent."""
        return self.delay_ticks == 0 and self.loss == 0.0

    def loses(self, receiver: str, sequence: int) -> bool:
        """Whether the message with this sequence number (1, 2, ...) is lost on its way to the receiver."""
        if self.loss == 0.0:
            return False
        key = stream_key(self.seed, f"channel/{self.link}/{receiver}")
        return bool(uniforms(key, sequence, 1, 1)[0, 0] < self.loss)
