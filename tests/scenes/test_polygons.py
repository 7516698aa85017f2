"""Polygonal faces: concave, with bridged holes, bent, self-intersecting; in every format that has them."""

import struct
from collections import Counter
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from shadowbench.scenes.meshes import read_meshes
from shadowbench.scenes.model import Scene
from shadowbench.scenes.polygons import Polygons, fan_faces, strip_faces, triangulated
from tests.scenes.conftest import refused

MeshFile = Callable[[str, str | bytes], Path]
SQUARE = "v 0 0 0\nv 2 0 0\nv 2 2 0\nv 0 2 0\n"


def cut(points: np.ndarray, ring: list[int]) -> tuple[np.ndarray, list[str]]:
    """The triangles of one polygon, and notes."""
    one = Polygons(points, np.array(ring), np.array([len(ring)]), np.zeros(1, dtype=np.int64), (None,), [])
    corners, _, notes = triangulated(one, "a")
    faces = one.corners[corners]
    return faces, notes


def corners_of(contents: Scene) -> np.ndarray:
    """(F, 3, 3)"""
    return np.concatenate([mesh.vertices[mesh.faces] for mesh in contents.meshes])


def area_vectors(triangles: np.ndarray) -> np.ndarray:
    return np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0]) / 2


def area(contents: Scene) -> float:
    return float(np.linalg.norm(area_vectors(corners_of(contents)), axis=1).sum())


def newell(ring: np.ndarray) -> np.ndarray:
    ring = ring - ring[0]
    return np.cross(ring, np.roll(ring, -1, axis=0)).sum(axis=0) / 2


def shoelace(ring: np.ndarray) -> float:
    x, y = ring.T
    return abs(float(x @ np.roll(y, -1) - y @ np.roll(x, -1))) / 2


# Polygons: (V, 2) points and the ring of indices into them.

Polygon = tuple[np.ndarray, list[int]]


def star(chance: np.random.Generator) -> Polygon:
    count = int(chance.integers(4, 30))
    turn = np.linspace(0.0, 2 * np.pi, count, endpoint=False)
    radius = chance.uniform(0.2, 1.0, count)
    return np.stack([radius * np.cos(turn), radius * np.sin(turn)], axis=1), list(range(count))


def star_with_a_hole(chance: np.random.Generator) -> Polygon:
    outer, inner = int(chance.integers(5, 20)), int(chance.integers(3, 12))
    turn = np.concatenate([np.linspace(0, 2 * np.pi, n, endpoint=False) for n in (outer, inner)])
    # A chord between neighbours of radius ≥ 0.7 stays beyond 0.7 cos 36°.
    radius = np.concatenate([chance.uniform(0.7, 1.0, outer), chance.uniform(0.1, 0.5, inner)])
    points = np.stack([radius * np.cos(turn), radius * np.sin(turn)], axis=1)
    return points, [*range(outer), 0, outer, *range(outer + inner - 1, outer - 1, -1)]


def facade(chance: np.random.Generator) -> Polygon:
    """Walls of differing height with windows, bridged from the ground; corners stand on straight lines."""
    bays = int(chance.integers(1, 6))
    points: list[tuple[float, float]] = [(0.0, 0.0)]
    for bay in range(bays):
        x = 3.0 * bay
        points += [(x + 1, 0), (x + 1, 1), (x + 1, 2), (x + 2, 2), (x + 2, 1), (x + 1, 1), (x + 1, 0), (x + 2, 0)]
    points.append((3.0 * bays, 0.0))
    for bay in reversed(range(bays)):
        height = 3.0 + int(chance.integers(3))
        points += [(3.0 * bay + 3, height), (3.0 * bay, height)]
    different = list(dict.fromkeys(points))
    return np.array(different), [different.index(point) for point in points]


