"""The truth does not depend on how its rays are traced: packets of any width, one thread or many, any processor."""

import os
import subprocess
import sys
from types import SimpleNamespace

import numpy as np
import pytest

from shadowbench.errors import InputError, ShadowbenchError
from shadowbench.scenes.model import View
from shadowbench.scenes.opening import chosen_view
from shadowbench.truths import packets
from shadowbench.truths.embree import answers_digest
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


def device_of(instructions: str, width: int | None = None) -> packets.Device:
    """A device as another processor would have it, tracing packets of its native width or of another."""
    device = packets.make_device(packets.load_library(), instructions)
    return device._replace(width=width or device.width)


@pytest.mark.parametrize(
    ("width", "count", "shared"), [(4, 33, True), (8, 15, False), (8, 2000, False), (16, 0, False), (16, 2000, True)]
)
def test_packets_of_any_width_find_what_every_triangle_against_every_ray_finds(width, count, shared) -> None:
    random = np.random.default_rng(count)
    corners = random.uniform(-0.5, 0.5, (200, 3, 3)).astype(np.float32)
    corners[:, 1:] = corners[:, :1] + random.uniform(-0.1, 0.1, (200, 2, 3))
    origins = random.uniform(-0.5, 0.5, (3, count)).astype(np.float32)
    directions = random.normal(size=(3, 1 if shared else count)).astype(np.float32)
    reach = random.choice([0.0, 0.1, 1e30], count).astype(np.float32)
    scene = packets.PacketScene(device_of("", width), corners.reshape(-1, 3), np.arange(600).reshape(-1, 3))
    triangle, distance = scene.intersect(origins, directions, reach)
    ways = np.broadcast_to(directions, origins.shape).T[:, np.newaxis]
    a, b, c = np.moveaxis(corners.astype(float) - origins.T[:, np.newaxis, np.newaxis], 2, 0)
    sides = np.stack([(np.cross(p, q) * ways).sum(axis=2) for p, q in ((b, c), (c, a), (a, b))])
    normal = np.cross(b - a, c - a)
    t = (normal * a).sum(axis=2) / (normal * ways).sum(axis=2)
    met = ((sides >= 0).all(axis=0) | (sides <= 0).all(axis=0)) & (t > 0) & (t < reach[:, np.newaxis])
    t = np.where(met, t, np.inf)
    assert np.array_equal(triangle, np.where(met.any(axis=1), t.argmin(axis=1), -1))
    assert np.allclose(distance, np.minimum(t.min(axis=1), reach), rtol=1e-4)
    assert np.array_equal(scene.occluded(origins, directions, reach), triangle >= 0)


@pytest.mark.parametrize(("instructions", "width"), [("sse2", 4), ("sse4.2", 16), ("avx2", 8)])
def test_a_truth_of_another_processor_decides_the_same(instructions, width, view, truth, monkeypatch) -> None:
    """Distances differ in their last bits, and with them single samples of soft shadows."""
    device = device_of(instructions, width)
    monkeypatch.setattr(packets, "default_device", lambda: device)
    other = trace(view, pixel_samples=1)
    for name in ("receivers", "undecided", "triangle", "cosine"):
        assert np.array_equal(getattr(other, name), getattr(truth, name)), name
    samples = np.abs(other.visibility - truth.visibility)[truth.receivers & ~truth.undecided]
    assert np.count_nonzero(samples) <= (3 if view.light.soft else 0) and samples.max() <= 2**-8
    assert np.allclose(other.blocker, truth.blocker, rtol=0, atol=1e-6 * truth.diagonal)


@pytest.mark.parametrize("instructions", ["sse2", "avx2"])
def test_truths_of_processors_with_one_digest_are_equal(instructions, view, monkeypatch) -> None:
    """The digest is part of the cache's key, since one folder may serve several machines."""
    digests, truths = [], []
    for device in (device_of("sse4.2"), device_of(instructions)):
        monkeypatch.setattr(packets, "default_device", lambda device=device: device)
        digests.append(answers_digest.__wrapped__())
        truths.append(trace(view, pixel_samples=1))
    equal = np.array_equal(truths[0].blocker, truths[1].blocker)
    assert (digests[0] == digests[1]) == equal
    if equal:
        assert_same(*truths)


def test_an_unknown_instruction_set_and_one_that_the_processor_lacks_are_refused(monkeypatch) -> None:
    """Embree itself would take its slowest code without a word."""
    monkeypatch.setenv("SHADOWBENCH_ISA", "avx3")
    with pytest.raises(InputError, match=r"SHADOWBENCH_ISA: 'avx3' is not one of sse2, .*, avx512"):
        packets.default_device.__wrapped__()
    library = SimpleNamespace(rtcNewDevice=lambda _: None)
    with pytest.raises(InputError, match="Embree finds no avx512 on this processor"):
        packets.make_device(library, "avx512")


def test_a_library_that_cannot_be_loaded_is_one_line(tmp_path, monkeypatch) -> None:
    (tmp_path / "embreex.libs").mkdir()
    (tmp_path / "embreex.libs" / "libembree4-1.so").write_bytes(b"\x7fELF of another processor")
    package = SimpleNamespace(__file__=str(tmp_path / "embreex" / "__init__.py"))
    (tmp_path / "embreex").mkdir()
    monkeypatch.setattr(packets, "import_module", lambda _: package)
    with pytest.raises(ShadowbenchError, match="embreex: its wheel holds no Embree 4 library that can be loaded"):
        packets.load_library.__wrapped__()


@pytest.mark.parametrize("cores", [1, 7])
def test_a_truth_is_the_same_for_any_number_of_threads(cores, view, truth, monkeypatch) -> None:
    monkeypatch.setattr(os, "cpu_count", lambda: cores)
    assert_same(trace(view, pixel_samples=1), truth)


def test_rays_are_traced_where_compiled_code_cannot_be_cached() -> None:
    """As in a read-only container whose user has no home."""
    nowhere = {"NUMBA_CACHE_LOCATOR_CLASSES": "UserProvidedCacheLocator", "NUMBA_CACHE_DIR": ""}
    told = "from shadowbench.truths import light_samples, packets"
    subprocess.run([sys.executable, "-c", told], env=os.environ | nowhere, check=True, capture_output=True)
