"""Workers of a cluster: what they are, and which of them may measure."""

import asyncio
import hashlib
import socket
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from typing import TYPE_CHECKING, Any

from shadowbench.cluster.parcel import Setup
from shadowbench.cluster.tasks import station
from shadowbench.data import PACKAGE, data_folder
from shadowbench.errors import ShadowbenchError
from shadowbench.measure.gl_drawer import GLDrawer
from shadowbench.measure.keys import files_in
from shadowbench.measure.machine import machine, versions
from shadowbench.measure.session import DeviceInfo

if TYPE_CHECKING:
    from distributed import Worker as DaskWorker


@dataclass(frozen=True, eq=False)
class WorkerFacts:
    """A Dask worker: its machine, versions and OpenGL device.

    identity: of its executor; reason: why it must not measure, None if it may.
    """

    address: str
    host: str
    machine: Mapping[str, Any]
    versions: Mapping[str, str]
    info: DeviceInfo | None
    identity: Mapping[str, str]
    reason: str | None

    @property
    def resource(self) -> str:
        """Dask resource of workers with equal versions and renderers, of which a task takes the only one."""
        assert self.info is not None
        parts = repr((sorted(self.versions.items()), self.info.renderer))
        return f"shadowbench-{hashlib.sha256(parts.encode()).hexdigest()[:12]}"


async def describe(setup: Setup, expected: Mapping[str, str], dask_worker: "DaskWorker") -> WorkerFacts:
    """Facts about the Dask worker that this runs on; expected: versions that it must have."""

    def facts() -> WorkerFacts:
        found, info = own_versions(), None
        identity: Mapping[str, str] = {}
        differing = [name for name, value in expected.items() if found.get(name) != value]
        reason = None
        if differing:
            name = differing[0]
            reason = f"{name} is {found.get(name)} there and {expected[name]} here"
        else:
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


def own_versions() -> dict[str, str]:
    """Versions that must be the same in all processes: of libraries, and of our sources."""
    return {**versions(), "the source code of shadowbench": _sources()}


@cache
def _sources() -> str:
    digest = hashlib.sha256()
    own = [file for file in files_in(PACKAGE) if "_data" not in file.parts]
    for file in [*own, *files_in(data_folder("shaders"))]:
        digest.update(file.name.encode() + b"\0" + file.read_bytes() + b"\0")
    return digest.hexdigest()[:12]
