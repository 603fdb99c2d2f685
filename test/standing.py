"""Laws that take their time at the third command: one computes, one waits for ever."""

from __future__ import annotations

import threading
import time

from etac_ros.parameters import FloatArray, Parameters


class BusyLaw:
    """Computes for a number of seconds of processor time."""

    class Parameters(Parameters):
        """How long [s]."""

        busy_s: float

    signal_size = 3
    command_size = 3

    def __init__(self, parameters: BusyLaw.Parameters, ticks_per_second: int) -> None:
        self._busy_s = parameters.busy_s
        self._commands = 0

    def command(self, signal: FloatArray) -> FloatArray:
        """Compute at the third time."""
        self._commands += 1
        if self._commands == 3:
            end = time.process_time() + self._busy_s
            while time.process_time() < end:
                pass
        return -signal


class BlockedLaw:
    """Never comes back."""

    Parameters = Parameters
    signal_size = 3
    command_size = 3

    def __init__(self, parameters: Parameters, ticks_per_second: int) -> None:
        self._commands = 0

    def command(self, signal: FloatArray) -> FloatArray:
        """Wait at the third time."""
        self._commands += 1
        if self._commands == 3:
            threading.Event().wait()
        return -signal
