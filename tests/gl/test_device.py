"""The OpenGL context, the driver's properties and arithmetic, and entry points that moderngl lacks."""

import gc
import os
import re
import subprocess
import sys
from functools import partial
from pathlib import Path
from types import SimpleNamespace
from typing import cast

import moderngl
import psutil
import pytest

from shadowbench.errors import NoGLError
from shadowbench.gl import device as device_module
from shadowbench.gl.arithmetic import arithmetic
from shadowbench.gl.device import SIGNATURES, Device, RawGL, device_of, open_device

MAJOR_VERSION, MINOR_VERSION = 0x821B, 0x821C


def test_device_says_what_it_is(device) -> None:
    major, minor = device.raw.integer(MAJOR_VERSION), device.raw.integer(MINOR_VERSION)
    assert device.version == 100 * major + 10 * minor >= 410
    assert re.search(r"\d+\.\d+", device.renderer), "rows of different drivers must not mix"
    assert device.max_map_size >= 4096
    assert 4 <= device.subpixel_bits <= 16


@pytest.mark.parametrize(
    ("renderer", "software"),
    [("NVIDIA H200", 0), ("Apple M2", 0), ("Mesa Intel(R) Graphics", 0), ("llvmpipe (LLVM)", 1)],
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


def test_a_missing_entry_point_is_named() -> None:
    context = SimpleNamespace(mglo=SimpleNamespace(_context=SimpleNamespace(load_opengl_function=lambda name: 0)))
    with pytest.raises(NotImplementedError, match="the OpenGL driver has no glSlowDown"):
        RawGL(context, {"glSlowDown": ()})("glSlowDown")


def test_an_opengl_error_names_the_activity(device) -> None:
    device.raw("glBeginQuery", 0xFFFF, 1)
    with pytest.raises(RuntimeError, match="GL_INVALID_ENUM in a test"):
        device.check("a test")
    device.check("a test")  # told once


def test_no_context_says_what_to_install(monkeypatch) -> None:
    def fail(**_: object) -> None:
        raise Exception("libEGL.so not loaded")

    monkeypatch.setattr(device_module.moderngl, "create_context", fail)
    with pytest.raises(NoGLError, match=r"libEGL\.so not loaded.*apt-get install libegl1"):
        open_device()


@pytest.mark.parametrize("bits", [64, 512])
def test_a_vector_width_without_depth_tests_is_refused(bits) -> None:
    info = {"GL_RENDERER": f"llvmpipe (LLVM 15.0.6, {bits} bits)", "GL_VERSION": "4.5 (Core Profile) Mesa 22.3.6"}
    context = SimpleNamespace(info=info, enable_direct=lambda flag: None, release=lambda: None)
    with pytest.raises(NoGLError, match=rf"LP_NATIVE_VECTOR_WIDTH: found {bits}.*allowed: 128, 256"):
        device_of(cast(moderngl.Context, context))


def test_a_window_keeps_from_shaders_of_another_vector_width(monkeypatch) -> None:
    window = pytest.importorskip("shadowbench.viewer.window")
    monkeypatch.setenv("LP_NATIVE_VECTOR_WIDTH", "128")
    monkeypatch.setenv("MESA_SHADER_CACHE_DISABLE", "")  # so that it is restored
    monkeypatch.delenv("MESA_SHADER_CACHE_DISABLE")
    found = []
    monkeypatch.setattr(
        window, "GlfwWindow", lambda **_: found.append(os.environ["MESA_SHADER_CACHE_DISABLE"]) or SimpleNamespace()
    )
    window._open("a window")
    assert found == ["true"]


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


@pytest.mark.slow
def test_memory_does_not_grow_over_views_of_a_scene(device, studio, builtin) -> None:
    def cycle() -> None:
        shot = studio.shot(builtin("cube-on-plane", 256))
        shot.triangle.sum()
        studio.release()
        studio.__init__(device)

    for _ in range(10):
        cycle()
    gc.collect()
    before = psutil.Process().memory_info().rss
    for _ in range(50):
        cycle()
    gc.collect()
    grown = psutil.Process().memory_info().rss - before
    assert grown < 50 * 256 * 256 * 4, "less than the smallest texture of a view, each time"


CPU = Path("/proc/cpuinfo")
FUSED = CPU.exists() and " fma " in CPU.read_text()


@pytest.fixture
def elsewhere(device: Device) -> partial[str]:
    """The arithmetic in a process with other variables of Mesa's software renderer."""
    if "llvmpipe" not in device.renderer or not FUSED:
        pytest.skip("Mesa's software renderer on a processor with fused multiply-add")
    program = (
        "from shadowbench.gl.device import open_device; from shadowbench.gl.arithmetic import arithmetic;"
        "print(arithmetic(open_device()))"
    )
    return partial(_output, program)


def _output(program: str, **variables: str) -> str:
    done = subprocess.run([sys.executable, "-c", program], stdout=subprocess.PIPE, env=os.environ | variables)
    return done.stdout.decode().strip()


def test_a_driver_calculates_alike_each_time(device) -> None:
    assert re.fullmatch("[0-9a-f]{8}", arithmetic(device))
    assert arithmetic(device) == arithmetic(device)


def test_without_fused_multiply_add_a_driver_of_the_same_name_calculates_differently(device, elsewhere) -> None:
    without = elsewhere(GALLIUM_OVERRIDE_CPU_CAPS="sse4.1", LP_NATIVE_VECTOR_WIDTH="128")
    assert re.fullmatch("[0-9a-f]{8}", without)
    assert without != arithmetic(device)


@pytest.mark.slow
@pytest.mark.parametrize("threads", ["1", "8"])
def test_neither_vector_width_nor_threads_nor_avx_512_change_how_a_driver_calculates(
    device, elsewhere, threads
) -> None:
    # Nor do they change one of the baseline's masks.
    for width in ("128", "256"):
        found = elsewhere(GALLIUM_OVERRIDE_CPU_CAPS="avx", LP_NATIVE_VECTOR_WIDTH=width, LP_NUM_THREADS=threads)
        assert found == arithmetic(device)
