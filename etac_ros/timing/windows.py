"""How long the next window is: long while nothing happens, short while much does."""

from __future__ import annotations

from dataclasses import dataclass

from etac_ros.errors import ScenarioError

_LOOKED_AHEAD_S = 0.1
"""How far a run that is slowed down is computed ahead of what is shown [wall s]."""


@dataclass(frozen=True, slots=True)
class WindowPolicy:
    """Length of windows in samples. No result depends on it, only speed does.

    Parameters
    ----------
    first
        Length of the first window.
    longest
        Upper bound; 1024 rigid-body samples are about 57 kB.
    """

    first: int = 64
    longest: int = 1024

    def __post_init__(self) -> None:
        if not 1 <= self.first <= self.longest:
            raise ValueError(f"windows need 1 <= first <= longest, found {self.first} and {self.longest}")

    def after_quiet(self, length: int) -> int:
        """Four times the length of a window in which nothing happened."""
        return min(4 * length, self.longest)

    def after_hit(self, used: int) -> int:
        """Twice the samples that were used before something happened: the next interval is seldom longer."""
        return min(max(1, 2 * used), self.longest)


USUAL_WINDOWS = WindowPolicy()
"""What a scenario gets that says nothing of windows."""


def check_pace(pace: float) -> None:
    """Refuse a pace at which time would stand still, or that is none.

    Raises
    ------
    ScenarioError
        If it is one.
    """
    if not 0.0 < pace < float("inf"):
        raise ScenarioError(f"--rate {pace:g}", "is no rate", "simulated seconds a second, more than 0")


def short_windows(windows: WindowPolicy, pace: float | None, ticks_per_second: int) -> WindowPolicy:
    """Windows of a run that is slowed down: none reaches further ahead than one looks.

    Raises
    ------
    ScenarioError
        If the pace is none.
    """
    if pace is None:
        return windows
    check_pace(pace)
    longest = max(1, min(windows.longest, int(_LOOKED_AHEAD_S * pace * ticks_per_second)))
    return WindowPolicy(min(windows.first, longest), longest)
