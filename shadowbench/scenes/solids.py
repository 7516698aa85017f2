"""Solids of revolution around the y axis; `shapes` says their sizes."""

from typing import Annotated

import numpy as np
from pydantic import Field

from shadowbench.scenes.geometry import Floats, Triangles, welded, without_zero_area

_POLE = 1e-8  # radius below which points of a profile are on the axis
Sections = Annotated[int, Field(ge=3, le=1024, strict=True)]  # segments around the axis


def torus(sections: Sections = 64) -> Triangles:
    """A horizontal ring, with half as many sections around the tube as around the axis."""
    angles = np.linspace(0, 2 * np.pi, max(3, sections // 2) + 1)
    angles[-1] = 0
    circle = np.column_stack([np.cos(angles), np.sin(angles)])
    return _revolved(circle * (1 / 6) + [0.5, 0.0], sections)


def cylinder(sections: Sections = 64) -> Triangles:
    """A closed cylinder."""
    return _revolved(np.array([[0, -0.5], [0.5, -0.5], [0.5, 0.5], [0, 0.5]]), sections)


def cone(sections: Sections = 64) -> Triangles:
    """A closed cone with its apex up, centred at half its height."""
    triangles = _revolved(np.array([[0, 0], [0.5, 0], [0, 1]]), sections)
    return Triangles(triangles.vertices - [0.0, 0.5, 0.0], triangles.faces)


def capsule(sections: Sections = 64) -> Triangles:
    """A cylinder of height 1 between two hemispheres."""
    quarter = (max(4, sections // 2) + 1) // 2 + 1  # points from the equator to a pole
    angles = np.concatenate([np.linspace(-np.pi / 2, 0, quarter), np.linspace(0, np.pi / 2, quarter)])
    profile = np.column_stack([np.cos(angles), np.sin(angles)]) * 0.5
    profile[:quarter, 1] -= 0.5
    profile[quarter:, 1] += 0.5
    return _revolved(profile, sections + sections % 2)


def _revolved(profile: Floats, sections: int) -> Triangles:
    """The surface that a profile of (P, 2) radii and heights sweeps around the y axis, upwards on its outside."""
    radius, height = profile.T
    angles = np.linspace(0, 2 * np.pi, sections + 1)[:-1, np.newaxis]
    angles = np.where(np.abs(radius) < _POLE, 0, angles)  # (sections, P)
    points = np.stack(
        [np.cos(angles) * radius, np.sin(angles) * radius, np.broadcast_to(height, angles.shape)], axis=-1
    )
    count = len(radius)
    quad = np.array([[0, count, 1], [1, count, count + 1]])
    strips = np.arange(sections)[:, np.newaxis] * count + np.arange(count - 1)  # the first corner of each quad
    corners = (strips[..., np.newaxis, np.newaxis] + quad).reshape(-1, 3) % (sections * count)
    closed = without_zero_area(welded(points.reshape(-1, 3), corners))[0]
    return Triangles(closed.vertices[:, [0, 2, 1]] * [1.0, 1.0, -1.0], closed.faces)
