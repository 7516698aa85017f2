"""What runs on a Dask worker: campaigns, drawn by a worker process of ours that it keeps between them."""

import atexit
import hashlib
import io
import pickle
import socket
import threading
from collections.abc import Callable, Mapping, Sequence
from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, NamedTuple

from shadowbench.errors import ShadowbenchError
from shadowbench.files import PACKAGE, data_folder
from shadowbench.measure.campaign import Campaign, Shadows, shadows_in
from shadowbench.measure.cells import Block
from shadowbench.measure.drawer import DeviceInfo, Limits
from shadowbench.measure.gl_drawer import GLDrawer
from shadowbench.measure.keys import files_in, plugin_folder, plugin_sources
from shadowbench.measure.machine import machine, versions
from shadowbench.measure.plugin_output import techniques_with
from shadowbench.measure.row_store import stream_rows
from shadowbench.measure.rows import Record
from shadowbench.measure.worker import Worker
from shadowbench.plugin.spec import Spec, parse_spec
from shadowbench.truths.cache import cached_truth


class Setup(NamedTuple):
    """What a worker process is started with. plugins: path of each in a folder, and bytes of all files there."""

    plugins: Sequence[tuple[str, Mapping[str, bytes]]]
    limits: Limits


class WorkerFacts(NamedTuple):
    """A Dask worker: its machine, device, and the identity of its drawer."""

    host: str
    machine: Mapping[str, Any]
    info: DeviceInfo
    identity: Mapping[str, str]


class Outcome(NamedTuple):
    """What a task made: rows, bytes of images by path in the run folder, and notes."""

    rows: Sequence[Record]
    images: Mapping[str, bytes]
    notes: Sequence[str]


def plugin_files(plugin: Path) -> tuple[str, Mapping[str, bytes]]:
    """A plug-in, which must exist, as in `Setup.plugins`: with all files that its rows' keys depend on."""
    plugin = plugin.resolve()
    root = plugin_folder(plugin).parent
    files = dict.fromkeys([plugin, *plugin_sources(plugin)])
    return str(plugin.relative_to(root)), {str(file.relative_to(root)): file.read_bytes() for file in files}


class _Pickler(pickle.Pickler):
    """Pickler that writes specs as text: the classes of plug-ins have no name that another process knows."""

    def persistent_id(self, thing: object) -> str | None:
        return thing.full_text if isinstance(thing, Spec) else None


def pack(*things: object) -> bytes:
    """Arguments of a task as bytes."""
    stream = io.BytesIO()
    _Pickler(stream, pickle.HIGHEST_PROTOCOL).dump(things)
    return stream.getvalue()


class Station:
    """The worker process with a setup, and the plug-ins that it draws. There is one at a time, for one thread."""

    lock = threading.RLock()
    current: "Station | None" = None

    def __init__(self, setup: Setup) -> None:
        self.setup = setup
        self.folder = TemporaryDirectory(prefix="shadowbench-", ignore_cleanup_errors=True)
        plugins = []
        for number, (path, files) in enumerate(setup.plugins):
            plugins.append(Path(self.folder.name, str(number), path))
            for name, data in files.items():
                file = Path(self.folder.name, str(number), name)
                file.parent.mkdir(parents=True, exist_ok=True)
                file.write_bytes(data)
        self.techniques = techniques_with(plugins)
        self.worker = Worker(plugins, setup.limits)

    def unpack(self, data: bytes) -> Any:
        """The arguments of `pack`."""
        unpickler = pickle.Unpickler(io.BytesIO(data))
        unpickler.persistent_load = lambda text: parse_spec(text, self.techniques)  # type: ignore[method-assign]
        return unpickler.load()


@atexit.register
def close_station() -> None:
    """End the worker process and remove the plug-ins."""
    with Station.lock:
        one, Station.current = Station.current, None
        if one is not None:
            one.worker.stop()
            one.folder.cleanup()


def do(setup: Setup, function: Callable[..., Any], packed: bytes) -> Any:
    """Result of `function(worker, *arguments)`, with the worker process of a setup."""
    with Station.lock:
        if Station.current is None or Station.current.setup != setup:
            close_station()
            Station.current = Station(setup)
        return function(Station.current.worker, *Station.current.unpack(packed))


class _Notes(list[str]):
    """Reporter that keeps notes. Steps are counted where the command runs."""

    def note(self, line: str) -> None:
        self.append(line)

    def stage(self, name: str, total: int | None) -> None: ...

    def step(self, what: str) -> None: ...


def measure(worker: Worker, block: Block, known: Sequence[Record], options: Mapping[str, Any]) -> Outcome:
    """Measure a block by a campaign with these options. known: its rows."""
    with TemporaryDirectory(prefix="shadowbench-") as name:
        folder, notes = Path(name), _Notes()
        with Campaign(folder, GLDrawer(worker), notes, **options) as campaign:
            campaign.store.append(*known)
            begin = campaign.store.file.stat().st_size
            list(campaign.measure([block]))
            rows = [row for row, end in stream_rows(campaign.store.file) if end > begin]
        images = {file.relative_to(folder).as_posix(): file.read_bytes() for file in sorted(folder.glob("*/*.png"))}
        return Outcome(rows, images, list(notes))


def trace(worker: Worker, block: Block) -> Shadows:
    """What a block's view shows, whose truth is in the cache there then."""
    return shadows_in(cached_truth(block.view))


def call(worker: Worker, method: Callable[..., Any], arguments: Sequence[Any], options: Mapping[str, Any]) -> Any:
    """Result of a worker's call."""
    return worker.call(method, *arguments, **options)


def describe(worker: Worker, expected: Mapping[str, str]) -> WorkerFacts:
    """Facts about this Dask worker. Raises ShadowbenchError without OpenGL, or for other versions than `expected`."""
    found = own_versions()
    for name, value in expected.items():
        if found.get(name) != value:
            raise ShadowbenchError(f"{name} is {found.get(name)} there and {value} here")
    return WorkerFacts(socket.gethostname(), machine(), worker.info, GLDrawer(worker).device_identity)


@cache
def own_versions() -> dict[str, str]:
    """Versions that must be the same in all processes: of libraries, and of our sources."""
    digest = hashlib.sha256()
    own = [file for file in files_in(PACKAGE) if "_data" not in file.parts]
    for file in [*own, *files_in(data_folder("shaders"))]:
        digest.update(file.name.encode() + b"\0" + file.read_bytes() + b"\0")
    return {**versions(), "the source code of shadowbench": digest.hexdigest()[:12]}
