"""Dask clusters that are started on this machine."""

import logging
import os
import re
from typing import TYPE_CHECKING

from shadowbench.errors import InputError

if TYPE_CHECKING:
    from distributed import LocalCluster

_MOST = 256


def local_workers(where: str) -> int | None:
    """N of `local:N`; None for an address. Raises InputError."""
    if where != "local" and not where.startswith("local:"):
        return None
    found = re.fullmatch(r"local:(\d{1,3})", where)
    if found is None or not 1 <= int(found[1]) <= _MOST:
        raise InputError(f"--dask {where}: allowed: local:N with N from 1 to {_MOST}, or a scheduler's address")
    return int(found[1])


def start_local(count: int) -> "LocalCluster":
    """Start a cluster of so many workers, each with its share of the cores."""
    import dask
    from distributed import LocalCluster

    threads = max((os.cpu_count() or 1) // count, 1)
    with dask.config.set({"distributed.worker.profile.enabled": False}):  # it samples every 10 ms
        return LocalCluster(
            n_workers=count,
            threads_per_worker=1,
            processes=True,
            dashboard_address=":0",
            silence_logs=logging.CRITICAL,
            # A software renderer would otherwise use all cores in every worker.
            env={"LP_NUM_THREADS": os.environ.get("LP_NUM_THREADS", str(threads))},
        )
