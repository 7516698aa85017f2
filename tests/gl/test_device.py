"""The OpenGL context, the driver's properties and arithmetic, and entry points that moderngl lacks."""

import os
import re
import subprocess
import sys
from pathlib import Path
from types import SimpleNamespace
from typing import cast

import moderngl
import pytest

from shadowbench.errors import NoGLError
from shadowbench.gl.device import SIGNATURES, Device, device_of
from shadowbench.gl.program import arithmetic

MAJOR_VERSION, MINOR_VERSION = 0x821B, 0x821C


@pytest.mark.parametrize(
    ("renderer", "software"),
    [("NVIDIA H200", 0), ("Mesa Intel(R) Graphics", 0), ("llvmpipe (LLVM)", 1)],
)
def test_software_is_known_by_its_name(renderer, software) -> None:
    device = Device(None)
    device.renderer = f"{renderer}, 4.6.0"
    assert device.software == software


def test_an_extension_is_available_by_name_or_by_version(device) -> None:
    assert device.has("GL_nobody_has_this", device.version)
    assert not device.has("GL_nobody_has_this", device.version + 10)
    some = min(device.context.extensions)
    assert device.has(some, device.version + 10)


def test_every_declared_entry_point_that_4_1_promises_can_be_loaded(device) -> None:
    newer = {"glClipControl"}
    for name in SIGNATURES.keys() - newer:
        assert device.context.mglo._context.load(name), name


def test_an_opengl_error_names_the_activity(device) -> None:
    device.raw("glBeginQuery", 0xFFFF, 1)
    with pytest.raises(RuntimeError, match="GL_INVALID_ENUM in a test"):
        device.check("a test")
    device.check("a test")  # told once


@pytest.mark.parametrize("bits", [64, 512])
def test_a_vector_width_without_depth_tests_is_refused(bits) -> None:
    info = {"GL_RENDERER": f"llvmpipe (LLVM 15.0.6, {bits} bits)", "GL_VERSION": "4.5 (Core Profile) Mesa 22.3.6"}
    context = SimpleNamespace(info=info, enable_direct=lambda flag: None, release=lambda: None)
    with pytest.raises(NoGLError, match=rf"LP_NATIVE_VECTOR_WIDTH: found {bits}.*allowed: 128, 256"):
        device_of(cast(moderngl.Context, context))


@pytest.mark.slow
def test_code_compiled_for_another_vector_width_is_not_drawn_with(tmp_path) -> None:
    # The volumes' caps: 8 lanes in a buffer for 4 overwrite the heap.
    drawn = ["render", "street", "-t", "shadow-volume", "--view-size", "128", "-q"]
    command = [sys.executable, "-m", "shadowbench", *drawn]
    cached = os.environ | {"MESA_SHADER_CACHE_DIR": str(tmp_path)}
    cached.pop("LP_NATIVE_VECTOR_WIDTH", None)
    for environment in (cached, cached | {"LP_NATIVE_VECTOR_WIDTH": "128"}):
        done = subprocess.run(
            [*command, "-o", tmp_path / "picture.png"], capture_output=True, text=True, env=environment
        )
        assert done.returncode == 0, done.stderr


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
    without = subprocess.run([sys.executable, "-c", program], stdout=subprocess.PIPE, text=True, env=older, check=True)
    assert re.fullmatch("[0-9a-f]{8}", without.stdout.strip())
    assert arithmetic(device) == arithmetic(device) != without.stdout.strip()
