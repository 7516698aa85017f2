"""A Dask cluster with two workers in this process, which draw in worker processes as others do."""

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import pytest
from distributed import LocalCluster

from shadowbench.cluster import tasks


@pytest.fixture(scope="module")
def address() -> Iterator[str]:
    """Address of the cluster's scheduler."""
    with local_cluster(2) as cluster:
        yield cluster.scheduler_address


@contextmanager
def local_cluster(workers: int) -> Iterator[LocalCluster]:
    settings: dict[str, Any] = {"processes": False, "threads_per_worker": 1, "dashboard_address": ":0"}
    with LocalCluster(n_workers=workers, protocol="tcp", host="127.0.0.1", **settings) as cluster:
        yield cluster
    tasks.close_station()
