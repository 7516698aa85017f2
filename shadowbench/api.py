"""What the commands compute, as functions that return values: `import shadowbench as sb`.

    scene = sb.load("armadillo.obj")
    truth = sb.truth(scene)
    drawn = sb.render(scene, "shadow-map:size=2048")
    sb.score(drawn.visibility, truth)["iou"]

A scene is what `load` returns, or anything that it takes: a built-in name, a `.toml`, a mesh file. A technique is a
spec as on the command line. What is wrong raises InputError with the line that the command would print; what fails
raises ShadowbenchError. Notes, such as what was assumed of a scene, go to the logger `shadowbench`, as information.

What draws shares one process, which holds the OpenGL context and is replaced when it fails; `close` ends it. Threads
take turns. Where several things are taken, one will do, or a list, an array or a series.
"""

import atexit
import logging
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from tempfile import TemporaryDirectory
from threading import RLock
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from shadowbench.advice.recommend import recommend as measure_recommendation
from shadowbench.advice.recommend import target_of
from shadowbench.advice.recommendation import Recommendation
from shadowbench.arguments import lit_share, number, of_kind, several, whole
from shadowbench.errors import InputError as InputError
from shadowbench.errors import ShadowbenchError as ShadowbenchError
from shadowbench.extremes.ranges import ranges_frame
from shadowbench.extremes.stress import LIMITS, chosen_axes
from shadowbench.extremes.stress import stress as sweep
from shadowbench.extremes.sweep import default_specs
from shadowbench.measure import single
from shadowbench.measure.executor import Limits
from shadowbench.measure.plugin_output import techniques_with
from shadowbench.measure.rendering import Rendering
from shadowbench.measure.scoring import prepare_truth
from shadowbench.measure.worker import Worker
from shadowbench.scenes.library import load_scene
from shadowbench.scenes.model import Scene, View
from shadowbench.scenes.views import LARGEST, chosen_view, notes_on
from shadowbench.scores.masks import quantise
from shadowbench.scores.metrics import score as metrics_of
from shadowbench.studies.crossing import Techniques
from shadowbench.studies.measure import measure, study_from_options
from shadowbench.survey.survey import Needs
from shadowbench.survey.survey import needs as surveyed
from shadowbench.techniques.spec import Spec, parse_spec
from shadowbench.truths.cache import cached_truth
from shadowbench.truths.trace import Truth

SceneLike = Scene | str | Path
SpecLike = str | Spec
Files = str | Path | Iterable[str | Path]

_log = logging.getLogger("shadowbench")


class _Logged:
    """Tells the logger how a measurement goes."""

    def note(self, line: str) -> None:
        _log.info(line)

    def stage(self, name: str, total: int) -> None:
        _log.debug("%s: %d", name, total)

    def step(self, what: str) -> None:
        _log.debug(what)


class _Shared:
    """The process that draws for every call, of the plug-ins and limits that the last call asked for."""

    turn = RLock()
    worker: Worker | None = None
    of: tuple[tuple[Path, ...], Limits] | None = None


def load(scene: SceneLike, *, assets: str | Path | None = None, up: str | None = None) -> Scene:
    """A scene: a built-in by name, a `.toml`, or any mesh file; what the file lacks is assumed, and in its `notes`.

    assets: a second folder in which a scene file's meshes may lie; up: y or z, the axis that points up in a mesh file
    of a format that does not say. Raises InputError.
    """
    given = of_kind(scene, "scene", "a built-in name, a file, or what load returns", Scene, str, Path)
    if isinstance(given, Scene):
        return given
    folder = None if assets is None else Path(of_kind(assets, "assets", "a folder", str, Path))
    return load_scene(given, folder, up)


def truth(
    scene: SceneLike,
    *,
    view_size: int = 512,
    view: str | None = None,
    light: str | None = None,
    pixel_samples: int = 4,
) -> Truth:
    """The ray-traced shadows of a view: arrays of (view_size, view_size), row 0 at the top, as in `truth.npz`.

    view, light: a camera and a light of the scene by name, the first of each for None; pixel_samples: rays along a side
    of a pixel, over which `area` is averaged. Kept in a cache between calls. Raises InputError.
    """
    return cached_truth(_view(scene, view_size, view, light), whole(pixel_samples, "pixel_samples", 1, 64))


