"""Blocks as tasks of Dask, which places, retries and restarts them. Rows are written here alone; nothing is timed."""

import logging
import os
import re
import threading
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import replace
from multiprocessing import resource_tracker
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, NamedTuple, cast

from shadowbench.errors import InputError, ShadowbenchError, how_to_install, message, quoted
from shadowbench.files import replace_file
from shadowbench.measure.campaign import (
    DEFAULT_REFERENCE,
    Block,
    Campaign,
    Cell,
    LogReporter,
    Reporter,
    Shadows,
    called,
    trace_view,
)
from shadowbench.measure.gl_drawer import GLDrawer
from shadowbench.measure.machine import machine, versions
from shadowbench.measure.plugin_output import techniques_with
from shadowbench.measure.rows import Record, Result, read_rows
from shadowbench.measure.worker import DeviceInfo, Limits, Worker, sigint_blocked
from shadowbench.plugin.spec import parse_spec
from shadowbench.scenes.model import View
from shadowbench.versions import of_rows

Setup = tuple[tuple[Path, ...], Limits]
"""Plug-ins and limits of the process that draws beside a Dask worker."""
CellText = tuple[str, int, str | None]
"""Spec, phase and home of a cell; classes of plug-ins have no name by which another process could unpickle them."""

_drawing = threading.RLock()  # a Dask worker may have several threads, and draws with one
_started: dict[Setup, Worker] = {}  # at most one


class WorkerFacts(NamedTuple):
    """A Dask worker. identity: of what draws there; traits: that, and versions of libraries and of our code."""

    traits: Mapping[str, str]
    identity: Mapping[str, str]
    info: DeviceInfo
    machine: Mapping[str, Any]


def worker_here(setup: Setup) -> Worker:
    """On a Dask worker, the process that draws; another one if the setup has changed."""
    if setup not in _started:
        while _started:
            _started.popitem()[1].stop()
        _started[setup] = Worker(*setup)
    return _started[setup]


def describe(setup: Setup) -> WorkerFacts:
    """Facts about this Dask worker. Raises ShadowbenchError without OpenGL."""
    with _drawing:
        worker = worker_here(setup)
        identity = GLDrawer(worker).device_identity
        return WorkerFacts({**versions(), **of_rows(), **identity}, identity, worker.info, machine())


def call(setup: Setup, method: Callable[..., Any], arguments: Sequence[Any], options: Mapping[str, Any]) -> Any:
    """Result of a call of the process that draws beside this Dask worker."""
    with _drawing:
        return worker_here(setup).call(method, *arguments, **options)


