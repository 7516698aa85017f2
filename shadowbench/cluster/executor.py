"""Executor whose jobs are tasks of a Dask cluster."""

import secrets
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import CancelledError
from contextlib import suppress
from dataclasses import dataclass
from queue import Empty, SimpleQueue
from time import monotonic
from typing import TYPE_CHECKING, Any, Concatenate

from shadowbench.cluster import tasks
from shadowbench.cluster.cluster import Cluster
from shadowbench.cluster.parcel import pack
from shadowbench.cluster.tasks import Outcome
from shadowbench.cluster.workers import WorkerFacts
from shadowbench.errors import ShadowbenchError
from shadowbench.measure.bench import Bench, Job
from shadowbench.measure.executor import Limits, P, R
from shadowbench.measure.row_store import Rows

if TYPE_CHECKING:
    from distributed import Future

    from shadowbench.measure.session import DeviceInfo, Session

_POLL_S = 1.0  # between looks for new workers
_MOST_AT_ONCE = 16  # outcomes that are fetched together
_RETRIES = 2  # of a task that raised an exception that is none of ours, such as a full disk


class DaskExecutor:
    """Executor on the workers with one renderer.

    worker: the only one that is used, for times; it is named in the study's `run.json`.
    """

    def __init__(self, cluster: Cluster, renderer: str, worker: WorkerFacts | None = None) -> None:
        self.cluster, self.renderer, self._only = cluster, renderer, worker
        self._first = worker or cluster.on(renderer)[0]

    @property
    def info(self) -> "DeviceInfo":
        """Device facts of the first worker."""
        assert self._first.info is not None
        return self._first.info

    @property
    def identity(self) -> Mapping[str, str]:
        """That of the first worker."""
        return self._first.identity

    @property
    def machine(self) -> Mapping[str, Any]:
        """The computer of the first worker."""
        return self._first.machine

    @property
    def jobs_at_once(self) -> int:
        """Number of workers, for now."""
        return 1 if self._only else len(self.cluster.on(self.renderer))

    @property
    def limits(self) -> Limits:
        """Limits of each call to a worker process."""
        return self.cluster.setup.limits

    def call(self, method: "Callable[Concatenate[Session, P], R]", *arguments: P.args, **options: P.kwargs) -> R:
        """Result of `method(session, …)` on one of the workers. Raises as the protocol says."""
        result: R
        (result,) = self.run([_Call(method, arguments, options)], Bench(self, Rows(), self.cluster.reporter))
        return result

    def run(self, jobs: Sequence[Job[R]], bench: Bench) -> Iterator[R]:
        """Results of jobs, in their order; rows and images are written as tasks end.

        Raises what a job raised, and ShadowbenchError for one that died with its worker several times.
        """
        if self._only is None:
            yield from self._run(jobs, bench)
            return
        for job in jobs:  # one by one, so that not even the next one's scene is sent meanwhile
            self.cluster.wait_until_idle(self._only)
            yield from self._run([job], bench)

    def _run(self, jobs: Sequence[Job[R]], bench: Bench) -> Iterator[R]:
        running = _Running(self, jobs, bench.pictures is not None)
        ended: dict[int, R] = {}
        try:
            for index in range(len(jobs)):
                while index not in ended:
                    ended |= {which: _keep(outcome, bench) for which, outcome in running.wait()}
                yield ended.pop(index)
        finally:
            running.cancel()

    def submit(self, job: Job[R], images: bool) -> "Future[Any]":
        """The task of a job."""
        data, scenes = pack(job)
        resource = self._first.resource
        return self.cluster.client.submit(
            tasks.run_job,
            self.cluster.send_setup(resource),
            data,
            [self.cluster.send_scene(scene, resource) for scene in scenes],
            [self.cluster.send_truth(view, samples, resource) for view, samples in job.truths],
            images,
            key=f"{type(job).__name__}-{secrets.token_hex(8)}",
            resources={resource: 1},  # every worker has one: its tasks run one after the other
            workers=[self._only.address] if self._only else None,
            retries=_RETRIES,
        )

    def stop(self) -> None:
        """Nothing: the worker processes are the cluster's."""


