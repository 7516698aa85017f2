"""What `doctor` computes: whether all is here that measuring needs, and which clock is used."""

import dataclasses
from pathlib import Path
from typing import Any

from shadowbench.errors import InputError, ShadowbenchError
from shadowbench.files import check_outputs
from shadowbench.gl.clock import WALL
from shadowbench.measure.executor import CellFailed
from shadowbench.measure.machine import machine, versions
from shadowbench.measure.noise import ALLOWED, CELL, ROUNDS, SCENE, noise
from shadowbench.measure.session import DeviceInfo
from shadowbench.measure.worker import Worker
from shadowbench.truths.cache import KEPT_BYTES, cache_folder


def examination() -> dict[str, dict[str, Any]]:
    """Facts of the machine, versions, OpenGL and the cache of truths, by part and name.

    `missing` in `opengl` says why nothing can be drawn, `problem` in `truth_cache` why no truth is kept.
    """
    found: dict[str, dict[str, Any]] = {"machine": machine(), "versions": versions()}
    try:
        with Worker() as worker:
            info = worker.info
            found["opengl"] = dataclasses.asdict(info) | {"why_this_clock": _why(info, info.clock)}
            found["opengl"] |= clock_noise(worker, info)
    except ShadowbenchError as error:
        found["opengl"] = {"missing": str(error)}
    cache = cache_folder()
    files = list(cache.glob("*.npz"))
    found["truth_cache"] = {
        "folder": str(cache),
        "truths": len(files),
        "mib": round(sum(file.stat().st_size for file in files) / 2**20, 1),
        "at_most_mib": KEPT_BYTES // 2**20,
    }
    unkept = _unkept(cache)
    if unkept is not None:
        found["truth_cache"]["problem"] = unkept
    return found


def _unkept(folder: Path) -> str | None:
    """Why no truth can be kept in a folder, or None."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
        check_outputs(".npz", folder / "truth.npz")
    except (OSError, InputError) as error:
        return str(error)
    return None


def clock_noise(worker: Worker, info: DeviceInfo) -> dict[str, Any]:
    """What timing a cell against itself finds, and by which clock: queries may turn out to be impossible."""
    try:
        found = noise(worker)
    except CellFailed as error:  # all else is still to be told
        return {"noise": f"not measured: {error}"}
    told: dict[str, Any] = {}
    if found.clock != info.clock:
        told |= {"clock": found.clock, "why_this_clock": _why(info, found.clock)}
    told |= {
        "noise": round(found.ratio, 4),
        f"noise_worst_of_{ROUNDS}_rounds": round(found.worst, 4),
        "noise_is": f"the ratio of {CELL} on {SCENE} to itself, timed as if it were two, over {found.n} rounds",
    }
    if found.ratio > ALLOWED:
        told["noise_is"] += f"; more than {ALLOWED}: something else runs here, and smaller differences mean nothing"
    return told


def _why(info: DeviceInfo, clock: str) -> str:
    if info.software:
        return "a software renderer's timer queries are wrong; finishing before and after is right"
    if clock == WALL:
        return "the GPU's timer said more than the wall clock did; finishing before and after is right"
    return "the GPU's own timer, one query at a time; whole frames and passes come from different draws"