def measure_block(
    block: Block, cells: Sequence[CellText], setup: Setup, options: Mapping[str, Any]
) -> tuple[list[Record], dict[str, bytes]]:
    """Rows of a block with these cells, and images by path in the run folder, by a campaign in a temporary one."""
    with _drawing, TemporaryDirectory(prefix="shadowbench-") as name:
        known, folder = techniques_with(setup[0]), Path(name)
        specs = {text: parse_spec(text, known) for spec, _, home in cells for text in (spec, home) if text}
        read = tuple(Cell(specs[spec], phase, specs.get(home or "")) for spec, phase, home in cells)
        with Campaign(folder, GLDrawer(worker_here(setup)), LogReporter(), **options) as campaign:
            list(campaign.measure([replace(block, cells=read)]))
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
        answers: dict[str, WorkerFacts | Exception] = client.run(describe, setup, on_error="return")
        expected = {**versions(), **of_rows()} | ({"renderer": renderer} if renderer else {})
        admitted: dict[str, WorkerFacts] = {}
        reason = "no worker within 60 s; allowed: one or more"
        for address, facts in sorted(answers.items()):
            if isinstance(facts, Exception):
                why = quoted(message(facts))
            elif unequal := [name for name in expected if facts.traits.get(name) != expected[name]]:
                why = f"{unequal[0]} is {facts.traits.get(unequal[0])} there, not {expected[unequal[0]]}"
            else:
                admitted[address] = facts
                expected |= facts.identity
                continue
            reason = f"worker {address} is left out: {why}"
            reporter.note(reason)
        if not admitted:
            raise InputError(f"--dask: {reason}")
        facts, *_ = admitted.values()
        self.info, self.limits, worker = facts.info, setup[1], cast("Worker", self)
        super().__init__(folder, GLDrawer(worker, facts.identity, facts.machine), reporter, **options)
        self._client, self._setup, self._options = client, setup, options | {"keep_going": False}
        self._addresses = [*admitted] if len(admitted) < len(answers) else None  # None: also those that join later

    def call(self, method: Callable[..., Any], *arguments: Any, **options: Any) -> Any:
        """See `Worker`."""
        ((_, result),) = self._map(call, [self._setup], [method], [arguments], [options])
        return result()

    def measure(self, blocks: Iterable[Block]) -> Iterator[list[Result]]:
        """See `Campaign`. What a task has made is written when it ends."""
        listed = list(blocks)
        missing = [(block, cells) for block in listed if (cells := self.unscored(block))]
        for _ in range(sum(len(block.cells) for block in listed) - sum(len(cells) for _, cells in missing)):
            self.reporter.step("measured before")
        bare = [replace(block, cells=(), rounds=0, reference=DEFAULT_REFERENCE) for block, _ in missing]
        texts = [
            [(cell.spec.full_text, cell.phase, cell.home and cell.home.full_text) for cell in cells]
            for _, cells in missing
        ]
        for index, result in self._map(measure_block, bare, texts, setup=self._setup, options=self._options):
            block, cells = missing[index]
            with self._attempt(*called(block)):
                rows, images = result()
                if {row["key"] for row in rows} != set(cells.values()):
                    raise ShadowbenchError("--dask: a worker that joined later, or a plug-in there, differs")
                for name, data in images.items():  # before the rows, which promise them
                    (self.folder / name).parent.mkdir(exist_ok=True)
                    with replace_file(self.folder / name) as temporary:
                        temporary.write_bytes(data)
                self.store.append(*rows)
            for cell in cells:
                self.reporter.step(f"{block.view.scene.name} {cell.spec.text}")
        yield from map(self.results, listed)

    def _traced(self, views: Sequence[View]) -> Iterator[tuple[int, Callable[[], Shadows]]]:
        return self._map(trace_view, views)

    def _map(
        self, function: Callable[..., Any], *jobs: Sequence[Any], **same: Any
    ) -> Iterator[tuple[int, Callable[[], Any]]]:
        """Index and result of each task, as they end. A result raises the task's error, others as ShadowbenchError."""
        from distributed import as_completed

        def result() -> Any:
            try:
                return future.result()
            except ShadowbenchError:
                raise
            except Exception as error:  # of the system there, or Dask's: the scheduler has gone, or workers die
                kept = "what was measured is kept, and the same command goes on"
                raise ShadowbenchError(f"--dask: {quoted(message(error))}; {kept}") from None

        futures = self._client.map(function, *jobs, **same, retries=3, pure=False, workers=self._addresses)
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
    local = re.fullmatch(r"local:([1-9]\d{0,2})", where)
    if local is None and where.partition(":")[0] == "local":
        raise InputError(f"--dask {where}: allowed: local:N with N from 1 to 999, or a scheduler's address")
    for name in ("distributed", "distributed.client"):  # the latter has a level of its own
        logging.getLogger(name).setLevel(logging.CRITICAL)  # errors are reported in one line
    dask.config.set({"distributed.admin.large-graph-warning-threshold": "1 TiB"})  # scenes are in the graph
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
            reason = quoted(message(error)) or type(error).__name__
            allowed = "local:N, or the address of a scheduler, such as tcp://host:8786"
            raise InputError(f"--dask {where}: no Dask scheduler answers ({reason}); allowed: {allowed}") from None
        stack.callback(client.close, timeout=2)
        yield DaskCampaign(folder, client, setup, renderer, reporter, **options)
