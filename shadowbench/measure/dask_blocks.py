"""Blocks as tasks of Dask, which places, retries and restarts them. Rows are written here alone; nothing is timed."""

import logging
import os
import re
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import replace
from functools import partial
from multiprocessing import resource_tracker
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, cast

from shadowbench.errors import InputError, ShadowbenchError, how_to_install, message, quoted
from shadowbench.measure.campaign import DEFAULT_REFERENCE, Block, Campaign, Cell, LogReporter, Reporter, called
from shadowbench.measure.gl_drawer import GLDrawer, shared_worker
from shadowbench.measure.machine import versions
from shadowbench.measure.plugin_output import techniques_with
from shadowbench.measure.rows import Record, Result, read_rows
from shadowbench.measure.worker import DeviceInfo, Limits, Worker, sigint_blocked
from shadowbench.plugin.spec import parse_spec
from shadowbench.versions import of_rows

Setup = tuple[tuple[Path, ...], Limits]
"""Plug-ins and limits of the process that draws beside a Dask worker."""
CellText = tuple[str, int, str | None]
"""Spec, phase and home of a cell; classes of plug-ins have no name by which another process could unpickle them."""


def drawn(setup: Setup, task: Callable[..., Any], *arguments: Any, **options: Any) -> Any:
    """On a Dask worker, `task(drawer, …)` with the process that draws, in one of its threads at a time."""
    with shared_worker(*setup) as worker:
        return task(GLDrawer(worker), *arguments, **options)


def describe(drawer: GLDrawer) -> tuple[Mapping[str, str], Mapping[str, str], DeviceInfo, Mapping[str, Any]]:
    """Of a Dask worker: versions that rows depend on, what draws there, and its device and computer."""
    return {**versions(), **of_rows()}, drawer.device_identity, drawer.info, drawer.machine


def measure_block(
    drawer: GLDrawer, block: Block, cells: Sequence[CellText], plugins: Sequence[Path], options: Mapping[str, Any]
) -> tuple[list[Record], dict[str, bytes]]:
    """Rows of a block with these cells, and images by path in the run folder, by a campaign in a temporary one."""
    with TemporaryDirectory(prefix="shadowbench-") as name:
        known, folder = techniques_with(plugins), Path(name)
        specs = {text: parse_spec(text, known) for spec, _, home in cells for text in (spec, home or spec)}
        read = [Cell(specs[spec], phase, specs[home] if home else None) for spec, phase, home in cells]
        with Campaign(folder, drawer, LogReporter(), **options) as campaign:
            list(campaign.measure([replace(block, cells=tuple(read))]))
        rows, _ = read_rows(folder / "rows.jsonl")
        return rows, {file.relative_to(folder).as_posix(): file.read_bytes() for file in folder.glob("*/*.png")}


