"""The command answers at once: heavy packages are imported where they are needed."""

import statistics
import subprocess
import sys
import time

import pytest

pytestmark = pytest.mark.alone


def median_seconds(*arguments: str) -> float:
    seconds = []
    for _ in range(5):
        start = time.perf_counter()
        subprocess.run([sys.executable, *arguments], check=True, capture_output=True)
        seconds.append(time.perf_counter() - start)
    return statistics.median(seconds)


def test_importing_the_package_costs_next_to_nothing() -> None:
    bare = median_seconds("-c", "pass")
    assert median_seconds("-c", "import shadowbench") - bare < 0.1


def test_help_is_there_in_half_a_second() -> None:
    assert median_seconds("-c", "from shadowbench.cli import main; main()", "--help") < 0.5