def polygons(count: int, bent: bool = False) -> Iterator[tuple[np.ndarray, list[int], float]]:
    """(V, 3) vertices anywhere in space, a ring, and its area by the shoelace formula."""
    chance = np.random.default_rng(7)
    for number in range(count):
        flat, ring = (star, star_with_a_hole, facade)[number % 3](chance)
        ring = ring[::-1] if number % 2 else ring
        start = int(chance.integers(len(ring)))
        ring = ring[start:] + ring[:start]
        heights = chance.uniform(-0.01, 0.01, len(flat)) if bent else np.zeros(len(flat))
        turn, _ = np.linalg.qr(chance.normal(size=(3, 3)))
        turn = np.eye(3) if number % 5 == 0 else turn
        vertices = np.column_stack([flat, heights * np.ptp(flat)]) @ turn.T + chance.normal(size=3)
        yield vertices, ring, shoelace(flat[ring])


def as_obj(vertices: np.ndarray, ring: list[int]) -> bytes:
    lines = [f"v {x!r} {y!r} {z!r}" for x, y, z in vertices.tolist()]
    return "\n".join([*lines, "f " + " ".join(str(k + 1) for k in ring)]).encode()


def rows(vertices: np.ndarray, ring: list[int]) -> str:
    lines = [f"{x!r} {y!r} {z!r}" for x, y, z in vertices.tolist()]
    return "\n".join([*lines, " ".join(map(str, [len(ring), *ring]))])


def as_off(vertices: np.ndarray, ring: list[int]) -> bytes:
    return f"OFF\n{len(vertices)} 1 0\n{rows(vertices, ring)}".encode()


def ply_header(kind: str, vertices: int, faces: int = 1, face: str = "property list uchar int vertex_indices\n") -> str:
    axes = "".join(f"property double {axis}\n" for axis in "xyz")
    return f"ply\nformat {kind} 1.0\nelement vertex {vertices}\n{axes}element face {faces}\n{face}end_header\n"


def as_text_ply(vertices: np.ndarray, ring: list[int]) -> bytes:
    return (ply_header("ascii", len(vertices)) + rows(vertices, ring)).encode()


def as_little_ply(vertices: np.ndarray, ring: list[int]) -> bytes:
    body = vertices.astype("<f8").tobytes() + bytes([len(ring)]) + np.array(ring, dtype="<i4").tobytes()
    return ply_header("binary_little_endian", len(vertices)).encode() + body


WRITERS = {
    "a.obj": as_obj, "b.off": as_off, "c.ply": as_text_ply, "d.ply": as_little_ply,
}  # fmt: skip


def test_a_planar_polygon_has_the_area_of_the_shoelace_formula(mesh_file: MeshFile) -> None:
    for number, (vertices, ring, expected) in enumerate(polygons(200)):
        name, write = list(WRITERS.items())[number % len(WRITERS)]
        contents = read_meshes(mesh_file(name, write(vertices, ring)))
        assert area(contents) == pytest.approx(expected, rel=1e-9)
        assert contents.notes == ()
        assert (area_vectors(corners_of(contents)) @ newell(vertices[ring]) > 0.0).all()


def test_a_bent_polygon_covers_its_projection_once_and_is_a_note(mesh_file: MeshFile) -> None:
    for vertices, ring, _ in polygons(60, bent=True):
        if np.linalg.matrix_rank(vertices[ring] - vertices[ring[0]], tol=1e-3) < 3:
            continue
        contents = read_meshes(mesh_file("a.obj", as_obj(vertices, ring)))
        normal = newell(vertices[ring])
        size = float(np.linalg.norm(normal))
        projected = area_vectors(corners_of(contents)) @ normal / size
        assert projected.sum() == pytest.approx(size, rel=1e-9)
        assert (projected > -1e-12 * size).all()
        assert contents.notes == ("a.obj: 1 polygon(s) not planar: cut as seen along their mean normal",)


def test_the_outline_of_the_triangles_is_the_ring_also_at_corners_on_straight_lines() -> None:
    for vertices, ring, _ in polygons(200):
        faces, _ = cut(vertices, ring)
        outline: Counter[tuple[int, int]] = Counter()
        for loop, sign in [*((face.tolist(), 1) for face in faces), (ring, -1)]:
            for a, b in zip(loop, loop[1:] + loop[:1], strict=True):
                outline[min(a, b), max(a, b)] += (a < b) * sign - (b < a) * sign
        assert not any(outline.values())


