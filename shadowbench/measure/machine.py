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
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
import psutil

from shadowbench.errors import InputError, ShadowbenchError
from shadowbench.files import cache_folder, check_outputs, replace_file
from shadowbench.gl.clock import WALL, Sample
from shadowbench.measure.rows import SCHEMA, Record, command_line
from shadowbench.measure.session import CellRequest, Session
from shadowbench.measure.worker import CellFailed, DeviceInfo, Worker
from shadowbench.scenes.library import load_scene
from shadowbench.scenes.model import view_of
from shadowbench.truths.cache import KEPT_BYTES
from shadowbench.truths.embree import packet_width
from shadowbench.versions import VERSION, installed

if TYPE_CHECKING:
    from shadowbench.measure.campaign import Drawer

_LIBRARIES = ("moderngl", "pyglm", "numpy", "embreex", "scikit-image", "scipy", "pandas", "trimesh", "pydantic")


def machine() -> dict[str, Any]:
    """Processor, cores, memory and operating system."""
    return {
        "processor": _processor(),
        "cores": os.cpu_count(),
        "memory_gib": round(psutil.virtual_memory().total / 2**30, 1),
        "system": f"{platform.system()} {platform.release()} {platform.machine()}",
    }


def machine_key(drawer: "Drawer") -> str:
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


def write_run_file(file: Path, drawer: "Drawer", notes: Sequence[str], study: Record, keys: Iterable[str]) -> None:
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


SPEC = "shadow-map:size=1024"  # the default reference, in the default view size of a study
SCENE, VIEW_SIZE, ROUNDS = "cube-on-plane", 512, 9
SERIES = 5
MAX_NOISE = 1.05


class Noise(NamedTuple):
    """Median ratio of a cell's time to its own over interleaved rounds, inverted if below 1; 1 means no noise.

    ratio: over all `n` rounds; worst: largest ratio over the SERIES series of ROUNDS rounds.
    """

    ratio: float
    worst: float
    n: int
    frame_ms: float
    clock: str


def measure_noise(worker: Worker) -> Noise:
    """Prepare one cell twice and time the two in turn. Raises CellFailed."""
    scene = load_scene(SCENE)
    view = view_of(scene, scene.cameras[0], scene.lights[0], VIEW_SIZE)
    for _ in range(2):
        worker.call(Session.prepare_timing, view, CellRequest(SPEC))
    worker.call(Session.raise_clocks)
    samples: list[list[Sample]] = []
    while len(samples) < SERIES * ROUNDS:
        samples.append([worker.call(Session.time_frame, index) for index in range(2)])
        if len({sample.clock for pair in samples for sample in pair}) > 1:
            samples = []  # the clock changed from queries to the wall, for good: times of two clocks have no ratio
    worker.call(Session.release_timed)
    ms = np.array([[sample.ms for sample in pair] for pair in samples])
    ratios = ms[:, 0] / ms[:, 1]
    series = [_at_least_one(part) for part in np.split(ratios, SERIES)]
    return Noise(_at_least_one(ratios), max(series), len(ratios), float(np.median(ms)), samples[0][0].clock)


def _at_least_one(ratios: np.ndarray) -> float:
    """Median of the ratios, or its inverse if that is larger."""
    median = float(np.median(ratios))
    return max(median, 1 / median)


def diagnosis() -> dict[str, dict[str, Any]]:
    """Facts about the machine, versions, OpenGL, Embree and the truth cache, by section and name.

    `missing` in `opengl` says why nothing can be drawn; `problem` in `truth_cache`, why truths are not cached.
    """
    found: dict[str, dict[str, Any]] = {"machine": machine(), "versions": versions()}
    try:
        with Worker() as worker:
            info = worker.info
            found["opengl"] = dataclasses.asdict(info) | {"why_this_clock": _clock_reason(info, info.clock)}
            found["opengl"] |= clock_noise(worker, info)
    except ShadowbenchError as error:
        found["opengl"] = {"missing": str(error)}
    width = packet_width()
    found["embree"] = {
        "rays_at_once": f"{width}, native to this processor" if width > 1 else "1: Embree's library cannot be loaded",
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


def clock_noise(worker: Worker, info: DeviceInfo) -> dict[str, Any]:
    """Timing noise of a cell against itself, and the clock if it changed: timer queries may prove unusable."""
    try:
        found = measure_noise(worker)
    except CellFailed as error:  # the rest of the diagnosis still counts
        return {"noise": f"not measured: {error}"}
    values: dict[str, Any] = {
        "noise": round(found.ratio, 4),
        f"noise_worst_of_{ROUNDS}_rounds": round(found.worst, 4),
        "noise_is": f"the ratio of {SPEC} on {SCENE} to itself, timed as if it were two, over {found.n} rounds",
    }
    if found.clock != info.clock:
        values = {"clock": found.clock, "why_this_clock": _clock_reason(info, found.clock), **values}
    if found.ratio > MAX_NOISE:
        values["noise_is"] += f"; more than {MAX_NOISE}: something else runs here, and smaller differences mean nothing"
    return values


def _clock_reason(info: DeviceInfo, clock: str) -> str:
    if info.software:
        return "a software renderer's timer queries are wrong; finishing before and after is right"
    if clock == WALL:
        return "the GPU's timer said more than the wall clock did; finishing before and after is right"
    return "the GPU's own timer, one query at a time; whole frames and passes come from different draws"
