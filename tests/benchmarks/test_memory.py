"""What a study of the largest views takes."""

import subprocess
import sys
import time
from pathlib import Path

import psutil
import pytest


def peak_bytes(process: subprocess.Popen[bytes]) -> int:
    """The largest sum of resident bytes of a process and all that it started, until it ends."""
    parent, peak = psutil.Process(process.pid), 0
    while process.poll() is None:
        held = 0
        for one in [parent, *parent.children(recursive=True)]:
            try:
                held += one.memory_info().rss
            except psutil.NoSuchProcess:
                continue
        peak = max(peak, held)
        time.sleep(0.02)
    return peak


@pytest.mark.slow
@pytest.mark.timeout(1200)
def test_views_of_4096_pixels_a_side_work_in_8_gib(tmp_path: Path) -> None:
    specs = ["shadow-map:size=4096", "ray-traced", "unshadowed"]
    command = [
        sys.executable,
        "-m",
        "shadowbench.cli",
        "run",
        "cube-on-plane",
        "colonnade",
        "-q",
        "--view-size",
        "4096",
    ]
    command += ["--rounds", "3", "-o", str(tmp_path / "run"), *(f"--technique={spec}" for spec in specs)]
    with (tmp_path / "complaints").open("w") as complaints:
        process = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=complaints)
        peak = peak_bytes(process)
    assert process.returncode == 0, (tmp_path / "complaints").read_text()
    assert len((tmp_path / "run" / "table.csv").read_text().splitlines()) == 1 + 2 * 3
    assert peak < 8 << 30, f"{peak / 2**30:.2f} GiB"
