"""Runs pytest on the sources of a folder, each time in a fork of this process.

`python forked.py SOURCES` holds the libraries and nothing of ours, so that what is imported for one run is gone before
the next. It reads node ids, a JSON list a line, and answers [exit code, types of what failed tests raised, output].
"""

import gc
import importlib
import json
import os
import sys
import tempfile
from typing import Any

# With what they import, these are imported once; ours are forgotten again.
WARM = ("pytest", "tests.conftest", "hypothesis.extra.numpy", "scipy.stats", "scipy.ndimage", "skimage.metrics")
# Bytecode of a changed module would later be taken for the unchanged one's.
OPTIONS = ("-q", "-x", "-p", "no:cacheprovider", "-p", "no:xdist", "--assert=plain", "--timeout=120", "-o", "addopts=")


class Raised:
    """Pytest plug-in that notes what failed tests raised."""

    def __init__(self) -> None:
        self.types: list[str] = []

    def pytest_configure(self, config: Any) -> None:
        config.workerinput = {}  # as xdist's workers have: conftest's loops are not all loaded, which takes a second

    def pytest_exception_interact(self, call: Any) -> None:
        self.types.append(call.excinfo.typename)


def run(tests: list[str], answer: Any) -> None:
    import pytest

    raised = Raised()
    folder = f"--basetemp={tempfile.gettempdir()}/{os.getpid()}"
    code = pytest.main([*OPTIONS, "--import-mode=importlib", folder, *tests], plugins=[raised])
    json.dump([int(code), raised.types], answer)
    answer.flush()


def main(sources: str) -> None:
    sys.dont_write_bytecode = True
    sys.path.insert(0, sources)
    os.chdir(sources)
    for name in WARM:
        importlib.import_module(name)
    for name in [name for name in sys.modules if name.partition(".")[0] in ("shadowbench", "tests")]:
        del sys.modules[name]
    gc.freeze()  # forks need not look through all this for garbage
    for line in sys.stdin:
        with tempfile.TemporaryFile() as printed, tempfile.TemporaryFile("w+") as answer:
            child = os.fork()
            if child == 0:
                for stream in (1, 2):
                    os.dup2(printed.fileno(), stream)
                try:
                    run(json.loads(line), answer)
                finally:
                    sys.stderr.flush()
                    os._exit(0)
            os.waitpid(child, 0)
            printed.seek(0)
            answer.seek(0)
            code, raised = json.loads(answer.read() or "[-1, []]")  # it crashed
            print(json.dumps([code, raised, printed.read().decode(errors="replace")]), flush=True)


if __name__ == "__main__":
    main(sys.argv[1])
