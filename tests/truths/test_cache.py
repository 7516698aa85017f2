"""The truth cache: a truth is traced once for its inputs, and again if what is kept is damaged."""

import os
import zipfile
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from shadowbench import versions
from shadowbench.scenes.model import Light, Mesh, View, view_of
from shadowbench.truths import cache
from shadowbench.truths.cache import cached_truth, read_truth, write_truth
from shadowbench.truths.trace import Truth, trace

Arrays = dict[str, np.ndarray]


class TracedAgainError(Exception):
    """Raised if a truth is traced unexpectedly."""


@pytest.fixture(autouse=True)
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The cache's folder, not made yet."""
    monkeypatch.setenv("SHADOWBENCH_CACHE", str(tmp_path / "a" / "b"))
    return tmp_path / "a" / "b"


@pytest.fixture
def view(shape: Callable[..., Mesh], looking: Callable[..., View]) -> View:
    sun = Light("sun", "directional", (0.5, -1.0, -0.3))
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
    assert first.arrays().keys() == second.arrays().keys()
    for name, array in first.arrays().items():
        assert second.arrays()[name].dtype == array.dtype
        assert np.array_equal(second.arrays()[name], array), name


def assert_heals(view: View, file: Path, first: Truth) -> None:
    """What is in the file is no truth, and the view's is traced again and kept."""
    assert read_truth(file, view) is None
    assert_equal(cached_truth(view), first)
    kept = read_truth(file, view)
    assert kept is not None
    assert_equal(kept, first)


def test_second_time_nothing_is_traced_whatever_names_there_are(view, first, no_tracing) -> None:
    scene = replace(view.scene, name="another name")
    renamed = replace(view, scene=scene, camera=replace(view.camera, name="c"), light=replace(view.light, name="l"))
    assert_equal(cached_truth(view), first)
    assert_equal(cached_truth(renamed), first)


def moved_vertex(view: View) -> View:
    ground, box = view.scene.meshes
    vertices = box.vertices.copy()
    vertices[0, 0] = np.nextafter(vertices[0, 0], np.inf)
    return replace(view, scene=replace(view.scene, meshes=(ground, replace(box, vertices=vertices))))


def without_casting(view: View) -> View:
    ground, box = view.scene.meshes
    return replace(view, scene=replace(view.scene, meshes=(ground, replace(box, casts=False))))


@pytest.mark.parametrize(
    "other",
    [
        lambda view: replace(view, camera=replace(view.camera, position=(2.3, 4.0, 3.4000001))),
        lambda view: replace(view, camera=replace(view.camera, far=99.0)),
        lambda view: replace(view, light=replace(view.light, direction=(0.5, -1.0, -0.30001))),
        lambda view: replace(view, size=33),
        moved_vertex,
        without_casting,
    ],
    ids=["camera", "far", "light", "size", "vertex", "casts"],
)
def test_another_view_is_traced(other, view, no_tracing) -> None:
    with pytest.raises(TracedAgainError):
        cached_truth(other(view))


def test_other_numbers_of_samples_and_truths_of_another_version_are_traced(view, no_tracing, monkeypatch) -> None:
    for other in ({"pixel_samples": 5}, {"standard_error": 0.01}):
        with pytest.raises(TracedAgainError):
            cached_truth(view, **other)
    monkeypatch.setattr(versions, "TRACE", versions.TRACE + 1)
    with pytest.raises(TracedAgainError):
        cached_truth(view)


def with_unknown_compression(content: bytes) -> bytes:
    for place in (content.index(b"PK\3\4") + 8, content.index(b"PK\1\2") + 10):
        content = content[:place] + (99).to_bytes(2, "little") + content[place + 2 :]
    return content


@pytest.mark.parametrize(
    "damaged",
    [
        *(lambda content, share=share: content[: int(len(content) * share)] for share in (0.0, 0.01, 0.5, 0.999)),
        *(lambda content, at=at: content[:at] + bytes(40) + content[at + 40 :] for at in (40, 100, 400, 800)),
        with_unknown_compression,
    ],
)
def test_file_that_is_damaged_or_cut_short_is_traced_again(damaged, view, file, first) -> None:
    file.write_bytes(damaged(file.read_bytes()))
    assert_heals(view, file, first)


def with_pixel(name: str, value: float) -> Callable[[Arrays], None]:
    def change(arrays: Arrays) -> None:
        arrays[name] = arrays[name].copy()
        arrays[name].flat[-1] = value

    return change


