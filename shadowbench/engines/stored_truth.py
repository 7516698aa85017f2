"""A truth as a file that masks are scored against without its scene, and without Embree."""

import json
import zipfile
from dataclasses import asdict, dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from shadowbench.engines.external_mask import LARGEST
from shadowbench.errors import InputError, printable
from shadowbench.measure.scoring import depths, points_at, prepare_truth
from shadowbench.options import ViewOptions
from shadowbench.scenes.model import LONGEST_VIEW_NAME, Camera, Light, Scene, View, view_digest
from shadowbench.scenes.scene_tables import LIGHT_TABLES, NAME
from shadowbench.scenes.vectors import vec3
from shadowbench.scores.prepared import PreparedTruth
from shadowbench.strict import short
from shadowbench.truths.cache import read_arrays, truth_of, write_truth
from shadowbench.truths.trace import Truth

_MOST_BYTES = 100 * LARGEST**2  # of all arrays
_ALLOWED = "allowed: a file that `shadowbench truth` wrote"


@dataclass(frozen=True, eq=False)
class TruthOfView:
    """A truth, and the view that it is of; digest: of the view.

    From a file, the view has names, camera and kind of light only, and depth is (N, N) metres along the camera's axis,
    from which widths of penumbrae are measured; None for a truth with its meshes.
    """

    truth: Truth
    view: View
    digest: str
    depth: NDArray[np.float64] | None = None

    def prepared(self, truth: Truth) -> PreparedTruth:
        """The input of metrics; truth: the stored one, perhaps with fewer receivers."""
        return prepare_truth(truth, None if self.depth is None else partial(points_at, self.view.camera, self.depth))


def write_stored_truth(file: Path, truth: Truth, view: View) -> None:
    """Write the arrays of a truth, with `depth`, and `about` its view as JSON, as a compressed .npz."""
    camera, light = view.camera, view.light
    about = {
        "scene": view.scene.name,
        "notes": list(view.scene.notes),
        "camera": {
            "name": camera.name,
            "position": list(map(float, camera.position)),
            "target": list(map(float, camera.target)),
            "fov_y": float(camera.fov_y),
            "up": list(map(float, camera.up)),
        },
        "light": {"name": light.name, "kind": light.kind},
        "digest": view_digest(view),
    }
    write_truth(file, truth, depth=depths(view, truth.triangle), about=json.dumps(about))


def stored_truth_of(scene: str | Path, options: ViewOptions) -> TruthOfView | None:
    """The truth in a file of `shadowbench truth`; None for any other scene. Raises InputError for one with options."""
    if not str(scene).lower().endswith(".npz"):
        return None
    for option in (f"--{name.replace('_', '-')}" for name, value in asdict(options).items() if value):
        raise InputError(f"{option}: {scene} is the truth of one view; allowed: a scene, with {option}")
    return read_stored_truth(Path(scene))


def read_stored_truth(file: Path) -> TruthOfView:
    """Read what `write_stored_truth` wrote. Raises InputError for any other file."""
    if not file.is_file():  # reading a named pipe would block
        raise InputError(f"{file}: {'is not a file' if file.exists() else 'no such file'}; {_ALLOWED}")
    try:
        return _read(file)
    except Exception as error:  # of many types in zipfile, NumPy and json
        raise InputError(f"{file}: found no truth of a view in it ({short(error)}); {_ALLOWED}") from None


def _read(file: Path) -> TruthOfView:
    """The truth in a file. Raises an exception of some kind for any other file."""
    with zipfile.ZipFile(file) as archive:
        size = sum(entry.file_size for entry in archive.infolist())
    if size > _MOST_BYTES:
        raise ValueError(f"{size} bytes of arrays, of at most {_MOST_BYTES}")
    arrays = read_arrays(file)
    depth, about = arrays.pop("depth"), json.loads(str(arrays.pop("about")))
    side = len(depth)
    fits = (
        0 < side <= LARGEST and depth.shape == (side, side) and depth.dtype == np.float64 and np.isfinite(depth).all()
    )
    truth = truth_of(arrays, side, np.iinfo(np.int32).max) if fits else None
    if truth is None:
        raise ValueError("arrays of other names, types, shapes or ranges")
    return TruthOfView(truth, _view_of(about, side), about["digest"], depth)


def _view_of(told: dict[str, Any], side: int) -> View:
    """The view that `about` describes. Raises an exception of some kind if it describes none."""
    given = told["camera"]
    position, target, up = (vec3(np.array(given[name], dtype=np.float64)) for name in ("position", "target", "up"))
    camera = Camera(given["name"], position, target, float(given["fov_y"]), up)
    light = Light(told["light"]["name"], told["light"]["kind"])
    view = View(Scene(told["scene"], (), (camera,), (light,), tuple(told["notes"])), camera, light, side)
    names = view.scene.name, camera.name, light.name  # parts of file names
    fits = np.isfinite(camera.basis()).all() and 0 < camera.fov_y < np.pi and light.kind in LIGHT_TABLES
    named = all(map(NAME.fullmatch, names)) and len(view.name.encode()) <= LONGEST_VIEW_NAME
    texts = told["digest"], *view.scene.notes
    if not (fits and named and all(isinstance(text, str) and printable(text) == text for text in texts)):
        raise ValueError("another description of a view")
    return view
