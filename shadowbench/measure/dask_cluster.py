"""A Dask scheduler, or one started in this process, and those of its workers that measure for one command."""

import asyncio
import logging
import os
import re
import secrets
import time
from collections import Counter
from collections.abc import Callable, Sequence
from contextlib import suppress
from multiprocessing import resource_tracker
from pathlib import Path
from threading import Thread
from typing import TYPE_CHECKING, Any

from shadowbench.errors import InputError, ShadowbenchError, how_to_install, message, quoted
from shadowbench.measure import dask_tasks as tasks
from shadowbench.measure.campaign import Reporter
from shadowbench.measure.dask_tasks import Setup, WorkerFacts
from shadowbench.measure.failures import Limits
from shadowbench.measure.worker import sigint_blocked

if TYPE_CHECKING:
    from distributed import Client, Future, LocalCluster

CONNECT_S = 10.0
WORKERS_S = 60.0
_MOST_LOCAL = 256
_RETRIES = 2  # of a task that raised an exception that is none of ours, such as a full disk


class Cluster:
    """Workers with our versions and an OpenGL device, on one renderer or on any.

    where: address of a scheduler, or `local:N`; renderer: name of the study's, None for that of most workers at the
    start; any_renderer: whether workers of other renderers are admitted too. A context manager; within it, `facts` has
    the admitted workers by address.
    """

    def __init__(
        self,
        where: str,
        reporter: Reporter,
        plugins: Sequence[Path] = (),
        limits: Limits | None = None,
        renderer: str | None = None,
        any_renderer: bool = False,
    ) -> None:
        try:
            import distributed  # noqa: F401
        except ImportError:
            raise InputError(f"--dask needs Dask; {how_to_install('dask')}") from None
        self.where, self.local = where, _local_workers(where)
        self.reporter, self.renderer, self.any_renderer = reporter, renderer, any_renderer
        self.setup = Setup(secrets.token_hex(8), tuple(map(tasks.plugin_files, plugins)), limits or Limits())
        self.facts: dict[str, WorkerFacts] = {}
        self._judged: set[str] = set()
        self._watcher = Thread(target=self._watch)
        self._started: LocalCluster | None = None

    def __enter__(self) -> "Cluster":
        import dask

        for name in ("distributed", "distributed.client"):  # the latter has a level of its own
            logging.getLogger(name).setLevel(logging.CRITICAL)  # errors are reported in one line
        # Scenes are in the graph, where they survive their worker.
        dask.config.set({"distributed.admin.large-graph-warning-threshold": "1 TiB"})
        try:
            if self.local is not None:
                resource_tracker.ensure_running()  # when it starts, it unblocks the signal
                with sigint_blocked():  # Ctrl-C is for this process, which ends the workers
                    self._started = _start_local(self.local)
            self.client = self._connect()
            self._wait()
        except BaseException:
            self.__exit__()
            raise
        return self

    def __exit__(self, *_: object) -> None:
        with suppress(Exception):  # workers or a scheduler that have gone, or were never there
            self.client.run(tasks.close_station, self.setup.number, workers=list(self.facts), on_error="ignore")
        with suppress(Exception):
            self.client.close(timeout=2)
        if self._started is not None:
            self._started.close(timeout=5)

    def submit(
        self, renderer: str, worker: WorkerFacts | None, function: Callable[..., Any], *arguments: object
    ) -> "Future[Any]":
        """A task on a worker, or on any of a renderer, given the setup before its arguments."""
        resource = (worker or self.on(renderer)[0]).resource
        return self.client.submit(
            function,
            self.setup,
            *arguments,
            key=f"{function.__name__}-{secrets.token_hex(8)}",
            resources={resource: 1},  # every worker has one: its tasks run one after the other
            workers=[worker.address] if worker else None,
            retries=_RETRIES,
        )

    def renderers(self) -> list[str]:
        """Renderers of the admitted workers, the study's first."""
        found = dict.fromkeys([self.renderer, *(one.renderer for one in self.facts.values())])
        return [name for name in found if name is not None]

    def on(self, renderer: str) -> list[WorkerFacts]:
        """Admitted workers with a renderer."""
        return [one for one in self.facts.values() if one.renderer == renderer]

    def named(self, name: str) -> WorkerFacts:
        """The worker of --time-on, by its address or the name of its machine. Raises InputError."""
        known = [] if self.local else list(self.facts.values())
        for one in known:
            if name in (one.address, one.host):
                return one
        others = dict.fromkeys(["here", *(one.host for one in known), *(one.address for one in known)])
        raise InputError(f"--time-on {name}: no such worker; allowed: {', '.join(others)}")

    def wait_until_idle(self, machine: WorkerFacts) -> None:
        """Wait until no worker on the machine of a worker runs a task, of whatever program."""
        beside = [one.address for one in self.facts.values() if one.host == machine.host]
        try:
            while any(self.client.processing(workers=beside).values()):
                time.sleep(0.1)
        except OSError:
            raise self._gone() from None

    def reconnect(self) -> None:
        """Wait for a scheduler that was restarted, and for workers, all of which are new. Raises ShadowbenchError."""
        end = time.monotonic() + WORKERS_S
        self.client.close(timeout=2)
        while True:
            try:
                self.client = self._connect()
                break
            except InputError:
                if time.monotonic() > end:
                    raise self._gone() from None
        if self._watcher.is_alive():
            self._watcher.join()
        self.facts.clear()
        self._judged.clear()
        self._wait()

    def watch(self) -> None:
        """Begin to admit workers that have joined, unless it is being done: one that dies meanwhile takes long."""
        if not self._watcher.is_alive():
            self._watcher = Thread(target=self._watch, daemon=True)
            self._watcher.start()

    def _watch(self) -> None:
        with suppress(Exception):  # the scheduler has gone, which the tasks tell
            self._join()

    def _connect(self) -> "Client":
        from distributed import Client

        if self._started is not None:
            return Client(self._started, set_as_default=False)
        try:
            asyncio.run(_probe(self.where))
            return Client(self.where, timeout=CONNECT_S, set_as_default=False)
        except (OSError, ValueError, TypeError, RuntimeError) as error:  # the last two: TLS on one side only
            reason = quoted(message(error)) or type(error).__name__
            raise InputError(
                f"--dask {self.where}: no Dask scheduler answers within {CONNECT_S:g} s ({reason}); allowed: local:N, "
                "or the address of a scheduler, such as tcp://host:8786"
            ) from None

    def _gone(self) -> ShadowbenchError:
        return ShadowbenchError(
            f"--dask {self.where}: the scheduler has gone; what was measured is kept, and the same command goes on"
        )

    def _wait(self) -> None:
        """Admit workers, of which at least one must come."""
        end = time.monotonic() + WORKERS_S
        reasons: dict[str, str] = {}
        while not (self.on(self.renderer) if self.renderer else self.facts):
            if reasons:
                name, reason = next(iter(reasons.items()))
                more = f" (and {len(reasons) - 1} more)" if len(reasons) > 1 else ""
                raise InputError(f"--dask {self.where}: no worker can measure; {name}: {reason}{more}")
            if time.monotonic() > end:
                raise InputError(
                    f"--dask {self.where}: no worker within {WORKERS_S:g} s; allowed: a cluster with at least one"
                )
            try:
                reasons = self._join()
            except OSError:
                raise self._gone() from None
            time.sleep(0 if self.facts or reasons else 0.2)

    def _join(self) -> dict[str, str]:
        """Admit workers that have joined since the last call; returns why others were left out, by name."""
        known = self.client.scheduler_info(n_workers=-1)["workers"]
        joined = [address for address in known if address not in self._judged]
        self.facts = {address: one for address, one in self.facts.items() if address in known}
        self._judged &= set(known)
        if not joined:
            return {}
        self._judged.update(joined)
        found = self.client.run(tasks.describe, self.setup, tasks.own_versions(), workers=joined, on_error="return")
        if self.renderer is None:
            counts = Counter(one.renderer for one in found.values() if isinstance(one, WorkerFacts) and one.renderer)
            self.renderer = min(counts, key=lambda name: (-counts[name], name), default=None)
        reasons, admitted = {}, {}
        for address, one in found.items():
            reason = self._objection(one)
            if isinstance(one, OSError):  # it has gone
                self._judged.discard(address)
            elif reason is None:
                admitted[address] = one
            else:
                name = f"{address} on {one.host}" if isinstance(one, WorkerFacts) else address
                reasons[name] = reason
                self.reporter.note(f"worker {name} is left out: {reason}")
        for resource in {one.resource for one in admitted.values()}:
            equal = [address for address, one in admitted.items() if one.resource == resource]
            self.client.run(tasks.admit, resource, workers=equal, on_error="ignore")
        self.facts |= admitted
        return reasons

    def _objection(self, one: WorkerFacts | BaseException) -> str | None:
        """Why a worker must not measure."""
        if isinstance(one, ModuleNotFoundError):
            return f"shadowbench is not installed there ({quoted(message(one))})"
        if isinstance(one, BaseException):
            return quoted(f"{type(one).__name__}: {message(one)}")
        if one.reason is not None or self.any_renderer or one.renderer == self.renderer:
            return one.reason
        return (
            f"its renderer is {one.renderer}, that of the study {self.renderer}; --renderer chooses another, "
            "--any-renderer makes rows for each"
        )


def _local_workers(where: str) -> int | None:
    """N of `local:N`; None for an address."""
    if where != "local" and not where.startswith("local:"):
        return None
    found = re.fullmatch(r"local:(\d{1,3})", where)
    if found is None or not 1 <= int(found[1]) <= _MOST_LOCAL:
        raise InputError(f"--dask {where}: allowed: local:N with N from 1 to {_MOST_LOCAL}, or a scheduler's address")
    return int(found[1])


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
