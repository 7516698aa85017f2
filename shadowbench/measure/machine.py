"""Which machine, which versions, which command: what a run folder says of how it was made."""

import dataclasses
import datetime
import hashlib
import json
import os
import platform
from collections.abc import Iterable, Sequence
from importlib.metadata import version
from pathlib import Path
from typing import Any

import psutil

from shadowbench import __version__
from shadowbench.files import replace_file
from shadowbench.measure.references import name_of
from shadowbench.measure.row_store import command_line
from shadowbench.measure.rows import SCHEMA, Record
from shadowbench.measure.session import DeviceInfo
from shadowbench.studies.study import Study
from shadowbench.techniques.spec import format_spec

_LIBRARIES = ("moderngl", "pyglm", "numpy", "embreex", "scikit-image", "scipy", "pandas", "trimesh", "pydantic")


def machine() -> dict[str, Any]:
    """Processor, cores, memory, system."""
    return {
        "processor": _processor(),
        "cores": os.cpu_count(),
        "memory_gib": round(psutil.virtual_memory().total / 2**30, 1),
        "system": f"{platform.system()} {platform.release()} {platform.machine()}",
    }


def machine_key(info: DeviceInfo) -> str:
    """Hex key of what times rest on beside a cell's own key: machine, renderer, the clock that a device starts with.

    Not the clock that a row ends with: where queries were given up, the next run begins with queries again.
    """
    parts = {"machine": machine(), "renderer": info.renderer, "clock": info.clock}
    return hashlib.sha256(json.dumps(parts, sort_keys=True).encode()).hexdigest()[:24]


def versions() -> dict[str, str]:
    """Of shadowbench, Python and the libraries that results rest on."""
    return {
        "shadowbench": __version__,
        "python": platform.python_version(),
        **{name: version(name) for name in _LIBRARIES},
    }


def write_run_file(file: Path, info: DeviceInfo, notes: Sequence[str], study: Study, scores: Iterable[Record]) -> None:
    """`run.json`: command, versions, machine, clock, assumptions, and the keys of its cells' score rows."""
    text = {
        "schema": SCHEMA,
        "command": command_line(),
        "finished": datetime.datetime.now(datetime.UTC).isoformat(timespec="seconds"),
        "versions": versions(),
        "machine": machine(),
        "machine_key": machine_key(info),
        "device": dataclasses.asdict(info),
        "clock": info.clock,
        "assumptions": list(notes),
        "study": {
            "scenes": [scene if isinstance(scene, str) else scene.name for scene in study.scenes],
            "specs": [format_spec(spec) for spec in study.specs],
            "reference": name_of(study.reference),
            "view_size": study.view_size,
            "rounds": study.rounds,
            "phases": study.phases,
            "coordinates": study.coordinates,
        },
        "keys": [row["key"] for row in scores],
    }
    with replace_file(file) as beside:
        beside.write_text(json.dumps(text, indent=2, ensure_ascii=False) + "\n", encoding="utf-8", errors="replace")


def _processor() -> str:
    cpuinfo = Path("/proc/cpuinfo")
    if cpuinfo.exists():  # platform.processor() says nothing on Linux
        for line in cpuinfo.read_text().splitlines():
            if line.startswith("model name"):
                return line.split(":", 1)[1].strip()
    return platform.processor() or "unknown"
