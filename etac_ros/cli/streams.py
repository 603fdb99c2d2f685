"""Standard streams that whoever started this process has closed (``>&-``)."""

from __future__ import annotations

import os
import sys


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
