"""Makes docs/tuning.md: runs `shadowbench tune` on built-in and larger scenes, and walks the limit of the texel bias.

python tools/tuning_docs.py [-o FOLDER]: rows are kept in the folder, so that a second call measures nothing. The larger
scenes lie in SHADOWBENCH_SCENES.
"""

import argparse
import json
import os
import subprocess
import sys
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from shadowbench.advice.tune_cells import Cells
from shadowbench.advice.tune_scores import log_error, mean_of, ratio, scene_scores
from shadowbench.measure.worker import Worker
from shadowbench.scenes.library import load_scene
from shadowbench.scenes.model import Light, Scene, vec3, view_of
from shadowbench.studies.study import Block, Study
from shadowbench.studies.tables import Interval, interval
from shadowbench.techniques.registry import techniques
from shadowbench.techniques.spec import parse_spec

ROOT = Path(__file__).resolve().parent.parent
PAGE = ROOT / "docs" / "tuning.md"
LARGER = ("2CylinderEngine.glb", "armadillo.obj", "bgfx_tree.obj", "retroufo.gltf")
BUILT_IN = (
    "canopy", "colonnade", "cube-on-plane", "deep-street", "inside-volume", "pebbles", "railings", "room-with-window",
    "sphere-and-torus", "spot-lamp", "stairs", "statue", "street", "table-top", "terrain",
)  # fmt: skip
CONSTANT = "shadow-map:bias=constant,filter=hard"  # 0.005, with the fit of the default
AGAINST = (CONSTANT, "shadow-map:bias=texel(limit=24)")
TRIALS = 96
FOLDS = 3
PROMISES = {"preset=course": 3.0, CONSTANT: 1.2}  # least ratios of 1 − IoU to the tuned's
TITLES = (
    "|  | setting | cost | tuning | held out | 1 − IoU × tuned | 1 − SSIM × tuned | acne | leak | contact |",
    "|---|---|---:|---:|---:|---:|---:|---:|---:|---:|",
)

DRAWN = 24  # scenes by lot
BODIES = ("box", "sphere", "torus", "cylinder", "cone", "capsule")

LIMITS = (4, 8, 16, 24, 32, 48, 64, 128)
LIT = ("cube-on-plane", "sphere-and-torus", "colonnade", "stairs", "table-top", "statue")
MESHES = ("armadillo.obj", "retroufo.gltf")
SPOTS = {"near": (0.7, 90.0), "far": (1.5, 50.0)}  # distance over the camera's, degrees of the cone

HEAD = """\
# Tuned parameters

What `shadowbench tune` finds for [`shadow-map`](techniques.md#shadow-map), and how far the published settings are from
it. Made by `python tools/tuning_docs.py`.

Error is √((1 − IoU) · (1 − SSIM)), a geometric mean over scenes: half the bias that is needed can win on IoU alone,
since partial shadow above ½ counts as light. Cost is `work_cost` over the default's. Intervals are 95% bootstrap
intervals over the scenes held out.
"""

SEARCH = """\
## Search

Bias, filter and fit at map size 2048, view 512, two phases; {trials} trials a search. The {scenes} scenes are dealt
into {folds} folds in the order of their names' hashes. Each search tunes on the scenes of the other folds and is
measured on those of its own, so that every scene is held out once, by a search that has not seen it. The best at the
default's cost is taken for the tuned where it is surely better on the scenes tuned on: where the interval of its error
over the default's, scene by scene, lies below 1. Else the default stands.
"""


