"""A campaign whose blocks are tasks of a Dask cluster; rows and images are written here alone."""

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from concurrent.futures import CancelledError
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING, Any

from shadowbench.errors import ShadowbenchError
from shadowbench.measure import dask_tasks as tasks
from shadowbench.measure.campaign import Campaign, Reporter, Uniform
from shadowbench.measure.cells import Block, Cell
from shadowbench.measure.dask_cluster import Cluster
from shadowbench.measure.dask_tasks import Outcome, WorkerFacts, pack
from shadowbench.measure.failures import Limits
from shadowbench.measure.rows import Result
from shadowbench.measure.session import DeviceInfo

if TYPE_CHECKING:
    from distributed import Future

_POLL_S = 1.0  # after which workers that have joined are looked for


def _remote(method: str) -> Callable[..., Any]:
    """A drawer's method that is a task."""

    def call(self: "ClusterDrawer", block: Block, *arguments: object, **options: object) -> Any:
        packed = pack((block.fresh(), *arguments, *options.values()))
        return self.submit(tasks.call, method, packed).result()

    return call


class ClusterDrawer:
    """Drawer whose calls are tasks, on the workers with one renderer; only: the one worker that it uses, to time."""

    unsupported, draw, surface, shading, time, shaders = map(
        _remote, ("unsupported", "draw", "surface", "shading", "time", "shaders")
    )

    def __init__(self, cluster: Cluster, renderer: str, only: WorkerFacts | None = None) -> None:
        self.cluster, self.renderer, self.only = cluster, renderer, only
        first = only or cluster.on(renderer)[0]
        assert first.info is not None
        self.info: DeviceInfo = first.info
        self.identity: Mapping[str, str] = first.identity
        self.machine: Mapping[str, Any] = first.machine
        self.limits: Limits = cluster.setup.limits

    def submit(self, function: Callable[..., Any], *arguments: object) -> "Future[Any]":
        """A task on one of the workers."""
        return self.cluster.submit(self.renderer, self.only, function, *arguments)


class ClusterCampaign(Campaign):
    """Campaign that measures each block in a task, by a campaign of its own in a temporary folder."""

    def __init__(self, folder: Path, drawer: ClusterDrawer, reporter: Reporter, **options: Any) -> None:
        super().__init__(folder, drawer, reporter, **options)
        self._drawer, self._options = drawer, {**options, "keep_going": False}  # which is decided here

    def trace(self, blocks: Sequence[Block]) -> list[tuple[Block, Uniform | None]]:
        """See `Campaign`."""
        self.reporter.stage("truth", len(blocks))
        found: dict[int, Uniform | None] = {}
        for index, outcome in self._run([(tasks.trace, pack(block)) for block in blocks]):
            name = blocks[index].view.name
            with self._attempt("truth", name):
                found[index] = self._keep(outcome)
            self.reporter.step(name)
        return [(blocks[index], found[index]) for index in sorted(found)]

    def measure(self, blocks: Iterable[Block]) -> Iterator[dict[Cell, Result]]:
        """See `Campaign`. What a task has made is written when it ends."""
        listed, kept, following = list(blocks), set[int](), 0
        jobs = [(tasks.measure, pack(block), self._known(block), self._options) for block in listed]
        for index, outcome in self._run(jobs):
            with self._attempt(*listed[index].called):
                self._keep(outcome)
            kept.add(index)
            while following in kept:
                yield self.results(listed[following])
                following += 1

    def _known(self, block: Block) -> list[Mapping[str, Any]]:
        """The rows of a block: a task must not measure them again, and times what they say succeeded."""
        found = self.results(block).values()
        return [row for one in found for row in (one.score, one.last_time) if row is not None]

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

    def _run(self, jobs: Sequence[tuple[Any, ...]]) -> Iterator[tuple[int, Outcome]]:
        """Outcomes of tasks as they end, by index. Begins again with a scheduler that replaces one that has gone.

        Raises ShadowbenchError for a task that died with its worker several times.
        """
        from distributed import KilledWorker, wait

        cluster, only = self._drawer.cluster, self._drawer.only
        if only:  # one by one, so that nothing else is sent while it times
            for index, job in enumerate(jobs):
                cluster.wait_until_idle(only)
                yield index, self._drawer.submit(*job).result()
            return
        left = {index: self._drawer.submit(*job) for index, job in enumerate(jobs)}
        try:
            while left:
                try:
                    with cluster.client.as_current():
                        done = wait([*left.values()], timeout=_POLL_S, return_when="FIRST_COMPLETED").done
                    ended = {index: future.result() for index, future in left.items() if future in done}
                except TimeoutError:
                    cluster.watch()
                except CancelledError:  # the scheduler has gone
                    cluster.reconnect()
                    left = {index: self._drawer.submit(*jobs[index]) for index in left}
                except KilledWorker as error:
                    last, times = error.last_worker.address, error.allowed_failures + 1
                    raise ShadowbenchError(
                        f"a task was lost {times} times with its worker, the last time with {last}, whose log says "
                        "more; what was measured is kept"
                    ) from None
                else:
                    left = {index: future for index, future in left.items() if index not in ended}
                    yield from ended.items()
        finally:
            if cluster.client.status == "running":  # not when the scheduler has gone
                with suppress(OSError, CancelledError):
                    cluster.client.cancel([*left.values()])
