"""The workers of a cluster that measure for one command."""

import secrets
import time
from collections import Counter
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path
from threading import Thread
from typing import TYPE_CHECKING

from shadowbench.cluster import tasks, workers
from shadowbench.cluster.connect import WORKERS_S, Connection
from shadowbench.cluster.parcel import PluginFiles, Setup
from shadowbench.cluster.workers import WorkerFacts
from shadowbench.errors import InputError, message, quoted
from shadowbench.measure.campaign import Reporter
from shadowbench.measure.failures import Limits

if TYPE_CHECKING:
    from distributed import Client


class Cluster:
    """Workers with our versions and an OpenGL device, on one renderer or on any.

    renderer: name of the study's, None for that of most workers at the start; any_renderer: whether workers of other
    renderers are admitted too. A context manager; within it, `facts` has the admitted workers by address.
    """

    def __init__(
        self,
        connection: Connection,
        reporter: Reporter,
        plugins: Sequence[Path] = (),
        limits: Limits | None = None,
        renderer: str | None = None,
        any_renderer: bool = False,
    ) -> None:
        self.connection, self.reporter = connection, reporter
        self.setup = Setup(secrets.token_hex(8), tuple(map(PluginFiles.of, plugins)), limits or Limits())
        self.renderer, self.any_renderer = renderer, any_renderer
        self.facts: dict[str, WorkerFacts] = {}
        self._judged: set[str] = set()
        self._watcher = Thread(target=self._watch)

    @property
    def client(self) -> "Client":
        """The current client; another one after the scheduler was restarted."""
        return self.connection.client

    def __enter__(self) -> "Cluster":
        self._wait()
        return self

    def __exit__(self, *_: object) -> None:
        with suppress(Exception):  # workers that have gone
            self.client.run(tasks.close_station, self.setup.number, workers=list(self.facts), on_error="ignore")

    def reconnect(self) -> None:
        """Wait for the scheduler and for workers, all of which are new."""
        self.connection.reconnect()
        if self._watcher.is_alive():
            self._watcher.join()
        self.facts.clear()
        self._judged.clear()
        self._wait()

    def renderers(self) -> list[str]:
        """Renderers of the admitted workers, the study's first."""
        found = dict.fromkeys([self.renderer, *(one.info.renderer for one in self.facts.values() if one.info)])
        return [name for name in found if name is not None]

    def on(self, renderer: str) -> list[WorkerFacts]:
        """Admitted workers with a renderer."""
        return [one for one in self.facts.values() if one.info is not None and one.info.renderer == renderer]

    def machines(self) -> dict[str, WorkerFacts]:
        """The first admitted worker on each machine, by the machine's name."""
        return {one.host: one for one in reversed(self.facts.values())}

    def watch(self) -> None:
        """Begin to admit workers that have joined, unless it is being done: one that dies meanwhile takes long."""
        if not self._watcher.is_alive():
            self._watcher = Thread(target=self._watch, daemon=True)
            self._watcher.start()

    def _watch(self) -> None:
        with suppress(Exception):  # the scheduler has gone, which the tasks tell
            self._join()

    def _join(self) -> dict[str, str]:
        """Admit workers that have joined since the last call; returns why others were left out, by name."""
        known = self.client.scheduler_info(n_workers=-1)["workers"]
        joined = [address for address in known if address not in self._judged]
        self.facts = {address: one for address, one in self.facts.items() if address in known}
        self._judged &= set(known)
        if not joined:
            return {}
        self._judged.update(joined)
        found = self.client.run(workers.describe, self.setup, workers.own_versions(), workers=joined, on_error="return")
        if self.renderer is None:
            self.renderer = _most_common([one for one in found.values() if isinstance(one, WorkerFacts)])
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
            self.client.run(workers.admit, resource, workers=equal, on_error="ignore")
        self.facts |= admitted
        return reasons

    def _objection(self, one: WorkerFacts | BaseException) -> str | None:
        """Why a worker must not measure."""
        if isinstance(one, ModuleNotFoundError):
            return f"shadowbench is not installed there ({quoted(message(one))})"
        if isinstance(one, BaseException):
            return quoted(f"{type(one).__name__}: {message(one)}")
        if one.reason is not None or one.info is None:
            return one.reason
        if self.any_renderer or one.info.renderer == self.renderer:
            return None
        return (
            f"its renderer is {one.info.renderer}, that of the study {self.renderer}; --renderer chooses another, "
            "--any-renderer makes rows for each"
        )

    def wait_until_idle(self, machine: WorkerFacts) -> None:
        """Wait until no worker on the machine of a worker runs a task, of whatever program."""
        beside = [one.address for one in self.facts.values() if one.host == machine.host]
        try:
            while any(self.client.processing(workers=beside).values()):
                time.sleep(0.1)
        except OSError:
            raise self.connection.gone() from None

    def _wait(self) -> None:
        """Admit workers, of which at least one must come."""
        end = time.monotonic() + WORKERS_S
        reasons: dict[str, str] = {}
        while True:
            try:
                reasons |= self._join()
            except OSError:
                raise self.connection.gone() from None
            if self.on(self.renderer) if self.renderer else self.facts:
                return
            if reasons or time.monotonic() > end:
                break
            time.sleep(0.2)
        where = f"--dask {self.connection.where}"
        if reasons:
            name, reason = next(iter(reasons.items()))
            more = f" (and {len(reasons) - 1} more)" if len(reasons) > 1 else ""
            raise InputError(f"{where}: no worker can measure; {name}: {reason}{more}")
        raise InputError(f"{where}: no worker within {WORKERS_S:g} s; allowed: a cluster with at least one")


def _most_common(found: Sequence[WorkerFacts]) -> str | None:
    """The renderer of most workers that have one, by name among equals; None if no worker has one."""
    counts = Counter(one.info.renderer for one in found if one.info is not None)
    return min(counts, key=lambda name: (-counts[name], name), default=None)
