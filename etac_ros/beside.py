"""Work beside one's own: what a forked process makes meanwhile."""

from __future__ import annotations

import multiprocessing
import os
import signal
from collections.abc import Callable
from contextlib import suppress
from multiprocessing.connection import Connection
from multiprocessing.process import BaseProcess
from typing import Any, Generic, Protocol, TypeVar

from etac_ros.processes import end_with_parent, flush_streams

T = TypeVar("T")
Work = Callable[[], T]
"""A piece of work, or what hands its outcome out."""


class Elsewhere(Protocol):
    """Who sees to it that a piece of work is done."""

    def __call__(self, work: Work[T], /) -> Work[T]:
        """Begin a piece of work; what is returned waits for its outcome."""


def here(work: Work[T]) -> Work[T]:
    """Do a piece of work at once, in this process."""
    made = work()
    return lambda: made


class Beside:
    """Pieces of work that this process and a forked one share out; the forked one finds all that is here.

    It takes one at a time, from the last on, as soon as there are any. This one goes on meanwhile, and does, from the
    first on, what is asked for and has not been begun. For a process whose other threads do nothing that the work
    needs, such as a command that shows how far it is: what they hold at a fork stays locked for ever. Where there is a
    single core the work is done here, and also where its process comes to nothing.

    Parameters
    ----------
    longest_s
        After so long [s] a piece of work has come to nothing; None waits for it.
    """

    def __init__(self, longest_s: float | None = 60.0) -> None:
        self._longest_s = longest_s
        self._waiting: list[_Piece[Any]] = []
        self._last: _Piece[Any] | None = None

    def __call__(self, work: Work[T], /) -> Work[T]:
        """Take a piece of work; what is returned hands out what came of it."""
        if len(os.sched_getaffinity(0)) == 1:
            return here(work)
        piece = _Piece(work, self._longest_s)
        self._waiting.append(piece)
        self._begin()

        def outcome() -> T:
            if piece in self._waiting:
                self._waiting.remove(piece)
            self._begin()
            return piece.outcome()

        return outcome

    def _begin(self) -> None:
        """Let the other core have one, unless it is busy: two at once would be more than it has room for."""
        if self._waiting and (self._last is None or not self._last.is_under_way):
            self._last = self._waiting.pop()
            self._last.begin()


class _Piece(Generic[T]):
    """One piece of work."""

    def __init__(self, work: Work[T], longest_s: float | None) -> None:
        self._work = work
        self._longest_s = longest_s
        self._made: list[T] = []
        self._process: BaseProcess | None = None
        self._pipe: Connection

    @property
    def is_under_way(self) -> bool:
        """Whether a process is at it."""
        return self._process is not None and not self._pipe.poll()

    def begin(self) -> None:
        """Have it done by a process of its own."""
        fork = multiprocessing.get_context("fork")
        self._pipe, theirs = fork.Pipe(duplex=False)
        flush_streams()  # or it would write once more what this one has not written yet
        self._process = fork.Process(target=_do, args=(self._work, theirs, os.getpid()), daemon=True)
        before = signal.pthread_sigmask(signal.SIG_BLOCK, [signal.SIGINT])
        try:
            self._process.start()
        finally:
            signal.pthread_sigmask(signal.SIG_SETMASK, before)
        theirs.close()

    def outcome(self) -> T:
        """What came of it: what its process sends, or else what is made here and now."""
        if self._process is not None:
            with suppress(EOFError, OSError):
                if self._pipe.poll(self._longest_s):
                    self._made.append(self._pipe.recv())
            self._process.kill()
            self._process.join()
            self._pipe.close()
            self._process = None
        if not self._made:
            self._made.append(self._work())
        return self._made[0]


def _do(work: Work[object], outcome: Connection, parent: int) -> None:
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C is for who waits, and ends this one with itself
    signal.pthread_sigmask(signal.SIG_UNBLOCK, [signal.SIGINT])
    end_with_parent(signal.SIGKILL)  # as does whatever else ends it
    if os.getppid() == parent:
        with suppress(BaseException):  # which the one that waits will meet itself, and tell
            made = work()
            flush_streams()
            outcome.send(made)
    os._exit(0)  # without what else happens at an end: that is the business of who has forked
