"""How the driver calculates, which its name leaves out."""

import os
import re
import subprocess
import sys
from functools import partial
from pathlib import Path

import pytest

from shadowbench.gl.arithmetic import arithmetic
from shadowbench.gl.device import Device

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
