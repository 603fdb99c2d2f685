"""A law that fails at its third command, and a process that just ends."""

from __future__ import annotations

import os
from typing import NoReturn

from etac_ros.parameters import FloatArray, Parameters


class BrokenLaw:
    """Raises."""

    Parameters = Parameters
    signal_size = 3
    command_size = 3

    def __init__(self, parameters: Parameters, ticks_per_second: int) -> None:
        self._commands = 0

    def command(self, signal: FloatArray) -> FloatArray:
        """Fail at the third time."""
        self._commands += 1
        if self._commands > 2:
            raise RuntimeError("the law is broken")
        return -signal


def leave(tell: object) -> NoReturn:
    """End the process without a word."""
    os._exit(3)
