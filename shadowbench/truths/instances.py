"""Embree scenes of instances: each source of triangles once, and moved in float32 as often as it is drawn."""

from functools import reduce

import numpy as np
from numpy.typing import NDArray

from shadowbench.errors import TooLarge
from shadowbench.scenes.geometry import Geometry, bounds_of
from shadowbench.scenes.instanced import InstancedGeometry
from shadowbench.scenes.vectors import Floats
from shadowbench.truths.embree import InstanceTracer, Tracer

BY_LAMP = 1 / 16
"""Share of an instance's extent within which a lamp is so close to it that float32 must see it from there."""


def tracer_of(geometry: Geometry) -> Tracer:
    """A tracer of all triangles."""
    if isinstance(geometry, InstancedGeometry):
        return _instance_tracers(geometry, None)[0]
    return Tracer(geometry.vertices, geometry.faces, geometry.cutouts)


def tracers_of(geometry: Geometry, lamp: Floats | None) -> tuple[Tracer, Tracer, Tracer | None]:
    """Tracers of all triangles and of the casters, and of these relative to a lamp (3,), if there is one.

    In float32 relative to the light, casters keep their direction from the light, however close to it they are.
    """
    if isinstance(geometry, InstancedGeometry):
        return _instance_tracers(geometry, lamp)
    casters = geometry.caster_faces, geometry.caster_cutouts
    everything, all_cast = tracer_of(geometry), geometry.caster_count == geometry.count
    of_casters = everything if all_cast else Tracer(geometry.vertices, *casters)
    return everything, of_casters, None if lamp is None else Tracer(geometry.vertices - lamp, *casters)


def world_matrices(geometry: InstancedGeometry) -> Floats:
    """(M, 4, 4) matrices from the points of each mesh to the world."""
    matrices: Floats = reduce(lambda inner, outer: outer @ inner, geometry.moves)
    return matrices


def _instance_tracers(geometry: InstancedGeometry, lamp: Floats | None) -> tuple[Tracer, Tracer, Tracer | None]:
    from shadowbench.compiled import DISABLED  # Numba takes 0.4 s to import
    from shadowbench.truths.packets import InstanceScene, PacketScene, default_device

    device = default_device()
    if device is None:
        disabled, missing = "NUMBA_DISABLE_JIT is set", "no library of embreex that has them can be loaded"
        cause = disabled if DISABLED else missing
        raise TooLarge(f"scenes of instances need packets of rays, and {cause}")
    scenes, matrices = [], world_matrices(geometry)
    for number, mesh in enumerate(geometry.sources):
        # About of unit size at the origin, where float32 is as precise as for a whole scene in local coordinates.
        low, high = bounds_of(mesh.points)
        scale, center = 2.0 ** np.round(np.log2(np.linalg.norm(high - low))), (low + high) / 2
        scenes.append(PacketScene(device, ((mesh.points - center) / scale).astype(np.float32), mesh.faces))
        unit = np.diag([scale, scale, scale, 1.0])
        unit[:3, 3] = center
        matrices[geometry.source == number] = matrices[geometry.source == number] @ unit
    parts, first = [scenes[number] for number in geometry.source], geometry.first[:-1].astype(np.int32)

    def tracer(chosen: NDArray[np.intp], parts: list[PacketScene], matrices: Floats) -> Tracer:
        own = [parts[number] for number in chosen]
        return InstanceTracer(InstanceScene(device, own, matrices[chosen, :3].astype(np.float32), first[chosen]))

    every, casters = np.arange(len(parts)), np.flatnonzero(geometry.mesh_casts)
    everything = tracer(every, parts, matrices)
    of_casters = everything if len(casters) == len(every) else tracer(casters, parts, matrices)
    if lamp is None:
        return everything, of_casters, None
    low, high = geometry.mesh_bounds.swapaxes(0, 1)
    margin = BY_LAMP * np.linalg.norm(high - low, axis=1, keepdims=True)
    moved = matrices.copy()
    moved[:, :3, 3] -= lamp
    for close in np.flatnonzero(((low - margin <= lamp) & (lamp <= high + margin)).all(axis=1)):
        mesh = geometry.meshes[close]
        parts[close] = PacketScene(device, (mesh.vertices - lamp).astype(np.float32), mesh.faces)
        moved[close] = np.eye(4)
    return everything, of_casters, tracer(casters, parts, moved)
