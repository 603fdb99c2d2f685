"""Where ``etac`` begins and ends: nothing heavy is imported yet, so that an interrupt has an answer from the start."""

from __future__ import annotations

import atexit
import fcntl
import gc
import io
import os
import stat
import sys
import threading
from contextlib import suppress
from typing import Any

from etac_ros.processes import flush_streams

INTERRUPTED = 130
_IMPORTED = 300_000
"""More objects than the imports of any command make."""
_USUAL = gc.get_threshold()


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
    gc.callbacks.append(_begin)
    gc.set_threshold(_IMPORTED, *_USUAL[1:])


def _begin(phase: str, info: dict[str, int]) -> None:
    gc.callbacks.remove(_begin)
    gc.set_threshold(*_USUAL)
    gc.freeze()


def leave(code: Any) -> None:
    """End this process: as Python would, but without taking down module by module what the system takes down at once.

    That was a fifth of what a run took, after all had been said. Whatever is not as simple as that is left to Python: a
    thread that is to be waited for, an exit code in words, or a file that somebody's class writes and does not close.
    """
    written = _is_written()
    if written:
        _flush_files()
    if written or not isinstance(code, int | None) or _is_waited_for():
        sys.exit(code)
    with suppress(KeyboardInterrupt):  # it is over: there is nothing left to interrupt
        atexit._run_exitfuncs()
    flush_streams()
    os._exit((code or 0) & 0xFF)


def _is_waited_for() -> bool:
    return any(not thread.daemon for thread in threading.enumerate() if thread is not threading.current_thread())


def _is_written() -> bool:
    """Whether a file or a device is open that this process has opened for writing: Python may hold the last of it."""
    with suppress(OSError):
        return any(_is_own_output(int(number)) for number in os.listdir("/proc/self/fd"))
    return True


def _flush_files() -> None:
    """Write what files hold back. Python would not in any case: not where they are part of a circle of objects."""
    if _begin in gc.callbacks:
        gc.callbacks.remove(_begin)
    gc.unfreeze()  # what is frozen is not listed, and would not go at Python's end
    files = gc.get_objects()
    for kind in (io.TextIOWrapper, io.BufferedIOBase):  # the former write to the latter
        for file in files:
            if issubclass(type(file), kind):
                with suppress(Exception):  # closed, or somebody's own kind of file
                    file.flush()


def _is_own_output(number: int) -> bool:
    try:
        if not fcntl.fcntl(number, fcntl.F_GETFD) & fcntl.FD_CLOEXEC:  # so Python opens; this one came from outside
            return False
        readable = fcntl.fcntl(number, fcntl.F_GETFL) & os.O_ACCMODE == os.O_RDONLY
        mode = os.fstat(number).st_mode
    except OSError:  # closed meanwhile: that of the listing itself
        return False
    return not readable and (stat.S_ISREG(mode) or stat.S_ISCHR(mode))
