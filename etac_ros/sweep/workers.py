"""Who runs the samples: this process, or a pool of processes.

Both are given samples and give back rows as they come, in any order. An interruption waits for what has begun, hands
it out, and goes on upwards; no process stays behind.
"""

from __future__ import annotations

import gc
import multiprocessing
import os
import signal
import threading
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from typing import Any

from etac_ros.errors import RunError
from etac_ros.sweep.plan import Plan
from etac_ros.sweep.sample import Row, row_of

Workers = Callable[[Plan, Sequence[int]], Iterator[list[Row]]]
"""Runs these samples of a plan."""

CHUNK_S = 0.5
"""How long a worker is to be busy with what it is handed at once."""
_MOST_AT_ONCE = 256
_AHEAD = 2
"""Chunks that each worker has before it, so that it never waits for the next."""
_THREADS = ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS", "NUMBA_NUM_THREADS")


def here(plan: Plan, samples: Sequence[int]) -> Iterator[list[Row]]:
    """Run samples in this process."""
    for sample in samples:
        yield [row_of(plan, sample)]


def processes(count: int) -> Workers:
    """Run samples in a number of processes of this machine.

    The processes come from a server that never had more than this package in it, so nothing of the calling program,
    its threads and its ROS, is in them.
    """

    def run(plan: Plan, samples: Sequence[int]) -> Iterator[list[Row]]:
        context = multiprocessing.get_context("forkserver")
        context.set_forkserver_preload([__name__])
        with (
            _one_thread_each(),
            ProcessPoolExecutor(count, mp_context=context, initializer=_begin, initargs=(plan,)) as pool,
        ):
            try:
                yield from spread(samples, count, lambda chunk: pool.submit(_rows, chunk))
            except BrokenProcessPool:
                raise RunError(
                    "sweep", "a worker process died (killed, or out of memory?)", "",
                    "the rows so far are kept; the same command goes on, with fewer --workers if memory was short",
                ) from None  # fmt: skip

    return run


def chunk_length(wall_s: float, left: int, workers: int) -> int:
    """How many samples to hand to a worker at once.

    Parameters
    ----------
    wall_s
        What a sample has taken so far [s]; 0 if nothing is known.
    left
        Samples that are left.
    workers
        Among whom.
    """
    fitting = int(CHUNK_S / wall_s) if wall_s > 0.0 else 1
    fair = -(-left // (_AHEAD * workers))
    return max(1, min(fitting, fair, _MOST_AT_ONCE))


def first_done(pending: set[Any]) -> tuple[set[Any], set[Any]]:
    """Wait for one future of a pool or more: those that are done, and those that are not."""
    done, left = wait(pending, return_when=FIRST_COMPLETED)
    return done, left


def spread(
    samples: Sequence[int],
    workers: int,
    submit: Callable[[tuple[int, ...]], Any],
    await_some: Callable[[set[Any]], tuple[set[Any], set[Any]]] = first_done,
) -> Iterator[list[Row]]:
    """Hand samples to workers chunk by chunk.

    Parameters
    ----------
    samples
        What is to be run.
    workers
        Among how many.
    submit
        Starts a chunk and returns a future of its rows.
    await_some
        Waits for the first of these futures.
    """
    left = deque(samples)
    pending: set[Any] = set()
    taken, wall = 0, 0.0
    try:
        while left or pending:
            while left and len(pending) < _AHEAD * workers:
                length = chunk_length(wall / taken if taken else 0.0, len(left), workers)
                pending.add(submit(tuple(left.popleft() for _ in range(length))))
            done, pending = await_some(pending)
            for future in done:
                rows = future.result()
                taken += len(rows)
                wall += sum(row["wall_s"] for row in rows)
                yield rows
    except KeyboardInterrupt:
        begun = {future for future in pending if not future.cancel()}
        while begun:
            done, begun = await_some(begun)
            for future in done:
                yield future.result()
        raise
    finally:
        for future in pending:
            future.cancel()


@contextmanager
def _one_thread_each() -> Iterator[None]:
    """Processes that are started within have one thread for linear algebra and kernels."""
    before = {name: os.environ.get(name) for name in _THREADS}
    os.environ.update(dict.fromkeys(_THREADS, "1"))
    try:
        yield
    finally:
        for name, value in before.items():
            if value is None:
                del os.environ[name]
            else:
                os.environ[name] = value


_plan: Plan
"""In a worker process: the plan that it was started for."""


def _begin(plan: Plan) -> None:
    global _plan  # the one way in which a pool hands something to all its tasks
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # a Ctrl-C goes to the whole group; the parent decides
    parent = multiprocessing.parent_process()
    assert parent is not None

    def end_with_parent() -> None:
        parent.join()
        os._exit(1)

    threading.Thread(target=end_with_parent, daemon=True).start()
    _plan = plan
    gc.freeze()  # what stands by now stays, and need not be looked through again and again


def _rows(samples: tuple[int, ...]) -> list[Row]:
    return [row_of(_plan, sample) for sample in samples]
