"""Disk cache of truths, keyed by a hash of the view, of the tracer's version and of how the processor rounds."""

import hashlib
import logging
from contextlib import suppress
from dataclasses import fields
from pathlib import Path
from typing import Any

import numpy as np

from shadowbench.errors import InputError
from shadowbench.files import cache_folder, replace_file
from shadowbench.scenes.model import View, view_digest
from shadowbench.truths.embree import answers_digest
from shadowbench.truths.trace import STANDARD_ERROR, Truth, trace
from shadowbench.versions import of_truths

_log = logging.getLogger(__name__)

PIXEL_SAMPLES = 4  # squared, the rays per pixel of a truth that masks are scored against
KEPT_BYTES = 4 << 30  # size of the cache; beyond it, the oldest truths are deleted


def cached_truth(view: View, pixel_samples: int = PIXEL_SAMPLES) -> Truth:
    """`trace` of a view, from the cache if it was traced before by the same version.

    A cache that cannot be written is a logged warning.
    """
    parts = (view_digest(view), pixel_samples, STANDARD_ERROR, of_truths(), answers_digest())
    file = cache_folder("truth") / f"{hashlib.sha256(repr(parts).encode()).hexdigest()[:32]}.npz"
    kept = read_truth(file, view)
    if kept is not None:
        with suppress(OSError):  # read-only caches are usable
            file.touch()
        return kept
    truth = trace(view, pixel_samples)
    try:
        file.parent.mkdir(parents=True, exist_ok=True)
        write_truth(file, truth)
        _delete_oldest(file.parent)
    except (OSError, InputError) as error:
        reason = error.strerror if isinstance(error, OSError) and error.strerror else error
        _log.warning("truth cache %s: truths are traced and not kept (%s)", file.parent, reason)
    return truth


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
    names = {field.name for field in fields(Truth)} - {"view"}
    if not names - {"shading_cosine", "facet_shadow"} <= arrays.keys() <= names:
        return None
    for name, array in arrays.items():
        if array.shape != (() if name == "diagonal" else view.size.shape):
            return None
        is_share = array.dtype == np.float32 and name != "blocker"
        if is_share and not ((array >= 0) & (array <= 1 + 1e-6)).all():  # cosines are rounded; NaN is in no range
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