@pytest.mark.parametrize(
    "change",
    [
        lambda arrays: arrays.update(visibility=arrays["visibility"].astype(np.float64)),
        lambda arrays: arrays.update(triangle=arrays["triangle"].astype(">i4")),
        lambda arrays: arrays.update(area=arrays["area"][:, :-1]),
        lambda arrays: arrays.update(diagonal=np.array("long")),
        lambda arrays: arrays.update(more=np.zeros(3)),
        lambda arrays: arrays.pop("undecided"),
        lambda arrays: arrays.clear(),
        *(with_pixel(name, np.nan) for name in ("visibility", "area", "blocker", "cosine", "diagonal")),
        *(with_pixel(name, value) for name in ("visibility", "area", "cosine") for value in (-0.01, 1.01)),
        with_pixel("blocker", -1.0),
        with_pixel("diagonal", 0.0),
        with_pixel("triangle", -2),
        with_pixel("triangle", 14),
    ],
)
def test_readable_but_wrong_truth_is_traced_again(change, view, file, first) -> None:
    assert len(view.scene.geometry.faces) == 14
    arrays = dict(first.arrays())
    change(arrays)
    np.savez_compressed(file, **arrays)
    assert_heals(view, file, first)


@pytest.mark.parametrize("claimed", ["(60000000, 60000000)", f"({2**70},)", "(32, 32", "(32,\n  32)"])
def test_a_truth_with_an_impossible_array_header_is_traced_again(claimed, view, file, first) -> None:
    with zipfile.ZipFile(file) as whole:
        arrays = {name: whole.read(name) for name in whole.namelist()}
    header = f"{{'descr': '<f4', 'fortran_order': False, 'shape': {claimed}, }}\n".encode()
    start = arrays["area.npy"][:8] + len(header).to_bytes(2, "little")
    with zipfile.ZipFile(file, "w") as other:
        for name, content in arrays.items():
            other.writestr(name, start + header if name == "area.npy" else content)
    assert_heals(view, file, first)


@pytest.mark.skipif(os.name != "posix", reason="pipes in the file system")
def test_pipe_in_a_truth_s_place_is_not_waited_for(view, file, first) -> None:
    file.unlink()
    os.mkfifo(file)
    assert_equal(cached_truth(view), first)


def test_every_truth_passes_its_check(view, tmp_path) -> None:
    """Including a lamp, which lights only a part, and a view that misses the scene in most pixels."""
    lamp = Light("lamp", "spot", (0.0, -1.0, 0.0), position=(0.3, 2.0, 0.2), angle=0.8)
    back = np.subtract(view.camera.position, view.camera.target) * 20 + view.camera.target
    away = replace(view.camera, position=tuple(back), near=None, far=None)
    for one in (view, replace(view, light=lamp), view_of(view.scene, away, view.light, 64)):
        write_truth(tmp_path / "truth.npz", trace(one))
        assert read_truth(tmp_path / "truth.npz", one) is not None


def test_oldest_truths_go_first(view, file, monkeypatch) -> None:
    (file.parent / "gone.npz").symlink_to("nowhere")  # listed, and deleted by another process
    monkeypatch.setattr(cache, "KEPT_BYTES", int(1.5 * file.stat().st_size))
    cached_truth(replace(view, light=replace(view.light, direction=(0.4, -1.0, -0.3))))
    assert [other.exists() for other in sorted(file.parent.iterdir())] == [True, False]
    assert not file.exists()


@pytest.mark.parametrize(("below", "why"), [("cache", "Not a directory"), ("", "")])
def test_where_no_folder_can_be_made_a_truth_is_traced_and_that_is_said(
    below, why, view, tmp_path, monkeypatch, caplog
) -> None:
    """Below a file, or at one, which is left alone: not even root can."""
    (tmp_path / "file").write_text("mine")
    monkeypatch.setenv("SHADOWBENCH_CACHE", str(tmp_path / "file" / below))
    assert_equal(cached_truth(view), trace(view))
    (line,) = caplog.messages
    assert f"{tmp_path / 'file' / below}: truths are traced and not kept" in line and why in line
    assert (tmp_path / "file").read_text() == "mine"


def test_folder_in_the_truth_s_place_is_left_alone(view, file, first, caplog) -> None:
    file.unlink()
    file.mkdir()
    assert_equal(cached_truth(view), first)
    assert ["is a folder" in line for line in caplog.messages] == [True]
    assert list(file.parent.iterdir()) == [file]


def test_full_disk_keeps_no_truth_and_no_part_of_one(view, folder, caplog) -> None:
    resource = pytest.importorskip("resource", reason="no limits on files here")
    allowed = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (1000, allowed[1]))  # bytes; a truth has more
    try:
        truth = cached_truth(view)
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, allowed)
    assert_equal(truth, trace(view))
    assert ["not kept" in line and "file too large" in line for line in caplog.messages] == [True]
    assert list(folder.iterdir()) == []


def test_truth_that_may_only_be_read_is_read(view, first, no_tracing, monkeypatch, caplog) -> None:
    def refuse(*_: object) -> None:
        raise PermissionError

    monkeypatch.setattr(Path, "touch", refuse)
    assert_equal(cached_truth(view), first)
    assert caplog.messages == []
