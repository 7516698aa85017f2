"""How much worse settings are in held-out scenes than in those that they were chosen on.

    python tools/held_out.py RUN...
    python tools/held_out.py --seed N FOLDER

RUN are folders of `shadowbench run -s held-out`, of which a Markdown table is printed. Errors are √((1 − IoU) · (1 −
SSIM)), as geometric means over scenes; in brackets are 95% bootstrap intervals over scenes. Held-out scenes may be
harder, so the last column is the setting's error over that of `shadow-map` there, divided by the same where it was
chosen: above 1 it was tuned too closely.

With a seed it draws scenes into FOLDER/held-out, and writes the study FOLDER/held-out.toml that measures them beside
the built-in ones: benchmarks/ has those of seed 1, and nobody has seen those of another. A scene is drawn again only if
its shadows cover less than a twentieth of what faces the light, whatever techniques make of them.
"""

import argparse
import math
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from shadowbench.api import InputError, truth
from shadowbench.measure.rows import Record
from shadowbench.plugin.registry import preset_names
from shadowbench.results.frame import read_runs
from shadowbench.scores.metrics import is_soft, ranking

STUDY = Path(__file__).resolve().parent.parent / "benchmarks" / "held-out.toml"
REFERENCE = "shadow-map"
PARTS = CHOSEN, HELD_OUT = "chosen on", "held-out scenes"
HEADINGS = ("setting", *PARTS, "to reference", "held out", "ratio")
_DRAWS = 10_000
_LEAST = 1e-4  # of errors, whose logarithms are averaged
LIGHTS = ("directional",) * 8 + ("spot", "point") * 2
HALF_HEIGHT = {"box": 0.5, "sphere": 0.5, "cylinder": 0.5, "cone": 0.5, "capsule": 1.0, "torus": 1 / 6, "stairs": 0.5}
"""Shapes of bodies, and their half heights."""
LEAST_SHADOW = 0.05  # share of the receivers


