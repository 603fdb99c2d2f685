"""Who of a run's processes stands still: signs of life outside DDS, and what they are taken for.

The loop of every process writes the time at which it last came round into memory that all of them share; a process
that has been stopped, or blocks, falls silent there, whatever DDS makes of it. The launcher looks at all of them a few
times a second. Silence is counted in looks, not in time, so that a launcher which was itself stopped (Ctrl-Z, a laptop
that sleeps) blames nobody for it.
"""

from __future__ import annotations

import math
import mmap
import os
import time
from dataclasses import dataclass, field
from pathlib import Path
from typing import NamedTuple

QUIET_S = 20.0
"""How long a node may stand still, or owe an answer, before it is reported. The one such setting: ``--quiet-s``."""
LOOK_EVERY_S = 0.25

_FRESH_S = 1.0
_BUSY_SHARE = 0.1
"""Share of a core with which a process counts as computing, even if it is never caught running."""
_SIZE = 8


def fresh_s(quiet_s: float) -> float:
    """For how long a sign of life counts as fresh [s].

    Loops come round twenty times a second; who has not for this long is at something else, or stands still. It is
    well below ``quiet_s``, so that who stands still is never taken for one who listens and owes an answer.
    """
    return min(_FRESH_S, quiet_s / 4)


class LifeSigns:
    """When each process of a run last showed that it lives [s], in memory shared by all that are forked afterwards.

    Parameters
    ----------
    processes
        How many.
    fresh_s
        For how long a sign counts as fresh.
    """

    def __init__(self, processes: int, fresh_s: float) -> None:
        # An aligned number of eight bytes is written at once: nobody reads half of it.
        self._times = memoryview(mmap.mmap(-1, max(1, processes) * _SIZE)).cast("d")
        self._count = processes
        self._fresh_s = fresh_s

    def give(self, process: int) -> None:
        """The loop of a process has come round."""
        self._times[process] = time.monotonic()

    def take_leave(self, process: int) -> None:
        """A process has done all that it had to do."""
        self._times[process] = math.inf

    def last(self, process: int) -> float:
        """When a process last gave a sign, on the clock of ``time.monotonic``; 0 before its first."""
        return self._times[process]

    def all_fresh(self) -> bool:
        """Whether every process listens, or has taken leave: none computes, is blocked or stopped."""
        now = time.monotonic()
        return all(now - self._times[process] < self._fresh_s for process in range(self._count))


class Glimpse(NamedTuple):
    """What the kernel says of a process at one moment.

    Attributes
    ----------
    state
        State of its main thread, a letter as in proc(5).
    main_cpu_s, cpu_s
        Processor time that its main thread and the whole process have used [s].
    """

    state: str
    main_cpu_s: float
    cpu_s: float


def glimpse(pid: int) -> Glimpse | None:
    """Look at a process; None if it is not there."""
    try:
        state, main = _stat(Path(f"/proc/{pid}/task/{pid}/stat"))
        _, whole = _stat(Path(f"/proc/{pid}/stat"))
    except (OSError, ValueError, IndexError):
        return None
    return Glimpse(state, main, whole)


def _stat(path: Path) -> tuple[str, float]:
    # Fields are counted from behind the command's name, which may hold anything.
    fields = path.read_text().rpartition(")")[2].split()
    return fields[0], (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


@dataclass
class Stillness:
    """How long one process has been still.

    Attributes
    ----------
    silent_s
        Time without a sign of life in which it did not compute either [s].
    computing_s
        Time without a sign of life in which it computed [s].
    state
        What the kernel last said of it.
    """

    silent_s: float = 0.0
    computing_s: float = 0.0
    state: str = "S"
    _sign: float = -1.0
    _before: Glimpse | None = field(default=None, repr=False)

    def look(self, elapsed_s: float, sign: float, seen: Glimpse | None) -> None:
        """Take in what is seen now.

        Parameters
        ----------
        elapsed_s
            Time since the last look.
        sign
            Last sign of life; only whether it has changed counts.
        seen
            What the kernel says.
        """
        if sign != self._sign:
            self._sign, self.silent_s, self.computing_s = sign, 0.0, 0.0
        elif self._computes(elapsed_s, seen):
            self.silent_s = 0.0
            self.computing_s += elapsed_s
        else:
            self.silent_s += elapsed_s
        self._before = seen
        if seen is not None:
            self.state = seen.state

    def _computes(self, elapsed_s: float, seen: Glimpse | None) -> bool:
        if seen is None or self._before is None or seen.state in "Tt":
            return False
        main = seen.main_cpu_s - self._before.main_cpu_s
        whole = seen.cpu_s - self._before.cpu_s
        # Threads of DDS work a little in any process; only where they are many times that is it the node's own work.
        return seen.state == "R" or main > _BUSY_SHARE * elapsed_s or whole > 5 * _BUSY_SHARE * elapsed_s

    @property
    def stopped(self) -> bool:
        """Whether a signal or a debugger holds it."""
        return self.state in ("T", "t")

    @property
    def manner(self) -> str:
        """In which way it stands still."""
        return {
            "T": "stopped by a signal",
            "t": "held by a debugger",
            "D": "blocked in the system, as by a disk that does not answer",
        }.get(self.state, "blocked")


@dataclass
class Watch:
    """Watches over processes, and says who stands still.

    Parameters
    ----------
    quiet_s
        How long that is allowed.
    """

    quiet_s: float
    still: dict[int, Stillness] = field(default_factory=dict)
    _looked: float | None = None
    _told: dict[int, float] = field(default_factory=dict)

    def look(self, now: float, signs: dict[int, float], seen: dict[int, Glimpse | None]) -> None:
        """Look at all processes, by number; who is no longer among them is forgotten."""
        elapsed = 0.0 if self._looked is None else min(now - self._looked, 2 * LOOK_EVERY_S)
        self._looked = now
        self.still = {number: self.still.get(number, Stillness()) for number in signs}
        for number, sign in signs.items():
            self.still[number].look(elapsed, sign, seen[number])

    def standing_still(self) -> list[int]:
        """Who has stood still for too long. Nobody who may only wait for one that is stopped."""
        stopped = [number for number, still in self.still.items() if still.stopped]
        suspects = stopped or list(self.still)
        return [number for number in suspects if self.still[number].silent_s >= self.quiet_s]

    def computing_long(self) -> list[int]:
        """Who has computed for as long as that since it was last said of it."""
        found = []
        for number, still in self.still.items():
            told = self._told.get(number, 0.0)
            if still.computing_s < told:
                told = 0.0
            if still.computing_s - told >= self.quiet_s:
                found.append(number)
                told = still.computing_s
            self._told[number] = told
        return found
