"""Vectors in float64."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Vec3 = tuple[float, float, float]


def vec3(values: Sequence[float] | Floats) -> Vec3:
    """Three numbers as a hashable tuple of floats."""
    x, y, z = (float(value) for value in values)
    return (x, y, z)


def unit(vector: Sequence[float] | Floats) -> Floats:
    """(3,) float64 unit vector. Raises ZeroDivisionError for a zero or non-finite vector."""
    array = np.asarray(vector, dtype=np.float64)
    largest = float(np.abs(array).max())
    if not largest > 0.0 or not np.isfinite(largest):
        raise ZeroDivisionError(f"no direction in {array}")
    array = array / largest  # avoids underflow and overflow of the squares of 1e-200 and 1e200
    return array / np.linalg.norm(array)


def rotation(axis: Sequence[float] | Floats, angle: float) -> Floats:
    """(3, 3) right-handed rotation about an axis, by an angle in radians (Rodrigues)."""
    x, y, z = unit(axis)
    skew = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    turn: Floats = np.eye(3) + np.sin(angle) * skew + (1 - np.cos(angle)) * skew @ skew
    return turn


def cross(a: Floats, b: Floats) -> Floats:
    """(3,) cross product of two vectors, with the bits of np.cross, which takes 20 times as long."""
    (x, y, z), (u, v, w) = a.tolist(), b.tolist()
    return np.array([y * w - z * v, z * u - x * w, x * v - y * u])


def perpendicular_basis(back: Floats, up: Sequence[float] | Floats) -> Floats:
    """(3, 3) right-handed basis with rows right, up, back; the last is the unit vector `back`.

    An `up` parallel to `back` is replaced by the coordinate axis most perpendicular to `back`.
    """
    right = cross(unit(up), back)
    if np.linalg.norm(right) < 1e-6:
        right = cross(np.eye(3)[np.argmin(np.abs(back))], back)
    right = unit(right)
    return np.array([right, cross(back, right), back])
