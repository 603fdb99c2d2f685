"""Where ``etac`` begins and ends: nothing heavy is imported yet, so that an interrupt has an answer from the start."""

from __future__ import annotations

import atexit
import gc
import os
import sys
import threading
from contextlib import suppress
from typing import Any

INTERRUPTED = 130
_IMPORTED = 300_000
"""More objects than the imports of any command make."""


def main() -> None:
    """Import the commands and run the one that is asked for."""
    spare_what_is_imported()
    # Else pydantic would look through all that is installed for plugins of its own, which have no business here.
    os.environ.setdefault("PYDANTIC_DISABLE_PLUGINS", "__all__")
    try:
        from etac_ros.cli.main import main as command

        command()
        code: Any = 0
    except KeyboardInterrupt:
        print("etac: interrupted", file=sys.stderr)
        code = INTERRUPTED
    except SystemExit as end:
        code = end.code
    leave(code)


def spare_what_is_imported() -> None:
    """Have the garbage collector begin once a command has made more than it imports, and leave alone what stands then.

    What is imported stays to the end. To look through it again and again, as it grows, was a tenth of what a run took.
    """
    usual = gc.get_threshold()

    def begin(phase: str, info: dict[str, int]) -> None:
        gc.callbacks.remove(begin)
        gc.set_threshold(*usual)
        gc.freeze()

    gc.callbacks.append(begin)
    gc.set_threshold(_IMPORTED, *usual[1:])


def leave(code: Any) -> None:
    """End this process: as Python would, but without taking down module by module what the system takes down at once.

    That was a fifth of what a run took, after all had been said. Whatever is not as simple as that, a thread that is
    to be waited for or an exit code in words, is left to Python.
    """
    if not isinstance(code, int | None) or any(
        not thread.daemon for thread in threading.enumerate() if thread is not threading.current_thread()
    ):
        sys.exit(code)
    with suppress(KeyboardInterrupt):  # it is over: there is nothing left to interrupt
        atexit._run_exitfuncs()
    for stream in (sys.stdout, sys.stderr):
        with suppress(OSError, ValueError, AttributeError):  # closed by who started this process
            stream.flush()
    os._exit((code or 0) & 0xFF)
