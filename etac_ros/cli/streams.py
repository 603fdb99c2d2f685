"""Standard streams that whoever started this process has closed (``>&-``), and those whose reader leaves early."""

from __future__ import annotations

import io
import os
import sys
from typing import Any


def hold_standard_streams() -> None:
    """Give closed standard streams something to write to, so that no socket of DDS gets their number instead.

    What would have been shown is lost, which is what was asked for; it is said once, where there is still a place.
    """
    closed = []
    for number, name in enumerate(("stdin", "stdout", "stderr")):
        try:
            os.fstat(number)
        except OSError:
            mode = "r" if number == 0 else "w"
            os.open(os.devnull, os.O_RDONLY if number == 0 else os.O_WRONLY)  # the lowest free number: this one
            setattr(sys, name, open(number, mode, encoding="utf-8", closefd=False))  # noqa: SIM115 - as long as we live
            closed.append(name)
    if "stdout" in closed:
        print("etac: standard output is closed: nothing of what is found can be shown", file=sys.stderr)


class _Lasting(io.FileIO):
    """Where nobody reads any more what is written is dropped, which is what ``| head`` asks for."""

    def write(self, data: Any) -> int:
        """As of a file."""
        try:
            return super().write(data) or 0
        except BrokenPipeError:
            void = os.open(os.devnull, os.O_WRONLY)
            os.dup2(void, self.fileno())
            os.close(void)
            return len(memoryview(data).cast("B"))


def outlive_readers() -> None:
    """Let the command go on when its reader leaves: it ends with the exit code that its work deserves.

    Letters that the terminal does not have are replaced by others.
    """
    for number, name in ((1, "stdout"), (2, "stderr")):
        stream = getattr(sys, name)
        if not isinstance(stream, io.TextIOWrapper):
            continue
        stream.flush()
        lasting = io.BufferedWriter(_Lasting(number, "w", closefd=False))
        by_lines = stream.line_buffering or stream.write_through  # the latter under PYTHONUNBUFFERED
        setattr(sys, name, io.TextIOWrapper(lasting, stream.encoding, "replace", line_buffering=by_lines))
