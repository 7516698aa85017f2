"""The truth does not depend on how its rays are traced: packets or single rays, in one thread or many."""

import importlib.util
import os
import subprocess
import sys
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from shadowbench.scenes.model import View
from shadowbench.scenes.views import chosen_view
from shadowbench.truths import packets
from shadowbench.truths.embree import EmbreexScene
from shadowbench.truths.trace import Truth, trace

VIEWS = {"hard": ("colonnade", 64), "soft": ("post", 64)}


def assert_same(one: Truth, other: Truth) -> None:
    for name, values in one.arrays().items():
        assert np.array_equal(values, other.arrays()[name]), name


@pytest.fixture(scope="module", params=VIEWS.values(), ids=VIEWS)
def view(request: pytest.FixtureRequest) -> View:
    return chosen_view(*request.param)


@pytest.fixture(scope="module")
def truth(view: View) -> Truth:
    return trace(view, pixel_samples=1)


@pytest.mark.parametrize("shared", [False, True], ids=["directions", "one direction"])
@pytest.mark.parametrize("count", [0, 1, 15, 33, 20_000])
def test_packets_and_single_rays_agree(count: int, shared: bool) -> None:
    random = np.random.default_rng(count)
    corners = random.uniform(-0.5, 0.5, (600, 3)).astype(np.float32)
    faces = np.arange(600, dtype=np.int32).reshape(200, 3)
    corners[faces[:, 1:]] = corners[faces[:, :1]] + random.uniform(-0.1, 0.1, (200, 2, 3))
    origins = random.uniform(-0.5, 0.5, (3, count)).astype(np.float32)
    directions = random.normal(size=(3, 1 if shared else count)).astype(np.float32)
    reach = random.choice([0.0, 0.1, 1e30], count).astype(np.float32)
    library = packets.load_library()
    assert library is not None
    of_packets, single = packets.PacketScene(library, corners, faces), EmbreexScene(corners, faces)
    for one, other in zip(
        of_packets.intersect(origins, directions, reach), single.intersect(origins, directions, reach), strict=True
    ):
        assert np.array_equal(one, other)
    blocked = of_packets.occluded(origins, directions, reach)
    assert np.array_equal(blocked, single.occluded(origins, directions, reach))
    if count == 20_000:
        assert 0.03 < blocked.mean() < 0.9


def test_a_truth_is_the_same_where_the_library_cannot_be_loaded(
    view: View, truth: Truth, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(packets, "load_library", lambda: None)
    assert_same(trace(view, pixel_samples=1), truth)


@pytest.mark.parametrize("content", [None, b"", b"\x7fELF of another processor"], ids=["absent", "empty", "damaged"])
def test_a_library_that_cannot_be_loaded_is_none(
    content: bytes | None, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "embreex.libs").mkdir()
    if content is not None:
        (tmp_path / "embreex.libs" / "libembree4-1.so").write_bytes(content)
    package = SimpleNamespace(origin=str(tmp_path / "embreex" / "__init__.py"))
    (tmp_path / "embreex").mkdir()
    monkeypatch.setattr(importlib.util, "find_spec", lambda _: package)
    assert packets.load_library.__wrapped__() is None


@pytest.mark.parametrize("cores", [1, 7])
def test_a_truth_is_the_same_for_any_number_of_threads(
    cores: int, view: View, truth: Truth, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(os, "cpu_count", lambda: cores)
    assert_same(trace(view, pixel_samples=1), truth)


def test_rays_are_traced_where_compiled_code_cannot_be_cached() -> None:
    """As in a read-only container whose user has no home."""
    nowhere = {"NUMBA_CACHE_LOCATOR_CLASSES": "UserProvidedCacheLocator", "NUMBA_CACHE_DIR": ""}
    told = "from shadowbench.truths import light_samples, packets"
    subprocess.run([sys.executable, "-c", told], env=os.environ | nowhere, check=True, capture_output=True)
