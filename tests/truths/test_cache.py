"""The truth cache: a truth is traced once for its inputs."""

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
from shadowbench.truths.cache import cache_folder, cached_truth, read_truth, write_truth
from shadowbench.truths.trace import Truth, trace


class TracedAgainError(Exception):
    """Raised if a truth is traced unexpectedly."""


@pytest.fixture(autouse=True)
def empty_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("SHADOWBENCH_CACHE", str(tmp_path))
    return tmp_path


@pytest.fixture
def view(shape: Callable[..., Mesh], looking: Callable[..., View]) -> View:
    sun = Light("sun", "directional", (0.5, -1.0, -0.3))
    return looking([shape("plane", 8.0), shape("box", at=(0, 0.5, 0))], sun, size=32)


@pytest.fixture
def no_tracing(monkeypatch: pytest.MonkeyPatch) -> Callable[[], None]:
    def forbid() -> None:
        def refuse(*_: object) -> Truth:
            raise TracedAgainError

        monkeypatch.setattr(cache, "trace", refuse)

    return forbid


def assert_equal(first: Truth, second: Truth) -> None:
    assert first.arrays().keys() == second.arrays().keys()
    for name, array in first.arrays().items():
        assert second.arrays()[name].dtype == array.dtype
        assert np.array_equal(second.arrays()[name], array), name


def test_second_time_nothing_is_traced(view: View, no_tracing: Callable[[], None]) -> None:
    first = cached_truth(view)
    assert_equal(first, trace(view))
    no_tracing()
    assert_equal(cached_truth(view), first)


def test_names_are_not_part_of_the_key(view: View, no_tracing: Callable[[], None]) -> None:
    cached_truth(view)
    no_tracing()
    scene = replace(view.scene, name="another name")
    cached_truth(replace(view, scene=scene, camera=replace(view.camera, name="c"), light=replace(view.light, name="l")))


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
def test_another_view_is_traced(other: Callable[[View], View], view: View, no_tracing: Callable[[], None]) -> None:
    cached_truth(view)
    no_tracing()
    with pytest.raises(TracedAgainError):
        cached_truth(other(view))


def test_other_numbers_of_samples_are_traced(view: View, no_tracing: Callable[[], None]) -> None:
    cached_truth(view)
    no_tracing()
    with pytest.raises(TracedAgainError):
        cached_truth(view, pixel_samples=5)
    with pytest.raises(TracedAgainError):
        cached_truth(view, standard_error=0.01)


def test_truths_of_another_version_are_traced(
    view: View, no_tracing: Callable[[], None], monkeypatch: pytest.MonkeyPatch
) -> None:
    cached_truth(view)
    no_tracing()
    monkeypatch.setattr(versions, "TRACE", versions.TRACE + 1)
    with pytest.raises(TracedAgainError):
        cached_truth(view)


@pytest.mark.parametrize("share", [0.0, 0.01, 0.5, 0.999])
def test_file_cut_short_is_traced_again(share: float, view: View, empty_folder: Path) -> None:
    first = cached_truth(view)
    (file,) = empty_folder.iterdir()
    content = file.read_bytes()
    file.write_bytes(content[: int(len(content) * share)])
    assert_equal(cached_truth(view), first)
    kept = read_truth(file, view)
    assert kept is not None
    assert_equal(kept, first)


@pytest.mark.parametrize("place", [40, 100, 200, 400, 800])
def test_damaged_file_is_traced_again(place: int, view: View, empty_folder: Path) -> None:
    first = cached_truth(view)
    (file,) = empty_folder.iterdir()
    content = bytearray(file.read_bytes())
    content[place : place + 16] = b"\xff" * 16
    file.write_bytes(content)
    assert_equal(cached_truth(view), first)


def test_file_of_something_else_is_no_truth(view: View, tmp_path: Path) -> None:
    np.savez(tmp_path / "other.npz", visibility=np.zeros(3))
    assert read_truth(tmp_path / "other.npz", view) is None


def with_pixel(name: str, value: float) -> Callable[[dict[str, np.ndarray]], None]:
    """One pixel, in the middle of the picture, or the diagonal has another value."""

    def change(arrays: dict[str, np.ndarray]) -> None:
        arrays[name] = arrays[name].copy()
        arrays[name][(16, 16) if arrays[name].ndim else ()] = value

    return change


