"""What a USD stage holds, read by usd-core in a process of its own: python -m shadowbench.scenes.usd_stage.

The answer is an array of JSON bytes, and arrays, as `StageArrays` has them. Matrices map column vectors, unlike USD's.
"""

import json
import math
from collections import Counter
from collections.abc import Iterator
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from pxr import Gf, Usd, UsdGeom, UsdLux, UsdSkel

from shadowbench.errors import InputError
from shadowbench.scenes.apart import serve
from shadowbench.scenes.geometry import MOST_TRIANGLES
from shadowbench.scenes.tables import MOST_COPIES
from shadowbench.scenes.usd_layers import check_layers
from shadowbench.scenes.usd_prims import Polygonal, camera_of, color_of, light_of, polygonal
from shadowbench.scenes.vectors import Floats

MOST_MEMORY = 6 << 30
"""Memory limit of the process, in bytes: USD reserves more than it uses."""
DEEPEST = 10
"""Most point instancers of which each is a prototype of the next."""


class Item(NamedTuple):
    """A drawn mesh: the path that its arrays are read from, the prim's name, and its (4, 4) matrix."""

    path: str
    name: str
    matrix: Floats


class Place(NamedTuple):
    """What a prim inherits: its parent's (4, 4) matrix to the world, and whether and for what purpose it is drawn."""

    matrix: Floats
    visible: bool
    purpose: str


class Reader:
    """Collects what is drawn of a stage at a time."""

    def __init__(self, stage: Any, time: Any) -> None:
        self.time = time
        self.meshes: dict[str, Polygonal] = {}
        self.cameras: list[dict[str, Any]] = []
        self.lights: list[dict[str, Any]] = []
        self.notes: Counter[str] = Counter()
        self.triangles = 0
        self.root = np.eye(4)
        self.root[:3, :3] *= _metres(stage)
        if UsdGeom.GetStageUpAxis(stage) == UsdGeom.Tokens.z:
            self.root[:3] = self.root[[0, 2, 1]] * [[1.0], [1.0], [-1.0]]
        self.items = self._below(stage.GetPseudoRoot(), Place(self.root, True, "default"), 0)

    def _below(self, top: Any, place: Place, depth: int) -> list[Item]:
        """The meshes of a prim and its descendants, as often as they are drawn."""
        items: list[Item] = []
        waiting = [(top, place)]
        while waiting:
            prim, inherited = waiting.pop()
            if prim.HasAuthoredMetadata("clips"):
                raise InputError(f"{prim.GetPath()}: value clips are not supported")
            here = self._place(prim, inherited)
            if prim.IsA(UsdGeom.PointInstancer):
                items += self._instanced(prim, here, depth)
            else:
                items += self._one(prim, here)
                children = prim.GetFilteredChildren(Usd.TraverseInstanceProxies(Usd.PrimDefaultPredicate))
                waiting += [(child, here) for child in reversed(children)]
            if len(items) > MOST_COPIES:
                raise InputError(f"more than {MOST_COPIES} meshes, each copy counted")
        return items

    def _place(self, prim: Any, inherited: Place) -> Place:
        matrix, visible, purpose = inherited
        if prim.IsA(UsdGeom.Xformable):
            xform = UsdGeom.Xformable(prim)
            local = np.array(xform.GetLocalTransformation(self.time)).T
            matrix = (self.root if xform.GetResetXformStack() else matrix) @ local
        if prim.IsA(UsdGeom.Imageable):
            shown = UsdGeom.Imageable(prim)
            visible = visible and shown.GetVisibilityAttr().Get(self.time) != UsdGeom.Tokens.invisible
            own = shown.GetPurposeAttr()
            purpose = own.Get() if own.HasAuthoredValue() else purpose
        return Place(matrix, visible, purpose)

    def _one(self, prim: Any, place: Place) -> list[Item]:
        kind, name = prim.GetTypeName(), prim.GetName()
        light = prim.HasAPI(UsdLux.LightAPI)
        if light or prim.IsA(UsdGeom.Gprim):
            if not place.visible:
                self.notes["light(s) of hidden prims left out" if light else "mesh(es) of hidden prims left out"] += 1
                return []
            if place.purpose in (UsdGeom.Tokens.proxy, UsdGeom.Tokens.guide):
                self.notes[f"prim(s) of the purpose {place.purpose} left out"] += 1
                return []
        if light:
            found, notes = light_of(prim, place.matrix, self.time)
            self.lights += found
            self.notes.update(notes)
        elif prim.IsA(UsdGeom.Camera):
            found, notes = camera_of(prim, place.matrix, self.time)
            self.cameras += found
            self.notes.update(notes)
        elif prim.IsA(UsdGeom.Gprim):
            path = str((prim.GetPrimInPrototype() if prim.IsInstanceProxy() else prim).GetPath())
            if path not in self.meshes:
                read = polygonal(prim, self.time)
                if read is None:
                    self.notes[f"prim(s) of the kind {kind} left out: meshes, cubes and such are drawn"] += 1
                    return []
                color, notes = color_of(prim, self.time)
                self.meshes[path] = read._replace(color=color)
                self.notes.update([*read.notes, *notes])
            self._count(self.meshes[path].triangles)
            return [Item(path, name, place.matrix)]
        return []

    def _instanced(self, prim: Any, place: Place, depth: int) -> list[Item]:
        """The meshes of a point instancer's prototypes, as often as they are drawn."""
        where = f"{prim.GetPath()}: point instancer"
        if not place.visible:
            self.notes["point instancer(s) hidden and left out"] += 1
            return []
        if depth >= DEEPEST:
            raise InputError(f"{where}: is a prototype of itself, or nested deeper than {DEEPEST}")
        instancer = UsdGeom.PointInstancer(prim)
        which = np.array(instancer.GetProtoIndicesAttr().Get(self.time) or [], dtype=np.int64)
        targets = instancer.GetPrototypesRel().GetForwardedTargets()
        if len(which) > MOST_COPIES:
            raise InputError(f"{where}: {len(which)} instances; allowed are at most {MOST_COPIES}")
        if len(which) and not 0 <= which.min() <= which.max() < len(targets):
            raise InputError(f"{where}: found prototype {which.max()} or {which.min()} of {len(targets)}, from 0")
        moment, apart = self.time, UsdGeom.PointInstancer.ExcludeProtoXform
        matrices = instancer.ComputeInstanceTransformsAtTime(moment, moment, apart, UsdGeom.PointInstancer.IgnoreMask)
        placed = np.array(matrices).reshape(-1, 4, 4).swapaxes(1, 2)
        shown = np.array(instancer.ComputeMaskAtTime(moment) or [True] * len(which), dtype=bool)
        if not len(placed) == len(shown) == len(which):
            raise InputError(f"{where}: {len(which)} instances, but {len(placed)} transforms")
        items: list[Item] = []
        for number, target in enumerate(targets):
            chosen = np.flatnonzero(shown & (which == number))
            if not len(chosen):
                continue
            before = self.triangles
            prototype = prim.GetStage().GetPrimAtPath(target)
            if not prototype:
                raise InputError(f"{where}: {target} is no prim")
            parts = self._below(prototype, Place(np.eye(4), True, place.purpose), depth + 1)
            self._count((self.triangles - before) * (len(chosen) - 1))
            if len(items) + len(parts) * len(chosen) > MOST_COPIES:
                raise InputError(f"{where}: more than {MOST_COPIES} meshes, each copy counted")
            for k in chosen:
                items += [
                    Item(part.path, f"{part.name} {k + 1}", place.matrix @ placed[k] @ part.matrix) for part in parts
                ]
        return items

    def _count(self, triangles: int) -> None:
        self.triangles += triangles
        if self.triangles > MOST_TRIANGLES:
            raise InputError(f"{self.triangles} triangles by now; a scene may have {MOST_TRIANGLES}")


