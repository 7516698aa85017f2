"""What runs on a Dask worker: campaigns, drawn by a worker process of ours that it keeps between them."""

import atexit
import threading
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from shadowbench.cluster.parcel import Setup, unpack
from shadowbench.errors import ShadowbenchError
from shadowbench.measure.campaign import Campaign, uniform
from shadowbench.measure.gl_drawer import GLDrawer
from shadowbench.measure.plugin_output import techniques_with
from shadowbench.measure.rows import Record, stream_rows
from shadowbench.measure.worker import Worker


@dataclass(frozen=True, eq=False)
class Outcome:
    """What a task returned or raised, and what it made.

    files: bytes of its images, by path in the run folder; messages: calls of its reporter, as names of methods and
    their argument.
    """

    value: Any = None
    error: Exception | None = None
    rows: Sequence[Record] = ()
    files: Mapping[str, bytes] = field(default_factory=dict)
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


def measure(setup: Setup, packed: bytes, known: Sequence[Record], options: Mapping[str, Any]) -> Outcome:
    """Measure a packed block. known: its rows; options: of the campaign."""
    with station(setup) as one, TemporaryDirectory(prefix="shadowbench-") as name:
        folder, messages, error = Path(name), _Messages(), None
        options = {**options, "keep_going": False}  # which the client decides
        with Campaign(folder, GLDrawer(one.worker), messages, **options) as campaign:
            campaign.store.append(*known)
            begin = (folder / "rows.jsonl").stat().st_size
            try:
                list(campaign.measure([unpack(packed, one.techniques)]))
            except ShadowbenchError as raised:  # no reason to try again
                error = raised
        rows = [row for row, end in stream_rows(folder / "rows.jsonl") if end > begin]
        images = [file for file in sorted(folder.glob("*/*")) if file.is_file()]
        files = {file.relative_to(folder).as_posix(): file.read_bytes() for file in images}
        return Outcome(None, error, rows, files, messages.calls)


def trace(setup: Setup, packed: bytes) -> Outcome:
    """Trace the truth of a packed block into the cache there; the value is that of `uniform`."""
    with station(setup) as one:
        block = unpack(packed, one.techniques)
    try:
        return Outcome(uniform(block.truth(0)))
    except ShadowbenchError as error:
        return Outcome(error=error)


def call(setup: Setup, method: str, packed: bytes) -> Any:
    """Result of a drawer's method; packed: its arguments."""
    with station(setup) as one:
        found = getattr(GLDrawer(one.worker), method)(*unpack(packed, one.techniques))
        return list(found) if isinstance(found, Iterator) else found
