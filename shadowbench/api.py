"""The commands as functions that return values: `import shadowbench as sb`.

    scene = sb.load("armadillo.obj")
    truth = sb.truth(scene)
    rendering = sb.render(scene, "shadow-map:size=2048")
    sb.score(rendering.visibility, truth)["iou"]

A scene argument is a Scene returned by `load`, or an argument of `load`: a built-in name, a `.toml`, or a mesh file. A
technique is a spec as on the command line. Invalid arguments raise InputError with the line that the command would
print, with parameters' names for options'; failures raise ShadowbenchError. Notes are logged to `shadowbench`, as INFO.

All drawing functions share a worker process, replaced if it fails; `close` ends it. Calls from several threads are
serialised. Arguments that take several values accept a single one, a list, an array or a Series.
"""

import logging
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pandas as pd
from numpy.typing import NDArray

from shadowbench import options
from shadowbench.advice.recommend import Recommendation, target_of
from shadowbench.advice.recommend import recommend as measured
from shadowbench.advice.search import technique_names
from shadowbench.errors import InputError as InputError
from shadowbench.errors import ShadowbenchError as ShadowbenchError
from shadowbench.masks.inputs import visibility_of
from shadowbench.measure.gl_drawer import campaign_in, shared_worker
from shadowbench.measure.gl_drawer import close as close
from shadowbench.measure.gl_drawer import render as draw_once
from shadowbench.measure.pictures import Rendering
from shadowbench.measure.plugin_output import subjects_with, techniques_with
from shadowbench.measure.scoring import prepare_truth, truth_record
from shadowbench.plugin.base import Technique as Technique
from shadowbench.plugin.params import param as param
from shadowbench.plugin.spec import Spec, parse_spec
from shadowbench.reports.notebook import Results
from shadowbench.results.ranges import ranges_frame
from shadowbench.scenes.model import Scene, View
from shadowbench.scenes.opening import chosen_view, opened
from shadowbench.scores.masks import quantise
from shadowbench.scores.metrics import score as score_mask
from shadowbench.studies.crossing import Techniques
from shadowbench.studies.run import measure
from shadowbench.studies.stress import LIMITS, SWEEPING, default_specs, select_axes
from shadowbench.studies.stress import stress as sweep
from shadowbench.studies.study import study_from_options
from shadowbench.survey.survey import Needs
from shadowbench.survey.survey import needs as survey_view
from shadowbench.truths.cache import cached_truth
from shadowbench.truths.embree import tracer_of
from shadowbench.truths.trace import Truth

SceneLike = Scene | str | Path
SpecLike = str | Spec
Placed = str | Iterable[float] | None
Files = str | Path | Iterable[str | Path]

_log = logging.getLogger("shadowbench")


@contextmanager
def _parameter_names() -> Iterator[None]:
    """Errors within it name parameters of Python, as in min_iou, where they name options, as in --min-iou."""
    try:
        yield
    except InputError as error:
        raise InputError(options.in_python(str(error))) from None


@_parameter_names()
def load(
    scene: SceneLike,
    *,
    assets: str | Path | None = None,
    up: str | None = None,
    sun: bool = False,
    no_ground: bool = False,
    time: float | None = None,
    clip: str | None = None,
    camera: Placed = None,
    target: Placed = None,
    lamp: Placed = None,
    sun_at: Placed = None,
) -> Scene:
    """Load a scene: a built-in by name, a `.toml`, or a mesh file. Assumptions about missing data are in its `notes`.

    assets: additional folder to search for a scene file's meshes; up: up axis, y or z, of mesh formats that do not
    specify it; sun: give directional lights without a size that of the sun; no_ground: assume no ground; time, clip:
    seconds, and the name or number of a clip, that pose an animated glTF; camera: the name
    of one of its cameras, "front", "back", "left", "right", "top", "inside", or a point, from which it looks at target;
    lamp, sun_at: a point light at a point, or a sun at azimuth and elevation in degrees, in place of the scene's
    lights. Raises InputError.
    """
    value = options.instance_of(scene, "scene", "a built-in name, a file, or what load returns", Scene, str, Path)
    folder = None if assets is None else Path(options.instance_of(assets, "assets", "a folder", str, Path))
    placed = {"camera": camera, "target": target, "lamp": lamp, "sun_at": sun_at}
    texts = {name: options.place_text(place, name) for name, place in placed.items()}
    chosen = options.SceneOptions(folder, up, sun, no_ground, time, clip, **texts)
    return opened(value, chosen, tracer_of)


