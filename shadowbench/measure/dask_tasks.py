"""What runs on a Dask worker: campaigns, drawn by a worker process of ours that it keeps between them."""

import asyncio
import atexit
import hashlib
import io
import pickle
import socket
import threading
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, Any

from shadowbench.errors import ShadowbenchError
from shadowbench.files import PACKAGE, data_folder
from shadowbench.measure.campaign import Campaign, uniform
from shadowbench.measure.failures import Limits
from shadowbench.measure.gl_drawer import GLDrawer
from shadowbench.measure.keys import files_in, plugin_folder, plugin_sources
from shadowbench.measure.machine import machine, versions
from shadowbench.measure.plugin_output import techniques_with
from shadowbench.measure.row_files import stream_rows
from shadowbench.measure.rows import Record
from shadowbench.measure.session import DeviceInfo
from shadowbench.measure.worker import Worker
from shadowbench.plugin.spec import Spec, parse_spec

if TYPE_CHECKING:
    from distributed import Worker as DaskWorker

PluginFiles = tuple[str, tuple[tuple[str, bytes], ...]]
"""A plug-in's path in a folder, and by path there all files that its rows' keys depend on."""


@dataclass(frozen=True)
class Setup:
    """What a worker process is started with. number: of the program that asks for it."""

    number: str
    plugins: tuple[PluginFiles, ...]
    limits: Limits


@dataclass(frozen=True, eq=False)
class WorkerFacts:
    """A Dask worker: its machine, versions and OpenGL device.

    identity: of its drawer; reason: why it must not measure, None if it may.
    """

    address: str
    host: str
    machine: Mapping[str, Any]
    versions: Mapping[str, str]
    info: DeviceInfo | None
    identity: Mapping[str, str]
    reason: str | None

    @property
    def renderer(self) -> str | None:
        """Name of its renderer; None if it must not measure."""
        return None if self.info is None else self.info.renderer

    @property
    def resource(self) -> str:
        """Dask resource of workers with equal versions and renderers, of which a task takes the only one."""
        parts = repr((sorted(self.versions.items()), self.renderer))
        return f"shadowbench-{hashlib.sha256(parts.encode()).hexdigest()[:12]}"


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


def plugin_files(plugin: Path) -> PluginFiles:
    """The files of a plug-in, which must exist."""
    plugin = plugin.resolve()
    root = plugin_folder(plugin).parent
    files = dict.fromkeys([plugin, *plugin_sources(plugin)])
    return str(plugin.relative_to(root)), tuple((str(file.relative_to(root)), file.read_bytes()) for file in files)


class _Pickler(pickle.Pickler):
    """Pickler that writes specs as text: the classes of plug-ins have no name that another process knows."""

    def persistent_id(self, thing: object) -> str | None:
        return thing.full_text if isinstance(thing, Spec) else None


def pack(thing: object) -> bytes:
    """A thing as bytes."""
    stream = io.BytesIO()
    _Pickler(stream, pickle.HIGHEST_PROTOCOL).dump(thing)
    return stream.getvalue()


class _Station:
    """The worker process with a setup, and the plug-ins that it draws."""

    lock = threading.RLock()
    current: "_Station | None" = None

    def __init__(self, setup: Setup) -> None:
        self.setup = setup
        self._folder = TemporaryDirectory(prefix="shadowbench-", ignore_cleanup_errors=True)
        plugins = []
        for number, (path, files) in enumerate(setup.plugins):
            folder = Path(self._folder.name, str(number))
            for name, data in files:
                (folder / name).parent.mkdir(parents=True, exist_ok=True)
                (folder / name).write_bytes(data)
            plugins.append(folder / path)
        self.techniques = techniques_with(plugins)
        self.worker = Worker(plugins, setup.limits)

    def unpack(self, data: bytes) -> Any:
        """The thing of `pack`."""
        unpickler = pickle.Unpickler(io.BytesIO(data))
        unpickler.persistent_load = lambda text: parse_spec(text, self.techniques)  # type: ignore[method-assign]
        return unpickler.load()

    def close(self) -> None:
        """End the worker process and remove the plug-ins."""
        self.worker.stop()
        self._folder.cleanup()


@contextmanager
def station(setup: Setup) -> Iterator[_Station]:
    """The station with a setup, for one thread at a time; that of another setup is closed."""
    with _Station.lock:
        if _Station.current is None or _Station.current.setup != setup:
            close_station()
            _Station.current = _Station(setup)
        yield _Station.current


def close_station(number: str | None = None) -> None:
    """End the worker process, if it was started for the program of this number; None for any."""
    with _Station.lock:
        one = _Station.current
        if one is not None and number in (None, one.setup.number):
            _Station.current = None
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
        with Campaign(folder, GLDrawer(one.worker), messages, **options) as campaign:
            campaign.store.append(*known)
            begin = (folder / "rows.jsonl").stat().st_size
            try:
                list(campaign.measure([one.unpack(packed)]))
            except ShadowbenchError as raised:  # no reason to try again
                error = raised
        rows = [row for row, end in stream_rows(folder / "rows.jsonl") if end > begin]
        images = [file for file in sorted(folder.glob("*/*")) if file.is_file()]
        files = {file.relative_to(folder).as_posix(): file.read_bytes() for file in images}
        return Outcome(None, error, rows, files, messages.calls)


def trace(setup: Setup, packed: bytes) -> Outcome:
    """Trace the truth of a packed block into the cache there; the value is that of `uniform`."""
    with station(setup) as one:
        block = one.unpack(packed)
    try:
        return Outcome(uniform(block.truth(0)))
    except ShadowbenchError as error:
        return Outcome(error=error)


def call(setup: Setup, method: str, packed: bytes) -> Any:
    """Result of a drawer's method; packed: its arguments."""
    with station(setup) as one:
        found = getattr(GLDrawer(one.worker), method)(*one.unpack(packed))
        return list(found) if isinstance(found, Iterator) else found


async def describe(setup: Setup, expected: Mapping[str, str], dask_worker: "DaskWorker") -> WorkerFacts:
    """Facts about the Dask worker that this runs on; expected: versions that it must have."""

    def facts() -> WorkerFacts:
        found, info, reason = own_versions(), None, None
        identity: Mapping[str, str] = {}
        for name, value in expected.items():
            if reason is None and found.get(name) != value:
                reason = f"{name} is {found.get(name)} there and {value} here"
        if reason is None:
            try:
                with station(setup) as one:
                    info, identity = one.worker.info, GLDrawer(one.worker).identity
            except ShadowbenchError as error:
                reason = str(error)
        return WorkerFacts(dask_worker.address, socket.gethostname(), machine(), found, info, identity, reason)

    return await asyncio.get_running_loop().run_in_executor(dask_worker.executor, facts)


async def admit(resource: str, dask_worker: "DaskWorker") -> None:
    """Give the Dask worker that this runs on a resource, by which tasks choose their workers, one at a time.

    Tasks that waited for such a worker are only assigned when one begins to run, hence the pause.
    """
    from distributed.core import Status

    dask_worker.status = Status.paused
    await dask_worker.set_resources(**{resource: 1})
    dask_worker.status = Status.running


@cache
def own_versions() -> dict[str, str]:
    """Versions that must be the same in all processes: of libraries, and of our sources."""
    digest = hashlib.sha256()
    own = [file for file in files_in(PACKAGE) if "_data" not in file.parts]
    for file in [*own, *files_in(data_folder("shaders"))]:
        digest.update(file.name.encode() + b"\0" + file.read_bytes() + b"\0")
    return {**versions(), "the source code of shadowbench": digest.hexdigest()[:12]}