def every_other_pixel(arrays: dict[str, np.ndarray]) -> None:
    arrays.update({name: array[::2, ::2] for name, array in arrays.items() if array.ndim})


@pytest.mark.parametrize(
    "change",
    [
        every_other_pixel,
        lambda arrays: arrays.update(visibility=arrays["visibility"].astype(np.float64)),
        lambda arrays: arrays.update(receivers=arrays["receivers"].astype(np.uint8)),
        lambda arrays: arrays.update(triangle=arrays["triangle"].astype(np.int64)),
        lambda arrays: arrays.update(triangle=arrays["triangle"].astype(">i4")),
        lambda arrays: arrays.update(area=arrays["area"][:, :-1]),
        lambda arrays: arrays.update(cosine=arrays["cosine"][..., None]),
        lambda arrays: arrays.update(diagonal=np.array([1.0, 2.0])),
        lambda arrays: arrays.update(diagonal=np.array("long")),
        lambda arrays: arrays.update(more=np.zeros(3)),
        lambda arrays: arrays.pop("undecided"),
        lambda arrays: arrays.clear(),
        *(with_pixel(name, np.nan) for name in ("visibility", "area", "blocker", "cosine", "diagonal")),
        *(with_pixel(name, np.inf) for name in ("visibility", "area", "cosine", "diagonal")),
        *(with_pixel(name, value) for name in ("visibility", "area", "cosine") for value in (-0.01, 1.01)),
        with_pixel("blocker", -1.0),
        with_pixel("diagonal", 0.0),
        with_pixel("triangle", -2),
        with_pixel("triangle", 14),
    ],
)  # fmt: skip
def test_readable_but_wrong_truth_is_made_again(
    change: Callable[[dict[str, np.ndarray]], object], view: View, empty_folder: Path
) -> None:
    assert len(view.scene.geometry.faces) == 14
    first = cached_truth(view)
    (file,) = empty_folder.iterdir()
    arrays: dict[str, np.ndarray] = dict(first.arrays())
    change(arrays)
    np.savez_compressed(file, **arrays)
    assert_equal(cached_truth(view), first)
    kept = read_truth(file, view)
    assert kept is not None, "it has healed"
    assert_equal(kept, first)


def test_single_array_in_a_truth_s_place_is_made_again(view: View, empty_folder: Path) -> None:
    first = cached_truth(view)
    (file,) = empty_folder.iterdir()
    with file.open("wb") as stream:
        np.save(stream, first.visibility)
    assert_equal(cached_truth(view), first)


@pytest.mark.parametrize(
    "claimed",
    ["(60000000, 60000000)", f"({2**70},)", "(32, 32", "(32,\n  32)"],
    ids=["more than fits", "more than numbers hold", "unfinished", "indented"],
)
def test_a_truth_with_an_impossible_array_header_is_traced_again(claimed: str, view: View, empty_folder: Path) -> None:
    first = cached_truth(view)
    (file,) = empty_folder.iterdir()
    with zipfile.ZipFile(file) as whole:
        arrays = {name: whole.read(name) for name in whole.namelist()}
    header = f"{{'descr': '<f4', 'fortran_order': False, 'shape': {claimed}, }}\n".encode()
    start = arrays["area.npy"][:8] + len(header).to_bytes(2, "little")
    with zipfile.ZipFile(file, "w") as other:
        for name, content in arrays.items():
            other.writestr(name, start + header if name == "area.npy" else content)
    assert_equal(cached_truth(view), first)
    kept = read_truth(file, view)
    assert kept is not None, "it has healed"


def test_a_truth_with_unknown_compression_is_traced_again(view: View, empty_folder: Path) -> None:
    first = cached_truth(view)
    (file,) = empty_folder.iterdir()
    content = bytearray(file.read_bytes())
    for place in (content.index(b"PK\3\4") + 8, content.index(b"PK\1\2") + 10):
        content[place : place + 2] = (99).to_bytes(2, "little")
    file.write_bytes(content)
    assert_equal(cached_truth(view), first)


@pytest.mark.skipif(os.name != "posix", reason="pipes in the file system")
def test_pipe_in_a_truth_s_place_is_not_waited_for(view: View, empty_folder: Path) -> None:
    first = cached_truth(view)
    (file,) = empty_folder.iterdir()
    file.unlink()
    os.mkfifo(file)
    assert_equal(cached_truth(view), first)


