"""Draco decoding in a process of its own, as corrupt data can make it crash, hang or allocate any amount of memory."""

import io
import subprocess
import sys
from collections.abc import Iterable, Iterator, Mapping
from contextlib import suppress
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from shadowbench.errors import InputError
from shadowbench.scenes.triangles import MOST_TRIANGLES

MOST_MEMORY = 2 << 30
"""Memory limit of the process, in bytes."""
LONGEST = 20.0
"""Time limit for decoding all of a file's primitives, in seconds."""


class Blob(NamedTuple):
    """A compressed primitive, and the Draco ids of its attributes by their names."""

    data: bytes
    ids: Mapping[str, int]


class Decoded(NamedTuple):
    """A decoded primitive.

    attributes: by name, (V, n) of floats or integers, as an accessor of the same type would hold them; faces: (F, 3)
    int64 indices into them.
    """

    attributes: Mapping[str, NDArray[Any]]
    faces: NDArray[np.int64]


def decode(blobs: list[Blob], where: str) -> list[Decoded]:
    """The decoded primitives. Raises InputError that begins with `where` if one cannot be decoded."""
    where = f"{where}: KHR_draco_mesh_compression"
    parts = [part for blob in blobs for part in (np.array([*blob.ids.values()]), np.frombuffer(blob.data, np.uint8))]
    # -P: do not import from the current folder, which may have a numpy.py.
    command = [sys.executable, "-P", "-m", __name__]
    try:
        done = subprocess.run(command, input=_packed(parts), capture_output=True, timeout=LONGEST, check=False)
    except subprocess.TimeoutExpired as error:
        raise InputError(f"{where}: took more than {LONGEST:.0f} s to decode") from error
    if done.returncode != 0:
        errors = done.stderr.decode(errors="replace").strip().splitlines()
        crash = f"the decoder died with code {done.returncode}"
        raise InputError(f"{where}: {errors[-1][:160] if done.returncode == 1 and errors else crash}")
    arrays = iter(_unpacked(done.stdout))
    return [Decoded({name: next(arrays) for name in blob.ids}, next(arrays)) for blob in blobs]


def _packed(arrays: Iterable[NDArray[Any]]) -> bytes:
    stream = io.BytesIO()
    np.savez(stream, *arrays, allow_pickle=False)
    return stream.getvalue()


def _unpacked(data: bytes) -> list[NDArray[Any]]:
    with np.load(io.BytesIO(data)) as file:
        return list(file.values())


def _decode_here(parts: list[NDArray[Any]]) -> Iterator[NDArray[Any]]:
    """Attributes and faces of each blob in turn; parts: the ids of a blob's attributes and its bytes, in turn."""
    import DracoPy  # type: ignore[import-not-found]  # compiled, without stubs

    triangles = 0
    for ids, blob in zip(parts[::2], parts[1::2], strict=True):
        mesh = DracoPy.decode(blob.tobytes())
        attributes = {row["unique_id"]: row["data"] for row in mesh.attributes}
        faces = np.asarray(getattr(mesh, "faces", ()), dtype=np.int64).reshape(-1, 3)
        triangles += len(faces)
        if triangles > MOST_TRIANGLES:
            raise ValueError(f"more than {MOST_TRIANGLES} triangles")
        for number in ids.tolist():
            if number not in attributes:
                raise ValueError(f"no attribute {number}, which the file names")
            yield attributes[number].reshape(len(attributes[number]), -1)
        yield faces


def _main() -> None:
    """Decode the blobs of standard input to standard output, within MOST_MEMORY."""
    import resource  # of POSIX alone

    with suppress(ValueError):  # macOS may refuse
        resource.setrlimit(resource.RLIMIT_AS, (MOST_MEMORY, MOST_MEMORY))
    try:
        sys.stdout.buffer.write(_packed(_decode_here(_unpacked(sys.stdin.buffer.read()))))
    except Exception as error:  # the decoder's exceptions for corrupt data vary; the parent reports them
        sys.exit(f"{type(error).__name__}: {' '.join(str(error).split())}")


if __name__ == "__main__":
    _main()
