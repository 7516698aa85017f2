"""Export of a view for another renderer: `scene.glb`, `view.json`, and the truth as an example mask."""

import json
import math
import re
import shlex
from pathlib import Path
from typing import Any

import numpy as np

from shadowbench.engines.model import glb_of
from shadowbench.errors import InputError
from shadowbench.files import replace_file
from shadowbench.scenes.model import Camera, Light, View
from shadowbench.scenes.vectors import Floats, perpendicular_basis, unit
from shadowbench.scores.masks import write_mask
from shadowbench.truths.trace import Truth

SCHEMA = 1
_ROW = re.compile(r"\[[^][{}]*\]")  # a list of numbers, which is written on one line
MODEL, DESCRIPTION, EXAMPLE = "scene.glb", "view.json", "truth.png"


def export_view(view: View, truth: Truth, folder: Path, scene_name: str) -> list[Path]:
    """Write a view's files into a folder, created if missing, and return their paths.

    scene_name: the scene's argument on the command line. Raises InputError if the folder cannot be written.
    """
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InputError(f"{folder}: cannot be created ({error.strerror or error})") from None
    model, description, example = (folder / name for name in (MODEL, DESCRIPTION, EXAMPLE))
    with replace_file(model) as temporary:
        temporary.write_bytes(glb_of(view))
    with replace_file(description) as temporary:
        text = json.dumps(describe(view, scene_name), indent=2, ensure_ascii=False, allow_nan=False)
        temporary.write_text(_ROW.sub(lambda row: " ".join(row[0].split()), text) + "\n", encoding="utf-8")
    write_mask(example, truth.visibility)
    return [model, description, example]


def inexpressible_in_gltf(view: View) -> list[str]:
    """One line for each mesh that casts or receives no shadow and for a light's size, which glTF cannot express."""
    lines = [light_in_gltf(view.light)] if view.light.soft or view.light.kind != view.light.hard_kind else []
    for mesh in view.scene.meshes:
        lacking = [what for what, holds in (("cast", mesh.casts), ("receive", mesh.receives)) if not holds]
        if lacking:
            lines.append(f"{mesh.name} is to {' and '.join(lacking)} no shadow, which glTF cannot say: see view.json")
    return lines


def light_in_gltf(light: Light) -> str:
    """What stands in glTF for a light that is no point or sun, or has a size."""
    if light.kind == light.hard_kind:
        return f"light {light.name!r} has a size, which glTF cannot say: see {DESCRIPTION}"
    spot = f"a spot of {math.degrees(light.frustum_angle or 0.0):.0f}° in {MODEL}"
    return f"light {light.name!r} is a {light.kind}, which glTF cannot say: {spot}; see {DESCRIPTION}"


def size_mismatch(given: Path, view: View) -> str | None:
    """A warning if `export_view` wrote the scene into the file's folder at a size other than the view's; else None."""
    exported = given.parent / DESCRIPTION
    if not exported.is_file():
        return None
    try:
        described = json.loads(exported.read_text(encoding="utf-8"))
    except ValueError:  # somebody else's file of that name
        return None
    match described:
        case {"scene": view.scene.name, "image": {"width": int(width)}} if width != view.size:
            sizes = f"{view.size}², where {exported} says {width}²"
            return f"{given}: {sizes}; a mask's size is the view's: scored as the view of {view.size}²"
    return None


def view_matrix(camera: Camera) -> Floats:
    """(4, 4) float64 world-to-camera matrix for column vectors; the camera looks along its −z."""
    matrix = np.eye(4)
    matrix[:3, :3] = camera.basis()
    matrix[:3, 3] = -matrix[:3, :3] @ np.asarray(camera.position)
    return matrix


def projection_matrix(view: View) -> Floats:
    """(4, 4) float64 camera-to-clip matrix for column vectors, in OpenGL's clip space, −w ≤ x, y, z ≤ w."""
    near, far = view.near_far
    slope = math.tan(view.camera.fov_y / 2)
    return np.array(
        [
            [1 / slope, 0, 0, 0],
            [0, 1 / slope, 0, 0],
            [0, 0, (far + near) / (near - far), 2 * far * near / (near - far)],
            [0, 0, -1, 0],
        ]
    )


def describe(view: View, scene_name: str) -> dict[str, Any]:
    """Contents of `view.json`: conventions that glTF leaves open, camera, light, meshes and the format of masks."""
    camera, (near, far) = view.camera, view.near_far
    names = ["--view", camera.name, "--light", view.light.name]
    return {
        "schema": SCHEMA,
        "scene": view.scene.name,
        "model": MODEL,
        "conventions": {
            "world": "metres, right-handed, y up",
            "matrices": "nested lists, one list a row; they multiply a column vector from the left: "
            "clip = projection · view · (x, y, z, 1)",
            "clip_space": "OpenGL: −w ≤ x, y, z ≤ w, x right, y up, z away",
            "pixels": "row 0 at the top; pixel (row, column) is sampled at its centre: "
            "clip x / w = (2 column + 1) / width − 1, clip y / w = 1 − (2 row + 1) / height",
            "angles": "degrees",
        },
        "image": {"width": view.size, "height": view.size},
        "camera": {
            "name": camera.name,
            "position": list(camera.position),
            "target": list(camera.target),
            "up": camera.basis()[1].tolist(),
            "fov_y": math.degrees(camera.fov_y),
            "near": near,
            "far": far,
            "view": view_matrix(camera).tolist(),
            "projection": projection_matrix(view).tolist(),
        },
        "light": _light(view.light),
        "meshes": [
            {
                "name": mesh.name,
                "color": list(mesh.color),
                "triangles": len(mesh.faces),
                "casts": mesh.casts,
                "receives": mesh.receives,
            }
            for mesh in view.scene.meshes
        ],
        "mask": {
            "example": EXAMPLE,
            "format": "grey PNG, 8 or 16 bit, linear (no sRGB curve): full where the light is seen, 0 in shadow, "
            "full where no surface faces camera and light",
            "score": shlex.join(["shadowbench", "score", scene_name, "MASK.png", *names]),
        },
        "assumptions": [*view.scene.notes, *inexpressible_in_gltf(view)],
    }


def _light(light: Light) -> dict[str, Any]:
    """Light in `view.json`; null for fields that its kind lacks.

    direction: unit vector in which the light travels, or a disc's or rectangle's normal; radius: of a sun in degrees as
    seen from the ground, else in metres; size: width and height of a rectangle in metres; up: unit vector along its
    height.
    """
    directional, rectangle = light.kind == "directional", light.kind == "rectangle"
    return {
        "name": light.name,
        "kind": light.kind,
        "direction": None if light.kind == "point" else unit(light.direction).tolist(),
        "position": None if directional else list(light.position),
        "cone": math.degrees(light.angle) if light.kind == "spot" else None,
        "radius": None if rectangle else math.degrees(light.radius) if directional else light.radius,
        "size": list(light.size) if rectangle else None,
        "up": perpendicular_basis(-unit(light.direction), light.up)[1].tolist() if rectangle else None,
    }
