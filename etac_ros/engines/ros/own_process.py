"""Runs something in a fresh Python process: for callers in whose own process a run over DDS cannot be started.

A run forks, and that is not safe everywhere. Where rclpy is already in use, the threads and the settings of its DDS
would be inherited by halves; in a thread, several runs would share what belongs to the process (signals, the moment of
a fork). A fresh process has neither, and costs about a second.
"""

from __future__ import annotations

import contextlib
import importlib
import os
import pickle
import signal
import subprocess
import sys
import threading
import traceback
from collections.abc import Callable, Mapping
from multiprocessing import Pipe
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Any

from etac_ros.engines.ros import LOADED_BEFORE
from etac_ros.engines.ros.environment import uses_another_dds
from etac_ros.errors import EtacError, RunError
from etac_ros.processes import end_with_parent

_END_S = 20.0
"""How long the process may take to end its run when it is told to."""

Tell = Callable[[str, Any], None]


def is_needed() -> bool:
    """Whether a run cannot be started from here."""
    return (
        threading.current_thread() is not threading.main_thread()
        or uses_another_dds(os.environ)  # rclpy is bound to a vendor when it is loaded
        or LOADED_BEFORE  # by a program that may have used it, of which no trace need be left
        or _dds_is_at_work()
    )


def _dds_is_at_work() -> bool:
    """Whether rclpy is in use in this process; some threads of Fast DDS stay even after a shutdown."""
    if "rclpy" not in sys.modules:
        return False
    for name in Path("/proc/self/task").glob("*/comm"):
        with contextlib.suppress(OSError):  # that thread has just ended
            if name.read_text().startswith("dds."):
                return True
    return bool(sys.modules["rclpy.context"].g_logging_ref_count)  # initialised, and no node yet


def call(target: str, arguments: Mapping[str, Any], on_event: Tell) -> Any:
    """Call a function in a fresh process.

    Parameters
    ----------
    target
        ``package.module:function``; takes a ``Tell`` and the arguments by name.
    arguments
        Anything that can be pickled.
    on_event
        Called here with what the function tells.

    Returns
    -------
    Any
        What the function returns.

    Raises
    ------
    EtacError
        As the function does, or if the process dies.
    KeyboardInterrupt, EndedBySignal
        If the process was ended by a signal, as by the user's Ctrl-C; it has completed the bag then.
    """
    here, there = Pipe()
    command = [sys.executable, "-c", f"from {__name__} import serve; serve({there.fileno()}, {os.getpid()})"]
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(path or os.getcwd() for path in sys.path)}
    process = subprocess.Popen(command, env=environment, pass_fds=[there.fileno()])
    there.close()
    try:
        here.send_bytes(pickle.dumps((target, dict(arguments))))
        return _listen(here, process, on_event)
    finally:
        here.close()
        _end(process)


def _listen(pipe: Connection, process: subprocess.Popen[bytes], on_event: Tell) -> Any:
    while True:
        try:
            kind, content = pipe.recv()
        except (EOFError, OSError):
            raise RunError(
                f"process {process.pid}, in which the run was to take place",
                f"has ended with exit code {process.wait(_END_S)}",
                "",
                "see what it printed",
            ) from None
        if kind == "returned":
            return content
        if kind == "raised":
            raise content
        on_event(kind, content)


def _end(process: subprocess.Popen[bytes]) -> None:
    if process.poll() is None:
        with contextlib.suppress(subprocess.TimeoutExpired):
            process.wait(0.5)  # nearly always it is about to end by itself
    if process.poll() is None:
        process.send_signal(signal.SIGTERM)
        try:
            process.wait(_END_S)
        except subprocess.TimeoutExpired:
            process.kill()
            process.wait()


def serve(file_descriptor: int, parent: int) -> None:
    """What the fresh process does."""
    # Its end is the end of this one: the run's own processes look after it in the same way.
    end_with_parent(signal.SIGTERM)
    pipe = Connection(file_descriptor)
    os.set_inheritable(file_descriptor, False)
    os.environ["RMW_IMPLEMENTATION"] = ""  # whatever it said: it is set for each process of the run
    if os.getppid() != parent:
        return

    def tell(kind: str, content: Any) -> None:
        pipe.send((kind, content))

    target, arguments = pickle.loads(pipe.recv_bytes())
    module, _, function = target.partition(":")
    try:
        result = getattr(importlib.import_module(module), function)(tell, **arguments)
        tell("returned", result)
    except (EtacError, KeyboardInterrupt, SystemExit) as error:
        with contextlib.suppress(OSError):
            tell("raised", error)
    except BaseException as error:
        with contextlib.suppress(OSError):
            tell("raised", RunError("the run", f"{type(error).__name__}: {error}\n{traceback.format_exc()}"))
