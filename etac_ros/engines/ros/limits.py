"""Limits of the system that a run can meet: open files, memory, threads. Said before a process dies of them."""

from __future__ import annotations

import contextlib
import errno
import os
import resource
from collections.abc import Iterator

from etac_ros.errors import RunError

_FILES_OF_A_NODE = 24
"""Sockets, pipes and events of Fast DDS in a process with one participant (16 measured), and a few to open files."""
_FILES_FOR_A_CHILD = 3
"""What the launcher keeps of each process: two ends of pipes, and one for the moment of starting it."""

_NO_MEMORY = ("failed to map segment", "Cannot allocate memory", "bad_alloc")
_NO_THREADS = ("can't start new thread", "pthread_create failed")


def files_needed(processes: int, already_open: int) -> int:
    """Open files that the launcher, or a process that it forks, may come to at most."""
    return already_open + _FILES_FOR_A_CHILD * processes + _FILES_OF_A_NODE


@contextlib.contextmanager
def enough_files(processes: int) -> Iterator[None]:
    """Within: the soft limit of open files suffices for so many processes. Those started within inherit it.

    Raises
    ------
    RunError
        If the hard limit does not suffice.
    """
    soft, hard = resource.getrlimit(resource.RLIMIT_NOFILE)
    needed = files_needed(processes, len(os.listdir("/proc/self/fd")))
    if soft == resource.RLIM_INFINITY or soft >= needed:
        yield
        return
    if hard != resource.RLIM_INFINITY and hard < needed:
        raise RunError(
            f"limit of open files ({hard})",
            f"is too low for a run of {processes} processes",
            f"{needed} or more",
            f"`ulimit -n {max(1024, needed)}`, or fewer processes: --processes namespace, or one",
        )
    resource.setrlimit(resource.RLIMIT_NOFILE, (needed, hard))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_NOFILE, (soft, hard))


def refused_by_system(error: BaseException, doing: str) -> RunError | None:
    """What an error means if it is the system that has no more to give; None for other errors."""
    code = error.errno if isinstance(error, OSError) else None
    if code in (errno.EMFILE, errno.ENFILE):
        limit = resource.getrlimit(resource.RLIMIT_NOFILE)[0]
        return RunError(doing, f"no more files can be opened; the limit is {limit}", "", "`ulimit -n 1024`")
    text = str(error)
    no_memory = isinstance(error, MemoryError) or code == errno.ENOMEM or any(word in text for word in _NO_MEMORY)
    if isinstance(error, (ImportError, OSError)) and code is None:
        no_memory |= _memory_limit() is not None  # what loads a library seldom says why it could not
    no_threads = code == errno.EAGAIN or any(word in text for word in _NO_THREADS)
    if no_memory or no_threads:
        what = "no memory is left" if no_memory else "no more processes or threads can be started"
        return RunError(doing, f"{what}{limits_in_force()}", "", "raise the limit, or --processes one")
    return None


def _memory_limit() -> int | None:
    limit = resource.getrlimit(resource.RLIMIT_AS)[0]
    return None if limit == resource.RLIM_INFINITY else limit


def limits_in_force() -> str:
    """Limits under which a process may have died, as an addition to a sentence; empty if there are none."""
    found = []
    memory = _memory_limit()
    if memory is not None:
        found.append(f"memory is limited to {memory // 2**20} MiB (ulimit -v)")
    files = resource.getrlimit(resource.RLIMIT_NOFILE)[0]
    if files != resource.RLIM_INFINITY and files < 256:
        found.append(f"open files to {files} (ulimit -n)")
    return f"; {', '.join(found)}" if found else ""
