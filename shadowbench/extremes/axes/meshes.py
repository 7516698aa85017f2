"""The axis of mesh defects, as left behind by modelling tools and scanners."""

from collections.abc import Callable

import numpy as np

from shadowbench.extremes.axes.model import Axis, Setting, base_meshes, light_at, view_of_meshes
from shadowbench.scenes.geometry import Triangles, without_zero_area
from shadowbench.scenes.model import LightKind, Mesh

_FLAT = 1e-7  # height of a sliver relative to its longest edge


def _closed(mesh: Triangles) -> Triangles:
    return mesh


def _slivers(mesh: Triangles) -> Triangles:
    """Every triangle cut in three at a point close to the middle of an edge, so that one part is a sliver."""
    a, b, c = (mesh.vertices[mesh.faces[:, k]] for k in range(3))
    inner = (a + b) / 2 * (1 - _FLAT) + c * _FLAT
    corners = [np.stack([a, b, inner], 1), np.stack([b, c, inner], 1), np.stack([c, a, inner], 1)]
    return _loose(np.concatenate(corners))


def _zero_area(mesh: Triangles) -> Triangles:
    """A triangle of zero area added on every edge, then dropped as loading does."""
    a, b = (mesh.vertices[mesh.faces[:, k]] for k in range(2))
    flat = _loose(np.stack([a, b, (a + b) / 2], 1))
    whole = Triangles(
        np.concatenate([mesh.vertices, flat.vertices]), np.concatenate([mesh.faces, flat.faces + len(mesh.vertices)])
    )
    return without_zero_area(whole)[0]


def _duplicated(mesh: Triangles) -> Triangles:
    """Every triangle twice, every third one three times."""
    return Triangles(mesh.vertices, np.concatenate([mesh.faces, mesh.faces, mesh.faces[::3]]))


def _t_junctions(mesh: Triangles) -> Triangles:
    """Every second triangle split at the middle of an edge that its neighbour keeps unsplit."""
    a, b, c = (mesh.vertices[mesh.faces[::2, k]] for k in range(3))
    middle = (a + b) / 2
    kept = mesh.vertices[mesh.faces[1::2]]
    return _loose(np.concatenate([kept, np.stack([a, middle, c], 1), np.stack([middle, b, c], 1)]))


def _inconsistent_winding(mesh: Triangles) -> Triangles:
    """Every third triangle with reversed winding."""
    faces = mesh.faces.copy()
    faces[::3] = faces[::3, ::-1]
    return Triangles(mesh.vertices, faces)


def _open(mesh: Triangles) -> Triangles:
    """Every fifth triangle missing."""
    return Triangles(mesh.vertices, mesh.faces[np.arange(len(mesh.faces)) % 5 != 0])


def _loose(corners: np.ndarray) -> Triangles:
    """Triangles from (N, 3, 3) corners, no vertex shared."""
    return Triangles(corners.reshape(-1, 3), np.arange(3 * len(corners), dtype=np.int32).reshape(-1, 3))


_KINDS: dict[str, Callable[[Triangles], Triangles]] = {
    "closed": _closed,
    "slivers": _slivers,
    "zero-area": _zero_area,
    "duplicated": _duplicated,
    "t-junctions": _t_junctions,
    "inconsistent-winding": _inconsistent_winding,
    "open": _open,
}


def _ill_made(name: str, kind: LightKind) -> Setting:
    floor, *casters = base_meshes()
    defective = [(_KINDS[name](Triangles(caster.vertices, caster.faces)), caster.name) for caster in casters]
    meshes = [Mesh(mesh_name, mesh.vertices, mesh.faces) for mesh, mesh_name in defective]
    return Setting((view_of_meshes([floor, *meshes], light_at(kind)),))


MESH = Axis(
    name="mesh",
    about="defects of casters: slivers, duplicated triangles, T-junctions, inconsistent winding, holes",
    unit="",
    values=tuple(_KINDS),
    default="closed",
    quick=("closed", "slivers", "inconsistent-winding", "open"),
    lights=("directional", "point"),
    invariant="triangles cast shadows whatever the mesh's topology",
    change=_ill_made,
    ordered=False,
)
