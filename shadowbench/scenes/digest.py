"""Content hashes of geometry and views, for the keys of cached truths and rows."""

import hashlib

import numpy as np

from shadowbench.scenes.geometry import Geometry
from shadowbench.scenes.model import View


def geometry_digest(geometry: Geometry) -> str:
    """Hex digest of all properties of triangles that affect shadows; colours do not."""
    digest = hashlib.sha256()
    for array in (geometry.vertices, geometry.faces, geometry.casts, geometry.receives):
        digest.update(repr((array.shape, array.dtype.str)).encode())
        digest.update(np.ascontiguousarray(array).tobytes())
    if geometry.planar.any():  # used by planar-projection:receives=flagged
        digest.update(np.ascontiguousarray(geometry.planar).tobytes())
    return digest.hexdigest()


def view_digest(view: View) -> str:
    """Hex digest of a view's geometry, camera, light and size, without names."""
    camera, light = view.camera, view.light
    parts = (
        geometry_digest(view.scene.geometry),
        (camera.position, camera.target, camera.up, camera.fov_y, camera.near, camera.far),
        (light.kind, light.direction, light.position, light.angle, light.radius, light.size, light.up),
        view.size,
    )
    return hashlib.sha256(repr(parts).encode()).hexdigest()
