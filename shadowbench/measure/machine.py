"""The computer that measures: its facts in a run folder, and what `doctor` says of it, its timing noise among that."""

import dataclasses
import datetime
import hashlib
import json
import os
import platform
import re
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import psutil

from shadowbench.errors import InputError, ShadowbenchError
from shadowbench.files import cache_folder, check_outputs, replace_file
from shadowbench.gl.clock import WALL
from shadowbench.measure.rows import SCHEMA, Record, command_line
from shadowbench.measure.session import CellRequest, Session
from shadowbench.measure.worker import CellFailed, DeviceInfo, Worker
from shadowbench.scenes.library import load_scene
from shadowbench.scenes.model import view_of
from shadowbench.truths.cache import KEPT_BYTES
from shadowbench.truths.embree import default_device
from shadowbench.versions import VERSION, installed

if TYPE_CHECKING:
    from shadowbench.measure.gl_drawer import GLDrawer

_LIBRARIES = ("moderngl", "pyglm", "numpy", "embreex", "scikit-image", "scipy", "pandas", "trimesh", "pydantic")


def machine() -> dict[str, Any]:
    """Processor, cores, memory and operating system."""
    return {
        "processor": _processor(),
        "cores": os.cpu_count(),
        "memory_gib": round(psutil.virtual_memory().total / 2**30, 1),
        "system": f"{platform.system()} {platform.release()} {platform.machine()}",
    }


def machine_key(drawer: "GLDrawer") -> str:
    """Hex key of what a drawer's times depend on besides the cell's key: machine, renderer, the initial clock.

    Not the clock of a row: a device that gave up timer queries in one run tries them again in the next.
    """
    info = drawer.info
    parts = {"machine": drawer.machine, "renderer": info.renderer, "clock": info.clock}
    return hashlib.sha256(json.dumps(parts, sort_keys=True).encode()).hexdigest()[:24]


def versions() -> dict[str, str]:
    """Versions of shadowbench, Python and the libraries that results depend on."""
    libraries = {name: installed(name) for name in _LIBRARIES}
    return {"shadowbench": VERSION, "python": platform.python_version(), **libraries}


def write_run_file(file: Path, drawer: "GLDrawer", notes: Sequence[str], study: Record, keys: Iterable[str]) -> None:
    """Write `run.json`: command, versions, machine, clock, assumptions, study and the keys of its cells."""
    text = {
        "schema": SCHEMA,
        "command": command_line(),
        "finished": datetime.datetime.now(datetime.UTC).isoformat(timespec="seconds"),
        "versions": versions(),
        "machine": drawer.machine,
        "machine_key": machine_key(drawer),
        "device": dataclasses.asdict(drawer.info),
        "clock": drawer.info.clock,
        "assumptions": list(notes),
        "study": study,
        "keys": list(keys),
    }
    with replace_file(file) as temporary:
        temporary.write_text(json.dumps(text, indent=2, ensure_ascii=False) + "\n", encoding="utf-8", errors="replace")


def _processor() -> str:
    cpuinfo = Path("/proc/cpuinfo")  # platform.processor() is empty on Linux
    named = re.search(r"^model name\s*: *(.*)", cpuinfo.read_text() if cpuinfo.exists() else "", re.MULTILINE)
    return named[1].strip() if named else platform.processor() or "unknown"


ROUNDS = 45
MAX_NOISE = 1.05


def diagnosis() -> dict[str, dict[str, Any]]:
    """Facts about the machine, versions, OpenGL, Embree and the truth cache, by section and name.

    `missing` in `opengl` says why nothing can be drawn; `problem` in `truth_cache`, why truths are not cached.
    """
    found: dict[str, dict[str, Any]] = {"machine": machine(), "versions": versions()}
    try:
        with Worker() as worker:
            found["opengl"] = dataclasses.asdict(worker.info) | _noise(worker)
    except ShadowbenchError as error:
        found["opengl"] = {"missing": str(error)}
    found["embree"] = {
        "rays_at_once": f"{default_device().width}, native to this processor",
        "instruction_set": os.environ.get("SHADOWBENCH_ISA") or "the processor's best; SHADOWBENCH_ISA chooses another",
    }
    cache = cache_folder("truth")
    files = list(cache.glob("*.npz"))
    found["truth_cache"] = {
        "folder": str(cache),
        "truths": len(files),
        "mib": round(sum(file.stat().st_size for file in files) / 2**20, 1),
        "at_most_mib": KEPT_BYTES // 2**20,
    }
    try:
        cache.mkdir(parents=True, exist_ok=True)
        check_outputs(".npz", cache / "truth.npz")
    except (OSError, InputError) as error:
        found["truth_cache"]["problem"] = str(error)
    return found


def measure_noise(worker: Worker) -> tuple[float, str]:
    """Median ratio of a cell's times to its own, timed as if it were two, at least 1; the clock. Raises CellFailed."""
    scene = load_scene("cube-on-plane")
    view = view_of(scene, scene.cameras[0], scene.lights[0], 512)
    for _ in range(2):
        worker.call(Session.prepare_timing, view, CellRequest("shadow-map:size=1024"))
    worker.call(Session.raise_clocks)
    pairs = [[worker.call(Session.time_frame, index) for index in range(2)] for _ in range(ROUNDS)]
    worker.call(Session.release_timed)
    clock = pairs[-1][1].clock  # a GPU whose timer is wrong goes over to the wall, for good
    ratio = float(np.median([one.ms / other.ms for one, other in pairs if one.clock == other.clock]))
    return max(ratio, 1 / ratio), clock


def _noise(worker: Worker) -> dict[str, Any]:
    try:
        ratio, clock = measure_noise(worker)
    except CellFailed as error:  # the rest of the diagnosis still counts
        return {"noise": f"not measured: {error}"}
    noise = f"{ratio:.4f}, the ratio of a shadow map's time to its own over {ROUNDS} rounds"
    if ratio > MAX_NOISE:
        noise += "; something else runs here, and smaller differences mean nothing"
    return {"clock": clock, "why_this_clock": _clock_reason(worker.info, clock), "noise": noise}


def _clock_reason(info: DeviceInfo, clock: str) -> str:
    if info.software:
        return "a software renderer's timer queries are wrong; finishing before and after is right"
    if clock == WALL:
        return "the GPU's timer said more than the wall clock did; finishing before and after is right"
    return "the GPU's own timer, one query at a time; whole frames and passes come from different draws"
