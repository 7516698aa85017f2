"""Campaigns whose blocks are tasks of a Dask cluster; rows and images are written here alone."""

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

from shadowbench.files import replace_file
from shadowbench.measure import dask_tasks as tasks
from shadowbench.measure.campaign import Campaign, Reporter, Shadows, called
from shadowbench.measure.cells import Block
from shadowbench.measure.dask_cluster import AHEAD, Cluster
from shadowbench.measure.drawer import DeviceInfo, Limits
from shadowbench.measure.gl_drawer import GLDrawer
from shadowbench.measure.rows import Result


class _RemoteWorker:
    """Worker process beside a Dask worker."""

    def __init__(self, run: Callable[..., Iterator[tuple[int, Any]]], info: DeviceInfo, limits: Limits) -> None:
        self._run, self.info, self.limits = run, info, limits

    def call(self, method: Callable[..., Any], *arguments: Any, **options: Any) -> Any:
        """See `Worker`."""
        ((_, answer),) = self._run((tasks.call, method, arguments, options))
        return _raised(answer)


class ClusterCampaign(Campaign):
    """Campaign that measures each block in a task, by a campaign of its own in a temporary folder.

    renderer: that of the workers; only: address of the one that it uses, to time.
    """

    def __init__(
        self, folder: Path, cluster: Cluster, reporter: Reporter, renderer: str, only: str | None = None, **options: Any
    ) -> None:
        def workers() -> list[str]:
            return [one for one in cluster.on(renderer) if only in (None, one)]

        def run(*jobs: Sequence[Any]) -> Iterator[tuple[int, Any]]:
            return cluster.run(workers, jobs, 1 if only else AHEAD)

        self._run, facts = run, cluster.facts[workers()[0]]
        worker: Any = _RemoteWorker(run, facts.info, cluster.setup.limits)
        super().__init__(folder, GLDrawer(worker, facts.identity, facts.machine), reporter, **options)
        self._options = {**options, "keep_going": False}  # which is decided here

    def trace(self, blocks: Sequence[Block]) -> list[Shadows | None]:
        """See `Campaign`."""
        self.reporter.stage("truth", len(blocks))
        found: list[Shadows | None] = [None] * len(blocks)
        for index, answer in self._run(*[(tasks.trace, block) for block in blocks]):
            with self._attempt("truth", blocks[index].view.name):
                found[index] = _raised(answer)
            self.reporter.step(blocks[index].view.name)
        return found

    def measure(self, blocks: Iterable[Block]) -> Iterator[list[Result]]:
        """See `Campaign`. What a task has made is written when it ends."""
        listed = list(blocks)
        jobs = [(tasks.measure, block, self._known(block), self._options) for block in listed]
        for index, answer in self._run(*jobs):
            block = listed[index]
            with self._attempt(*called(block)):
                self._keep(_raised(answer))
            for _ in range(len(block.cells) + sum(map(block.times, block.cells))):
                self.reporter.step(block.view.scene.name)
        yield from map(self.results, listed)

    def _known(self, block: Block) -> list[Mapping[str, Any]]:
        """The rows of a block: a task must not measure them again, and times what they say succeeded."""
        return [row for one in self.results(block) for row in (one.score, one.last_time) if row is not None]

    def _keep(self, outcome: tasks.Outcome) -> None:
        """Write what a task has made, images before the rows that promise them."""
        for name, data in outcome.images.items():
            file = self.folder / name
            file.parent.mkdir(exist_ok=True)
            with replace_file(file) as temporary:
                temporary.write_bytes(data)
        if outcome.rows:
            self.store.append(*outcome.rows)
        for line in outcome.notes:
            self.reporter.note(line)


def _raised(answer: Any) -> Any:
    """An answer, unless it is an error."""
    if isinstance(answer, Exception):
        raise answer
    return answer
