"""The same sweep on a cluster: dask.distributed, here with scheduler and workers in this process, over TCP."""

from __future__ import annotations

from collections.abc import Iterator

import pytest
from conftest import SmallScenario

from etac_ros.errors import ScenarioError
from etac_ros.sweep import cluster as cluster_module
from etac_ros.sweep.cluster import cluster
from etac_ros.sweep.plan import Plan, make_plan
from etac_ros.sweep.run import sweep
from etac_ros.sweep.workers import here

distributed = pytest.importorskip("distributed")


@pytest.fixture(scope="module")
def address() -> Iterator[str]:
    with distributed.LocalCluster(
        n_workers=2, threads_per_worker=1, processes=False, protocol="tcp", dashboard_address=None
    ) as started:
        yield started.scheduler_address


@pytest.fixture
def plan(small: SmallScenario) -> Plan:
    rate = "plant.dynamics.rate_deg_s=normal:2"
    return make_plan(str(small()), 6, None, ["controller.law.k=1.0,2.0"], [rate])


def test_a_cluster_gives_the_rows_of_this_process(plan: Plan, address: str) -> None:
    found = sweep(plan, cluster(address)).table
    assert found.num_rows == 12
    assert found.drop_columns(["wall_s"]).equals(sweep(plan, here).table.drop_columns(["wall_s"]))


def test_workers_of_another_version_are_refused(plan: Plan, address: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(cluster_module, "__version__", "9.9")
    with pytest.raises(ScenarioError, match=r"expected: etac_ros 9\.9"):
        sweep(plan, cluster(address))


def test_nobody_at_the_address_is_an_error(plan: Plan, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(cluster_module, "_CONNECT_S", 0.2)
    with pytest.raises(ScenarioError, match="no scheduler answers"):
        sweep(plan, cluster("tcp://127.0.0.1:9"))


def test_an_address_that_is_none_is_an_error(plan: Plan) -> None:
    with pytest.raises(ScenarioError, match="--scheduler nonsense"):
        sweep(plan, cluster("nonsense://x"))