def test_a_polygon_that_crosses_itself_and_faces_that_are_none_are_named(mesh_file: MeshFile) -> None:
    contents = read_meshes(mesh_file("a.obj", SQUARE + "f 1 3 2 4\nf 1 2\nf 3\nf 1 2 3\n"))
    assert contents.notes == (
        "a.obj: 2 face(s) of fewer than 3 corners left out",
        "a.obj: 1 polygon(s) that cross themselves: cut as fans from their first corner",
    )
    assert len(corners_of(contents)) == 3


def test_any_ring_keeps_its_area_vector_and_its_projected_area_unless_a_note_says_that_it_crosses() -> None:
    chance = np.random.default_rng(3)
    for number in range(1000):
        count = int(chance.integers(4, 11))
        points = chance.integers(0, 3, (count, 3)).astype(float) * [1, 1, number % 2 and chance.choice([1e-5, 1e-2, 1])]
        faces, notes = cut(points, list(range(count)))
        expected, vectors = newell(points), area_vectors(points[faces])
        assert vectors.sum(axis=0) == pytest.approx(expected, abs=1e-6)
        size = float(np.linalg.norm(expected))
        if size > 0.0 and not any("cross themselves" in note for note in notes):
            assert np.abs(vectors @ expected).sum() == pytest.approx(size**2, rel=1e-5)


# What each format may say.


def test_an_obj_keeps_every_face_however_it_is_written(mesh_file: MeshFile) -> None:
    for text, expected in (
        (SQUARE + "f 1 2 3\nf\t1 3 4\n", 4.0),
        (SQUARE + "f 1 2 3\n  f 1 3 4\n", 4.0),
        (SQUARE + "f 1 2 3 4 # the only one\n", 4.0),
        (SQUARE + "f 1 2 3 4# the only one\n", 4.0),
        (SQUARE + "f 1 2 \\\n3 4\n", 4.0),
        (SQUARE.replace("\n", " 1.0 # a corner\n") + "\tf  1/1/1 2//2 3/3 4\t\n", 4.0),
        (SQUARE.replace("\n", "\r\n") + "f 1 2 3\r\nf 1 3 4\r\n", 4.0),
        (SQUARE.replace("v ", "v\t") + "f -4 -3 -2 -1\n", 4.0),
        ("v 0 0 0\nv 1 0 0\nv 0 1 0\nf -3 -2 -1\nv 0 0 1\nf -1 -2 -3\n", 0.5 + np.sqrt(3) / 2),
        ("f 1 2 3 4\n" + SQUARE, 4.0),
        (SQUARE + "o #1\nf 1 2 3\no #2\nf 1 3 4", 4.0),
        (SQUARE + "f 1 2 3\nf 1 3 4\\", 4.0),
        ("\ufeff" + SQUARE + "f 1 2 3 4\n", 4.0),
    ):
        contents = read_meshes(mesh_file("a.obj", text))
        assert area(contents) == pytest.approx(expected)
        assert contents.notes == ()


def test_an_off_keeps_every_face(mesh_file: MeshFile) -> None:
    for text in (
        "\ufeffOFF\n5 2 0\n0 0 0\n2 0 0\n2 2 0\n0 2 0\n4 1 0\n4 0 1 2 3\n3 1 4 2\n",
        "OFF\n5 2 0\n0 0 0\n2 0 0\n2 2 0\n0 2 0\n4 1 0\n4 0 1 2 3 # x\n3 1 4 2\n",
        "# first\nOFF 5 2 0\n\n0 0 0\n2 0 0\n2 2 0\n0 2 0\n4 1 0\n 4 0 1 2 3 255 0 0\n3 1 4 2 0.5 0.5 0.5\n",
        "COFF\n5 2\n"
        + "".join(f"{v} 1 0 0 1\n" for v in ("0 0 0", "2 0 0", "2 2 0", "0 2 0", "4 1 0"))
        + "4 0 1 2 3\n3 1 4 2\n",
    ):
        contents = read_meshes(mesh_file("a.off", text))
        assert (area(contents), contents.notes) == (pytest.approx(6.0), ())


