"""Provenance of a run folder: machine, versions and command."""

import dataclasses
import datetime
import hashlib
import json
import os
import platform
import re
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

import psutil

from shadowbench.files import replace_file
from shadowbench.measure.drawer import Drawer
from shadowbench.measure.row_store import command_line
from shadowbench.measure.rows import SCHEMA, StudyFacts, escaped
from shadowbench.versions import VERSION, installed

_LIBRARIES = ("moderngl", "pyglm", "numpy", "embreex", "scikit-image", "scipy", "pandas", "trimesh", "pydantic")


def machine() -> dict[str, Any]:
    """Processor, cores, memory and operating system."""
    return {
        "processor": _processor(),
        "cores": os.cpu_count(),
        "memory_gib": round(psutil.virtual_memory().total / 2**30, 1),
        "system": f"{platform.system()} {platform.release()} {platform.machine()}",
    }


def machine_key(drawer: Drawer) -> str:
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


def write_run_file(file: Path, drawer: Drawer, notes: Sequence[str], study: StudyFacts, keys: Iterable[str]) -> None:
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
        temporary.write_text(
            json.dumps(escaped(text), indent=2, ensure_ascii=False) + "\n", encoding="utf-8", errors="replace"
        )


def _processor() -> str:
    cpuinfo = Path("/proc/cpuinfo")  # platform.processor() is empty on Linux
    named = re.search(r"^model name\s*: *(.*)", cpuinfo.read_text() if cpuinfo.exists() else "", re.MULTILINE)
    return named[1].strip() if named else platform.processor() or "unknown"
