"""Connection to a Dask scheduler, or to one started in this process with workers on this machine."""

import asyncio
import logging
import os
import re
import time
from contextlib import suppress
from multiprocessing import resource_tracker
from typing import TYPE_CHECKING

from shadowbench.errors import InputError, ShadowbenchError, how_to_install, message, quoted
from shadowbench.measure.worker import sigint_blocked

if TYPE_CHECKING:
    from distributed import Client, LocalCluster

CONNECT_S = 10.0
WORKERS_S = 60.0
_MOST_LOCAL = 256


class Connection:
    """A client of the scheduler at an address, or of `local:N`. A context manager."""

    def __init__(self, where: str) -> None:
        _check_installed()
        self.where, self._count = where, _local_workers(where)

    @property
    def local(self) -> bool:
        """Whether the workers are on this machine."""
        return self._count is not None

    def __enter__(self) -> "Connection":
        import dask

        for name in ("distributed", "distributed.client"):  # the latter has a level of its own
            logging.getLogger(name).setLevel(logging.CRITICAL)  # errors are reported in one line
        # Scenes are in the graph, where they survive their worker.
        dask.config.set({"distributed.admin.large-graph-warning-threshold": "1 TiB"})
        self.cluster: LocalCluster | None = None
        try:
            if self._count is not None:
                resource_tracker.ensure_running()  # when it starts, it unblocks the signal
                with sigint_blocked():  # Ctrl-C is for this process, which ends the workers
                    self.cluster = _start_local(self._count)
            self.client = self._connect()
        except BaseException:
            self._close_cluster()
            raise
        return self

    def __exit__(self, *_: object) -> None:
        with suppress(Exception):  # a scheduler that has gone
            self.client.close(timeout=2)
        self._close_cluster()

    def reconnect(self) -> None:
        """Wait for a scheduler that was restarted. Raises ShadowbenchError after WORKERS_S."""
        end = time.monotonic() + WORKERS_S
        self.client.close(timeout=2)
        while True:
            try:
                self.client = self._connect()
                return
            except InputError:
                if time.monotonic() > end:
                    raise self.gone() from None

    def gone(self) -> ShadowbenchError:
        """The error of a scheduler that does not answer any more."""
        return ShadowbenchError(
            f"--dask {self.where}: the scheduler has gone; what was measured is kept, and the same command goes on"
        )

    def _connect(self) -> "Client":
        from distributed import Client

        if self.cluster is not None:
            return Client(self.cluster, set_as_default=False)
        try:
            asyncio.run(_probe(self.where))
            return Client(self.where, timeout=CONNECT_S, set_as_default=False)
        except (OSError, ValueError, TypeError, RuntimeError) as error:  # the last two: TLS on one side only
            reason = quoted(message(error)) or type(error).__name__
            raise InputError(
                f"--dask {self.where}: no Dask scheduler answers within {CONNECT_S:g} s ({reason}); allowed: local:N, "
                "or the address of a scheduler, such as tcp://host:8786"
            ) from None

    def _close_cluster(self) -> None:
        if self.cluster is not None:
            self.cluster.close(timeout=5)


def _local_workers(where: str) -> int | None:
    """N of `local:N`; None for an address."""
    if where != "local" and not where.startswith("local:"):
        return None
    found = re.fullmatch(r"local:(\d{1,3})", where)
    if found is None or not 1 <= int(found[1]) <= _MOST_LOCAL:
        raise InputError(f"--dask {where}: allowed: local:N with N from 1 to {_MOST_LOCAL}, or a scheduler's address")
    return int(found[1])


def _check_installed() -> None:
    try:
        import distributed  # noqa: F401
    except ImportError:
        raise InputError(f"--dask needs Dask; {how_to_install('dask')}") from None


async def _probe(address: str) -> None:
    """Connect and close again. Raises as Dask does; a client that fails to connect may hang when it is deleted."""
    from distributed import Security
    from distributed.comm.core import connect

    arguments = Security().get_connection_args("client")  # from Dask's configuration
    await (await connect(address, timeout=CONNECT_S, **arguments)).close()


def _start_local(count: int) -> "LocalCluster":
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
