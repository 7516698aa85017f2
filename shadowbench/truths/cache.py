"""Disk cache of truths, keyed by a hash of the view, of the tracer's version and of how the processor rounds."""

import hashlib
import logging
import os
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np
import platformdirs

from shadowbench.errors import InputError
from shadowbench.files import replace_file
from shadowbench.scenes.model import View, view_digest
from shadowbench.truths.embree import answers_digest
from shadowbench.truths.trace import STANDARD_ERROR, Truth, trace
from shadowbench.versions import of_truths

_RANGES: dict[str, tuple[type[np.generic], float, float]] = {
    **dict.fromkeys(("visibility", "standard_error", "irradiance", "area"), (np.float32, 0, 1)),
    **dict.fromkeys(("receivers", "undecided"), (np.bool_, 0, 1)),
    "blocker": (np.float32, 0, np.inf),
    "cosine": (np.float32, 0, 1 + 1e-6),  # the vectors are rounded
    "shading_cosine": (np.float32, 0, 1),
    "facet_shadow": (np.bool_, 0, 1),
    "diagonal": (np.float64, np.finfo(np.float64).tiny, np.finfo(np.float64).max),
}
"""Type, lowest and highest value of each array of a truth except `triangle`, whose range depends on the scene."""

_OF_SMOOTH = {"shading_cosine", "facet_shadow"}
"""Arrays that only truths of smooth surfaces have."""

_log = logging.getLogger(__name__)

PIXEL_SAMPLES = 4  # squared, the rays per pixel of a truth that masks are scored against
KEPT_BYTES = 4 << 30  # size of the cache; beyond it, the oldest truths are deleted


def cached_truth(view: View, pixel_samples: int = PIXEL_SAMPLES, standard_error: float = STANDARD_ERROR) -> Truth:
    """`trace` of a view, from the cache if it was traced before by the same version.

    A cache that cannot be written is a logged warning.
    """
    file = truth_file(view, pixel_samples, standard_error)
    kept = read_truth(file, view)
    if kept is not None:
        with suppress(OSError):  # read-only caches are usable
            file.touch()
        return kept
    truth = trace(view, pixel_samples, standard_error)
    try:
        file.parent.mkdir(parents=True, exist_ok=True)
        write_truth(file, truth)
        _delete_oldest(file.parent)
    except (OSError, InputError) as error:
        reason = error.strerror if isinstance(error, OSError) and error.strerror else error
        _log.warning("truth cache %s: truths are traced and not kept (%s)", file.parent, reason)
    return truth


def truth_file(view: View, pixel_samples: int = PIXEL_SAMPLES, standard_error: float = STANDARD_ERROR) -> Path:
    """File of a view's truth in the cache, whether or not it exists."""
    parts = (view_digest(view), pixel_samples, standard_error, of_truths(), answers_digest())
    return cache_folder() / f"{hashlib.sha256(repr(parts).encode()).hexdigest()[:32]}.npz"


def cache_folder() -> Path:
    """Folder of the cache: $SHADOWBENCH_CACHE, or the platform's cache folder; created with the first truth."""
    chosen = os.environ.get("SHADOWBENCH_CACHE")
    return Path(chosen) if chosen else Path(platformdirs.user_cache_dir("shadowbench")) / "truth"


def write_truth(file: Path, truth: Truth) -> None:
    """Write all arrays of a truth as a compressed .npz."""
    with replace_file(file) as temporary, temporary.open("wb") as stream:
        # The stub types allow_pickle alone.
        np.savez_compressed(stream, **truth.arrays())  # type: ignore[arg-type]


def read_truth(file: Path, view: View) -> Truth | None:
    """Read the truth of a view; None if the file is missing, unreadable, truncated, damaged or of another view size."""
    if not file.is_file():  # reading a named pipe would block
        return None
    try:
        # Opened here, since np.load does not close a file that it fails to read.
        with file.open("rb") as stream, np.load(stream) as entries:
            arrays: dict[str, Any] = {name: np.asarray(entry) for name, entry in entries.items()}  # bytes if no array
    except Exception:  # of many types in zipfile and NumPy, MemoryError included
        return None
    ranges = {**_RANGES, "triangle": (np.int32, -1, view.scene.geometry.count - 1)}
    if (absent := ranges.keys() ^ arrays.keys()) and not absent <= _OF_SMOOTH:
        return None
    ranges = {name: ranges[name] for name in arrays}
    for name, (kind, low, high) in ranges.items():
        array, shape = arrays[name], () if name == "diagonal" else (view.size, view.size)
        if array.dtype != kind or array.shape != shape or not ((array >= low) & (array <= high)).all():  # NaN neither
            return None
    return Truth(**{**arrays, "diagonal": float(arrays["diagonal"]), "view": view})


def _delete_oldest(folder: Path) -> None:
    """Delete the oldest truths beyond KEPT_BYTES; other processes may delete the same ones meanwhile."""
    kept = []
    for file in folder.glob("*.npz"):
        with suppress(FileNotFoundError):
            kept.append((file.stat().st_mtime, file.stat().st_size, file))
    total = 0
    for _, size, file in sorted(kept, reverse=True):
        total += size
        if total > KEPT_BYTES:
            file.unlink(missing_ok=True)
