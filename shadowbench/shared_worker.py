"""The worker process that all drawing functions of Python share, for one thread at a time; progress is logged."""

import atexit
import logging
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path
from tempfile import TemporaryDirectory
from threading import RLock
from typing import Any

from shadowbench.engines.drawer import EngineDrawer
from shadowbench.measure.campaign import Campaign
from shadowbench.measure.drawer import Limits
from shadowbench.measure.gl_drawer import GLDrawer
from shadowbench.measure.worker import Worker

_log = logging.getLogger("shadowbench")


class _LogReporter:
    """Reporter that logs progress."""

    def note(self, line: str) -> None:
        _log.info(line)

    def stage(self, name: str, total: int | None) -> None:
        _log.debug("%s: %s", name, total)

    def step(self, what: str) -> None:
        _log.debug(what)


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
def campaign(folder: Path | None, worker: Worker, **options: Any) -> Iterator[Campaign]:
    """A campaign that logs its progress, in a folder, a temporary one for None; options: see `Campaign`."""
    with ExitStack() as stack:
        if folder is None:
            folder = Path(stack.enter_context(TemporaryDirectory(prefix="shadowbench-")))
        drawer = stack.enter_context(EngineDrawer(GLDrawer(worker)))
        yield Campaign(folder, drawer, _LogReporter(), **options)
