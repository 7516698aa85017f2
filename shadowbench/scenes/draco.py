"""Draco decoding, in a process of its own: python -m shadowbench.scenes.draco < blobs.npz > arrays.npz."""

from collections.abc import Iterator, Mapping
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from shadowbench.scenes.apart import decoded_apart, serve
from shadowbench.scenes.geometry import MOST_TRIANGLES

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
    parts = [
        part
        for blob in blobs
        for part in (np.array([*blob.ids.values()], np.int64), np.frombuffer(blob.data, np.uint8))
    ]
    arrays = iter(decoded_apart(__name__, LONGEST, f"{where}: KHR_draco_mesh_compression", *parts))
    return [Decoded({name: next(arrays) for name in blob.ids}, next(arrays)) for blob in blobs]


def _decode_here(*parts: NDArray[Any]) -> Iterator[NDArray[Any]]:
    """Attributes and faces of each blob in turn; parts: the ids of a blob's attributes and its bytes, in turn."""
    import DracoPy  # type: ignore[import-not-found]  # compiled, without stubs

    triangles = 0
    for ids, blob in zip(parts[::2], parts[1::2], strict=True):
        mesh = DracoPy.decode(blob.tobytes())
        found = {row["unique_id"]: row["data"] for row in mesh.attributes}
        faces = np.asarray(getattr(mesh, "faces", ()), dtype=np.int64).reshape(-1, 3)
        triangles += len(faces)
        if triangles > MOST_TRIANGLES:
            raise ValueError(f"more than {MOST_TRIANGLES} triangles")
        for number in ids.tolist():
            if number not in found:
                raise ValueError(f"no attribute {number}, which the file names")
            yield found[number].reshape(len(found[number]), -1)
        yield faces


if __name__ == "__main__":
    serve(_decode_here)
