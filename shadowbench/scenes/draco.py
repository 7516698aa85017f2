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
from shadowbench.scenes.triangles import MOST_TRIANGLES

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
    arrays = _packed(
        data=np.frombuffer(b"".join(blob.data for blob in blobs), dtype=np.uint8),
        lengths=np.array([len(blob.data) for blob in blobs]),
        numbers=np.array([blob.positions for blob in blobs]),
    )
    try:
        # -P: do not import from the current folder, which may have a numpy.py.
        done = subprocess.run(
            [sys.executable, "-P", "-m", __name__], input=arrays, capture_output=True, timeout=LONGEST, check=False
        )
    except subprocess.TimeoutExpired as error:
        raise InputError(f"{where}: KHR_draco_mesh_compression: took more than {LONGEST:.0f} s to decode") from error
    if done.returncode != 0:
        errors = done.stderr.decode(errors="replace").strip().splitlines()
        crash = f"the decoder died with code {done.returncode}"
        reason = errors[-1][:160] if done.returncode == 1 and errors else crash
        raise InputError(f"{where}: KHR_draco_mesh_compression: {reason}")
    found = _unpacked(done.stdout)
    parts = (np.split(found[name], np.cumsum(found[f"{name}_rows"])[:-1]) for name in Decoded._fields)
    return [Decoded(positions, faces) for positions, faces in zip(*parts, strict=True)]


def _packed(**arrays: NDArray[Any]) -> bytes:
    stream = io.BytesIO()
    np.savez(stream, allow_pickle=False, **arrays)
    return stream.getvalue()


def _unpacked(data: bytes) -> dict[str, NDArray[Any]]:
    with np.load(io.BytesIO(data)) as file:
        return dict(file)


def _decode_here(blobs: list[Blob]) -> Iterator[Decoded]:
    import DracoPy  # type: ignore[import-not-found]  # compiled, without stubs

    triangles = 0
    for blob in blobs:
        mesh = DracoPy.decode(blob.data)
        found = [row["data"] for row in mesh.attributes if row["unique_id"] == blob.positions]
        if not found:
            raise ValueError(f"no attribute {blob.positions}, which the file says is its positions")
        faces = np.asarray(getattr(mesh, "faces", ()), dtype=np.int64).reshape(-1, 3)
        triangles += len(faces)
        if triangles > MOST_TRIANGLES:
            raise ValueError(f"more than {MOST_TRIANGLES} triangles")
        yield Decoded(np.asarray(found[0], dtype=np.float64).reshape(-1, 3), faces)


def _main() -> None:
    import resource  # of POSIX alone

    with suppress(ValueError):  # macOS may refuse
        resource.setrlimit(resource.RLIMIT_AS, (MOST_MEMORY, MOST_MEMORY))
    request = _unpacked(sys.stdin.buffer.read())
    ends = np.cumsum(request["lengths"])
    data = request["data"].tobytes()
    rows = zip(ends - request["lengths"], ends, request["numbers"], strict=True)
    try:
        found = list(_decode_here([Blob(data[start:end], int(number)) for start, end, number in rows]))
    except Exception as error:  # the decoder's exceptions for corrupt data vary; the parent reports them
        sys.exit(f"{type(error).__name__}: {' '.join(str(error).split())}")
    answer = {}
    for k, name in enumerate(Decoded._fields):
        answer[name] = np.concatenate([one[k] for one in found])
        answer[f"{name}_rows"] = np.array([len(one[k]) for one in found])
    sys.stdout.buffer.write(_packed(**answer))


if __name__ == "__main__":
    _main()