FIVE = np.array([[0, 0, 0], [2, 0, 0], [2, 2, 0], [0, 2, 0], [4, 1, 0.0]])


def test_a_binary_ply_mixes_triangles_quads_and_other_properties(mesh_file: MeshFile) -> None:
    codes = {"uchar": "B", "ushort": "H", "int": "i", "uint": "I", "short": "h", "float": "f", "double": "d"}
    for kind, length, before, after in (
        ("binary_little_endian", "uchar", "", ""),
        ("binary_big_endian", "ushort", "uchar", ""),
        ("binary_little_endian", "int", "", "float"),
        ("binary_big_endian", "uint", "short", "double"),
    ):
        order = "<" if "little" in kind else ">"
        header = f"property {before} first\n" * bool(before) + f"property list {length} int vertex_index\n"
        header += f"property {after} last\n" * bool(after)
        body = FIVE.astype(order + "f8").tobytes()
        for ring in ((0, 1, 2, 3), (1, 4, 2)):
            body += struct.pack(order + codes[before], 7) if before else b""
            body += struct.pack(f"{order}{codes[length]}{len(ring)}i", len(ring), *ring)
            body += struct.pack(order + codes[after], 7) if after else b""
        contents = read_meshes(mesh_file("a.ply", ply_header(kind, 5, 2, header).encode() + body))
        assert (area(contents), contents.notes) == (pytest.approx(6.0), ())


def test_a_text_ply_has_scalars_beside_lists_and_rows_that_are_no_faces(mesh_file: MeshFile) -> None:
    face = "property uchar red\nproperty list ushort uint vertex_indices\nproperty list uchar float texcoord\n"
    vertices = "\n".join(" ".join(map(str, row)) for row in FIVE.tolist())
    text = ply_header("ascii", 5, 2, face) + vertices + "\n9 4 0 1 2 3 2 0.5 0.5\n9 3 1 4 2 0\n"
    for mark in ("", "\ufeff"):
        assert area(read_meshes(mesh_file("a.ply", mark + text))) == pytest.approx(6.0)
    edges = (
        text.replace("end_header", "element edge 1\nproperty int vertex1\nproperty int vertex2\nend_header") + "0 1\n"
    )
    assert read_meshes(mesh_file("b.ply", edges)).notes == ("b.ply: rows left out that are no faces: 1 edge",)


def test_a_damaged_binary_ply_is_one_line(mesh_file: MeshFile) -> None:
    for damage, words in (
        (lambda data: data[:-1], ["cut short"]),
        (lambda data: data.replace(b"uchar int", b"int int"), ["cut short"]),
        (lambda data: data.replace(b"\x03\0\0\0\0", b"\xff\0\0\0\0"), ["cut short"]),
        (lambda data: data.replace(b"\1\0\0\0", b"\xff\xff\xff\xff"), ["vertex -1"]),
    ):
        refused(mesh_file("a.ply", damage(as_little_ply(FIVE, [0, 1, 2]))), "a.ply", *words)


def test_files_that_were_once_misread_have_the_right_area(shared_scenes: Path) -> None:
    for name, expected in (
        ("annulus.obj", 12.0),
        ("tab1.obj", 4.0),
        ("ind1.obj", 4.0),
        ("trailc.off", 6.0),
        ("mix1.ply", 6.0),
        ("polygonfaces.obj", 1_162_570.385),
    ):
        contents = read_meshes(shared_scenes.parent / "cases" / name)
        assert area(contents) == pytest.approx(expected)
        assert not any("cross themselves" in note for note in contents.notes)


# Strips and fans, with the winding of the glTF specification, 3.7.2.1.

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
