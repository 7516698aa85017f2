"""Standard output in any encoding, full or without a reader."""

import os
import subprocess
import sys
from pathlib import Path

import pytest


def test_tables_are_printed_in_any_encoding() -> None:
    done = subprocess.run(
        [sys.executable, "-m", "shadowbench", "list", "techniques"],
        capture_output=True, encoding="ascii", env=os.environ | {"PYTHONIOENCODING": "ascii"}, check=False,
    )  # fmt: skip
    assert (done.returncode, done.stderr) == (0, "") and "shadow-map" in done.stdout


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="a device of Linux")
@pytest.mark.parametrize(
    ("to", "code", "line"),
    [
        (">/dev/full", 2, "shadowbench: stdout or a file: cannot be written (no space left on device)\n"),
        ("| head -1; exit ${PIPESTATUS[0]}", 1, ""),
    ],
)
def test_an_output_that_cannot_be_written_is_a_line(to: str, code: int, line: str) -> None:
    command = f"'{sys.executable}' -m shadowbench list {to}"
    done = subprocess.run(["bash", "-c", command], capture_output=True, text=True, check=False)
    assert (done.returncode, done.stderr) == (code, line)