def truth(
    scene: SceneLike,
    *,
    view_size: options.ViewSizeLike = 512,
    view: str | None = None,
    light: str | None = None,
    pixel_samples: int = 4,
) -> Truth:
    """Ray-trace the shadows of a view: arrays of (height, width), row 0 at the top, as in `truth.npz`.

    view_size: a square's side, or "1280x720"; view, light: names of a camera and a light, by default the scene's first;
    pixel_samples: `area` averages pixel_samples² rays per pixel. Cached on disk. Raises InputError.
    """
    samples = options.whole_number(pixel_samples, "pixel_samples", options.PIXEL_SAMPLES)
    return cached_truth(_view(scene, view_size, view, light), samples)


def render(
    scene: SceneLike,
    technique: SpecLike,
    *,
    view_size: options.ViewSizeLike = 512,
    view: str | None = None,
    light: str | None = None,
    plugins: Files = (),
    tint: bool = False,
) -> Rendering:
    """Draw a view with a technique; returns its visibility, shaded picture, shadow map, work counts and GPU memory.

    map: (H, W) linear depth in [0, 1], 0 is near; for `cube-map` the faces unfolded into a cross (3 · size, 4 · size),
    for `cascades` the layers side by side (size, count · size); None for a technique without a map.
    tint: colour the picture by the technique's debug colours, such as one per cascade. Raises InputError if the
    technique does not support the view, ShadowbenchError if it fails.
    """
    files = _paths(plugins)
    options.instance_of(technique, "technique", "a spec as text, or a Spec", str, Spec)
    (spec,) = _specs(technique, techniques_with(files))
    chosen = _view(scene, view_size, view, light)
    with shared_worker(files) as worker:
        return draw_once(chosen, spec, worker, name=spec.text, with_map=True, tint=tint)


def score(visibility: NDArray[Any], truth: Truth) -> Mapping[str, float | None]:
    """All metrics of a mask by name, None if a denominator is 0; `shadowbench list metrics` explains them.

    For a truth with penumbrae also `truth_error`, `truth_error_pen`, `penumbra` and `width_share`, as in `table.csv`.
    visibility: (H, W) of the truth's size: floats in [0, 1], booleans, uint8 or uint16; 1 or the integer maximum is
    lit. It is quantised to 16 bits first, as stored masks are. Raises InputError.
    """
    options.instance_of(truth, "truth", "what truth returns", Truth)
    try:
        mask = quantise(visibility_of(visibility, "visibility"))
    except ValueError as error:
        raise InputError(f"visibility: {error}") from None
    if mask.shape != truth.visibility.shape:
        raise InputError(f"visibility: found shape {mask.shape}; allowed: {truth.visibility.shape}, that of the truth")
    prepared = prepare_truth(truth)
    return score_mask(mask, prepared) | truth_record(prepared)


def run(
    scenes: SceneLike | Iterable[SceneLike] = (),
    techniques: SpecLike | Iterable[SpecLike] = (),
    *,
    map_size: int | Iterable[int] | None = None,
    view_size: options.ViewSizeLike | None = None,
    view: str | None = None,
    light: str | None = None,
    rounds: int | None = None,
    phases: int | None = None,
    sequence: str | None = None,
    frames: int | None = None,
    study: str | None = None,
    plugins: Files = (),
    folder: str | Path | None = None,
    each_phase: bool = False,
) -> Results:
    """Measure techniques on scenes: one line per spec, map size and view, with the columns of `table.csv`.

    Numbers are medians over the phases of a map's grid, `phases` their number; each_phase: one line per cell, with its
    `phase`. `front()` and `sizes()` of the result draw its charts.
    study: a study file or built-in study, `default` for None, with the defaults of all other arguments; light: name
    of a light, by default each light of a scene in turn; rounds: how often each cell is timed, 0 for no timing;
    sequence: one of the scene's file or built in, "all" of the latter, or several with commas, whose first `frames` are
    drawn in order and scored in motion; folder: run folder to keep rows, masks and
    pictures in, or to resume. A cell that fails is a line with that status. Raises InputError.
    """
    files = _paths(plugins)
    known = subjects_with(files)
    size = None if view_size is None else options.ViewSize.of(view_size)
    named = options.as_list(scenes, "scenes", "built-in names, files, and what load returns", Scene, str, Path)
    chosen = study_from_options(
        known,
        [entry if isinstance(entry, Scene) else str(entry) for entry in named],
        _specs(techniques, known),
        study=None if study is None else str(options.instance_of(study, "study", "a name or a file", str, Path)),
        map_size=None if map_size is None else options.whole_numbers(map_size, "map_size", options.MAP_SIZE),
        measuring=options.Measuring(size, rounds, phases, sequence, frames),
        view=options.ViewOptions(view=view, light=light),
    )
    with shared_worker(files, chosen.limits) as worker, campaign_in(_kept_in(folder), worker=worker) as made:
        return Results.of(measure(chosen, made).run.last, each_phase)


