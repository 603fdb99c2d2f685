"""Work beside one's own: bytes that a forked process makes meanwhile."""

from __future__ import annotations

import multiprocessing
import os
import signal
from collections.abc import Callable
from contextlib import suppress
from multiprocessing.connection import Connection

Work = Callable[[], bytes]
"""A piece of work, or what hands its outcome out."""
_LONGEST_S = 60.0
"""After that a piece of work has come to nothing."""


def here(work: Work) -> Work:
    """Do a piece of work at once, in this process."""
    made = work()
    return lambda: made


class Beside:
    """Pieces of work in a process of their own, one after the other: forked, so that each finds all that is here.

    For a process whose other threads do nothing that the work needs, such as a command that shows how far it is: what
    they hold at a fork stays locked for ever. Where there is a single core the work is done here, and also where its
    process comes to nothing.
    """

    def __init__(self) -> None:
        self._last: _Forked | None = None

    def __call__(self, work: Work) -> Work:
        """Begin a piece of work once the one before it is done; what is returned waits for its outcome."""
        if len(os.sched_getaffinity(0)) == 1:
            return here(work)
        if self._last is not None:
            self._last.outcome()  # two at once would be more than the other core has room for
        self._last = _Forked(work)
        return self._last.outcome


class _Forked:
    """One piece of work."""

    def __init__(self, work: Work) -> None:
        self._work, self._made = work, b""
        fork = multiprocessing.get_context("fork")
        self._ours, theirs = fork.Pipe(duplex=False)
        self._process = fork.Process(target=_do, args=(work, theirs), daemon=True)
        self._process.start()
        theirs.close()

    def outcome(self) -> bytes:
        """What came of it; empty is nothing."""
        if not self._made:
            with suppress(EOFError, OSError):
                self._made = self._ours.recv_bytes() if self._ours.poll(_LONGEST_S) else b""
            self._ours.close()
            self._process.kill()
            self._process.join()
            self._made = self._made or self._work()
        return self._made


def _do(work: Work, outcome: Connection) -> None:
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C is for who waits, and ends this one with itself
    with suppress(BaseException):  # which the one that waits will meet itself, and tell
        outcome.send_bytes(work())
    os._exit(0)  # without what else happens at an end: that is the business of who has forked
