"""Generates docs/explanation/default-bias.md from folders of `run -s race`, and of `run` with the held-out scenes."""

import sys
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from pages import filled, measured, table, write

from shadowbench.measure.rows import Record
from shadowbench.plugin.registry import techniques
from shadowbench.plugin.spec import parse_spec
from shadowbench.results.frame import read_runs
from shadowbench.results.law import law_on_record

FILE = Path(__file__).resolve().parent.parent / "docs" / "explanation" / "default-bias.md"
REFERENCE, CLEAN = "texel", 1e-3
FILTERS = {"2×2": "hardware", "5×5": "pcf(taps=5)"}
LEAST = 1e-5  # of errors, whose logarithms are averaged
HEADINGS = ("bias", "1 − IoU", "worst", "at equal ms", "1 − SSIM", "contact", "acne > 0.001", "ms", "held out", "front")


def main() -> int:
    """Write the page."""
    rows = [row for run in read_runs([Path(name) for name in sys.argv[1:]]) for row in run.rows]
    cells = pd.DataFrame([_cell(row) for row in rows if row["status"] == "ok"])
    means = cells.groupby(["filter", "bias", "held_out", "scene", "size"]).mean().sort_index()
    scenes = means.xs(False, level="held_out").reset_index()["scene"].nunique()
    values = {name: "\n".join(_table(means.loc[written])) for name, written in FILTERS.items()}
    values |= {"MEASURED": measured("shadowbench run -s race"), "SCENES": str(scenes)}
    return write({FILE: filled(__file__, values)}, check=False)


def _cell(row: Record) -> dict[str, object]:
    params = parse_spec(row["full_spec"], techniques()).params
    metrics, law = row["metrics"], law_on_record()
    names = {"filter": params.filter.written(), "bias": params.bias.written(), "scene": row["scene"]}  # type: ignore[attr-defined]
    errors = {"iou": max(1 - metrics["iou"], LEAST), "ssim": max(1 - metrics["ssim"], LEAST)}
    faults = {"acne": metrics["acne"], "contact": metrics["contact"], "ms": law.of_row(row) if law else None}
    return {**names, "size": row["map_size"], "held_out": row["scene"].startswith("held-out"), **errors, **faults}


def _table(means: pd.DataFrame) -> list[str]:
    """Lines of a Markdown table, a line per bias, by 1 − IoU; all but contact and acne as ratios to REFERENCE."""
    lines = {bias: _line(means.loc[bias], means.loc[REFERENCE]) for bias in means.index.unique("bias")}
    rows = []
    for bias, (error, *others, ms, held_out) in sorted(lines.items(), key=lambda item: item[1]):
        beaten = any(line[0] < error and line[-2] < ms for line in lines.values())
        worst, equal, ssim, contact, acne = others
        ratios = f"{error:.3f}", f"{worst:.2f}", f"{equal:.3f}", f"{ssim:.3f}", f"{contact:.3f}", acne, f"{ms:.2f}"
        rows.append((f"`{bias}`", *ratios, f"{held_out:.3f}", "" if beaten else "●"))
    size, time = (min(lines, key=lambda bias: lines[bias][index]) for index in (0, 2))
    best = f"At equal size `{size}` is the most accurate, at equal predicted time `{time}`."
    return [*table(HEADINGS, rows), "", best]


def _line(errors: Any, reference: Any) -> tuple[float, ...]:
    ratios = errors / reference
    own, held_out = (np.log(ratios[["iou", "ssim", "ms"]].xs(part, level="held_out")) for part in (False, True))
    built_in = errors.xs(False, level="held_out")
    iou, ssim, ms = np.exp(own.mean())
    worst, acne = float(np.exp(own["iou"].max())), int((built_in["acne"] > CLEAN).sum())
    equal = _at_equal_ms(built_in, reference.xs(False, level="held_out"))
    return iou, worst, equal, ssim, float(built_in["contact"].mean()), acne, ms, float(np.exp(held_out["iou"].mean()))


def _at_equal_ms(errors: Any, reference: Any) -> float:
    """Ratio of 1 − IoU at the map size that costs what the reference's middle one does.

    Between measured sizes times are linear in texels, as by the law, and errors are powers of the size.
    """
    logs = []
    for scene, own in errors.groupby("scene"):
        other = reference.loc[scene].iloc[len(own) // 2]
        sizes = own.index.get_level_values("size").to_numpy(dtype=float)
        size = np.sqrt(np.interp(other["ms"], own["ms"], sizes**2))
        logs.append(np.interp(np.log(size), np.log(sizes), np.log(own["iou"])) - np.log(other["iou"]))
    return float(np.exp(np.mean(logs)))


if __name__ == "__main__":
    sys.exit(main())
