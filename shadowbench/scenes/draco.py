"""Draco decoding in a process of its own, as corrupt data can make the decoder crash or allocate any amount of memory.

python -m shadowbench.scenes.draco < blobs.npz > arrays.npz
"""

import io
import subprocess
import sys
from collections.abc import Iterator
from contextlib import suppress
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from shadowbench.errors import InputError
from shadowbench.scenes.geometry import MOST_TRIANGLES

LONGEST = 20.0
"""Time limit for decoding all of a file's primitives, in seconds."""
MOST_MEMORY = 2 << 30
"""Memory limit of the decoding process, in bytes."""


class Blob(NamedTuple):
    """A compressed primitive, and the Draco id of its position attribute."""

    data: bytes
    positions: int


class Decoded(NamedTuple):
    """A decoded primitive. positions: (V, 3) float64, not dequantized; faces: (F, 3) int64 indices into them."""

    positions: NDArray[np.float64]
    faces: NDArray[np.int64]


def decode(blobs: list[Blob], where: str) -> list[Decoded]:
    """The decoded primitives. Raises InputError that begins with `where` if one cannot be decoded."""
    request = _packed(
        np.array([blob.positions for blob in blobs]), *(np.frombuffer(blob.data, dtype=np.uint8) for blob in blobs)
    )
    where = f"{where}: KHR_draco_mesh_compression"
    try:
        # -P: do not import from the current folder, which may have a numpy.py.
        done = subprocess.run(
            [sys.executable, "-P", "-m", __name__], input=request, capture_output=True, timeout=LONGEST, check=False
        )
    except subprocess.TimeoutExpired as error:
        raise InputError(f"{where}: took more than {LONGEST:.0f} s to decode") from error
    if done.returncode != 0:
        errors = done.stderr.decode(errors="replace").strip().splitlines()
        crash = f"the decoder died with code {done.returncode}"
        raise InputError(f"{where}: {errors[-1][:160] if done.returncode == 1 and errors else crash}")
    arrays = _unpacked(done.stdout)
    return [Decoded(*pair) for pair in zip(arrays[::2], arrays[1::2], strict=True)]


def _packed(*arrays: NDArray[Any]) -> bytes:
    stream = io.BytesIO()
    np.savez(stream, *arrays, allow_pickle=False)
    return stream.getvalue()


def _unpacked(data: bytes) -> list[NDArray[Any]]:
    with np.load(io.BytesIO(data)) as file:
        return list(file.values())


def _decode_here(numbers: NDArray[Any], *blobs: NDArray[np.uint8]) -> Iterator[NDArray[Any]]:
    """Positions and faces of each blob in turn."""
    import DracoPy  # type: ignore[import-not-found]  # compiled, without stubs

    triangles = 0
    for number, blob in zip(numbers, blobs, strict=True):
        mesh = DracoPy.decode(blob.tobytes())
        found = [row["data"] for row in mesh.attributes if row["unique_id"] == number]
        if not found:
            raise ValueError(f"no attribute {number}, which the file says is its positions")
        faces = np.asarray(getattr(mesh, "faces", ()), dtype=np.int64).reshape(-1, 3)
        triangles += len(faces)
        if triangles > MOST_TRIANGLES:
            raise ValueError(f"more than {MOST_TRIANGLES} triangles")
        yield np.asarray(found[0], dtype=np.float64).reshape(-1, 3)
        yield faces


if __name__ == "__main__":
    import resource  # of POSIX alone

    with suppress(ValueError):  # macOS may refuse
        resource.setrlimit(resource.RLIMIT_AS, (MOST_MEMORY, MOST_MEMORY))
    try:
        sys.stdout.buffer.write(_packed(*_decode_here(*_unpacked(sys.stdin.buffer.read()))))
    except Exception as error:  # the decoder's exceptions for corrupt data vary; the parent reports them
        sys.exit(f"{type(error).__name__}: {' '.join(str(error).split())}")