def render(
    scene: SceneLike,
    technique: SpecLike,
    *,
    view_size: int = 512,
    view: str | None = None,
    light: str | None = None,
    plugins: Files = (),
    tint: bool = False,
) -> Rendering:
    """One draw of a view with a technique's shadows: `visibility`, `picture` and `map`, beside its work and memory.

    map: linear depth in [0, 1] as (H, W), near is 0; of `cube-map` the faces unfolded into a cross (3 · size,
    4 · size), of `cascades` the layers beside each other (size, count · size); None for a technique without one.
    tint: colour the picture by what the technique did where, such as by cascade. Raises InputError for what does not
    go together, ShadowbenchError where the technique fails.
    """
    files = _paths(plugins)
    one = of_kind(technique, "technique", "a spec as text, or a Spec", str, Spec)
    (spec,) = _specs(one, techniques_with(files))
    chosen = _view(scene, view_size, view, light)
    return single.render(chosen, spec, _worker(files), name=spec.text, with_map=True, tint=tint)


def score(visibility: NDArray[Any], truth: Truth) -> Mapping[str, float | None]:
    """Every metric of a mask by its name, None where there is nothing to divide by; `list metrics` explains them.

    visibility: (N, N) of the truth's size: floats in [0, 1], booleans, uint8 or uint16; 1, or their largest, is lit. It
    is quantised to 16 bits first, as stored masks are. Raises InputError for anything else.
    """
    of_kind(truth, "truth", "what truth returns", Truth)
    mask = lit_share(visibility, "visibility", truth.visibility.shape)
    try:
        return metrics_of(quantise(mask), prepare_truth(truth))
    except ValueError as error:
        raise InputError(f"visibility: {error}") from None


def run(
    scenes: SceneLike | Iterable[SceneLike] = (),
    techniques: SpecLike | Iterable[SpecLike] = (),
    *,
    map_size: int | Iterable[int] | None = None,
    view_size: int | None = None,
    view: str | None = None,
    light: str | None = None,
    rounds: int | None = None,
    phases: int | None = None,
    study: str | None = None,
    plugins: Files = (),
    folder: str | Path | None = None,
) -> pd.DataFrame:
    """Measure techniques on scenes: a line a cell, with the columns of `table.csv`.

    What is not given is the study's, a file or one of ours by name, and `default` for None. light: each of the scene's
    in turn for None; rounds: how often each cell is timed, 0 for not at all; folder: a run folder that keeps rows,
    masks and pictures, and goes on where it was. Raises InputError; a cell that fails is a line whose status says so.
    """
    files = _paths(plugins)
    known = techniques_with(files)
    named = several(scenes, "scenes", "built-in names, files, and what load returns", Scene, str, Path)
    asked = study_from_options(
        known,
        [one if isinstance(one, Scene) else str(one) for one in named],
        _specs(techniques, known),
        study=None if study is None else str(of_kind(study, "study", "a name or a file", str, Path)),
        map_size=None if map_size is None else _sizes(map_size),
        phases=None if phases is None else whole(phases, "phases", 1, 10_000),
        view=view,
        light=light,
        view_size=None if view_size is None else whole(view_size, "view_size", 1, LARGEST),
        rounds=None if rounds is None else whole(rounds, "rounds", 0, 10_000),
    )
    limits = Limits(asked.time_limit, int(asked.memory_limit * 2**30))
    with _folder(folder) as path:
        return measure(asked, path, _worker(files, limits), _Logged()).frame


def needs(scene: SceneLike, *, view_size: int = 512, view: str | None = None, light: str | None = None) -> Needs:
    """What a scene asks of shadows, without drawing any: map size, cascades, depth bits, bias, penumbra.

    Raises InputError.
    """
    return surveyed(_view(scene, view_size, view, light))


