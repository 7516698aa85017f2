"""Compiled code and Embree stay within the arrays that they are given: valgrind's memcheck finds no fault.

It has no AVX-512 on any machine, so that Numba compiles for a processor that it knows, in a cache of its own.
"""

import os
import subprocess
import sys
from pathlib import Path
from xml.etree import ElementTree

import pytest

from tests.samples import daily

SCRIPT = """
import sys

import numpy as np

from shadowbench.geometry.facing import cap_weights
from shadowbench.geometry.tree import build_tree
from shadowbench.geometry.vertex_order import in_reuse_order
from shadowbench.measure.scoring import prepare_truth
from shadowbench.scenes.opening import chosen_view
from shadowbench.scores.metrics import score
from shadowbench.truths import embree
from shadowbench.truths.trace import trace

device = embree.make_device("sse4.2")
for width in (4, 8, 16):  # native, and emulated
    embree.default_device = lambda: device._replace(width=width)
    truth = trace(chosen_view(sys.argv[1], 9), 1)
    print(truth.visibility.sum())
print(score(np.roll(truth.visibility, 1), prepare_truth(truth)))
geometry = truth.view.scene.geometry
vertices, faces = geometry.vertices, geometry.faces
print(build_tree(vertices, faces).order.sum(), in_reuse_order(faces).sum())
print(cap_weights(vertices, faces.astype(np.int64), np.array([0.0, 1.0, 0.0, 0.0]), 0, len(faces)).sum())
"""
SCENES = ["cube-on-plane", "room-with-lamp", "post"]
FIXED = {"NUMBA_CPU_NAME": "haswell", "NUMBA_CPU_FEATURES": "", "PYTHONMALLOC": "malloc", "OPENBLAS_NUM_THREADS": "1"}


@pytest.mark.slow
@pytest.mark.timeout(900)
@pytest.mark.parametrize("scene", daily(SCENES, 21))
def test_nothing_is_read_or_written_outside_its_block(scene: str, tmp_path: Path) -> None:
    environment = os.environ | FIXED | {"NUMBA_CACHE_DIR": str(tmp_path / "numba")}
    command = [sys.executable, "-c", SCRIPT, scene]
    plain = subprocess.run(command, env=environment, check=True, capture_output=True, text=True)
    log = tmp_path / "memcheck.xml"
    memcheck = ["valgrind", "--undef-value-errors=no", "--xml=yes", f"--xml-file={log}"]
    checked = subprocess.run([*memcheck, *command], env=environment, check=True, capture_output=True, text=True)
    assert checked.stdout == plain.stdout
    assert not faults(log)


def faults(log: Path) -> list[str]:
    """Invalid reads, writes and frees, but for those of the dynamic linker, which reads text by whole words."""
    found = []
    for error in ElementTree.parse(log).iter("error"):
        innermost = error.findtext("stack/frame/obj") or ""
        if not (error.findtext("kind") or "").startswith("Leak") and "ld-linux" not in innermost:
            found.append(ElementTree.tostring(error, encoding="unicode"))
    return found
