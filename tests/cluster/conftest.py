"""A Dask cluster with two workers in this process, which draw in worker processes as others do."""

import sys
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
    path = list(sys.path)
    with LocalCluster(n_workers=workers, protocol="tcp", host="127.0.0.1", **settings) as cluster:
        yield cluster
    sys.path[:] = path  # Dask leaves the workers' folders there, where later tests would look for modules
    tasks.close_station()