def recommend(
    scene: SceneLike,
    *,
    min_iou: float | None = None,
    max_edge_px: float | None = None,
    budget_ms: float | None = None,
    on_this_machine: bool = False,
    view_size: int = 512,
    view: str | None = None,
    light: str | None = None,
    plugins: Files = (),
    folder: str | Path | None = None,
) -> Recommendation:
    """The cheapest technique and parameters that meet a target in a view, measured as they are searched for.

    min_iou, 0.99 where neither is given, or max_edge_px: the target; budget_ms: milliseconds at most, on a GPU;
    on_this_machine: rank by times even on a software renderer. `choice` is None where nothing meets it. Raises
    InputError.
    """
    limits = {"min_iou": min_iou, "max_edge_px": max_edge_px, "budget_ms": budget_ms}
    target = target_of(**{name: None if one is None else number(one, name) for name, one in limits.items()})
    files = _paths(plugins)
    chosen, known = _view(scene, view_size, view, light), techniques_with(files)
    with _folder(folder) as path:
        found, _ = measure_recommendation(
            chosen, target, known, path, _worker(files), _Logged(), on_this_machine=on_this_machine
        )
    return found


def stress(
    techniques: SpecLike | Iterable[SpecLike] = (),
    *,
    axes: str | Iterable[str] = (),
    quick: bool = False,
    plugins: Files = (),
    folder: str | Path | None = None,
) -> pd.DataFrame:
    """Operating ranges of techniques along axes: a line a technique, light and axis, with the columns of `ranges.csv`.

    Without names, all techniques at their defaults, and all axes; quick: a few values of each. Raises InputError.
    """
    files = _paths(plugins)
    chosen = chosen_axes(several(axes, "axes", "names of axes", str))
    known = techniques_with(files)
    specs = _specs(techniques, known) or default_specs(known.values())
    with _folder(folder) as path:
        found = sweep(specs, chosen, path, _worker(files, LIMITS), _Logged(), quick=quick)
    return ranges_frame(found.ranges)


def close() -> None:
    """End the process that draws; the next call that draws starts another."""
    if _Shared.worker is not None:
        _Shared.worker.stop()
    _Shared.worker = _Shared.of = None


atexit.register(close)


def _worker(plugins: tuple[Path, ...], limits: Limits | None = None) -> Worker:
    asked = plugins, limits or Limits()
    with _Shared.turn:
        if _Shared.worker is None or _Shared.of != asked:
            close()
            _Shared.worker, _Shared.of = Worker(*asked), asked
        return _Shared.worker


def _view(scene: SceneLike, size: int, camera: str | None, light: str | None) -> View:
    chosen = chosen_view(load(scene), whole(size, "view_size", 1, LARGEST), camera, light)
    for line in notes_on(chosen, camera, light):
        _log.info(line)
    return chosen


def _specs(given: SpecLike | Iterable[SpecLike], known: Techniques) -> list[Spec]:
    specs = several(given, "techniques", "specs, as text or as a Spec", str, Spec)
    return [one if isinstance(one, Spec) else parse_spec(one, known) for one in specs]


def _paths(plugins: Files) -> tuple[Path, ...]:
    return tuple(Path(file).resolve() for file in several(plugins, "plugins", "Python files", str, Path))


def _sizes(given: int | Iterable[int]) -> list[int]:
    """At least one."""
    found = several(given, "map_size", "whole numbers", int, np.integer)
    sizes = [whole(size, "map_size", 1, 65536) for size in found]
    if not sizes:
        raise InputError("map_size: found none; allowed: one or several, or None for the study's")
    return sizes


@contextmanager
def _folder(given: str | Path | None) -> Iterator[Path]:
    """The folder that is given, or one for the time being."""
    if given is not None:
        yield Path(of_kind(given, "folder", "a folder", str, Path))
        return
    with TemporaryDirectory(prefix="shadowbench-") as folder:
        yield Path(folder)