class DaskCampaign(Campaign):
    """Campaign whose blocks are measured by Dask workers, each by a campaign of its own, and not timed.

    Workers of other versions, or of another renderer (that of the first worker for None), are refused at the start.
    Raises InputError if none is left. In place of a `Worker`, the drawer calls any of them.
    """

    def __init__(
        self, folder: Path, client: Any, setup: Setup, renderer: str | None, reporter: Reporter, **options: Any
    ) -> None:
        with suppress(TimeoutError):
            client.wait_for_workers(1, 60)
        answers: dict[str, Any] = client.run(drawn, setup, describe, on_error="return")
        expected = {**versions(), **of_rows()} | ({"renderer": renderer} if renderer else {})
        admitted, reason = list[str](), "no worker within 60 s; allowed: one or more"
        for address, facts in sorted(answers.items()):
            there = {} if isinstance(facts, Exception) else {**facts[0], **facts[1]}
            differs = next((name for name in expected if there.get(name) != expected[name]), None)
            if differs is not None:
                why = f"{differs} is {there[differs]} there, not {expected[differs]}" if there else message(facts)
                reason = f"worker {address} is left out: {quoted(why)}"
                reporter.note(reason)
            else:
                admitted.append(address)
                expected |= there
        if not admitted:
            raise InputError(f"--dask: {reason}")
        _, identity, self.info, machine = answers[admitted[0]]
        self.limits = setup[1]
        super().__init__(folder, GLDrawer(cast("Worker", self), identity, machine), reporter, **options)
        self._client, self._plugins, self._options = client, setup[0], options | {"keep_going": False}
        self._drawn = partial(drawn, setup)
        self._addresses = admitted if len(admitted) < len(answers) else None  # None: also those that join later

    def call(self, method: Callable[..., Any], *arguments: Any, **options: Any) -> Any:
        """See `Worker`."""
        ((_, result),) = self._map(self._drawn, [lambda drawer: drawer.worker.call(method, *arguments, **options)])
        return result()

    def measure(self, blocks: Iterable[Block]) -> Iterator[list[Result]]:
        """See `Campaign`. What a task has made is written when it ends."""
        listed = list(blocks)
        missing = [(block, cells) for block in listed if (cells := self.unscored(block))]
        for _ in range(sum(len(block.cells) for block in listed) - sum(len(cells) for _, cells in missing)):
            self.reporter.step("measured before")
        bare = [replace(block, cells=(), rounds=0, reference=DEFAULT_REFERENCE) for block, _ in missing]
        texts = [[(c.spec.full_text, c.phase, c.home and c.home.full_text) for c in cells] for _, cells in missing]
        measured = partial(self._drawn, measure_block, plugins=self._plugins, options=self._options)
        for index, result in self._map(measured, bare, texts):
            block, cells = missing[index]
            with self._attempt(*called(block)):
                rows, images = result()
                if {row["key"] for row in rows} != set(cells.values()):
                    raise ShadowbenchError("--dask: a worker that joined later, or a plug-in there, differs")
                for name, data in images.items():  # before the rows, which promise them
                    (self.folder / name).parent.mkdir(exist_ok=True)
                    (self.folder / name).write_bytes(data)
                self.store.append(*rows)
            for cell in cells:
                self.reporter.step(f"{block.view.scene.name} {cell.spec.text}")
        yield from map(self.results, listed)

    def _map(self, task: Callable[..., Any], *jobs: Sequence[Any]) -> Iterator[tuple[int, Callable[[], Any]]]:
        """See `Campaign`: as the tasks end. A result raises the task's error, others as ShadowbenchError."""
        from distributed import as_completed

        def result() -> Any:
            try:
                return future.result()
            except ShadowbenchError:
                raise
            except Exception as error:  # of the system there, or Dask's: the scheduler has gone, or workers die
                raise ShadowbenchError(f"--dask: {quoted(message(error))}; repeat the command to resume") from None

        futures = self._client.map(task, *jobs, retries=3, pure=False, workers=self._addresses)
        indices = {future: index for index, future in enumerate(futures)}
        for future in as_completed(futures, loop=self._client.loop):
            yield indices[future], result
            future.release()  # of its result, in the memory of a worker


@contextmanager
def dask_campaign(
    folder: Path, where: str, renderer: str | None, setup: Setup, reporter: Reporter, **options: Any
) -> Iterator[DaskCampaign]:
    """A campaign by the workers of the scheduler at an address, or of a cluster that lives here for `local:N`."""
    try:
        import dask
        from distributed import Client, LocalCluster
    except ImportError:
        raise InputError(f"--dask needs Dask; {how_to_install('dask')}") from None
    for name in ("distributed", "distributed.client"):  # the latter has a level of its own
        logging.getLogger(name).setLevel(logging.CRITICAL)  # errors are reported in one line
    dask.config.set({"distributed.admin.large-graph-warning-threshold": "1 TiB"})  # scenes are in the graph
    local = re.fullmatch(r"local:([1-9]\d{0,2})", where)
    if local is None and where.startswith("local:"):
        raise InputError(f"--dask {where}: allowed: local:N with N from 1 to 999, or a scheduler's address")
    with ExitStack() as stack:
        cluster: Any = where
        if local is not None:
            count = int(local[1])
            # A software renderer would use all cores in every worker.
            environment = {"LP_NUM_THREADS": str(max((os.cpu_count() or 1) // count, 1)), **os.environ}
            silent = {"dashboard_address": ":0", "silence_logs": logging.CRITICAL}
            resource_tracker.ensure_running()  # when it starts, it unblocks the signal
            with sigint_blocked():  # Ctrl-C is for this process, which ends the workers
                cluster = LocalCluster(n_workers=count, threads_per_worker=1, env=environment, **silent)
            stack.callback(cluster.close, timeout=5)
        try:
            client = Client(cluster, timeout=10, set_as_default=False)
        except (OSError, ValueError, TypeError, RuntimeError) as error:  # the last two: TLS on one side only
            allowed = "local:N, or the address of a scheduler, such as tcp://host:8786"
            reason = f"no Dask scheduler answers ({quoted(message(error))})"
            raise InputError(f"--dask {where}: {reason}; allowed: {allowed}") from None
        stack.callback(client.close, timeout=2)
        yield DaskCampaign(folder, client, setup, renderer, reporter, **options)
