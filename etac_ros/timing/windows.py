"""How long the next window is: long while nothing happens, short while much does."""

from __future__ import annotations

from dataclasses import dataclass


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
