"""The truth cache: a truth is traced once for its inputs, and again if what is kept is damaged."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from shadowbench import versions
from shadowbench.scenes.model import Light, Mesh, View
from shadowbench.truths import cache
from shadowbench.truths.cache import cached_truth, read_truth
from shadowbench.truths.trace import Truth, trace


class TracedAgainError(Exception):
    """Raised if a truth is traced unexpectedly."""


@pytest.fixture(autouse=True)
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The cache's folder, not made yet."""
    monkeypatch.setenv("SHADOWBENCH_CACHE", str(tmp_path / "a" / "b"))
    return tmp_path / "a" / "b" / "truth"


@pytest.fixture
def view(shape: Callable[..., Mesh], looking: Callable[..., View], sun: Light) -> View:
    return looking([shape("plane", 8.0), shape("box", at=(0, 0.5, 0))], sun, size=32)


@pytest.fixture
def first(view: View) -> Truth:
    """The view's truth, in the cache."""
    return cached_truth(view)


@pytest.fixture
def file(first: Truth, folder: Path) -> Path:
    (file,) = folder.iterdir()
    return file


@pytest.fixture
def no_tracing(first: Truth, monkeypatch: pytest.MonkeyPatch) -> None:
    """Once the view's truth is in the cache."""

    def refuse(*_: object) -> Truth:
        raise TracedAgainError

    monkeypatch.setattr(cache, "trace", refuse)


def assert_equal(first: Truth, second: Truth) -> None:
    np.testing.assert_equal(second.arrays(), first.arrays())


def assert_heals(view: View, file: Path, first: Truth) -> None:
    """What is in the file is no truth, and the view's is traced again and kept."""
    assert read_truth(file, view) is None
    assert_equal(cached_truth(view), first)
    assert_equal(read_truth(file, view), first)


def test_second_time_nothing_is_traced_whatever_names_there_are(view, first, no_tracing) -> None:
    scene = replace(view.scene, name="another name")
    renamed = replace(view, scene=scene, camera=replace(view.camera, name="c"), light=replace(view.light, name="l"))
    assert_equal(cached_truth(view), first)
    assert_equal(cached_truth(renamed), first)


def test_oldest_truths_go_first(view, file, monkeypatch) -> None:
    (file.parent / "gone.npz").symlink_to("nowhere")  # listed, and deleted by another process
    monkeypatch.setattr(cache, "KEPT_BYTES", int(1.5 * file.stat().st_size))
    cached_truth(replace(view, light=replace(view.light, direction=(0.4, -1.0, -0.3))))
    assert [other.exists() for other in sorted(file.parent.iterdir())] == [True, False]
    assert not file.exists()


def test_another_view_is_traced_and_other_samples_and_another_version(view, no_tracing, monkeypatch) -> None:
    ground, box = view.scene.meshes
    vertices = box.vertices.copy()
    vertices[0, 0] = np.nextafter(vertices[0, 0], np.inf)
    for other in (
        replace(view, camera=replace(view.camera, far=99.0)),
        replace(view, light=replace(view.light, direction=(0.5, -1.0, -0.30001))),
        replace(view, size=33),
        replace(view, scene=replace(view.scene, meshes=(ground, replace(box, vertices=vertices)))),
        replace(view, scene=replace(view.scene, meshes=(ground, replace(box, casts=False)))),
    ):
        with pytest.raises(TracedAgainError):
            cached_truth(other)
    with pytest.raises(TracedAgainError):
        cached_truth(view, pixel_samples=5)
    monkeypatch.setattr(versions, "TRACE", versions.TRACE + 1)
    with pytest.raises(TracedAgainError):
        cached_truth(view)


def test_file_that_is_damaged_or_holds_another_truth_is_traced_again(view, file, first) -> None:
    content, arrays = file.read_bytes(), first.arrays()
    for damaged in (b"", content[: len(content) // 2], content[:400] + bytes(40) + content[440:]):
        file.write_bytes(damaged)
        assert_heals(view, file, first)
    nan = np.where(np.arange(32 * 32).reshape(32, 32) == 5, np.nan, arrays["visibility"]).astype(np.float32)
    for wrong in (
        {"visibility": nan},
        {"cosine": arrays["cosine"] + np.float32(0.5)},
        {"area": arrays["area"][:, :-1]},
        {"more": np.zeros(3)},
    ):
        np.savez_compressed(file, **arrays | wrong)
        assert_heals(view, file, first)


def test_where_no_folder_can_be_made_a_truth_is_traced_and_that_is_said(view, tmp_path, monkeypatch, caplog) -> None:
    """Below a file: not even root can."""
    (tmp_path / "file").write_text("mine")
    monkeypatch.setenv("SHADOWBENCH_CACHE", str(tmp_path / "file" / "cache"))
    assert_equal(cached_truth(view), trace(view))
    (line,) = caplog.messages
    assert f"{tmp_path / 'file' / 'cache' / 'truth'}: truths are traced and not kept" in line
