"""What runs on a Dask worker: jobs, drawn by a worker process of ours that it keeps between them."""

import atexit
import pickle
import threading
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from shadowbench.cluster.parcel import Setup, unpack
from shadowbench.errors import InputError, ShadowbenchError
from shadowbench.files import replace_file
from shadowbench.measure.bench import Bench
from shadowbench.measure.executor import Unsupported
from shadowbench.measure.pictures import Pictures
from shadowbench.measure.plugin_output import techniques_with
from shadowbench.measure.row_store import Rows
from shadowbench.measure.rows import Record
from shadowbench.measure.worker import Worker
from shadowbench.scenes.model import Scene, View
from shadowbench.truths.cache import cache_folder, cached_truth, truth_file, write_truth


@dataclass(frozen=True, eq=False)
class Outcome:
    """What a job returned or raised, and what it made.

    rows: without those it was given; files: bytes of its images, by path in the run folder; messages: calls of its
    reporter, as names of methods and their argument.
    """

    value: Any = None
    error: Exception | None = None
    rows: Sequence[Record] = ()
    files: dict[str, bytes] = field(default_factory=dict)
    messages: Sequence[tuple[str, str]] = ()


class Station:
    """The worker process with a setup, and the plug-ins that it draws."""

    lock = threading.RLock()
    current: "Station | None" = None

    def __init__(self, setup: Setup) -> None:
        self.setup = setup
        self._folder = TemporaryDirectory(prefix="shadowbench-", ignore_cleanup_errors=True)
        plugins = [plugin.write(Path(self._folder.name, str(n))) for n, plugin in enumerate(setup.plugins)]
        self.techniques = techniques_with(plugins)
        self.worker = Worker(plugins, setup.limits)

    def close(self) -> None:
        """End the worker process and remove the plug-ins."""
        self.worker.stop()
        self._folder.cleanup()


@contextmanager
def station(setup: Setup) -> Iterator[Station]:
    """The station with a setup, for one thread at a time; that of another setup is closed."""
    with Station.lock:
        if Station.current is None or Station.current.setup != setup:
            close_station()
            Station.current = Station(setup)
        yield Station.current


def close_station(number: str | None = None) -> None:
    """End the worker process, if it was started for the program of this number; None for any."""
    with Station.lock:
        one = Station.current
        if one is not None and number in (None, one.setup.number):
            Station.current = None
            one.close()


atexit.register(close_station)


class _Made(Rows):
    """Rows in memory that remember which were added."""

    def __init__(self, known: Sequence[Record]) -> None:
        super().__init__(known)
        self.made: list[Record] = []

    def append(self, *records: Record) -> None:
        super().append(*records)
        self.made += records


class _Messages:
    """Reporter that records its calls."""

    def __init__(self) -> None:
        self.calls: list[tuple[str, str]] = []

    def note(self, line: str) -> None:
        self.calls.append(("note", line))

    def stage(self, name: str, total: int | None) -> None:
        raise NotImplementedError("stages are the client's")

    def step(self, what: str) -> None:
        self.calls.append(("step", what))


def run_job(
    setup: Setup, job: bytes, scenes: Sequence[Scene], truths: Sequence[tuple[str, bytes]], images: bool
) -> Outcome:
    """Outcome of a packed job. truths: those that it needs, as by `trace_truth`; images: whether it makes images."""
    for name, data in truths:
        _keep_truth(name, data)
    with station(setup) as one, TemporaryDirectory(prefix="shadowbench-") as folder:
        call = unpack(job, scenes, one.techniques)
        store, messages = _Made(call.known), _Messages()
        bench = Bench(one.worker, store, messages, Pictures(Path(folder)) if images else None)
        try:
            value = call(bench)
        except (ShadowbenchError, Unsupported) as error:  # no reason to try again
            return Outcome(error=error, rows=store.made, messages=messages.calls)
        return Outcome(value, None, store.made, _files(Path(folder)), messages.calls)


def _files(folder: Path) -> dict[str, bytes]:
    return {
        file.relative_to(folder).as_posix(): file.read_bytes() for file in sorted(folder.rglob("*")) if file.is_file()
    }


def trace_truth(view: bytes, scenes: Sequence[Scene], pixel_samples: int) -> tuple[str, bytes]:
    """File name in the cache, and bytes, of a packed view's truth. Raises InputError for a view that shows nothing."""
    placed: View = unpack(view, scenes, {})
    file = truth_file(placed, pixel_samples)
    truth = cached_truth(placed, pixel_samples)
    with suppress(OSError):  # a cache that cannot be written
        return file.name, file.read_bytes()
    with TemporaryDirectory() as folder:
        write_truth(Path(folder, file.name), truth)
        return file.name, Path(folder, file.name).read_bytes()


def _keep_truth(name: str, data: bytes) -> None:
    """Put a truth that another machine has traced into the cache of this one."""
    file = cache_folder() / name
    if not file.exists():
        with suppress(OSError, InputError):  # a cache that cannot be written: the job traces it again
            file.parent.mkdir(parents=True, exist_ok=True)
            with replace_file(file) as temporary:
                temporary.write_bytes(data)


def load(data: bytes) -> Any:
    """A thing that many tasks need, sent once."""
    return pickle.loads(data)
