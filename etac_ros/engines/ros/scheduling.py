"""How the processes of a run in simulated time share the processors: nobody is interrupted by whom it has just told.

There are more processes than processors, and nearly every message wakes two of them, the receiver and the recorder.
The kernel would let them push aside who is still sending. With SCHED_BATCH who is awake finishes; and the recorder, for
which nobody waits before the end, leaves the processors to the others. Nobody starves: it is a matter of turns.
"""

from __future__ import annotations

import contextlib
import os

_RECORDER_NICE = 10


def take_turns(only_listens: bool) -> None:
    """Set how this process, and all threads that it will start, are scheduled.

    Parameters
    ----------
    only_listens
        Whether it is the recorder's.
    """
    with contextlib.suppress(OSError):  # a system that forbids it is only slower
        if os.sched_getscheduler(0) == os.SCHED_OTHER:  # else somebody has chosen another
            os.sched_setscheduler(0, os.SCHED_BATCH, os.sched_param(0))
        if only_listens:
            os.nice(_RECORDER_NICE)
