"""The OpenGL context, the driver's properties and arithmetic, and entry points that moderngl lacks."""

import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

from shadowbench.gl.device import Device
from shadowbench.gl.program import arithmetic


@pytest.mark.parametrize(
    ("renderer", "software"),
    [("NVIDIA H200", 0), ("Mesa Intel(R) Graphics", 0), ("llvmpipe (LLVM)", 1)],
)
def test_software_is_known_by_its_name(renderer, software) -> None:
    device = Device(None)
    device.renderer = f"{renderer}, 4.6.0"
    assert device.software == software


def test_an_opengl_error_names_the_activity(device) -> None:
    device.raw("glBeginQuery", 0xFFFF, 1)
    with pytest.raises(RuntimeError, match="GL_INVALID_ENUM in a test"):
        device.check("a test")
    device.check("a test")  # told once


def test_a_processor_without_fused_multiply_add_is_told_from_one_with_it(device) -> None:
    """By the bits of a small image; the driver has the same name on both."""
    cpu = Path("/proc/cpuinfo")
    if "llvmpipe" not in device.renderer or not cpu.exists() or " fma " not in cpu.read_text():
        pytest.skip("Mesa's software renderer on a processor with fused multiply-add")
    program = (
        "from shadowbench.gl.device import open_device; from shadowbench.gl.program import arithmetic;"
        "print(arithmetic(open_device()))"
    )
    older = os.environ | {"GALLIUM_OVERRIDE_CPU_CAPS": "sse4.1", "LP_NATIVE_VECTOR_WIDTH": "128"}
    older["MESA_SHADER_CACHE_DISABLE"] = "true"
    without = subprocess.run([sys.executable, "-c", program], stdout=subprocess.PIPE, text=True, env=older, check=True)
    assert re.fullmatch("[0-9a-f]{8}", without.stdout.strip())
    assert arithmetic(device) == arithmetic(device) != without.stdout.strip()
