"""A figure that walks, posed by angles of its joints."""

from typing import Annotated

import numpy as np
from pydantic import Field

from shadowbench.scenes.geometry import Floats, Triangles
from shadowbench.scenes.solids import capsule

_HIP, _KNEE, _CHEST, _NECK, _HEAD = 0.50, 0.26, 0.78, 0.84, 0.93  # heights, of a figure of height 1
_STRIDE, _SWING, _BEND = np.radians(28.0), np.radians(24.0), np.radians(50.0)


def walker(
    phase: Annotated[float, Field(ge=0.0, le=1.0, strict=True)] = 0.1,
    sections: Annotated[int, Field(ge=4, le=256, strict=True)] = 12,
) -> Triangles:
    """A walking figure of height about 1 that faces +z, of closed limbs that overlap, its feet near y = 0.

    phase: of its stride, a whole one from 0 to 1; sections: around a limb.
    """
    angle = 2 * np.pi * phase
    limbs = [
        _limb((0, _HIP, 0), (0, _CHEST, 0), 0.085, 0.1, sections),
        _limb((0, _NECK, 0), (0, _HEAD, 0.01), 0.03, 0.065, sections),
    ]
    for side in (-1.0, 1.0):
        leg, arm = side * np.sin(angle), -side * np.sin(angle)
        bend = _BEND * max(0.0, side * np.cos(angle)) ** 2 + 0.08
        hip, shoulder = np.array([0.055 * side, _HIP, 0.0]), np.array([0.125 * side, _CHEST, 0.0])
        thigh = _STRIDE * leg
        knee = hip + (_HIP - _KNEE) * _down(thigh)
        ankle = knee + (_KNEE - 0.04) * _down(thigh - bend)
        elbow = shoulder + 0.16 * _down(_SWING * arm)
        hand = elbow + 0.17 * _down(_SWING * arm + 0.5)
        toe = ankle + 0.1 * np.array([0.0, np.sin(thigh - bend), np.cos(thigh - bend)])
        limbs += [_limb(hip, knee, 0.055, 0.043, sections), _limb(knee, ankle, 0.041, 0.03, sections)]
        limbs += [_limb(ankle, toe, 0.032, 0.026, sections), _limb(shoulder, elbow, 0.036, 0.031, sections)]
        limbs.append(_limb(elbow, hand, 0.029, 0.026, sections))
    starts = np.cumsum([0, *(len(limb.vertices) for limb in limbs[:-1])])
    faces = np.concatenate([limb.faces + start for limb, start in zip(limbs, starts, strict=True)])
    vertices = np.concatenate([limb.vertices for limb in limbs])
    return Triangles(vertices - [0.0, vertices[:, 1].min(), 0.0], faces.astype(np.int32))


def _down(angle: float) -> Floats:
    """Unit vector downwards, turned forwards by an angle."""
    return np.array([0.0, -np.cos(angle), np.sin(angle)])


def _limb(start: object, end: object, first: float, last: float, sections: int) -> Triangles:
    """A closed capsule between two points, of radius `first` at the start and `last` at the end."""
    one, other = np.asarray(start, dtype=np.float64), np.asarray(end, dtype=np.float64)
    along = (other - one) / np.linalg.norm(other - one)
    across = np.cross(along, [0.0, 0.0, 1.0] if abs(along[2]) < 0.9 else [0.0, 1.0, 0.0])
    across /= np.linalg.norm(across)
    basis = np.stack([across, along, np.cross(across, along)])
    shape = capsule(sections)
    upper = shape.vertices[:, 1] > 0
    round_part = shape.vertices - np.where(upper, 0.5, -0.5)[:, None] * [0.0, 1.0, 0.0]
    vertices = np.where(upper[:, None], other, one) + 2 * np.where(upper, last, first)[:, None] * round_part @ basis
    return Triangles(vertices, shape.faces)
