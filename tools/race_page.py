"""Generates docs/explanation/default-bias.md from folders of the commands that it shows."""

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
from shadowbench.scores.metrics import is_soft

FILE = Path(__file__).resolve().parent.parent / "docs" / "explanation" / "default-bias.md"
REFERENCE, CLEAN = "texel", 1e-3
FILTERS = {"2×2": "hardware", "5×5": "pcf(taps=5)"}
LEAST = 1e-5  # of errors, whose logarithms are averaged
HEADINGS = ("bias", "error", "worst", "at equal ms", "1 − SSIM", "contact", "acne > 0.001", "ms", "held out", "front")


def main() -> int:
    """Write the page."""
    rows = [row for run in read_runs([Path(name) for name in sys.argv[1:]]) for row in run.rows]
    cells = pd.DataFrame([_cell(row) for row in rows if row["status"] == "ok" and row["metrics"]["iou"] is not None])
    means = cells.groupby(["filter", "bias", "held_out", "scene", "size", "light"]).mean().sort_index()
    raced = means.xs("", level="light")
    values = {name: "\n".join(_table(raced.loc[written])) for name, written in FILTERS.items()}
    scenes = raced.loc["hardware"].xs(False, level="held_out").index.unique("scene").size
    values |= {"SCENES": str(scenes), "LIGHTS": _lights(means.drop("", level="light")["error"])}
    values |= {"MEASURED": measured("shadowbench run -s race"), "OTHERS": measured("shadowbench run … --sun-at 100,…")}
    return write({FILE: filled(__file__, values)}, check=False)


def _cell(row: Record) -> dict[str, object]:
    params = parse_spec(row["full_spec"], techniques()).params
    metrics, law = row["metrics"], law_on_record()
    soft, sun, held_out = is_soft(metrics), row["light"].startswith("sun "), row["scene"].startswith("held-out")
    names = {"filter": params.filter.written(), "bias": params.bias.written(), "scene": row["scene"]}  # type: ignore[attr-defined]
    names["light"] = ("held out" if held_out else "soft") if soft else row["light"][-2:] + "°" if sun else ""
    error = metrics["rmse"] if soft else 1 - metrics["iou"]
    errors = {"error": max(error, LEAST), "ssim": max(1 - metrics["ssim"], LEAST)}
    faults = {"acne": metrics["acne"], "contact": metrics["contact"], "ms": (law and law.of_row(row)) or np.nan}
    return {**names, "size": row["map_size"], "held_out": held_out, **errors, **faults}


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
    best = f"Most accurate at equal size: `{size}`; at equal time: `{time}`."
    return [*table(HEADINGS, rows), "", best]


def _lights(errors: Any) -> str:
    """A table with a line per bias: errors as ratios to REFERENCE, for each filter and light."""
    logs = np.log(errors) - np.log(errors.xs(REFERENCE, level="bias"))
    means = np.exp(logs.groupby(["bias", "filter", "light"]).mean()).unstack([1, 2]).sort_index(axis=1)
    return str(means.to_string(float_format="{:.2f}".format))


def _line(errors: Any, reference: Any) -> tuple[float, ...]:
    ratios = errors / reference
    own, held_out = (np.log(ratios[["error", "ssim", "ms"]].xs(part, level="held_out")) for part in (False, True))
    built_in = errors.xs(False, level="held_out")
    error, ssim, ms = np.exp(own.mean())
    worst, acne = float(np.exp(own["error"].max())), int((built_in["acne"] > CLEAN).sum())
    equal = _at_equal_ms(built_in, reference.xs(False, level="held_out"))
    contact, held = float(built_in["contact"].mean()), float(np.exp(held_out["error"].mean()))
    return error, worst, equal, ssim, contact, acne, ms, held


def _at_equal_ms(errors: Any, reference: Any) -> float:
    """Ratio of 1 − IoU at the map size that costs what the reference's middle one does.

    Between measured sizes times are linear in texels, as by the law, and errors are powers of the size.
    """
    logs = []
    for scene, own in errors.groupby("scene"):
        other = reference.loc[scene].iloc[len(own) // 2]
        sizes = own.index.get_level_values("size").to_numpy(dtype=float)
        size = np.sqrt(np.interp(other["ms"], own["ms"], sizes**2))
        logs.append(np.interp(np.log(size), np.log(sizes), np.log(own["error"])) - np.log(other["error"]))
    return float(np.exp(np.mean(logs)))


if __name__ == "__main__":
    sys.exit(main())
