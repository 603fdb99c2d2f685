"""Samples on a cluster, by dask.distributed: the extra ``cluster``."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any

from etac_ros import __version__
from etac_ros.errors import RunError, ScenarioError
from etac_ros.sweep.plan import Plan
from etac_ros.sweep.sample import Row, row_of
from etac_ros.sweep.workers import Workers, spread

_CONNECT_S = 10.0


def cluster(address: str) -> Workers:
    """Run samples on the workers of a dask scheduler.

    Parameters
    ----------
    address
        Of the scheduler, as ``tcp://host:8786``. Its workers need this version of etac_ros, and whatever classes of
        its user the scenario names.

    Raises
    ------
    ScenarioError
        If dask.distributed is not installed, nobody answers, or the workers have another etac_ros.
    RunError
        If a worker failed.
    """

    def run(plan: Plan, samples: Sequence[int]) -> Iterator[list[Row]]:
        client = _connected(address)
        try:
            count = _checked(client, address)
            # The plan goes to every worker once, not with every chunk.
            shared = client.scatter(plan, broadcast=True)
            # Draws are part of the plan, so a chunk that ran on a lost worker runs elsewhere with the same result.
            yield from spread(samples, count, lambda chunk: client.submit(_rows, shared, chunk, pure=False), _wait)
        except OSError as error:
            raise RunError(
                f"--scheduler {address}", f"the cluster failed ({error})", "", "the same command goes on"
            ) from None
        finally:
            client.close()

    return run


def _rows(plan: Plan, samples: tuple[int, ...]) -> list[Row]:
    return [row_of(plan, sample) for sample in samples]


def _wait(pending: set[Any]) -> tuple[set[Any], set[Any]]:
    from distributed import wait

    finished = wait(pending, return_when="FIRST_COMPLETED")
    return set(finished.done), set(finished.not_done)


def _connected(address: str) -> Any:
    where = f"--scheduler {address}"
    try:
        from distributed import Client
    except ImportError:
        raise ScenarioError(where, "dask.distributed is not installed", "", "pip install 'etac_ros[cluster]'") from None
    try:
        return Client(address, timeout=_CONNECT_S)
    except (OSError, ValueError, TypeError) as error:
        reason = str(error).splitlines()[0] if str(error) else type(error).__name__
        raise ScenarioError(where, f"no scheduler answers ({reason})", "the address of a running one") from None


def _checked(client: Any, address: str) -> int:
    """Threads of the cluster, if its workers have this version."""
    versions = client.run(_version)
    where = f"--scheduler {address}"
    if not versions:
        raise ScenarioError(where, "has no workers", "", f"start some: dask worker {address}")
    for worker, version in versions.items():
        if version != __version__:
            raise ScenarioError(where, f"worker {worker} has etac_ros {version}", f"etac_ros {__version__}")
    return sum(client.nthreads().values())


def _version() -> str:
    from etac_ros import __version__ as version

    return version