def main() -> int:
    """Print the table of run folders, or draw scenes."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folders", metavar="RUN|FOLDER", type=Path, nargs="+")
    parser.add_argument("--seed", type=int)
    chosen = parser.parse_args()
    if chosen.seed is not None:
        write_scenes(chosen.folders[0], chosen.seed)
        return 0
    try:
        print("\n".join(table([row for run in read_runs(chosen.folders) for row in run.rows])))
    except InputError as error:
        print(f"error: {error}", file=sys.stderr)
        return 2
    return 0


def table(rows: Sequence[Record]) -> list[str]:
    """Lines of a Markdown table, one per setting. Raises InputError without a row of the reference."""
    frame = pd.DataFrame(map(_cell, (row for row in rows if row["status"] == "ok")))
    means = frame.groupby(["setting", "scene", "part"])["error"].mean().unstack("part").reindex(columns=PARTS)
    names = list(frame["setting"].unique())
    if REFERENCE not in names:
        raise InputError(f"found no row of {REFERENCE}; allowed: a folder of `run -s held-out -t {REFERENCE}`")
    lines = [_line(name, means.loc[name], means.loc[REFERENCE]) for name in names]
    return [f"| {' | '.join(line)} |" for line in (HEADINGS, ["---", *["---:"] * (len(HEADINGS) - 1)], *lines)]


def _cell(row: Record) -> dict[str, Any]:
    part = HELD_OUT if row["scene"].startswith("held-out") else CHOSEN
    return {"setting": row["spec"], "part": part, "scene": row["scene"], "error": _log_error(row)}


def _log_error(row: Record) -> float:
    """Log √((1 − IoU) · (1 − SSIM)), of soft shadows with RMSE in place of 1 − IoU; NaN without."""
    metrics = row["metrics"]
    ranked_by = ranking(is_soft(metrics))
    if metrics[ranked_by.name] is None or metrics["ssim"] is None:
        return math.nan
    error = max(ranked_by.error(metrics[ranked_by.name]), _LEAST, row.get("truth_error", 0.0))
    return math.log(error * max(1 - metrics["ssim"], _LEAST)) / 2


def _line(name: str, errors: pd.DataFrame, reference: pd.DataFrame) -> list[str]:
    """errors: logarithms, a line for each scene and a column for each part."""
    beside = errors - reference
    means = [f"{np.exp(errors[part].mean()):.4f}" if errors[part].count() else "" for part in PARTS]
    ratios = [f"{np.exp(beside[part].mean()):.2f}" if beside[part].count() else "" for part in PARTS]
    gap = _ratio(beside[HELD_OUT].dropna(), beside[CHOSEN].dropna()) if name != REFERENCE and all(ratios) else ""
    return [f"`{preset_names().get(name, name)}`", *means, *ratios, gap]


def _ratio(over: pd.Series, under: pd.Series) -> str:
    """exp(mean over − mean under) with its interval; scenes of both are drawn apart."""
    random = np.random.default_rng(0)
    drawn, other = (random.choice(values, (_DRAWS, len(values))).mean(axis=1) for values in (over, under))
    low, high = np.exp(np.percentile(drawn - other, [2.5, 97.5]))
    return f"{np.exp(over.mean() - under.mean()):.3g} [{low:.3g}, {high:.3g}]"


def write_scenes(folder: Path, seed: int) -> None:
    """Write a scene for each of LIGHTS into `folder`/held-out, and the study that names them beside it."""
    (folder / "held-out").mkdir(parents=True, exist_ok=True)
    for index, light in enumerate(LIGHTS, 1):
        random = np.random.default_rng([seed, index])
        file = folder / "held-out" / f"{index:02}.toml"
        shadow = 0.0
        while shadow < LEAST_SHADOW:
            file.write_text(_scene(random, f"held-out-{seed}-{index:02}", light), encoding="utf-8")
            drawn = truth(file, view_size=64)
            shadow = float((drawn.visibility[drawn.receivers] < 0.5).mean()) if drawn.receivers.any() else 0.0
    (folder / STUDY.name).write_bytes(STUDY.read_bytes())


def _scene(random: np.random.Generator, name: str, kind: str) -> str:
    """Text of a scene with its centre at the origin: ground, bodies, rows of bars, foliage."""
    radius = 10 ** random.uniform(0.0, 1.5)  # metres
    azimuth = random.uniform(0.0, 360.0)
    meshes = [{"shape": "plane", "scale": [8 * radius, 1, 8 * radius]}]
    if random.random() < 0.25:
        hills = {"shape": "terrain", "waves": random.uniform(1.0, 4.0), "seed": int(random.integers(1000))}
        meshes = [hills | {"scale": [8 * radius, random.uniform(0.2, 0.8) * radius, 8 * radius]}]
    meshes += [_body(random, radius) for _ in range(random.integers(5, 13))]
    meshes += [_bars(random, radius) for _ in range(random.integers(0, 3))]
    if random.random() < 0.3:
        crown = {"shape": "leaves", "count": 300, "size": random.uniform(0.05, 0.2), "seed": int(random.integers(1000))}
        meshes.append(crown | {"scale": 0.8 * radius, "translate": _place(random, radius, 0.6 * radius)})
    distance = random.uniform(2.6, 4.0) * radius
    eye = _around(azimuth + random.uniform(50.0, 310.0), random.uniform(12.0, 55.0), distance)  # not with the light
    camera = {"position": eye, "target": [0, 0.2 * radius, 0], "fov_y": random.uniform(30.0, 55.0)}
    lines = [f'name = "{name}"', 'about = "held out: bodies drawn at random"']
    lines += [f"camera = {_text(camera)}", f"light = {_text(_light(random, kind, azimuth, radius))}", "mesh = ["]
    return "\n".join([*lines, *(f"    {_text(mesh)}," for mesh in meshes), "]", ""])


def _light(random: np.random.Generator, kind: str, azimuth: float, radius: float) -> dict[str, Any]:
    if kind == "point":
        return {"kind": kind, "position": _place(random, 0.8 * radius, random.uniform(0.8, 1.6) * radius)}
    elevation = random.uniform(12.0, 75.0) if kind == "directional" else random.uniform(35.0, 75.0)
    position = _around(azimuth, elevation, random.uniform(2.0, 3.0) * radius)
    light = {"kind": kind, "direction": [-value for value in position]}
    return light if kind == "directional" else light | {"position": position, "angle": random.uniform(45.0, 80.0)}


def _body(random: np.random.Generator, radius: float) -> dict[str, Any]:
    """A body on the ground, or above it, a quarter of them tilted."""
    shape = str(random.choice(sorted(HALF_HEIGHT)))
    scale = radius * 10 ** random.uniform(-1.3, -0.2, 3)
    rise = random.uniform(0.0, 0.6) * radius if random.random() < 0.3 else 0.0
    turn = random.uniform(0.0, 360.0, 3) if random.random() < 0.25 else [0, random.uniform(0.0, 360.0), 0]
    at = _place(random, radius, HALF_HEIGHT[shape] * scale[1] + rise)
    return {"shape": shape, "scale": scale, "rotate": turn, "translate": at}


def _bars(random: np.random.Generator, radius: float) -> dict[str, Any]:
    """A row of thin upright bars."""
    width, height = random.uniform(0.01, 0.05) * radius, random.uniform(0.2, 0.8) * radius
    step = _around(random.uniform(0.0, 360.0), 0.0, random.uniform(1.5, 4.0) * width)
    row = {"count": int(random.integers(8, 25)), "step": step}
    at = _place(random, 0.8 * radius, height / 2)
    return {"shape": "box", "scale": [width, height, width], "translate": at, "repeat": row}


def _place(random: np.random.Generator, radius: float, height: float) -> list[float]:
    x, _, z = _around(random.uniform(0.0, 360.0), 0.0, radius * math.sqrt(random.random()))
    return [x, height, z]


def _around(azimuth: float, elevation: float, distance: float) -> list[float]:
    """A point at an azimuth and elevation in degrees."""
    about, up = math.radians(azimuth), math.radians(elevation)
    x, y, z = math.sin(about) * math.cos(up), math.sin(up), math.cos(about) * math.cos(up)
    return [distance * x, distance * y, distance * z]


def _text(value: Any) -> str:
    """TOML of a table, a list, a text or a number, of four digits."""
    if isinstance(value, dict):
        return f"{{ {', '.join(f'{key} = {_text(one)}' for key, one in value.items())} }}"
    if isinstance(value, list | np.ndarray):
        return f"[{', '.join(map(_text, value))}]"
    return f'"{value}"' if isinstance(value, str) else f"{value:.4g}"


if __name__ == "__main__":
    sys.exit(main())
