"""The truth does not depend on how its rays are traced: packets of any width, one thread or many, any processor."""

import os
import subprocess
import sys
from collections.abc import Iterator

import numpy as np
import pytest

from shadowbench.errors import InputError
from shadowbench.scenes.model import View
from shadowbench.scenes.opening import chosen_view
from shadowbench.truths import embree, packets
from shadowbench.truths.trace import Truth, trace

VIEWS = {"hard": ("colonnade", 64), "soft": ("post", 64)}


@pytest.fixture(scope="module", params=VIEWS.values(), ids=VIEWS)
def view(request: pytest.FixtureRequest) -> View:
    return chosen_view(*request.param)


@pytest.fixture(scope="module")
def truth(view: View) -> Truth:
    return trace(view, pixel_samples=1)


def as_if(instructions: str, width: int, patch: pytest.MonkeyPatch) -> None:
    """Trace as another processor would, in packets of its native width or of another."""
    device = embree.make_device(instructions)._replace(width=width)
    patch.setattr(embree, "default_device", lambda: device)


GUARD = np.uint32(0xA5A5A5A5)


@pytest.fixture
def no_overrun(monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    """Fails the test if Embree writes behind a buffer of a packet: more guard words stand there than a packet has."""
    behind: list[np.ndarray] = []
    aligned = packets._aligned

    def guarded(words: int) -> np.ndarray:
        buffer = aligned(words + 512)
        buffer[words:] = GUARD
        behind.append(buffer[words:])
        return buffer[:words]

    monkeypatch.setattr(packets, "_aligned", guarded)
    yield
    assert behind and all((words == GUARD).all() for words in behind)


@pytest.mark.usefixtures("no_overrun")
@pytest.mark.parametrize(
    ("width", "count", "shared"), [(4, 33, True), (8, 15, False), (8, 2000, False), (16, 0, False), (16, 2000, True)]
)
def test_packets_of_any_width_find_what_every_triangle_against_every_ray_finds(
    width, count, shared, monkeypatch
) -> None:
    as_if("", width, monkeypatch)
    random = np.random.default_rng(count)
    corners = random.uniform(-0.5, 0.5, (200, 3, 3)).astype(np.float32)
    corners[:, 1:] = corners[:, :1] + random.uniform(-0.1, 0.1, (200, 2, 3))
    origins = random.uniform(-0.5, 0.5, (count, 3)).astype(np.float32)
    directions = random.normal(size=(1 if shared else count, 3)).astype(np.float32)
    reach = random.choice([0.0, 0.1, 1e30], count).astype(np.float32)
    tracer = embree.Tracer(corners.reshape(-1, 3), np.arange(600, dtype=np.int32).reshape(-1, 3))
    triangle, distance = tracer.hits(origins, directions, reach)
    ways = np.broadcast_to(directions, origins.shape)[:, np.newaxis]
    a, b, c = np.moveaxis(corners.astype(float) - origins[:, np.newaxis, np.newaxis], 2, 0)
    sides = np.stack([(np.cross(p, q) * ways).sum(axis=2) for p, q in ((b, c), (c, a), (a, b))])
    normal = np.cross(b - a, c - a)
    t = (normal * a).sum(axis=2) / (normal * ways).sum(axis=2)
    met = ((sides >= 0).all(axis=0) | (sides <= 0).all(axis=0)) & (t > 0) & (t < reach[:, np.newaxis])
    t = np.where(met, t, np.inf)
    assert np.array_equal(triangle, np.where(met.any(axis=1), t.argmin(axis=1), -1))
    assert np.allclose(distance, np.minimum(t.min(axis=1), reach), rtol=1e-4)
    assert np.array_equal(tracer.occluded(origins, directions, reach), triangle >= 0)


@pytest.mark.parametrize(("instructions", "width"), [("sse2", 4), ("sse4.2", 16), ("avx2", 8)])
def test_a_truth_of_another_processor_decides_the_same(instructions, width, view, truth, monkeypatch) -> None:
    """Distances differ in their last bits, and with them single samples of soft shadows: then the cache's key does."""
    digest = embree.computed_digest()
    as_if(instructions, width, monkeypatch)
    other = trace(view, pixel_samples=1)
    for name in ("receivers", "undecided", "triangle", "cosine"):
        assert np.array_equal(getattr(other, name), getattr(truth, name)), name
    samples = np.abs(other.visibility - truth.visibility)[truth.receivers & ~truth.undecided]
    assert np.count_nonzero(samples) <= (3 if view.light.soft else 0) and samples.max() <= 2**-8
    assert np.allclose(other.blocker, truth.blocker, rtol=0, atol=1e-6 * truth.diagonal)
    assert (embree.computed_digest() == digest) == np.array_equal(other.blocker, truth.blocker)


def test_how_embree_rounds_is_kept_for_a_processor_and_computed_for_another(tmp_path, monkeypatch) -> None:
    monkeypatch.setenv("SHADOWBENCH_CACHE", str(tmp_path / "cache"))
    monkeypatch.setattr(embree, "_PROCESSOR", processor := tmp_path / "cpuinfo")
    digest = embree.computed_digest()
    for flags, kept in (("flags : avx", "0" * 64), ("flags : avx2", "damaged")):
        processor.write_text(flags)
        assert embree.answers_digest.__wrapped__() == digest
        (file,) = (tmp_path / "cache" / "truth").glob("*.answers")
        file.write_text(kept)
        assert embree.answers_digest.__wrapped__() == (digest if kept == "damaged" else kept)
        file.unlink()


def test_an_unknown_instruction_set_is_refused_where_embree_would_take_its_slowest_code(monkeypatch) -> None:
    monkeypatch.setenv("SHADOWBENCH_ISA", "avx3")
    with pytest.raises(InputError, match=r"SHADOWBENCH_ISA: 'avx3'; allowed: .* of sse2, .*, avx512"):
        embree.default_device.__wrapped__()


@pytest.mark.parametrize("cores", [1, 7])
def test_a_truth_is_the_same_for_any_number_of_threads(cores, view, truth, monkeypatch) -> None:
    monkeypatch.setattr(os, "cpu_count", lambda: cores)
    other = trace(view, pixel_samples=1).arrays()
    assert all(np.array_equal(array, other[name]) for name, array in truth.arrays().items())


def test_rays_are_traced_where_compiled_code_cannot_be_cached() -> None:
    """As in a read-only container whose user has no home."""
    nowhere = {"NUMBA_CACHE_LOCATOR_CLASSES": "UserProvidedCacheLocator", "NUMBA_CACHE_DIR": ""}
    told = "from shadowbench.truths import light_samples, packets"
    subprocess.run([sys.executable, "-c", told], env=os.environ | nowhere, check=True, capture_output=True)
