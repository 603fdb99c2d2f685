r"""Signals that end a run: heard at once, acted on where nothing is half done, and never twice.

Ctrl-C, a closed terminal, Ctrl-\ and ``kill`` all end a run alike: the processes leave, the bag is completed, and the
exit code says which signal it was (128 and its number).
"""

from __future__ import annotations

import contextlib
import os
import signal
import sys
import threading
from collections.abc import Iterator
from types import FrameType, TracebackType
from typing import Self

ENDING = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP, signal.SIGQUIT)
_DEFAULTS = (signal.SIG_DFL, signal.default_int_handler)


class EndedBySignal(SystemExit):
    """Another signal than SIGINT has ended the run; unless somebody catches it, it becomes the exit code.

    Parameters
    ----------
    number
        The signal's.
    """

    def __init__(self, number: int) -> None:
        super().__init__(128 + number)
        self.number = number

    def __reduce__(self) -> tuple[type, tuple[int]]:
        # It may cross a process border; the default would hand __init__ the exit code.
        return type(self), (self.number,)


class SignalGuard:
    """While entered, an ending signal is kept until :meth:`check`; after the first, others have no effect.

    Who handles a signal in a way of their own, or ignores it (as ``nohup`` does), keeps it. Outside the main thread,
    which is where Python hands out signals, it does nothing.
    """

    def __init__(self) -> None:
        self.received: int | None = None
        self._previous: dict[int, object] = {}
        self._pipe: tuple[int, int] | None = None
        self._raised = False

    @property
    def wakes(self) -> list[int]:
        """File descriptors that become readable when a signal has come, to wait on."""
        return [] if self._pipe is None else [self._pipe[0]]

    def check(self) -> None:
        """Go no further if a signal has come.

        Raises
        ------
        KeyboardInterrupt
            For SIGINT.
        EndedBySignal
            For the others.
        """
        if self.received is None or self._raised:
            return
        self._raised = True
        name = signal.Signals(self.received).name
        with contextlib.suppress(OSError, AttributeError):  # the terminal may be what has gone
            print(f"etac: {name}: ending the run; what has happened until now is in the bag", file=sys.stderr)
        if self.received == signal.SIGINT:
            raise KeyboardInterrupt
        raise EndedBySignal(self.received)

    def __enter__(self) -> Self:
        if threading.current_thread() is threading.main_thread():
            self._pipe = os.pipe()
            os.set_blocking(self._pipe[1], False)
            for number in ENDING:
                if signal.getsignal(number) in _DEFAULTS:
                    self._previous[number] = signal.signal(number, self._on_signal)
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        for number, handler in self._previous.items():
            signal.signal(number, handler)  # type: ignore[arg-type]
        if self._pipe is not None:
            for end in self._pipe:
                os.close(end)
            self._pipe = None
        if error is None:
            self.check()

    def _on_signal(self, number: int, frame: FrameType | None) -> None:
        if self.received is None:
            self.received = number
            if self._pipe is not None:
                os.write(self._pipe[1], b"!")


@contextlib.contextmanager
def held_back() -> Iterator[None]:
    """Nothing is interrupted in here: a process that has just been forked has to be known before it can be ended."""
    before = signal.pthread_sigmask(signal.SIG_BLOCK, ENDING)
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


def let_through() -> None:
    """In a forked process, once it can deal with them: signals come again."""
    signal.pthread_sigmask(signal.SIG_UNBLOCK, ENDING)
