"""Generates docs/explanation/engine-biases.md from a folder of `run -s presets`: engines' biases beside two planes."""

import sys
from collections.abc import Iterator
from pathlib import Path

import pandas as pd
from pages import measured

from shadowbench.plugin.registry import techniques
from shadowbench.plugin.spec import parse_spec
from shadowbench.results.frame import read_runs

FILE = Path(__file__).resolve().parent.parent / "docs" / "explanation" / "engine-biases.md"
CLEAN = 1e-3
SCENES = "colonnade stairs statue street terrain table-top"
COMMAND = f"shadowbench run {SCENES} -s presets --map-size 1024 --view-size 512"
OWN: dict[str, dict[str, float]] = {  # the engines' own parameters, as shipped
    "three": {},
    "babylon": {"bias": 0.01},
    "godot": {"shadow_bias": 0.1, "shadow_normal_bias": 2},
    "bevy": {"shadow_depth_bias": 0.02, "shadow_normal_bias": 1.8},
    "filament": {"constantBias": 0.001, "normalBias": 1, "polygonOffsetConstant": 0.5, "polygonOffsetSlope": 2},
    "unity": {"depth bias": 1, "normal bias": 1},
}
PAGE = """\
# Engines' biases

<!-- by python tools/presets_page.py -->

<!-- not run: it measures 240 cells -->
```sh
{command} -o results/presets
```

Each engine's [preset](../reference/techniques/shadow-map.md) with the bias that it ships, with `texel` and with
`two-planes`, all else equal. Means over {count} scenes, acne of the worst. Where a quarter, half or twice of all of an
engine's numbers is more accurate, with acne of at most {clean:g} everywhere, the best of them is listed too.

{measured}

| preset | bias | 1 − IoU | 1 − SSIM | contact | acne |
|---|---|---:|---:|---:|---:|
{rows}
"""


def main() -> int:
    """Write the page."""
    (run,) = read_runs([Path(sys.argv[1])])
    rows = [{"spec": row["full_spec"], "scene": row["scene"], **row["metrics"]} for row in run.rows]
    cells = pd.DataFrame(rows).groupby("spec")[["iou", "ssim", "contact", "acne"]]
    scores = cells.mean().assign(acne=cells.max()["acne"])
    scores[["iou", "ssim"]] = 1 - scores[["iou", "ssim"]]
    lines = [line for engine in OWN for line in _lines(engine, scores)]
    values = {"count": len(SCENES.split()), "clean": CLEAN, "measured": measured(COMMAND), "rows": "\n".join(lines)}
    FILE.write_text(PAGE.format(command=COMMAND, **values), encoding="utf-8")
    return 0


def _lines(engine: str, scores: pd.DataFrame) -> Iterator[str]:
    """Lines of a Markdown table: as shipped, the best multiple if any is better, and the biases of ours."""
    shipped = parse_spec(f"shadow-map:preset={engine}", techniques())
    bias = shipped.params.bias  # type: ignore[attr-defined]
    multiples = {factor: bias.scaled(factor) for factor in (0.25, 0.5, 2.0)} if OWN[engine] else {}
    values = {factor: scores.loc[shipped.with_(bias=one).full_text] for factor, one in multiples.items()}
    least = scores.loc[shipped.full_text].iou
    better = {factor: own.iou for factor, own in values.items() if own.iou < least and own.acne <= CLEAN}
    named = {_own(engine, 1): shipped}
    for factor in sorted(better, key=better.__getitem__)[:1]:
        named[_own(engine, factor)] = shipped.with_(bias=multiples[factor])
    named |= {f"`{name}`": shipped.with_(bias=name) for name in ("texel", "two-planes")}
    for name, spec in named.items():
        own = scores.loc[spec.full_text]
        yield f"| `{engine}` | {name} | {own.iou:.4f} | {own.ssim:.3f} | {own.contact:.3f} | {own.acne:.4f} |"


def _own(engine: str, factor: float) -> str:
    return ", ".join(f"`{name}` {factor * value:g}" for name, value in OWN[engine].items()) or "back faces cast"


if __name__ == "__main__":
    sys.exit(main())
