"""The truth does not depend on how its rays are traced: packets or single rays, one thread or many, any processor."""

import importlib.util
import os
import subprocess
import sys
from types import SimpleNamespace

import numpy as np
import pytest

from shadowbench.errors import InputError
from shadowbench.scenes.model import View
from shadowbench.scenes.opening import chosen_view
from shadowbench.truths import packets
from shadowbench.truths.embree import EmbreexScene, answers_digest
from shadowbench.truths.trace import Truth, trace

VIEWS = {"hard": ("colonnade", 64), "soft": ("post", 64)}

ANSWERS = """
import sys, warnings
import numpy as np
warnings.simplefilter("error")
import shadowbench as sb
answers = {}
for scene, size in (("cube-on-plane", 32), ("leaves", 16), ("lamp-over-table", 8)):
    truth = sb.truth(scene, view_size=size, pixel_samples=1)
    scores = sb.score(np.roll(truth.visibility, 2, axis=0), truth)
    answers |= {f"{scene} {name}": array for name, array in truth.arrays().items()}
    answers |= {f"{scene} {name}": np.array(np.nan if value is None else value) for name, value in scores.items()}
np.savez(sys.argv[1], **answers)
"""


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
    library = packets.load_library()
    assert library is not None
    device = packets.make_device(library, instructions)
    return device._replace(width=width or device.width)


@pytest.mark.parametrize("shared", [False, True], ids=["directions", "one direction"])
@pytest.mark.parametrize("count", [0, 1, 15, 33, 20_000])
@pytest.mark.parametrize("width", [4, 8, 16])
def test_packets_and_single_rays_agree(width, count, shared) -> None:
    random = np.random.default_rng(count)
    corners = random.uniform(-0.5, 0.5, (600, 3)).astype(np.float32)
    faces = np.arange(600, dtype=np.int32).reshape(200, 3)
    corners[faces[:, 1:]] = corners[faces[:, :1]] + random.uniform(-0.1, 0.1, (200, 2, 3))
    origins = random.uniform(-0.5, 0.5, (3, count)).astype(np.float32)
    directions = random.normal(size=(3, 1 if shared else count)).astype(np.float32)
    reach = random.choice([0.0, 0.1, 1e30], count).astype(np.float32)
    single = EmbreexScene(corners, faces)
    of_packets = packets.PacketScene(device_of("", width), corners, faces)
    for one, other in zip(
        of_packets.intersect(origins, directions, reach)[:2],
        single.intersect(origins, directions, reach)[:2],
        strict=True,
    ):
        assert np.array_equal(one, other)
    blocked = of_packets.occluded(origins, directions, reach)[0]
    assert np.array_equal(blocked, single.occluded(origins, directions, reach)[0])
    if count == 20_000:
        assert 0.03 < blocked.mean() < 0.9


@pytest.mark.parametrize("width", [4, 8, 16])
@pytest.mark.parametrize("instructions", ["sse2", "sse4.2", "avx2"])
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


@pytest.mark.parametrize("instructions", ["sse2", "sse4.2", "avx", "avx2"])
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


@pytest.mark.parametrize("content", [None, b"\x7fELF of another processor"], ids=["absent", "damaged"])
def test_a_library_that_cannot_be_loaded_is_none(content, tmp_path, monkeypatch) -> None:
    (tmp_path / "embreex.libs").mkdir()
    if content is not None:
        (tmp_path / "embreex.libs" / "libembree4-1.so").write_bytes(content)
    package = SimpleNamespace(origin=str(tmp_path / "embreex" / "__init__.py"))
    (tmp_path / "embreex").mkdir()
    monkeypatch.setattr(importlib.util, "find_spec", lambda _: package)
    assert packets.load_library.__wrapped__() is None


@pytest.mark.parametrize("cores", [1, 7])
def test_a_truth_is_the_same_for_any_number_of_threads_and_where_the_library_cannot_be_loaded(
    cores, view, monkeypatch
) -> None:
    device = device_of("")  # embreex has no other
    monkeypatch.setattr(packets, "default_device", lambda: device)
    by_packets = trace(view, pixel_samples=1)
    monkeypatch.setattr(packets, "default_device", lambda: None)
    monkeypatch.setattr(os, "cpu_count", lambda: cores)
    assert_same(trace(view, pixel_samples=1), by_packets)


def test_rays_are_traced_where_compiled_code_cannot_be_cached() -> None:
    """As in a read-only container whose user has no home."""
    nowhere = {"NUMBA_CACHE_LOCATOR_CLASSES": "UserProvidedCacheLocator", "NUMBA_CACHE_DIR": ""}
    told = "from shadowbench.truths import light_samples, packets"
    subprocess.run([sys.executable, "-c", told], env=os.environ | nowhere, check=True, capture_output=True)


@pytest.mark.slow
def test_truths_and_scores_are_the_same_without_compiled_code(tmp_path) -> None:
    """As in a suite whose coverage includes what Numba compiles; no warning either, of 0/0 for one."""
    found = []
    for disabled in ("0", "1"):
        own = {"NUMBA_DISABLE_JIT": disabled, "SHADOWBENCH_CACHE": str(tmp_path / disabled)}
        file = tmp_path / f"{disabled}.npz"
        subprocess.run([sys.executable, "-c", ANSWERS, file], env=os.environ | own, check=True)
        found.append(np.load(file))
    compiled, python = found
    assert compiled["cube-on-plane visibility"].any() and compiled["leaves iou"] < 1
    for name in compiled:
        assert np.array_equal(compiled[name], python[name], equal_nan=compiled[name].dtype.kind == "f"), name
