"""Draco's decoder in a process of its own: made-up bytes let it ask for any memory, or die.

python -m shadowbench.scenes.draco < blobs.npz > arrays.npz
"""

import io
import subprocess
import sys
from collections.abc import Iterator
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from shadowbench.errors import InputError
from shadowbench.scenes.triangles import MOST_TRIANGLES

LONGEST = 20.0
"""Seconds for all that a file has compressed."""
MOST_MEMORY = 2 << 30
"""Bytes."""


class Blob(NamedTuple):
    """A compressed primitive, and Draco's own number of the attribute that is its positions."""

    data: bytes
    positions: int


class Decoded(NamedTuple):
    """positions: (V, 3) float64, integers where the file has them; faces: (F, 3) int64 into them."""

    positions: NDArray[np.float64]
    faces: NDArray[np.int64]


def decode(blobs: list[Blob], where: str) -> list[Decoded]:
    """What each blob holds; InputError that begins with `where` if one cannot be decoded."""
    arrays = _packed(
        data=np.frombuffer(b"".join(blob.data for blob in blobs), dtype=np.uint8),
        lengths=np.array([len(blob.data) for blob in blobs]),
        numbers=np.array([blob.positions for blob in blobs]),
    )
    try:
        # -P: a folder that holds a numpy.py is no place to import from.
        done = subprocess.run(
            [sys.executable, "-P", "-m", __name__], input=arrays, capture_output=True, timeout=LONGEST, check=False
        )
    except subprocess.TimeoutExpired as error:
        raise InputError(f"{where}: KHR_draco_mesh_compression: took more than {LONGEST:.0f} s to decode") from error
    if done.returncode != 0:
        said = done.stderr.decode(errors="replace").strip().splitlines()
        reason = said[-1][:160] if done.returncode == 1 and said else f"the decoder died with code {done.returncode}"
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
    try:
        import resource

        resource.setrlimit(resource.RLIMIT_AS, (MOST_MEMORY, MOST_MEMORY))
    except (ImportError, ValueError):  # Windows has no such limit, macOS may not grant it
        pass
    asked = _unpacked(sys.stdin.buffer.read())
    ends = np.cumsum(asked["lengths"])
    data = asked["data"].tobytes()
    rows = zip(ends - asked["lengths"], ends, asked["numbers"], strict=True)
    try:
        found = list(_decode_here([Blob(data[start:end], int(number)) for start, end, number in rows]))
    except Exception as error:  # whatever the decoder says of a corrupt blob; the parent tells it
        sys.exit(f"{type(error).__name__}: {' '.join(str(error).split())}")
    answer = {}
    for k, name in enumerate(Decoded._fields):
        answer[name] = np.concatenate([one[k] for one in found])
        answer[f"{name}_rows"] = np.array([len(one[k]) for one in found])
    sys.stdout.buffer.write(_packed(**answer))


if __name__ == "__main__":
    _main()