def main() -> None:
    """Measure, and write the page."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("-o", "--output", type=Path, default=ROOT / "results" / "tune", metavar="FOLDER")
    folder = parser.parse_args().output
    parts = [HEAD, *tuned(folder), "", *by_lot(folder), "", *limits(folder)]
    PAGE.write_text("\n".join(parts) + "\n", encoding="utf-8")


def tuned(folder: Path) -> Iterator[str]:
    """The search, its front, what it is set beside, and whether what was promised holds."""
    larger = Path(os.environ.get("SHADOWBENCH_SCENES", "../shared/scenes"))
    scenes = [*BUILT_IN, *(str(larger / name) for name in LARGER)]
    command = ["tune", "-t", "shadow-map", "--scenes", ",".join(scenes)]
    command += [part for spec in AGAINST for part in ("--against", spec)]
    command += ["--folds", str(FOLDS), "--trials", str(TRIALS), "--json", "-q", "-o", str(folder)]
    done = subprocess.run(
        [sys.executable, "-m", "shadowbench", *command], cwd=ROOT, stdout=subprocess.PIPE, text=True, check=True
    )
    found = json.loads(done.stdout)
    yield SEARCH.format(folds=FOLDS, scenes=len(scenes), trials=TRIALS)
    for number, fold in enumerate(found["folds"], start=1):
        yield f"### Fold {number}\n\nHeld out: {', '.join(fold['held_out'])}. The best at each cost:\n"
        yield from TITLES
        yield from (line(one, one["name"]) for one in fold["front"])
        yield ""
    others = found["others"]
    yield f"### All folds\n\nEach of the {len(scenes)} scenes by the search that has not seen it:\n"
    yield from TITLES
    yield line(found["tuned"], "tuned")
    yield from (line(one, one["name"] if one["name"].startswith(("default", "preset")) else "") for one in others)
    yield f"\n{found['verdict'][0].upper()}{found['verdict'][1:]}.\n"
    yield f"## Against published settings\n\nThe tuned, over the {len(scenes)} scenes, each held out:\n"
    for one in others:
        if one["name"] in PROMISES:
            yield promise(one["name"], Interval(**one["iou_ratio"]), Interval(**one["ssim_ratio"]))
    scores = by_spec(folder / "table.csv")
    default = scores["shadow-map"]
    if any(fold["tuned"]["spec"] != "shadow-map" for fold in found["folds"]):
        yield f"\nThe default, over the same {len(default)} scenes:\n"
        yield from promises(scores, {one["name"]: one["spec"] for one in others})
    yield "\nThose who chose the default knew these scenes; [others](#on-scenes-by-lot) they did not."
    yield from by_scene(found["folds"], scores)


def best(fold: dict[str, Any]) -> str:
    """The spec with the least error on the tuning scenes that costs no more than the default."""
    able = [one for one in fold["front"] if one["cost"] <= 1]
    return str(min(able, key=lambda one: float(one["tuning"]))["spec"])


def promises(scores: dict[str, pd.DataFrame], specs: dict[str, str]) -> Iterator[str]:
    """Whether the default keeps what is promised."""
    for name in PROMISES:
        iou, ssim = (ratio(metric, scores[specs[name]], scores["shadow-map"]) for metric in ("iou", "ssim"))
        assert iou is not None and ssim is not None
        yield promise(name, iou, ssim)


def by_lot(folder: Path) -> Iterator[str]:
    """The default against published settings on scenes that nobody has chosen by."""
    made = folder / "drawn"
    made.mkdir(parents=True, exist_ok=True)
    scenes = [drawn(number, made / f"drawn-{number:02}.toml") for number in range(DRAWN)]
    specs = {name: parse_spec(name, techniques()) for name in ("shadow-map", "shadow-map:preset=course", CONSTANT)}
    blocks = [Block(view_of(scene, scene.cameras[0], scene.lights[0], 512), ()) for scene in scenes]
    home = specs["shadow-map"]
    study = Study.of(["cube-on-plane"], [home], map_size=(2048,), view_size=512, rounds=0, phases=2)
    with Worker() as worker, Cells(study, folder / "by-lot", worker, Silent()) as cells:
        rows = cells.measured(list(specs.values()), blocks)
    scores = {name: scene_scores(rows[spec]) for name, spec in specs.items()}
    count = len(scores["shadow-map"])
    yield "## On scenes by lot\n"
    yield f"{count} scenes drawn at random, once, that no setting was chosen by: a floor, 4 to 16 bodies that lie on"
    yield "it, sink into it or float, turned and sized by lot, a sun 10 to 75° high, a camera 15 to 50°. The default:\n"
    yield from promises(scores, {"preset=course": "shadow-map:preset=course", CONSTANT: CONSTANT})


def drawn(number: int, file: Path) -> Scene:
    """A scene by lot, written to a file."""
    lot = np.random.default_rng(number)

    def towards(least: float, most: float) -> list[float]:
        height, turn = np.radians(lot.uniform(least, most)), lot.uniform(0, 2 * np.pi)
        return [float(np.cos(height) * np.cos(turn)), float(np.sin(height)), float(np.cos(height) * np.sin(turn))]

    camera, sun = towards(15, 50), towards(10, 75)
    lines = [f'name = "{file.stem}"', "[camera]", f"position = {[5 * x for x in camera]}", "target = [0.0, 0.3, 0.0]"]
    lines += ["fov_y = 36.0", "[light]", 'kind = "directional"', f"direction = {[-x for x in sun]}"]
    lines += ["[[mesh]]", 'name = "floor"', 'shape = "plane"', "scale = 12.0"]
    for body in range(lot.integers(4, 17)):
        place = [*lot.uniform(-1.3, 1.3, 2), lot.uniform(0.0, 0.7)]
        lines += ["[[mesh]]", f'name = "body-{body}"', f'shape = "{lot.choice(BODIES)}"']
        lines += [f"scale = {lot.uniform(0.15, 0.8, 3).tolist()}", f"rotate = {lot.uniform(0, 360, 3).tolist()}"]
        lines += [f"translate = [{place[0]}, {place[2]}, {place[1]}]"]
    file.write_text("\n".join(lines) + "\n", encoding="utf-8")
    return load_scene(str(file))


def by_scene(folds: Sequence[dict[str, Any]], scores: dict[str, pd.DataFrame]) -> Iterator[str]:
    """Where the best on the scenes tuned on gains on the default, and where it loses; the constant beside them."""
    found = pd.concat([scores[best(fold)].loc[fold["held_out"]] for fold in folds])
    constant, default = (scores[spec].loc[found.index] for spec in (CONSTANT, "shadow-map"))
    over = interval(np.exp(log_error(found) - log_error(default)).tolist())
    assert over is not None
    yield "\n### By scene\n"
    yield f"The best on the scenes tuned on, surely so or not, has {over.text(exact)} times the error of the default on"
    yield f"those held out, median over scenes. Both beside `{CONSTANT}`:\n"
    yield (
        "| scene | 1 − IoU: best | default | constant | 1 − SSIM: best | default | constant "
        "| acne: default | constant | contact: default | constant |"
    )
    yield f"|---|{'---:|' * 10}"
    for scene in (constant["iou"] - default["iou"]).sort_values().index:
        errors = [np.exp(one.loc[scene, name]) for name in ("iou", "ssim") for one in (found, default, constant)]
        others = [one.loc[scene, name] for name in ("acne", "contact") for one in (default, constant)]
        yield f"| {scene} | {' | '.join(f'{value:.4f}' for value in errors + others)} |"


def by_spec(table: Path) -> dict[str, pd.DataFrame]:
    """The scores of every spec of a table, by scene."""
    frame = pd.read_csv(table)
    return {
        str(spec): scene_scores(
            {"scene": row["scene"], "status": row["status"], "metrics": row, "work": {"cost": row["work_cost"]}}
            for row in group.to_dict("records")
        )
        for spec, group in frame[frame["status"] == "ok"].groupby("spec")
    }


def line(one: dict[str, Any], name: str) -> str:
    """A row of the table."""
    cells = [
        name,
        "each fold's own" if one["spec"] is None else f"`{one['spec']}`",
        f"{one['cost']:.2f}",
        f"{one['tuning']:.4f}",
        Interval(**one["held_out"]).text(lambda value: f"{value:.4f}"),
        Interval(**one["iou_ratio"]).text(factor),
        Interval(**one["ssim_ratio"]).text(factor),
        *("–" if one[name] is None else f"{one[name]:.4f}" for name in ("acne", "leak", "contact")),
    ]
    return f"| {' | '.join(cells)} |"


def promise(name: str, iou: Interval, ssim: Interval) -> str:
    """Whether a setting's error is so many times as large."""
    least = PROMISES[name]
    holds = iou.median >= least and (iou.low or 0) > 1 and ssim.median > 1
    return (
        f"- `{name}`: 1 − IoU is {iou.text(exact)} times as large, 1 − SSIM {ssim.text(exact)} times. Asked: "
        f"at least {least:g}, its interval above 1, and worse on SSIM: {'holds' if holds else 'does not hold'}."
    )


