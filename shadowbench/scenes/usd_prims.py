"""Prims of a USD stage: meshes and basic solids as polygons, cameras, lights and colours as tables of scene files."""

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from pxr import UsdGeom, UsdLux, UsdShade

from shadowbench.errors import InputError
from shadowbench.scenes.contents import target_of
from shadowbench.scenes.geometry import check_indices
from shadowbench.scenes.model import GREY, WIDEST_CONE
from shadowbench.scenes.shapes import SHAPES
from shadowbench.scenes.vectors import Floats, Vec3, unit, vec3

Table = dict[str, Any]
AXES = {"X": -1, "Y": 0, "Z": 1}
"""How many places coordinates move, for a solid about the y axis to stand on another."""


class Polygonal(NamedTuple):
    """(V, 3) float64 points, (P,) corners of each polygon, (C,) indices of points; colour; notes."""

    points: Floats
    counts: NDArray[np.int64]
    corners: NDArray[np.int64]
    color: Vec3 = GREY
    notes: tuple[str, ...] = ()

    @property
    def triangles(self) -> int:
        """Number of triangles that the polygons are cut into."""
        return int(np.maximum(self.counts - 2, 0).sum())


def polygonal(prim: Any, time: Any) -> Polygonal | None:
    """The polygons of a mesh or solid, None for any other prim. Raises InputError for invalid ones."""
    if prim.IsA(UsdGeom.Mesh):
        return _mesh(UsdGeom.Mesh(prim), time, f"{prim.GetPath()}")
    solid = SOLIDS.get(str(prim.GetTypeName()))
    if solid is None:
        return None
    name, extents = solid
    values = {each.GetBaseName(): each.Get(time) for each in prim.GetAttributes() if each.HasValue()}
    axis = str(values.get("axis", "Y"))
    triangles = SHAPES[name]()
    points = np.roll(triangles.vertices, AXES[axis], axis=1) * extents(values, axis)
    return Polygonal(points, np.full(len(triangles.faces), 3), triangles.faces.ravel().astype(np.int64))


def _round(values: Table, axis: str) -> Floats:
    sizes = np.full(3, 2.0 * values["radius"])
    sizes["XYZ".index(axis)] = values["height"]
    return sizes


def _flat(values: Table, axis: str) -> Floats:
    width, length = values["width"], values["length"]
    return np.array({"X": (1.0, length, width), "Y": (width, 1.0, length), "Z": (width, length, 1.0)}[axis])


SOLIDS: dict[str, tuple[str, Callable[[Table, str], Floats | float]]] = {
    "Cube": ("box", lambda values, axis: float(values["size"])),
    "Sphere": ("sphere", lambda values, axis: 2.0 * values["radius"]),
    "Cylinder": ("cylinder", _round),
    "Cone": ("cone", _round),
    "Plane": ("plane", _flat),
}
"""Shapes of height and width 1 about the y axis for solids of USD, and their extents along x, y and z."""


def _mesh(mesh: Any, time: Any, where: str) -> Polygonal:
    points = np.array(mesh.GetPointsAttr().Get(time) or [], dtype=np.float64).reshape(-1, 3)
    counts = np.array(mesh.GetFaceVertexCountsAttr().Get(time) or [], dtype=np.int64)
    corners = np.array(mesh.GetFaceVertexIndicesAttr().Get(time) or [], dtype=np.int64)
    if (counts < 0).any() or counts.sum() != len(corners):
        found = f"faceVertexCounts sum to {counts.sum()}"
        raise InputError(f"{where}: {found}; needed are the {len(corners)} of faceVertexIndices")
    check_indices(corners, len(points), where)
    holes = np.array(mesh.GetHoleIndicesAttr().Get(time) or [], dtype=np.int64)
    if len(holes):  # faces that are not drawn
        kept = np.ones(len(counts), dtype=bool)
        kept[holes[(holes >= 0) & (holes < len(counts))]] = False
        counts, corners = counts[kept], corners[np.repeat(kept, counts)]
    if mesh.GetOrientationAttr().Get(time) == UsdGeom.Tokens.leftHanded:
        counts, corners = counts[::-1], corners[::-1]
    smooth = mesh.GetSubdivisionSchemeAttr().Get(time) != UsdGeom.Tokens.none
    notes = ("subdivision surface(s) drawn as their control meshes",) if smooth else ()
    return Polygonal(points, counts, corners, notes=notes)


