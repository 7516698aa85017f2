"""USD: meshes, basic solids, point instancers, cameras and lights of a stage, in metres and with y up.

Composed and read by usd-core, an extra, in a process of its own.
"""

import json
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from shadowbench.errors import InputError, how_to_install
from shadowbench.scenes.apart import decoded_apart
from shadowbench.scenes.contents import Contents, unique_name
from shadowbench.scenes.geometry import Triangles, checked, welded
from shadowbench.scenes.model import Mesh
from shadowbench.scenes.polygons import Polygons, triangulated
from shadowbench.scenes.tables import MOST_NAMED, camera_from_table, light_from_table
from shadowbench.scenes.vectors import vec3

USD_SUFFIXES = (".usd", ".usda", ".usdc", ".usdz")
LONGEST = 20.0
"""Time limit for reading a file, in seconds."""


def read_usd(path: Path, where: str) -> Contents:
    """The contents of a .usd, .usda, .usdc or .usdz at the first moment of its animation. Raises InputError."""
    if find_spec("pxr") is None:
        raise InputError(f"{where}: USD files need usd-core; {how_to_install('usd')}")
    request = np.frombuffer(json.dumps(str(path.resolve())).encode(), dtype=np.uint8)
    answer, meshes, matrices, *arrays = decoded_apart("shadowbench.scenes.usd_stage", LONGEST, where, request)
    facts: dict[str, Any] = json.loads(bytes(answer))
    drawn, notes = _triangulated(arrays, where)
    instances = [
        (Mesh(name, drawn[mesh].vertices, drawn[mesh].faces, vec3(facts["colors"][mesh])), matrix)
        for name, mesh, matrix in zip(facts["names"], meshes.tolist(), matrices, strict=True)
    ]
    tables = {what: _named(facts[what], what[:-1], where) for what in ("cameras", "lights")}
    cameras = [camera_from_table(table, f"{where}: camera {table['name']}") for table in tables["cameras"]]
    lights = [light_from_table(table, f"{where}: light {table['name']}") for table in tables["lights"]]
    found = [f"{where}: {count} {line}" for line, count in facts["notes"].items()]
    return Contents(instances, cameras, lights, [*found, *notes])


def _triangulated(arrays: list[NDArray[Any]], where: str) -> tuple[list[Triangles], list[str]]:
    """The triangles of each mesh, and notes. arrays: points, counts and corners of each."""
    points, counts, corners = arrays[::3], arrays[1::3], arrays[2::3]
    if not points:
        return [], []
    first = np.cumsum([0, *map(len, points[:-1])])
    owners = np.repeat(np.arange(len(points)), [len(each) for each in counts])
    shifted = [each + start for each, start in zip(corners, first, strict=True)]
    joined = np.concatenate(points)
    checked(joined, where)
    polygons = Polygons(joined, np.concatenate(shifted), np.concatenate(counts), owners, (None,) * len(points), [])
    faces, polygon, notes = triangulated(polygons, where)
    parts = np.split(polygons.corners[faces], np.searchsorted(owners[polygon], np.arange(1, len(points))))
    return [welded(joined, part) for part in parts], notes


def _named(tables: list[dict[str, Any]], kind: str, where: str) -> list[dict[str, Any]]:
    """The tables of cameras or lights with names that differ and that a scene file allows."""
    if len(tables) > MOST_NAMED:
        raise InputError(f"{where}: {len(tables)} {kind}s; allowed are at most {MOST_NAMED}")
    taken: set[str] = set()
    for table in tables:
        table["name"] = unique_name(table["name"], kind, taken)
        taken.add(table["name"])
    return tables