def needs(
    scene: SceneLike, *, view_size: options.ViewSizeLike = 512, view: str | None = None, light: str | None = None
) -> Needs:
    """Shadow requirements of a view, computed without drawing: map size, cascades, depth bits, bias, penumbra.

    Raises InputError.
    """
    return survey_view(_view(scene, view_size, view, light))


@_parameter_names()
def recommend(
    scene: SceneLike,
    *,
    min_iou: float | None = None,
    max_edge_px: float | None = None,
    max_rmse: float | None = None,
    max_flicker: float | None = None,
    budget_ms: float | None = None,
    by: str | None = None,
    device: str | None = None,
    techniques: str | Iterable[str] = (),
    view_size: options.ViewSizeLike = 512,
    view: str | None = None,
    light: str | None = None,
    plugins: Files = (),
    folder: str | Path | None = None,
) -> Recommendation:
    """Search for the cheapest technique and parameters that meet a target in a view, by measuring few of them.

    min_iou, max_edge_px or max_rmse: the target, by default an IoU of 0.99, or an RMSE of 0.02 if there are penumbrae;
    max_flicker: the most, in pixels, in the first sequence of the scene's file, else in a pan; budget_ms: largest frame
    time; by: what ranks, "time" (of this machine), "device" (times predicted for a GPU, by
    default where none draws) or "work"; device: its name, the first on record if None; techniques: those to search.
    `choice` is None if nothing meets it. Raises InputError.
    """
    limits = {"min_iou": min_iou, "max_edge_px": max_edge_px, "max_rmse": max_rmse}
    limits |= {"max_flicker": max_flicker, "budget_ms": budget_ms}
    *values, flicker, budget = (
        None if value is None else options.number(value, name) for name, value in limits.items()
    )
    target = target_of(*values)
    files = _paths(plugins)
    known = techniques_with(files)
    among = technique_names(options.as_list(techniques, "techniques", "names of techniques", str), known)
    chosen = _view(scene, view_size, view, light)
    with shared_worker(files) as worker, campaign_in(_kept_in(folder), worker=worker) as made:
        return measured(
            chosen, target, known, made, by=by, device=device, budget_ms=budget, among=among, max_flicker=flicker
        )[0]


def stress(
    techniques: SpecLike | Iterable[SpecLike] = (),
    *,
    axes: str | Iterable[str] = (),
    quick: bool = False,
    plugins: Files = (),
    folder: str | Path | None = None,
) -> pd.DataFrame:
    """Operating ranges of techniques along stress axes: one line per technique, light and axis, as in `ranges.csv`.

    techniques, axes: by default all techniques at their defaults, and all axes; quick: a few values of each axis.
    Raises InputError.
    """
    files = _paths(plugins)
    chosen = select_axes(options.as_list(axes, "axes", "names of axes", str))
    known = subjects_with(files)
    specs = _specs(techniques, known) or default_specs(known.values())
    with shared_worker(files, LIMITS) as worker, campaign_in(_kept_in(folder), worker=worker, **SWEEPING) as made:
        result = sweep(specs, chosen, made, quick=quick)
    return ranges_frame(result.ranges)


@_parameter_names()
def _view(scene: SceneLike, size: options.ViewSizeLike, camera: str | None, light: str | None) -> View:
    return chosen_view(load(scene), size, options.ViewOptions(view=camera, light=light), _log.info)


def _specs(value: SpecLike | Iterable[SpecLike], known: Techniques) -> list[Spec]:
    specs = options.as_list(value, "techniques", "specs, as text or as a Spec", str, Spec)
    return [spec if isinstance(spec, Spec) else parse_spec(spec, known) for spec in specs]


def _paths(plugins: Files) -> tuple[Path, ...]:
    return tuple(Path(file).resolve() for file in options.as_list(plugins, "plugins", "Python files", str, Path))


def _kept_in(folder: str | Path | None) -> Path | None:
    return None if folder is None else Path(options.instance_of(folder, "folder", "a folder", str, Path))