def test_every_truth_passes_its_check(view: View, tmp_path: Path) -> None:
    """Including a lamp, which lights only a part, and a view that misses the scene in most pixels."""
    lamp = Light("lamp", "spot", (0.0, -1.0, 0.0), position=(0.3, 2.0, 0.2), angle=0.8)
    back = np.subtract(view.camera.position, view.camera.target) * 20 + view.camera.target
    away = replace(view.camera, position=tuple(back), near=None, far=None)
    for one in (view, replace(view, light=lamp), view_of(view.scene, away, view.light, 64)):
        write_truth(tmp_path / "truth.npz", trace(one))
        assert read_truth(tmp_path / "truth.npz", one) is not None


def test_oldest_truths_go_first(view: View, empty_folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    cached_truth(view)
    (oldest,) = empty_folder.iterdir()
    monkeypatch.setattr(cache, "KEPT_BYTES", int(1.5 * oldest.stat().st_size))
    cached_truth(replace(view, light=replace(view.light, direction=(0.4, -1.0, -0.3))))
    assert len(list(empty_folder.iterdir())) == 1
    assert not oldest.exists()


def test_a_truth_deleted_by_another_process_is_skipped(
    view: View, empty_folder: Path, caplog: pytest.LogCaptureFixture
) -> None:
    (empty_folder / "gone.npz").symlink_to("nowhere")  # listed, and no longer there
    truth = cached_truth(view)
    assert caplog.messages == []
    assert any(file.exists() for file in empty_folder.iterdir())
    assert_equal(cached_truth(view), truth)


def test_folder_is_made(view: View, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("SHADOWBENCH_CACHE", str(tmp_path / "a" / "b"))
    assert cache_folder() == tmp_path / "a" / "b"
    cached_truth(view)
    assert len(list(cache_folder().iterdir())) == 1


@pytest.fixture
def below_a_file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A cache folder that cannot be created, not even by root."""
    (tmp_path / "file").write_text("mine")
    monkeypatch.setenv("SHADOWBENCH_CACHE", str(tmp_path / "file" / "cache"))
    return tmp_path / "file" / "cache"


def test_without_a_folder_it_is_traced_and_said(
    view: View, below_a_file: Path, caplog: pytest.LogCaptureFixture
) -> None:
    assert_equal(cached_truth(view), trace(view))
    (line,) = caplog.messages
    assert line == f"truth cache {below_a_file}: truths are traced and not kept (Not a directory)"
    assert below_a_file.parent.read_text() == "mine"


def test_file_where_the_folder_should_be_is_left_alone(
    view: View, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    (tmp_path / "file").write_text("mine")
    monkeypatch.setenv("SHADOWBENCH_CACHE", str(tmp_path / "file"))
    assert_equal(cached_truth(view), trace(view))
    assert ["not kept" in line for line in caplog.messages] == [True]
    assert (tmp_path / "file").read_text() == "mine"


def test_folder_in_the_truth_s_place_is_left_alone(
    view: View, empty_folder: Path, caplog: pytest.LogCaptureFixture
) -> None:
    first = cached_truth(view)
    (file,) = empty_folder.iterdir()
    file.unlink()
    file.mkdir()
    assert_equal(cached_truth(view), first)
    assert ["is a folder" in line for line in caplog.messages] == [True]
    assert list(empty_folder.iterdir()) == [file]


def test_full_disk_keeps_no_truth_and_no_part_of_one(
    view: View, empty_folder: Path, caplog: pytest.LogCaptureFixture
) -> None:
    resource = pytest.importorskip("resource", reason="no limits on files here")
    first = trace(view)
    allowed = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (1000, allowed[1]))  # bytes; a truth has more
    try:
        truth = cached_truth(view)
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, allowed)
    assert_equal(truth, first)
    assert ["not kept" in line and "file too large" in line for line in caplog.messages] == [True]
    assert list(empty_folder.iterdir()) == []


def test_truth_that_may_only_be_read_is_read(
    view: View, no_tracing: Callable[[], None], monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    def refuse(*_: object) -> None:
        raise PermissionError

    first = cached_truth(view)
    no_tracing()
    monkeypatch.setattr(Path, "touch", refuse)
    assert_equal(cached_truth(view), first)
    assert caplog.messages == []
