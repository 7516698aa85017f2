"""Images of a run folder, masks and pictures named by cell key, truths by view; jobs in the background."""

from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageSequence

from shadowbench.errors import InputError, counted
from shadowbench.files import png_of, replace_file
from shadowbench.scenes.model import View
from shadowbench.scores.masks import mask_sha256, read_mask, write_mask
from shadowbench.truths.trace import Truth

_FRAME_MS = 125


@dataclass(frozen=True, eq=False)
class Rendering:
    """Images and measurements of one draw; row 0 of images is at the top.

    visibility: (H, W) float32, 0 in shadow to 1 lit, quantised to 16 bits; picture: (H, W, 3) uint8 sRGB, shaded with
    the visibility; map: float32 linear depth, None if not requested or the technique has none; gpu_bytes: of its
    textures and buffers; work: counts by name; facts: numbers reported by the technique, by name.

    Of another engine, gpu_bytes is None; engine: its version, its renderer, whose light box it is (`given`, `own`), and
    what a phase shifts (`box`, `none`); measurable: (H, W) bool, where its pictures are bright enough.
    """

    visibility: NDArray[np.float32]
    picture: NDArray[np.uint8]
    map: NDArray[np.float32] | None
    gpu_bytes: int | None
    work: dict[str, int]
    facts: dict[str, float]
    engine: Mapping[str, str] | None = None
    measurable: NDArray[np.bool_] | None = None

    def __repr__(self) -> str:
        """One line: the sizes of its images."""
        height, width = self.visibility.shape
        shadow_map = "no map" if self.map is None else f"a map of {self.map.shape[1]} × {self.map.shape[0]} texels"
        return f"<Rendering of {width} × {height} pixels, {(self.visibility < 0.5).mean():.1%} in shadow, {shadow_map}>"

    def _repr_png_(self) -> bytes:
        """PNG of the picture, for notebooks."""
        return png_of(self.picture)


class Surface(NamedTuple):
    """What masks of a view are drawn over; row 0 is at the top.

    triangle: (H, W) int32 triangle ids, None if the renderer does not tell; lit, ambient: pictures, (H, W, 3) uint8
    sRGB, with visibility 1 everywhere and 0 everywhere, from which a mask's picture is blended.
    """

    triangle: NDArray[np.int32] | None
    lit: NDArray[np.uint8]
    ambient: NDArray[np.uint8]


class Pictures:
    """Writer of a folder's `masks/`, `pictures/` and `truth/`."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder

    def write_cell(self, key: str, rendering: Rendering) -> None:
        """Write the mask and picture of a cell."""
        write_mask(self._subfolder("masks") / f"{key}.png", rendering.visibility)
        write_picture(self._subfolder("pictures") / f"{key}.png", rendering.picture)

    def write_film(self, key: str, frames: Sequence[NDArray[np.uint8]]) -> None:
        """Write the (H, W, 3) frames of a cell, if any, as an animated PNG, an eighth of a second each."""
        if frames:
            first, *others = map(Image.fromarray, frames)
            with replace_file(self._subfolder("masks") / f"{key}.frames.png") as temporary:
                first.save(temporary, format="PNG", save_all=True, append_images=others, duration=_FRAME_MS, loop=0)

    def write_truth(self, view: View, truth: Truth) -> None:
        """Write the truth's visibility, undecided pixels and facets, unless the files hold them already.

        A scene edited and then restored has no new cells, but the files may hold the truth of the edited version.
        """
        folder = self._subfolder("truth")
        masks = {"": truth.visibility, ".undecided": truth.undecided, ".facets": truth.facets}
        for name, mask in masks.items():
            if not _holds_mask(file := folder / f"{view.name}{name}.png", mask.astype(np.float32)):
                write_mask(file, mask.astype(np.float32))

    def write_shading(self, view: View, surface: Surface) -> None:
        """Write the pictures from which that of a mask is blended."""
        folder = self._subfolder("truth")
        write_picture(folder / f"{view.name}.lit.png", surface.lit)
        write_picture(folder / f"{view.name}.ambient.png", surface.ambient)

    def _subfolder(self, name: str) -> Path:
        folder = self.folder / name
        folder.mkdir(exist_ok=True)
        return folder


def write_picture(file: Path, picture: NDArray[np.uint8]) -> None:
    """Write a (H, W, 3) sRGB or (H, W) grey uint8 image as PNG."""
    with replace_file(file) as temporary:
        Image.fromarray(picture).save(temporary, format="PNG", compress_level=1)


def read_film(file: Path, count: int) -> NDArray[np.uint8]:
    """(count, H, W, 3), the frames of a film. Raises InputError for a file that is none."""
    frames: list[NDArray[np.uint8]] = []
    try:
        with Image.open(file, formats=["PNG"]) as film:
            for frame in ImageSequence.Iterator(film):
                # Equal ones in a row were written as one that lasts longer; if all are equal, as a still image.
                lasts = film.info.get("duration", count * _FRAME_MS) / _FRAME_MS
                frames += [np.asarray(frame.convert("RGB"))] * round(lasts)
    except (OSError, SyntaxError, ValueError, Image.DecompressionBombError):
        frames = []
    if len(frames) != count:
        raise InputError(f"{file}: cannot be read as a film; allowed: an animated PNG of {counted(count, 'frame')}")
    return np.stack(frames)


def _holds_mask(file: Path, mask: NDArray[np.floating]) -> bool:
    try:
        return mask_sha256(read_mask(file)) == mask_sha256(mask)
    except InputError:  # missing, or not a mask
        return False


class Background:
    """Runs jobs one after the other in a thread, while the worker draws: scores a cell, writes its images and row.

    Use as a context manager: all jobs are done when it exits. An exception of a job is raised by the next `finish` or
    on exit.
    """

    def __init__(self) -> None:
        self._pool = ThreadPoolExecutor(1)
        self._waiting: list[Callable[[], None]] = []
        self._begun: list[Future[None]] = []

    def __enter__(self) -> "Background":
        return self

    def __exit__(self, *_: object) -> None:
        with self._pool:
            self.begin()
            self.finish()

    def add(self, job: Callable[[], None]) -> None:
        """Add a job, which waits for `begin`."""
        self._waiting.append(job)

    def begin(self) -> None:
        """Begin the jobs that wait."""
        waiting, self._waiting = self._waiting, []
        self._begun += map(self._pool.submit, waiting)

    def finish(self) -> None:
        """Wait for the jobs that were begun."""
        begun, self._begun = self._begun, []
        for job in begun:
            job.result()
