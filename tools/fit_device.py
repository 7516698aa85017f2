"""Fits a device's law to its times, for `recommend --device`.

    python tools/fit_device.py TIMED COUNTED NAME

TIMED is the folder of `shadowbench run -s device` on the device, COUNTED that of the same study with `--rounds 0` on
Mesa's software renderer, whose counts of work are those that times are predicted from: NVIDIA's count no fragments that
write depth alone. Writes benchmarks/devices/NAME.json (see shadowbench/results/law.py), and prints the table of
docs/explanation/devices.md.

Non-negative least squares (Lawson and Hanson 1974) of errors relative to the times; errors are of scenes left out one
at a time. Times by the GPU's timer are as if `unshadowed`, the same picture in every view, took its median beside all
cells: it tells how fast the clocks ran.
"""

import json
import re
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray
from scipy.optimize import nnls

from shadowbench.gl.clock import QUERIES
from shadowbench.results.frame import read_runs
from shadowbench.results.law import FLOOR, OWN, SHARED, SHORTEST_MS, counts_of, kind_of
from shadowbench.scenes.library import load_scene

ROOT = Path(__file__).resolve().parent.parent
CELL = ["scene", "light", "spec", "map_size"]
_LEAST_MS = 0.2  # below which errors of a fit are absolute


def main() -> int:
    """Fit the law of the folders that the command line names."""
    timed, counted, device = sys.argv[1:]
    (times,), (counts,) = read_runs([Path(timed)]), read_runs([Path(counted)])
    cells = [
        {name: result.score[name] for name in CELL}
        | {name: result.time[name] for name in ("clock", "frame_ms", "added_ms")}
        for result in times.last.results
        if result.time is not None and result.status == "ok"
    ]
    triangles = {row["scene"]: load_scene(row["scene"]).geometry.count for row in counts.last.rows}
    work = [
        {name: row[name] for name in CELL} | counts_of(row, triangles[row["scene"]])
        for row in counts.last.rows
        if row["status"] == "ok"
    ]
    law = {"device": device, "timed": times.about["finished"][:10], "cells": len(cells)}
    law |= fitted(pd.DataFrame(cells).merge(pd.DataFrame(work), on=CELL))
    file = ROOT / "benchmarks" / "devices" / (re.sub(r"[^a-z0-9]+", "-", device.lower()).strip("-") + ".json")
    file.write_text(json.dumps(law, indent=1) + "\n", encoding="utf-8")
    print(file, *table(law), sep="\n")
    return 0


def fitted(cells: pd.DataFrame) -> dict[str, Any]:
    """The fields `shared` and `kinds` of a law, fitted to cells with their times and counts."""
    cells = cells[cells["spec"] != FLOOR].reset_index(drop=True)
    cells = cells.assign(kind=cells["spec"].map(kind_of), frames=1)
    by_gpu, floor = cells["clock"] == QUERIES, cells["frame_ms"] - cells["added_ms"]
    ms = (cells["added_ms"] * (floor[by_gpu].median() / floor).where(by_gpu, 1.0)).to_numpy(float)
    kinds = sorted(cells["kind"].unique())
    its = cells["kind"].to_numpy()[:, None] == np.array(kinds)
    own = its[:, :, None] * cells[list(OWN)].to_numpy(float)[:, None, :]  # 0 in the cells of other kinds
    features = np.hstack([cells[list(SHARED)].to_numpy(float), own.reshape(len(cells), -1)])
    predicted = np.empty(len(cells))
    for scene in cells["scene"].unique():
        left_out = (cells["scene"] == scene).to_numpy()
        predicted[left_out] = features[left_out] @ _nanoseconds(features[~left_out], ms[~left_out]) / 1e6
    factors = np.exp(np.abs(np.log(np.maximum(predicted, SHORTEST_MS) / np.maximum(ms, SHORTEST_MS))))
    values = iter(_nanoseconds(features, ms).tolist())
    law: dict[str, Any] = {"shared": {name: next(values) for name in SHARED}, "kinds": {}}
    for kind in kinds:
        errors = factors[(cells["kind"] == kind).to_numpy()]
        median, most = float(np.median(errors)), float(np.percentile(errors, 90))
        scenes = cells[cells["kind"] == kind]["scene"].nunique()
        law["kinds"][kind] = {name: next(values) for name in OWN} | {"median": median, "most": most, "scenes": scenes}
    return law


def _nanoseconds(features: NDArray[np.float64], ms: NDArray[np.float64]) -> NDArray[np.float64]:
    """(counts,) nanoseconds of each count, from (cells, counts) and (cells,) milliseconds."""
    weight = 1 / np.maximum(ms, _LEAST_MS)
    scale = np.maximum(features.max(axis=0), 1)
    solved, _ = nnls(features / scale * weight[:, None], ms * weight)
    return np.asarray(solved / scale * 1e6)


def table(law: Mapping[str, Any]) -> Sequence[str]:
    """Lines of a Markdown table: what each kind of technique takes, and the errors of its predictions."""
    lines = [
        "| technique | scenes | median error | 9 of 10 | per frame | per million fragments | per 1000 triangles |",
        "|---|---:|---:|---:|---:|---:|---:|",
    ]
    for kind, own in law["kinds"].items():
        ms = [f"{own[name] * many:.3g} ms" for name, many in zip(OWN, (1e-6, 1.0, 1e-3), strict=True)]
        errors = f"{own['scenes']} | ×{own['median']:.2f} | ×{own['most']:.2f}"
        lines.append(f"| `{kind}` | {errors} | {' | '.join(ms)} |")
    return lines


if __name__ == "__main__":
    sys.exit(main())
