"""A Dask cluster, or one started in this process, and the tasks that its workers do."""

import asyncio
import logging
import time
from collections import Counter, deque
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import CancelledError
from contextlib import suppress
from multiprocessing import resource_tracker
from pathlib import Path
from typing import TYPE_CHECKING, Any

from shadowbench.errors import InputError, ShadowbenchError, how_to_install, message, quoted
from shadowbench.measure import dask_tasks as tasks
from shadowbench.measure.campaign import Reporter
from shadowbench.measure.dask_local import local_workers, start_local
from shadowbench.measure.drawer import Limits
from shadowbench.measure.worker import sigint_blocked

if TYPE_CHECKING:
    from distributed import Client, Future, LocalCluster

CONNECT_S, WORKERS_S, _LOOK_S = 10.0, 60.0, 1.0
AHEAD = 2  # tasks that a worker has at a time, so that it need not wait for this process
_TRIES = 4  # of a task whose worker dies, or that raises an exception that is none of ours, such as a full disk
_GONE = RuntimeError("it has gone")


class Cluster:
    """The workers of a scheduler with our versions and an OpenGL device, on one renderer or on any.

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
        self.where, self.local = where, local_workers(where)
        self.reporter, self.renderer, self.any_renderer = reporter, renderer, any_renderer
        self.setup = tasks.Setup([*map(tasks.plugin_files, plugins)], limits or Limits())
        self.facts: dict[str, tasks.WorkerFacts] = {}
        self._refused: dict[str, str] = {}  # why, by address
        self._asked: dict[str, Future[Any]] = {}
        self._looked = 0.0
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
                    self._started = start_local(self.local)
            self.client = self._connect()
            self._wait()
        except BaseException:
            self.__exit__()
            raise
        return self

    def __exit__(self, *_: object) -> None:
        with suppress(Exception):  # workers or a scheduler that have gone, or were never there
            self.client.run(tasks.close_station, workers=list(self.facts), on_error="ignore")
        with suppress(Exception):
            self.client.close(timeout=2)
        if self._started is not None:
            self._started.close(timeout=5)

    def renderers(self) -> list[str]:
        """Renderers of the admitted workers, the study's first."""
        return list(dict.fromkeys([str(self.renderer), *(one.info.renderer for one in self.facts.values())]))

    def on(self, renderer: str) -> list[str]:
        """Addresses of the admitted workers with a renderer."""
        return [address for address, one in self.facts.items() if one.info.renderer == renderer]

    def named(self, name: str) -> str:
        """Address of the worker of --time-on, given by that or the name of its machine. Raises InputError."""
        known = {} if self.local else {address: one.host for address, one in self.facts.items()}
        for address, host in known.items():
            if name in (address, host):
                return address
        others = dict.fromkeys(["here", *known.values(), *known])
        raise InputError(f"--time-on {name}: no such worker; allowed: {', '.join(others)}")

    def run(
        self, workers: Callable[[], Sequence[str]], jobs: Sequence[Sequence[Any]], ahead: int = AHEAD
    ) -> Iterator[tuple[int, Any]]:
        """Results of jobs as they end, or our errors that they raised, with their index.

        workers: addresses of those that may do them; jobs: a function of `dask_tasks` and its arguments each; ahead:
        tasks that a worker has at a time; if 1, they begin when its machine does nothing else. Jobs of a worker that
        dies go to another; after a restart of the scheduler they begin again. Raises ShadowbenchError for a job that is
        lost several times.
        """
        waiting, lost = deque(range(len(jobs))), Counter[int]()
        running: dict[Future[Any], tuple[int, str]] = {}
        try:
            while waiting or running:
                try:
                    if time.monotonic() > self._looked + _LOOK_S:
                        self._look()
                    busy = Counter(address for _, address in running.values())
                    for address in [*workers()] * ahead:
                        if waiting and busy[address] < ahead and (ahead > 1 or self._is_idle(address)):
                            busy[address] += 1
                            index = waiting.popleft()
                            running[self._submit(address, *jobs[index])] = index, address
                    for future, answer in self._ended(running).items():
                        index, address = running.pop(future)
                        if not isinstance(answer, Exception) or isinstance(answer, ShadowbenchError):
                            yield index, answer
                            continue
                        waiting.appendleft(index)
                        lost[index] += 1
                        self._check_lost(lost[index], address, answer)
                except (OSError, CancelledError):  # the scheduler has gone
                    waiting.extendleft(index for index, _ in running.values())
                    running.clear()
                    self._reconnect()
        finally:
            with suppress(OSError, CancelledError, RuntimeError):  # the scheduler has gone
                self.client.cancel([*running])

    def _check_lost(self, times: int, address: str, reason: Exception) -> None:
        """Raises ShadowbenchError for a task that was lost too often."""
        if times == _TRIES:
            last = f"the last time with {address}: {quoted(message(reason))}"
            raise ShadowbenchError(f"a task was lost {times} times, {last}; what was measured is kept")

    def _submit(self, address: str, function: Callable[..., Any], *arguments: object) -> "Future[Any]":
        packed = tasks.pack(*arguments)
        return self.client.submit(tasks.do, self.setup, function, packed, workers=[address], pure=False)

    def _ended(self, running: "Mapping[Future[Any], tuple[int, str]]") -> "dict[Future[Any], Any]":
        """Results or exceptions of the tasks that have ended, or whose worker has; waits for one, but not long."""
        from distributed import wait

        with suppress(TimeoutError), self.client.as_current():
            if running:
                wait([*running], timeout=_LOOK_S, return_when="FIRST_COMPLETED")
            else:
                time.sleep(0.1)
        gone = {future: _GONE for future, (_, at) in running.items() if at not in self.facts}
        ended = {future: self._answer(future, at) for future, (_, at) in running.items() if future.done()}
        return gone | ended

    def _answer(self, future: "Future[Any]", address: str) -> Any:
        """Result or exception of a task that has ended, or that its worker has gone: Dask waits for that to return."""
        timeout = _LOOK_S
        while True:
            with suppress(TimeoutError):
                return future.exception(timeout) or future.result(timeout)
            if address not in self.client.scheduler_info()["workers"]:
                return _GONE
            timeout *= 2

    def _is_idle(self, address: str) -> bool:
        """Whether no worker on the machine of a worker has a task, of whatever program."""
        beside = [other for other, one in self.facts.items() if one.host == self.facts[address].host]
        return not any(self.client.processing(workers=beside).values())

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

    def _reconnect(self) -> None:
        """Wait for a scheduler that was restarted, and for workers, all of which are new. Raises ShadowbenchError."""
        end = time.monotonic() + WORKERS_S
        self.client.close(timeout=2)
        for known in (self.facts, self._refused, self._asked):
            known.clear()
        while True:
            try:
                self.client = self._connect()
                return self._wait()
            except InputError:
                if time.monotonic() > end:
                    raise self._gone() from None

    def _gone(self) -> ShadowbenchError:
        return ShadowbenchError(
            f"--dask {self.where}: the scheduler has gone; what was measured is kept, and the same command goes on"
        )

    def _wait(self) -> None:
        """Admit workers, of which at least one must come."""
        end = time.monotonic() + WORKERS_S
        try:
            while not self._refused and time.monotonic() < end:
                self._look(patient=True)
                if self.on(self.renderer) if self.renderer else self.facts:
                    return
                time.sleep(0.1)
        except (OSError, CancelledError):
            raise self._gone() from None
        line = f"no worker within {WORKERS_S:g} s; allowed: a cluster with at least one"
        if self._refused:
            (address, reason), *others = self._refused.items()
            line = f"no worker can measure; {address}: {reason}{f' (and {len(others)} more)' if others else ''}"
        raise InputError(f"--dask {self.where}: {line}")

    def _look(self, patient: bool = False) -> None:
        """Ask workers that have joined, and admit or refuse them; patient: none before all have answered."""
        self._looked = time.monotonic()
        present = self.client.scheduler_info()["workers"].keys()
        if self.client.status != "running":
            raise CancelledError
        for known in (self.facts, self._refused, self._asked):
            for address in known.keys() - present:
                del known[address]
        for address in present - self.facts.keys() - self._refused.keys() - self._asked.keys():
            self._asked[address] = self._submit(address, tasks.describe, tasks.own_versions())
        answered = [address for address, future in self._asked.items() if future.done()]
        if patient and len(answered) < len(self._asked):
            return
        answers = {address: self._asked.pop(address) for address in answered}
        found = {address: self._answer(future, address) for address, future in answers.items()}
        self._judge({address: answer for address, answer in found.items() if answer is not _GONE})

    def _judge(self, answers: "Mapping[str, tasks.WorkerFacts | Exception]") -> None:
        """Admit or refuse workers by what they are."""
        if self.renderer is None:
            counts = Counter(one.info.renderer for one in answers.values() if isinstance(one, tasks.WorkerFacts))
            self.renderer = min(counts, key=lambda name: (-counts[name], name), default=None)
        for address, one in answers.items():
            reason = self._objection(one)
            if not isinstance(one, Exception) and reason is None:
                self.facts[address] = one
            else:
                self._refused[address] = str(reason)
                self.reporter.note(f"worker {address} is left out: {reason}")

    def _objection(self, one: "tasks.WorkerFacts | Exception") -> str | None:
        """Why a worker must not measure."""
        if isinstance(one, Exception):
            return quoted(message(one)) or type(one).__name__
        if self.any_renderer or one.info.renderer == self.renderer:
            return None
        return (
            f"its renderer is {one.info.renderer}, that of the study {self.renderer}; --renderer chooses another, "
            "--any-renderer makes rows for each"
        )


async def _probe(address: str) -> None:
    """Connect and close again. Raises as Dask does; a client that fails to connect may hang when it is deleted."""
    from distributed import Security
    from distributed.comm.core import connect

    arguments = Security().get_connection_args("client")  # from Dask's configuration
    await (await connect(address, timeout=CONNECT_S, **arguments)).close()