class _Running:
    """The tasks of some jobs that have not ended."""

    def __init__(self, executor: DaskExecutor, jobs: Sequence[Job[Any]], images: bool) -> None:
        self._executor, self._jobs, self._images = executor, jobs, images
        self._ended: SimpleQueue[Future[Any]] = SimpleQueue()
        self._looked = monotonic()
        self._futures: dict[Any, tuple[int, Future[Any]]] = {}
        self._submit(range(len(jobs)))

    def _submit(self, indices: Sequence[int]) -> None:
        for index in indices:
            future = self._executor.submit(self._jobs[index], self._images)
            self._futures[future.key] = index, future
            future.add_done_callback(self._ended.put)

    def wait(self) -> list[tuple[int, Outcome]]:
        """The tasks that have ended, as indices of their jobs and outcomes; waits for one, but not for ever."""
        from distributed import KilledWorker

        if monotonic() - self._looked > _POLL_S:
            self._executor.cluster.watch()
            self._looked = monotonic()
        ended = self._take_ended()
        finished = [future for future in ended if future.status == "finished"]
        try:
            try:
                outcomes = self._executor.cluster.client.gather(finished)
            except OSError as error:  # not of a job, as these have finished
                raise CancelledError from error
            if not finished and ended:
                ended[0].result()  # raises
        except CancelledError:  # the scheduler has gone
            self._begin_again()
            return []
        except KilledWorker as error:
            last, times = error.last_worker.address, error.allowed_failures + 1
            raise ShadowbenchError(
                f"a task was lost {times} times with its worker, the last time with {last}, whose log says more; what "
                "was measured is kept"
            ) from None
        for future in ended:
            if future not in finished:  # after those that have finished
                self._ended.put(future)
        return [(self._futures.pop(future.key)[0], outcome) for future, outcome in zip(finished, outcomes, strict=True)]

    def _take_ended(self) -> "list[Future[Any]]":
        """Futures that have ended, at most _MOST_AT_ONCE; waits for one, but not for ever."""
        ended = []
        try:
            ended.append(self._ended.get(timeout=_POLL_S))
            while len(ended) < _MOST_AT_ONCE:
                ended.append(self._ended.get_nowait())
        except Empty:
            pass
        return [future for future in ended if future.key in self._futures]  # others are of a scheduler that has gone

    def _begin_again(self) -> None:
        """Submit all tasks to the scheduler that takes the place of one that has gone."""
        left = [index for index, _ in self._futures.values()]
        self._futures.clear()
        self._executor.cluster.reconnect()
        self._submit(left)

    def cancel(self) -> None:
        """Cancel the tasks that have not ended."""
        if self._futures:
            with suppress(OSError, CancelledError):  # the scheduler has gone
                self._executor.cluster.client.cancel([future for _, future in self._futures.values()])
            self._futures.clear()


@dataclass(frozen=True, eq=False)
class _Call(Job[Any]):
    """Job that calls the session."""

    method: Callable[..., Any]
    arguments: Sequence[Any]
    options: Mapping[str, Any]

    def __call__(self, bench: Bench) -> Any:
        return bench.executor.call(self.method, *self.arguments, **self.options)


def _keep(outcome: Outcome, bench: Bench) -> Any:
    """Write what a job has made, images before the rows that promise them, and return its value."""
    if bench.pictures is not None:
        for name, data in outcome.files.items():
            bench.pictures.write(name, data)
    if outcome.rows:
        bench.store.append(*outcome.rows)
    for method, line in outcome.messages:
        getattr(bench.reporter, method)(line)
    if outcome.error is not None:
        raise outcome.error
    return outcome.value
