"""The proof that wu2018 and flexible share: ``u = -k s(t_i)``, fired when ``|e| >= alpha |s| + gamma``.

Both bound ``V' <= -rate V + push`` with a free constant ``eta`` in (0, k (1 - alpha)). ``eta = k (1 - alpha) / 2``
gives the least ultimate bound, since it makes ``eta (k (1 - alpha) - eta)`` largest.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from etac_ros.parameters import FloatArray
from etac_ros.theorems.bound import Bound, at_least, everywhere
from etac_ros.theorems.evidence import Trigger, norms


@dataclass(frozen=True)
class Numbers:
    """Equation numbers of the shared proof."""

    rate_of_error: str
    growth: str
    at_trigger: str
    least_error: str
    interval: str


@dataclass(frozen=True)
class HeldErrorLaw:
    """What the shared proof takes.

    Attributes
    ----------
    k
        Gain [N m s].
    alpha, gamma
        Of the trigger rule; gamma [rad/s].
    inertia
        The inertia that the law acts on [kg m^2], shape (3, 3).
    """

    k: float
    alpha: float
    gamma: float
    inertia: FloatArray

    @property
    def eta(self) -> float:
        """The constant that makes the ultimate bound least [N m s]."""
        return 0.5 * self.k * (1.0 - self.alpha)

    @property
    def largest(self) -> float:
        """Largest eigenvalue of the inertia [kg m^2]."""
        return float(np.linalg.eigvalsh(self.inertia)[-1])

    @property
    def smallest(self) -> float:
        """Smallest eigenvalue of the inertia [kg m^2]."""
        return float(np.linalg.eigvalsh(self.inertia)[0])

    @property
    def rate(self) -> float:
        """``epsilon`` or ``varsigma`` [1/s]."""
        return 2.0 * (self.k * (1.0 - self.alpha) - self.eta) / self.largest

    @property
    def inverse_norm(self) -> float:
        """Spectral norm of the inverse inertia [1/(kg m^2)]."""
        return 1.0 / self.smallest


def interval_bounds(
    law: HeldErrorLaw,
    drift: FloatArray,
    rates: FloatArray,
    signal: FloatArray,
    signal_dot: FloatArray,
    trigger: Trigger,
    tick_s: float,
    numbers: Numbers,
) -> list[Bound]:
    """The statements on the way to the least interval, and that interval.

    Parameters
    ----------
    law
        Gain, trigger and inertia.
    drift
        ``L`` of wu2018's eq. (26), ``G`` of flexible's eq. (59) [N m], shape (n, 3).
    rates
        Angular velocity [rad/s], shape (n, 3).
    signal, signal_dot
        ``s`` or ``sigma`` and its rate, shape (n, 3).
    trigger
        What the rule was shown.
    tick_s
        The shortest interval that there can be [s].
    numbers
        Of the equations.
    """
    speed = norms(rates)
    shape = 1.0 + speed + speed**2
    b = float((norms(drift) / shape).max())
    s = norms(signal)
    rows = trigger.compared.ticks - trigger.shown.first
    error, fired = trigger.compared.errors, trigger.compared.fired
    starts = trigger.shown.ticks[np.searchsorted(trigger.shown.ticks, trigger.compared.ticks, side="left") - 1]
    age = (trigger.compared.ticks - starts) / trigger.ticks_per_second
    grown = np.expm1(law.k * law.inverse_norm * age)
    after = rows[rows < s.size]
    part = slice(0, after.size)
    allowed = (b * shape[after] + law.k * s[after]) / law.k * grown[part]
    at = fired[part]
    lengths = trigger.intervals_s
    threshold = trigger.compared.thresholds[part][at]
    # As printed, the values at the end of the interval stand for those during it.
    end = after[at]
    least = np.log1p(law.k * law.gamma / (b * shape[end] + law.k * s[end])) / (law.k * law.inverse_norm)
    with_b = f"with the least b of this run, {b:.3g} N m"
    return [
        everywhere(
            numbers.rate_of_error,
            "growth of |e|",
            norms(signal_dot)[after],
            law.inverse_norm * (b * shape[after] + law.k * (s[after] + error[part])),
            with_b,
        ),
        everywhere(
            numbers.growth,
            "|e| since the last triggering instant",
            error[part],
            allowed,
            "the comparison lemma takes |s| and Phi for constant in time, and they are not",
        ),
        everywhere(
            numbers.at_trigger,
            "threshold at a triggering instant",
            threshold,
            allowed[at],
            "the same, where it matters: at the end of an interval",
        ),
        at_least(numbers.least_error, "|e| at a triggering instant", law.gamma, float(error[part][at].min()), "rad/s"),
        at_least(
            numbers.interval,
            "shortest interval",
            float(least.min()),
            float(lengths.min()),
            "s",
            tick_s,
            f"{with_b}; a tick is {tick_s:.3g} s, and no interval can be shorter",
        ),
    ]
