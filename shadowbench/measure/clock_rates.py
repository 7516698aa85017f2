"""The clock rates of a GPU, as its driver tells them."""

import csv
import math
import re
import shutil
import subprocess
from typing import Any

_FIELDS = {
    "driver": "driver_version",
    "graphics_mhz": "clocks.gr",
    "memory_mhz": "clocks.mem",
    "most_graphics_mhz": "clocks.max.gr",
    "power_limit_w": "power.limit",
}
_INNER = re.compile(r"(?:ANGLE|D3D12|virgl|zink[^(]*) ?\((.*)\)")
"""Layers of drivers that name the device in parentheses."""


def device_name(renderer: str) -> str:
    """Name of the device in an OpenGL renderer's, without bus, compiler and version: `NVIDIA H100 80GB HBM3`."""
    layered = _INNER.match(renderer)
    return layered[1] if layered else re.split(r"/PCIe| \(|, \d", renderer)[0]


def clock_rates(renderer: str) -> dict[str, Any] | None:
    """Driver, present and highest rates in MHz, and the limit of its power in W; None where no driver tells them.

    By `nvidia-smi`, of the GPU with the name of an OpenGL renderer's. To be called right after the GPU was at work.
    """
    program = shutil.which("nvidia-smi")
    if program is None:
        return None
    command = [program, f"--query-gpu=name,{','.join(_FIELDS.values())}", "--format=csv,noheader,nounits"]
    try:
        told = subprocess.run(command, capture_output=True, text=True, errors="replace", timeout=60, check=True).stdout
    except (OSError, subprocess.SubprocessError):
        return None  # a driver that does not answer is one that does not tell
    for row in csv.reader(told.splitlines(), skipinitialspace=True):
        if len(row) == 1 + len(_FIELDS) and row[0] == device_name(renderer):
            return dict(zip(_FIELDS, (row[1], *map(_number, row[2:])), strict=True))
    return None


def _number(text: str) -> float | None:
    """None for what a GPU does not tell, `[N/A]`."""
    try:
        number = float(text)
    except ValueError:
        return None
    return number if math.isfinite(number) and number >= 0 else None
