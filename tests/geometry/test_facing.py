"""Which triangles face a light, compared with another evaluation of the same determinant."""

import numpy as np

from shadowbench.geometry.facing import IN_PLANE, cap_weights
from shadowbench.scenes.shapes import build_shape

LIGHTS = {
    "sun": (0.3, 1.0, 0.2, 0.0),
    "sun along faces": (0.0, 1.0, 0.0, 0.0),
    "lamp": (1.1, 2.0, 0.3, 1.0),
    "lamp inside": (0.0, 0.1, 0.0, 1.0),
    "lamp in a plane": (0.7, 0.5, 0.1, 1.0),
    "lamp on a face": (0.2, 0.5, 0.1, 1.0),
    "lamp at a corner": (0.5, 0.5, 0.5, 1.0),
}


def weights_by_numpy(
    vertices: np.ndarray, faces: np.ndarray, light: np.ndarray, both_from: int, closed: int
) -> np.ndarray:
    order = np.argsort(faces, axis=1)
    parity = np.where((np.diff(order, axis=1) % 3 == 1).all(axis=1), 1, -1)
    a, b, c = vertices[np.take_along_axis(faces, order, axis=1)].transpose(1, 0, 2)
    normal = np.cross(b - a, c - a)
    volume = np.einsum("ij,ij->i", normal, light[:3] - light[3] * a)
    size = np.einsum("ij,ij->i", np.abs(normal), np.abs(light[:3]) + light[3] * np.abs(a))
    apart = np.abs(vertices[faces] - light[:3]).sum(axis=2).min(axis=1)
    at_corner = (light[3] != 0) & (apart <= IN_PLANE * np.abs(light[:3]).sum())
    in_plane = np.where((np.arange(len(faces)) < closed) & ~at_corner, -1, 0)
    side = np.where(np.abs(volume) <= IN_PLANE * size, in_plane, np.sign(volume) * parity).astype(np.int8)
    side[:both_from] = np.maximum(side[:both_from], 0)
    return side


def test_caps_are_of_the_triangles_that_face_the_light() -> None:
    for kind in ("box", "torus", "cylinder"):
        for light in LIGHTS:
            mesh = build_shape(kind, {}, "test")
            faces, source = mesh.faces.astype(np.int64), np.array(LIGHTS[light])
            for both_from, closed in ((len(faces), len(faces)), (0, len(faces)), (0, 0), (5, 7)):
                arguments = mesh.vertices, faces, source, both_from, closed
                assert np.array_equal(cap_weights(*arguments), weights_by_numpy(*arguments))
