"""`doctor`: is all here that measuring needs, and which clock is used."""

import dataclasses
from typing import Any

from shadowbench.commands.console import out, print_json
from shadowbench.errors import ShadowbenchError
from shadowbench.studies.machine import machine, versions
from shadowbench.studies.session import DeviceInfo
from shadowbench.studies.worker import Worker
from shadowbench.truth.cache import KEPT_BYTES, cache_folder


def doctor_command(as_json: bool) -> int:
    """Print what is found; 3 when there is no OpenGL, else 0."""
    found: dict[str, Any] = {"machine": machine(), "versions": versions()}
    problem = None
    try:
        with Worker() as worker:
            info: DeviceInfo = worker.call("info")
        found["opengl"] = dataclasses.asdict(info) | {"why_this_clock": _why(info)}
    except ShadowbenchError as error:
        problem = str(error)
        found["opengl"] = {"missing": problem}
    cache = cache_folder()
    files = list(cache.glob("*.npz"))
    found["truth_cache"] = {
        "folder": str(cache),
        "truths": len(files),
        "mib": round(sum(file.stat().st_size for file in files) / 2**20, 1),
        "at_most_mib": KEPT_BYTES // 2**20,
    }
    if as_json:
        print_json(found)
    else:
        for title, values in found.items():
            out.print(title.replace("_", " "))
            for name, value in values.items():
                out.print(f"  {name.replace('_', ' ')}: {value}", markup=False, soft_wrap=True)
        out.print("all is here" if problem is None else "no technique can be drawn here; truth and score work")
    return 3 if problem else 0


def _why(info: DeviceInfo) -> str:
    if info.software:
        return "a software renderer's timer queries are wrong; finishing before and after is right"
    return "the GPU's own timer, one query at a time; whole frames and passes come from different draws"
