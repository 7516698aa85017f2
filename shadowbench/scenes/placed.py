"""Meshes placed in the world, with triangles of their own, or, in large scenes, with those of all their instances."""

from collections import Counter
from collections.abc import Iterable, Iterator
from dataclasses import replace
from functools import reduce

import numpy as np
from numpy.typing import NDArray

from shadowbench.errors import InputError
from shadowbench.scenes.geometry import (
    MOST_DRAWN,
    MOST_TRIANGLES,
    Triangles,
    bounds_of,
    checked,
    heights,
    mirrors,
    transformed,
    used_by,
    with_area,
)
from shadowbench.scenes.mesh import CORNERS, Mesh, shared_key
from shadowbench.scenes.vectors import Floats

MOST_SKEWED = 1e4
"""Ratio of the longest to the shortest scale of an instance above which it has triangles of its own."""

_BATCH = 1 << 12
"""Triangles that are looked at together, at least."""


def is_large(meshes: Iterable[Mesh], where: str) -> bool:
    """Whether meshes have so many triangles that instances must share theirs. Raises InputError for too many."""
    times = Counter(shared_key(mesh) for mesh in meshes)
    own, drawn = sum(key[-1] for key in times), sum(key[-1] * number for key, number in times.items())
    if own > MOST_TRIANGLES:
        raise InputError(
            f"{where}: {own} triangles; a scene may have {MOST_TRIANGLES}, those of instances counted once"
        )
    if drawn > MOST_DRAWN:
        raise InputError(f"{where}: {drawn} triangles of all instances; a scene may have {MOST_DRAWN}")
    return drawn > MOST_TRIANGLES


def placed(instances: Iterable[tuple[Mesh, Floats]], where: str) -> tuple[list[Mesh], int]:
    """The meshes under affine (4, 4) matrices without triangles of zero area, and the number of those.

    Raises InputError that begins with `where` for coordinates that become infinite or too large.
    """
    meshes, dropped = [], 0
    for mesh, matrix, (vertices, faces), kept in _moved(instances, where):
        lost = int(len(kept) - kept.sum())
        dropped += lost
        if lost:  # and without the vertices that only those used
            used, corners = np.unique(faces[kept], return_inverse=True)
            vertices, faces = vertices[used], corners.reshape(-1, 3).astype(np.int32)
        if len(faces):
            meshes.append(mesh.reshaped(vertices, faces, matrix, kept if lost else None))
    return meshes, dropped


def _moved(
    instances: Iterable[tuple[Mesh, Floats]], where: str
) -> Iterator[tuple[Mesh, Floats, Triangles, NDArray[np.bool_]]]:
    """Meshes, their matrices, their triangles under these, and which have an area; many tiny meshes are one batch."""
    batch = list[tuple[Mesh, Floats, Triangles]]()
    held = 0

    def looked_at() -> Iterator[tuple[Mesh, Floats, Triangles, NDArray[np.bool_]]]:
        vertices = checked(np.concatenate([each.vertices for *_, each in batch]), where)
        first = np.cumsum([0, *(len(each.vertices) for *_, each in batch)])
        ends = np.cumsum([len(each.faces) for *_, each in batch])
        faces = [each.faces + start for (*_, each), start in zip(batch, first, strict=False)]
        kept = np.split(with_area(Triangles(vertices, np.concatenate(faces))), ends[:-1])
        for (mesh, matrix, triangles), own in zip(batch, kept, strict=True):
            yield mesh, matrix, triangles, own

    for mesh, matrix in instances:
        batch.append((mesh, matrix, transformed(Triangles(mesh.vertices, mesh.faces), matrix)))
        held += len(mesh.faces)
        if held >= _BATCH:
            yield from looked_at()
            batch.clear()
            held = 0
    if batch:
        yield from looked_at()


def shared(instances: Iterable[tuple[Mesh, Floats]], where: str) -> tuple[list[Mesh], int]:
    """As `placed`, but the instances of a mesh share its triangles. Raises InputError for cut-out ones too."""
    meshes: list[Mesh] = []
    sources: dict[tuple[object, ...], Mesh] = {}
    least: dict[object, list[float]] = {}
    dropped = own = 0
    for mesh, matrix in instances:
        if mesh.cutout is not None:
            found = f"{mesh.name!r:.60} is cut out, in a scene of more than {MOST_TRIANGLES} triangles"
            raise InputError(f"{where}: {found}; allowed are opaque instances")
        copy, key = replace(mesh, moves=(*mesh.moves, matrix)), shared_key(mesh)
        vertices = checked(copy.vertices, where)
        if key not in least:
            least[key] = [values.min(initial=np.inf) for values in heights(Triangles(mesh.points, mesh.faces))]
        height, edge = least[key]
        scales = np.linalg.svd(reduce(np.matmul, reversed(copy.moves))[:3, :3], compute_uv=False)
        skewed = bool(scales[0] > MOST_SKEWED * scales[2])
        # No triangle of these is flattened, by far, nor by rounding; of others, each is looked at.
        if (
            skewed
            or height * scales[2] ** 2 < 1e-6 * scales[0] ** 2
            or edge * scales[2] < 1e-6 * np.abs(vertices).max()
        ):
            kept = with_area(Triangles(vertices, mesh.faces))
        else:
            kept = np.ones(len(mesh.faces), dtype=bool)
        lost = int(len(kept) - kept.sum())
        if skewed:  # rays could not be moved to its source
            more, _ = placed([(mesh.with_vertices(mesh.vertices), matrix)], where)
            meshes += more
            own += len(kept) - lost
        elif lost < len(kept):
            number = key, mirrors(matrix), kept.tobytes() if lost else b""
            if number not in sources:
                sources[number] = _source(mesh, mirrors(matrix), kept)
                own += len(kept) - lost
            same = {name: getattr(sources[number], name) for name in ("points", "faces", "tints", *CORNERS)}
            bounds = bounds_of(used_by(mesh.faces[kept], vertices) if lost else vertices)
            meshes.append(replace(copy, **same).with_bounds(bounds))
        dropped += lost
        if own > 2 * MOST_TRIANGLES:  # of mirrored ones too
            found = f"more than {2 * MOST_TRIANGLES} triangles that no two instances share"
            raise InputError(f"{where}: {found}, as those of zero area are left out; allowed are fewer")
    return meshes, dropped


def _source(mesh: Mesh, mirrored: bool, kept: NDArray[np.bool_]) -> Mesh:
    """A mesh of the kept triangles, for instances that mirror it or not."""
    points, faces = mesh.points, mesh.faces
    if not kept.all():
        used, corners = np.unique(faces[kept], return_inverse=True)
        points, faces = points[used], corners.reshape(-1, 3).astype(np.int32)
    faces = np.ascontiguousarray(faces[:, ::-1]) if mirrored else faces
    return mesh.picked(points, faces, mirrored, None if kept.all() else kept)
