"""Standard output and error in any encoding, closed, full or without a reader."""

import os
import subprocess
import sys
from pathlib import Path

import pytest


@pytest.mark.parametrize(
    ("words", "code", "out", "err"),
    [("techniques", 0, "shadow-map", ""), ("≥ 影", 2, "", "shadowbench: list: found '? ?'; allowed: techniques, ")],
)
def test_tables_are_printed_in_any_encoding(words: str, code: int, out: str, err: str) -> None:
    command = [sys.executable, "-m", "shadowbench", "list", words]
    environment = os.environ | {"PYTHONIOENCODING": "ascii"}
    done = subprocess.run(command, capture_output=True, encoding="ascii", env=environment, check=False)
    assert done.returncode == code and out in done.stdout and done.stderr.startswith(err)


FULL = "stdout: cannot be written (no space left on device)"
CLOSED = "stdout: cannot be written (bad file descriptor)"


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="a device of Linux")
@pytest.mark.parametrize(
    ("to", "code", "line"),
    [
        (">/dev/full", 2, FULL),
        (">&-", 2, CLOSED),
        ("nonsense >&- 2>/dev/full", 2, None),
        ("| head -1; exit ${PIPESTATUS[0]}", 0, None),
    ],
)
def test_an_output_that_cannot_be_written_is_a_line(to: str, code: int, line: str | None) -> None:
    command = f"'{sys.executable}' -m shadowbench list {to}"
    done = subprocess.run(["bash", "-c", command], capture_output=True, text=True, check=False)
    assert (done.returncode, done.stderr) == (code, f"shadowbench: {line}\n" if line else "")