def factor(value: float) -> str:
    """Three digits."""
    return f"{value:.3g}"


def exact(value: float) -> str:
    """Four digits, as three may round to what is asked."""
    return f"{value:.4g}"


def limits(folder: Path) -> Iterator[str]:
    """The limit of the texel bias under suns and spots."""
    home = parse_spec("shadow-map", techniques())
    specs = {limit: home.with_(bias=f"texel(limit={limit})") for limit in LIMITS}
    larger = Path(os.environ.get("SHADOWBENCH_SCENES", "../shared/scenes"))
    sunny = [load_scene(name) for name in (*LIT, *(str(larger / name) for name in MESHES))]
    scenes = {"sun": sunny, "spot": [load_scene("spot-lamp"), *sunny]}
    lit = {
        "sun": [(scene, scene.lights[0]) for scene in scenes["sun"]],
        "spot": [(scene, light) for scene in scenes["spot"] for light in spots(scene)],
    }
    blocks = {
        kind: [Block(view_of(scene, scene.cameras[0], light, 512), ()) for scene, light in pairs]
        for kind, pairs in lit.items()
    }
    study = Study.of(["spot-lamp"], [home], map_size=(1024, 2048), view_size=512, rounds=0)
    yield "## Limit of the texel bias\n"
    yield "The texel bias grows with the light's slant up to its limit, twice as far under a lamp. Below what a slant"
    yield "needs there is acne, above it contact is lost. Under a sun a flat receiver has one slant; under a lamp the"
    yield "slant changes across it."
    yield f"Sun: {', '.join(scene.name for scene in sunny)}. Spot: spot-lamp, and the same scenes under two lamps that"
    yield "shine the way of their sun. Map sizes 1024 and 2048, view 512.\n"
    yield "| limit | sun: error | 1 − IoU | 1 − SSIM | contact | spot: error | 1 − IoU | 1 − SSIM | contact |"
    yield "|---:|---:|---:|---:|---:|---:|---:|---:|---:|"
    with Worker() as worker, Cells(study, folder / "limits", worker, Silent()) as cells:
        rows = {kind: cells.measured(list(specs.values()), own) for kind, own in blocks.items()}
    for limit, spec in specs.items():
        texts = []
        for kind in blocks:
            scores = scene_scores(rows[kind][spec])
            means = [log_error(scores).mean(), scores["iou"].mean(), scores["ssim"].mean()]
            texts += [*(f"{np.exp(mean):.5f}" for mean in means), f"{mean_of('contact', scores):.4f}"]
        yield f"| {limit} | {' | '.join(texts)} |"


def spots(scene: Scene) -> Sequence[Light]:
    """The scene's own lamps, or two that shine the way of its sun on what the camera looks at."""
    if scene.lights[0].kind == "spot":
        return scene.lights
    camera, sun = scene.cameras[0], np.array(scene.lights[0].direction)
    target, away = np.array(camera.target), np.linalg.norm(np.subtract(camera.target, camera.position))
    return [
        Light(
            name=f"spot-{name}",
            kind="spot",
            position=vec3(target - sun / np.linalg.norm(sun) * away * distance),
            direction=vec3(sun),
            angle=float(np.radians(degrees)),
        )
        for name, (distance, degrees) in SPOTS.items()
    ]


class Silent:
    """A reporter that says nothing."""

    def note(self, line: str) -> None:
        """Nothing."""

    def stage(self, name: str, total: int) -> None:
        """Nothing."""

    def step(self, what: str) -> None:
        """Nothing."""


if __name__ == "__main__":
    main()
