"""What forked and other processes have in common: how they end, and what they have to write before."""

from __future__ import annotations

import sys
from contextlib import suppress

_PR_SET_PDEATHSIG = 1


def flush_streams() -> None:
    """Write what standard output and standard error hold back: a fork would write it twice, an end at once never."""
    for stream in (sys.stdout, sys.stderr):
        with suppress(OSError, ValueError, AttributeError):  # closed by who started this process
            stream.flush()


def end_with_parent(signal_number: int) -> None:
    """Have the system send this process a signal when its parent ends, however that ends."""
    import ctypes  # only here: every command begins with this file

    ctypes.CDLL(None).prctl(_PR_SET_PDEATHSIG, signal_number)