def color_of(prim: Any, time: Any) -> tuple[Vec3, list[str]]:
    """The linear base colour: the material's, or the prim's own; and a note if it is seen through."""
    notes: list[str] = []
    material = UsdShade.MaterialBindingAPI(prim).ComputeBoundMaterial()[0]
    shader = material.ComputeSurfaceSource()[0] if material else None
    if shader and shader.GetIdAttr().Get(time) == "UsdPreviewSurface":
        opacity, diffuse = shader.GetInput("opacity"), shader.GetInput("diffuseColor")
        if opacity and (opacity.HasConnectedSource() or (opacity.Get(time) or 0.0) < 1.0):
            notes.append("see-through mesh(es) drawn opaque")
        if diffuse and not diffuse.HasConnectedSource() and diffuse.Get(time) is not None:
            return _clipped(diffuse.Get(time)), notes
    shown = UsdGeom.Gprim(prim).GetDisplayColorAttr().Get(time)
    return _clipped(shown[0]) if shown is not None and len(shown) == 1 else GREY, notes


def _clipped(color: Any) -> Vec3:
    return vec3(np.clip(np.nan_to_num(np.array(color, dtype=np.float64)), 0.0, 1.0))


def camera_of(prim: Any, matrix: Floats, time: Any) -> tuple[list[Table], list[str]]:
    """The table of a perspective camera, or the note that it is left out."""
    camera = UsdGeom.Camera(prim)
    if camera.GetProjectionAttr().Get(time) == UsdGeom.Tokens.orthographic:
        return [], ["orthographic camera(s) left out: cameras here are perspective"]
    found = camera.GetCamera(time)
    unit_length = float(np.linalg.norm(matrix[:3, 2]))
    position, forward = matrix[:3, 3], _axis(-matrix[:3, 2], prim)
    table = {
        "name": prim.GetName(),
        "position": position.tolist(),
        "target": list(target_of(position, forward)),
        "up": _axis(matrix[:3, 1], prim).tolist(),
        "fov_y": float(found.GetFieldOfView(found.FOVVertical)),
        "near": found.clippingRange.min * unit_length,
        "far": found.clippingRange.max * unit_length,
    }
    return [table], []


def light_of(prim: Any, matrix: Floats, time: Any) -> tuple[list[Table], list[str]]:
    """The table of a distant, sphere, disk or rect light, and notes on what is left out."""
    values = {each.GetBaseName(): each.Get(time) for each in prim.GetAttributes() if each.HasValue()}
    kind, notes = str(prim.GetTypeName()), []
    if kind not in ("DistantLight", "SphereLight", "DiskLight", "RectLight"):
        return [], [f"light(s) of the kind {kind} left out"]
    if values.get("intensity") == 0.0:
        notes.append("light(s) of intensity 0 kept: they shine and cast shadows")
    across, up, back = (float(length) for length in np.linalg.norm(matrix[:3, :3], axis=0))
    table: Table = {"name": prim.GetName(), "position": matrix[:3, 3].tolist()}
    direction = _axis(-matrix[:3, 2], prim).tolist()
    if kind == "DistantLight":
        del table["position"]
        table |= {"kind": "directional", "direction": direction, "angular_radius": float(values["angle"]) / 2}
    elif kind == "SphereLight":
        radius = 0.0 if values.get("treatAsPoint") else float(values["radius"]) * (across + up + back) / 3
        table |= {"kind": "point", "radius": radius}
        cone = UsdLux.ShapingAPI(prim).GetShapingConeAngleAttr().Get(time) if prim.HasAPI(UsdLux.ShapingAPI) else None
        if cone is not None and 0.0 < cone < 90.0:
            angle = min(2.0 * float(cone), WIDEST_CONE)
            table |= {"kind": "spot", "direction": direction, "angle": angle}
            if angle < 2.0 * cone:
                notes.append(f"light(s) whose cone is taken as {WIDEST_CONE:g}°")
    elif kind == "DiskLight":
        table |= {"kind": "disc", "direction": direction, "radius": float(values["radius"]) * (across + up) / 2}
    else:
        size = [float(values["width"]) * across, float(values["height"]) * up]
        table |= {"kind": "rectangle", "direction": direction, "up": _axis(matrix[:3, 1], prim).tolist(), "size": size}
    return [table], notes


def _axis(vector: Floats, prim: Any) -> Floats:
    if not (np.isfinite(vector).all() and vector.any()):
        raise InputError(f"{prim.GetPath()}: its transform is singular, so that it has no direction")
    return unit(vector)