def _metres(stage: Any) -> float:
    """Metres of a unit. Raises InputError for none."""
    metres = float(stage.GetMetadata("metersPerUnit"))  # UsdGeom raises for one of 32 bits, as Blender writes it
    if not (math.isfinite(metres) and metres > 0.0):
        raise InputError(f"metersPerUnit is {metres:g}; allowed: above 0")
    return metres


def read_stage(request: NDArray[np.uint8]) -> Iterator[NDArray[Any]]:
    """The answer to a request, the path of a file as an array of JSON bytes. Raises InputError and USD's own errors."""
    path = json.loads(bytes(request))
    check_layers(path)
    stage = Usd.Stage.Open(path)
    start = stage.GetStartTimeCode() if stage.HasAuthoredTimeCodeRange() else None
    time = Usd.TimeCode.EarliestTime() if start is None else Usd.TimeCode(start)
    stage.SetEditTarget(stage.GetSessionLayer())
    UsdSkel.BakeSkinning(stage.Traverse(), Gf.Interval(time.GetValue(), time.GetValue()))
    reader = Reader(stage, time)
    notes = dict(reader.notes)
    if not stage.HasAuthoredMetadata("metersPerUnit"):
        notes[f"unit assumed, of {_metres(stage):g} m as in USD without metersPerUnit"] = 1
    numbers = {path: k for k, path in enumerate(reader.meshes)}
    facts = {
        "names": [item.name for item in reader.items],
        "colors": [mesh.color for mesh in reader.meshes.values()],
        "cameras": reader.cameras,
        "lights": reader.lights,
        "notes": notes,
    }
    yield np.frombuffer(json.dumps(facts).encode(), dtype=np.uint8)
    yield np.array([numbers[item.path] for item in reader.items], dtype=np.int64)
    yield np.array([item.matrix for item in reader.items]).reshape(-1, 4, 4)
    for mesh in reader.meshes.values():
        yield mesh.points
        yield mesh.counts
        yield mesh.corners


if __name__ == "__main__":
    serve(read_stage, MOST_MEMORY)
