"""Triangles of strips and fans, with the winding of the glTF specification, 3.7.2.1."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from shadowbench.scenes.polygons import fan_faces, strip_faces

RESTART = 255


def rotated(faces: list[tuple[int, int, int]]) -> list[tuple[int, ...]]:
    """Each triangle from its smallest corner on: the same triangle, the same winding."""
    return [tuple(np.roll(face, -int(np.argmin(face))).tolist()) for face in faces]


def by_the_specification(indices: list[int], fan: bool) -> list[tuple[int, int, int]]:
    faces, run = [], []
    for index in [*indices, RESTART]:
        if index != RESTART:
            run.append(index)
            continue
        for i in range(len(run) - 2):
            if fan:
                faces.append((run[i + 1], run[i + 2], run[0]))
            else:
                faces.append((run[i], run[i + 1 + i % 2], run[i + 2 - i % 2]))
        run = []
    return [face for face in faces if fan or len(set(face)) == 3]


@given(st.lists(st.integers(0, 6) | st.just(RESTART), max_size=30), st.booleans())
def test_triangles_are_those_of_the_specification_also_after_a_restart(indices: list[int], fan: bool) -> None:
    faces = (fan_faces if fan else strip_faces)(np.array(indices, dtype=np.uint8), RESTART)
    assert faces.shape[1:] == (3,) and faces.dtype == np.int64
    assert rotated(faces.tolist()) == rotated(by_the_specification(indices, fan))
