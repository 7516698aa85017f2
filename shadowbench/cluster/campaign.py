"""A campaign whose blocks are tasks of a Dask cluster; rows and images are written here alone."""

import secrets
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from concurrent.futures import CancelledError
from contextlib import suppress
from pathlib import Path
from time import monotonic
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from shadowbench.cluster import tasks
from shadowbench.cluster.cluster import Cluster
from shadowbench.cluster.parcel import pack
from shadowbench.cluster.tasks import Outcome
from shadowbench.cluster.workers import WorkerFacts
from shadowbench.errors import ShadowbenchError
from shadowbench.measure.campaign import Campaign, Reporter, Uniform
from shadowbench.measure.cells import Block, Cell
from shadowbench.measure.failures import Limits
from shadowbench.measure.rendering import Rendering
from shadowbench.measure.rows import Result
from shadowbench.measure.session import DeviceInfo
from shadowbench.measure.time_rows import Timing
from shadowbench.techniques.stage import ShaderText

if TYPE_CHECKING:
    from distributed import Future

_POLL_S = 1.0  # between looks for new workers
_RETRIES = 2  # of a task that raised an exception that is none of ours, such as a full disk


class ClusterDrawer:
    """Drawer whose calls are tasks, on the workers with one renderer; worker: the only one that it uses, to time."""

    def __init__(self, cluster: Cluster, renderer: str, worker: WorkerFacts | None = None) -> None:
        self.cluster, self.renderer, self.only = cluster, renderer, worker
        self._first = worker or cluster.on(renderer)[0]

    @property
    def info(self) -> DeviceInfo:
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
    def limits(self) -> Limits:
        """Limits of each call to a worker process."""
        return self.cluster.setup.limits

    def unsupported(self, block: Block, cell: Cell) -> str | None:
        """See `Drawer`."""
        reason: str | None = self._call("unsupported", block, cell)
        return reason

    def draw(self, block: Block, cell: Cell, keep: bool = False) -> Iterator[Rendering]:
        """See `Drawer`."""
        yield from self._call("draw", block, cell, keep)

    def surface(self, block: Block) -> NDArray[np.int32]:
        """See `Drawer`."""
        ids: NDArray[np.int32] = self._call("surface", block)
        return ids

    def shading(self, block: Block) -> tuple[NDArray[np.uint8], NDArray[np.uint8]]:
        """See `Drawer`."""
        lit, ambient = self._call("shading", block)
        return lit, ambient

    def time(self, block: Block, sizes: Mapping[Cell, int], retried: Mapping[Cell, int]) -> Iterator[Timing]:
        """See `Drawer`."""
        yield from self._call("time", block, sizes, retried)

    def shaders(self, block: Block, cell: Cell) -> Sequence[ShaderText]:
        """See `Drawer`."""
        texts: Sequence[ShaderText] = self._call("shaders", block, cell)
        return texts

    def _call(self, method: str, block: Block, *arguments: object) -> Any:
        return self.submit(tasks.call, method, pack((block.fresh(), *arguments))).result()

    def submit(self, function: Callable[..., Any], *arguments: object) -> "Future[Any]":
        """A task on one of the workers, given the setup before its arguments."""
        resource = self._first.resource
        return self.cluster.client.submit(
            function,
            self.cluster.setup,
            *arguments,
            key=f"{function.__name__}-{secrets.token_hex(8)}",
            resources={resource: 1},  # every worker has one: its tasks run one after the other
            workers=[self.only.address] if self.only else None,
            retries=_RETRIES,
        )


class ClusterCampaign(Campaign):
    """Campaign that measures each block in a task, by a campaign of its own in a temporary folder."""

    def __init__(self, folder: Path, drawer: ClusterDrawer, reporter: Reporter, **options: Any) -> None:
        super().__init__(folder, drawer, reporter, **options)
        self._drawer, self._options = drawer, options
        self._traced: dict[Block, Future[Uniform | None]] = {}

    def trace(self, blocks: Sequence[Block]) -> list[tuple[Block, Uniform | None]]:
        """See `Campaign`. A block is measured where its truth is, unless that worker is busy or gone."""
        self.reporter.stage("truth", len(blocks))
        traced = []
        jobs = ((tasks.trace, pack(block)) for block in blocks)
        for block, answer in zip(blocks, self._run(jobs), strict=True):
            with self._attempt("truth", block.view.name):
                traced.append((block, self._keep(answer)))
            self.reporter.step(block.view.name)
        return traced

    def measure(self, blocks: Iterable[Block]) -> Iterator[dict[Cell, Result]]:
        """See `Campaign`."""
        listed = list(blocks)
        jobs = ((tasks.measure, pack(block), self._known(block), self._options) for block in listed)
        for block, answer in zip(listed, self._run(jobs), strict=True):
            with self._attempt(*block.called):
                self._keep(answer)
            yield self.results(block)

    def _known(self, block: Block) -> list[Mapping[str, Any]]:
        """The rows of a block: a task must not measure them again, and times what they say succeeded."""
        found = self.results(block).values()
        return [row for one in found for row in (one.score, one.time) if row is not None]

    def _keep(self, outcome: Outcome) -> Any:
        """Write what a task has made, images before the rows that promise them, and return its value."""
        for name, data in outcome.files.items():
            self._pictures.write(name, data)
        if outcome.rows:
            self.store.append(*outcome.rows)
        for method, line in outcome.messages:
            getattr(self.reporter, method)(line)
        if outcome.error is not None:
            raise outcome.error
        return outcome.value

    def _run(self, jobs: Iterable[tuple[Any, ...]]) -> Iterator[Outcome]:
        """Outcomes of tasks, in the order of the jobs. Begins again with a scheduler that replaces one that has gone.

        Raises ShadowbenchError for a task that died with its worker several times.
        """
        from distributed import KilledWorker

        cluster, waiting = self._drawer.cluster, list(jobs)
        if self._drawer.only:  # one by one, so that nothing else is sent while it times
            for job in waiting:
                cluster.wait_until_idle(self._drawer.only)
                yield self._drawer.submit(*job).result()
            return
        futures = [self._drawer.submit(*job) for job in waiting]
        try:
            for index in range(len(waiting)):
                while True:
                    try:
                        yield self._wait(futures[index])
                        break
                    except CancelledError:  # the scheduler has gone
                        cluster.reconnect()
                        futures[index:] = [self._drawer.submit(*job) for job in waiting[index:]]
                    except KilledWorker as error:
                        last, times = error.last_worker.address, error.allowed_failures + 1
                        raise ShadowbenchError(
                            f"a task was lost {times} times with its worker, the last time with {last}, whose log says "
                            "more; what was measured is kept"
                        ) from None
        finally:
            with suppress(OSError, CancelledError):  # the scheduler has gone
                cluster.client.cancel(futures)

    def _wait(self, future: "Future[Any]") -> Outcome:
        looked = monotonic()
        while True:
            try:
                outcome: Outcome = future.result(timeout=_POLL_S)
                return outcome
            except TimeoutError:
                if monotonic() - looked > _POLL_S:
                    self._drawer.cluster.watch()
                    looked = monotonic()
