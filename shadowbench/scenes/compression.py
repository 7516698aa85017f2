"""Decoders of compressed glTF, which the extra `compressed` installs.

meshopt's streams are decoded here, within the bytes that the file's layout allows them; Draco's in a process of its
own, as a few of their bytes can stand for gigabytes.
"""

import pickle
import subprocess
import sys
from collections.abc import Mapping
from contextlib import suppress
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from shadowbench.errors import InputError, module_of_extra
from shadowbench.scenes.triangles import MOST_TRIANGLES

MOST_MEMORY = 2 << 30
"""Memory limit of the process that decodes Draco, in bytes."""
LONGEST = 20.0
"""Time limit for decoding all of a file's Draco primitives, in seconds."""


class DracoBlob(NamedTuple):
    """A compressed primitive, and the Draco ids of its attributes by their names."""

    data: bytes
    ids: Mapping[str, int]


class DracoMesh(NamedTuple):
    """A decoded primitive: by name, (V, n) attributes as an accessor would hold them; (F, 3) int64 faces."""

    attributes: Mapping[str, NDArray[Any]]
    faces: NDArray[np.int64]


def decode_draco(blobs: list[DracoBlob], where: str) -> list[DracoMesh]:
    """The decoded primitives. Raises InputError that begins with `where` if one cannot be decoded."""
    where = f"{where}: KHR_draco_mesh_compression"
    module_of_extra("DracoPy", "compressed", f"{where}: is decompressed by")
    # -P: do not import from the current folder, which may have a numpy.py.
    command, blobs_as_bytes = [sys.executable, "-P", "-m", __name__], pickle.dumps(blobs)
    try:
        done = subprocess.run(command, input=blobs_as_bytes, capture_output=True, timeout=LONGEST, check=False)
    except subprocess.TimeoutExpired as error:
        raise InputError(f"{where}: took more than {LONGEST:.0f} s to decode") from error
    if done.returncode != 0:
        last_line = done.stderr.decode(errors="replace").strip().rpartition("\n")[2]
        crash = f"the decoder died with code {done.returncode}"
        raise InputError(f"{where}: {last_line[:160] if done.returncode == 1 else crash}")
    return [DracoMesh(*mesh) for mesh in pickle.loads(done.stdout)]


def decode_meshopt(stream: bytes, count: int, size: int, mode: str, filtered: str, where: str) -> bytes:
    """`count` elements of `size` bytes of a stream of a mode, without its filter. Raises InputError or ValueError."""
    meshopt = module_of_extra("meshopt", "compressed", f"{where}: is decompressed by")
    return bytes(meshopt.decode_gltf_buffer(stream, count, size, mode, filtered)) if count else b""


def _decode_here(blobs: list[DracoBlob]) -> list[tuple[dict[str, NDArray[Any]], NDArray[np.int64]]]:
    """The fields of a `DracoMesh` for each blob."""
    import DracoPy  # type: ignore[import-not-found]  # compiled, without stubs

    meshes, triangles = [], 0
    for blob in blobs:
        mesh = DracoPy.decode(blob.data)
        faces = np.asarray(getattr(mesh, "faces", ()), dtype=np.int64).reshape(-1, 3)
        triangles += len(faces)
        if triangles > MOST_TRIANGLES:
            raise ValueError(f"more than {MOST_TRIANGLES} triangles")
        rows = {row["unique_id"]: row["data"].reshape(len(row["data"]), -1) for row in mesh.attributes}
        meshes.append(({name: rows[number] for name, number in blob.ids.items()}, faces))
    return meshes


def _main() -> None:
    """Decode the blobs of standard input to standard output, within MOST_MEMORY."""
    import resource  # of POSIX alone

    with suppress(ValueError):  # macOS may refuse
        resource.setrlimit(resource.RLIMIT_AS, (MOST_MEMORY, MOST_MEMORY))
    sys.stdout.buffer.write(pickle.dumps(_decode_here(pickle.load(sys.stdin.buffer))))


if __name__ == "__main__":
    _main()
