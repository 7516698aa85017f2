"""Campaigns where they are wanted: in a worker process here, which Python functions share, or on a Dask cluster."""

import atexit
from collections.abc import Iterator, Sequence
from contextlib import ExitStack, contextmanager
from pathlib import Path
from tempfile import TemporaryDirectory
from threading import RLock
from typing import Any

from shadowbench.measure.campaign import Campaign, LogReporter, Reporter
from shadowbench.measure.gl_drawer import drawer_of
from shadowbench.measure.worker import Limits, Worker


class _Shared:
    """The worker process of all calls, started with the plug-ins and limits of the last one."""

    lock = RLock()
    worker: Worker | None = None
    settings: tuple[tuple[Path, ...], Limits] | None = None


def close() -> None:
    """End the worker process, after the calls of other threads; the next drawing call starts another."""
    with _Shared.lock:
        _end_worker()


def _end_worker() -> None:
    if _Shared.worker is not None:
        _Shared.worker.stop()
    _Shared.worker = _Shared.settings = None


atexit.register(_end_worker)  # a daemon thread's call is not waited for


@contextmanager
def shared_worker(plugins: tuple[Path, ...], limits: Limits | None = None) -> Iterator[Worker]:
    """The worker process with these plug-ins and limits, for one thread at a time."""
    settings = plugins, limits or Limits()
    with _Shared.lock:
        if _Shared.worker is None or _Shared.settings != settings:
            _end_worker()
            _Shared.worker, _Shared.settings = Worker(*settings), settings
        yield _Shared.worker


@contextmanager
def campaign_in(
    folder: Path | None,
    reporter: Reporter | None = None,
    plugins: Sequence[Path] = (),
    limits: Limits | None = None,
    *,
    worker: Worker | None = None,
    dask: str | None = None,
    renderer: str | None = None,
    **options: Any,
) -> Iterator[Campaign]:
    """A campaign in a folder, a temporary one for None; without a reporter it logs its progress.

    worker: the one that draws, else one of its own, with these plug-ins and limits; dask, renderer: a cluster that
    measures instead, and the renderer of its workers; options: see `Campaign`.
    """
    with ExitStack() as stack:
        if folder is None:
            folder = Path(stack.enter_context(TemporaryDirectory(prefix="shadowbench-")))
        reporter = reporter or LogReporter()
        if dask is not None:
            from shadowbench.measure.dask_blocks import dask_campaign

            setup = tuple(plugin.resolve() for plugin in plugins), limits or Limits()
            yield stack.enter_context(dask_campaign(folder, dask, renderer, setup, reporter, **options))
            return
        here = worker or stack.enter_context(Worker(plugins, limits))
        yield Campaign(folder, stack.enter_context(drawer_of(here)), reporter, **options)
