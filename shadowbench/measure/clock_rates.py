"""The clock rates of a GPU, as its driver tells them."""

import csv
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


def clock_rates(renderer: str) -> dict[str, Any] | None:
    """Driver, present and highest rates in MHz, and the limit of its power in W; None where no driver tells them.

    By `nvidia-smi`, of the GPU whose name begins an OpenGL renderer's. To be called while the GPU is at work.
    """
    program = shutil.which("nvidia-smi")
    if program is None:
        return None
    command = [program, f"--query-gpu=name,{','.join(_FIELDS.values())}", "--format=csv,noheader,nounits"]
    told = subprocess.run(command, capture_output=True, text=True, timeout=60, check=False).stdout
    for name, driver, *numbers in csv.reader(told.splitlines(), skipinitialspace=True):
        if renderer.startswith(name):
            return dict(zip(_FIELDS, (driver, *map(_number, numbers)), strict=True))
    return None


def _number(text: str) -> float | None:
    """None for what a GPU does not tell, `[N/A]`."""
    try:
        return float(text)
    except ValueError:
        return None
