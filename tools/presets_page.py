"""Renews the table of docs/explanation/engine-biases.md, or one of motion.md, from the run folder of its command."""

import sys
from pathlib import Path

import pandas as pd
from pages import MEASURED, completed, measured, table, write

from shadowbench.plugin.registry import techniques
from shadowbench.plugin.spec import parse_spec
from shadowbench.results.frame import Run, read_runs
from shadowbench.results.law import law_on_record
from shadowbench.results.summary import summaries
from shadowbench.strict import read_toml

ROOT = Path(__file__).resolve().parent.parent
PAGE, MOTION = (ROOT / "docs" / "explanation" / f"{name}.md" for name in ("engine-biases", "motion"))
COMMAND = "shadowbench run colonnade stairs statue street terrain table-top -s presets --map-size 1024 --view-size 512"
CLEAN = 1e-3
FACTORS = (1.0, 0.25, 0.5, 2.0)  # by which the study multiplies an engine's own parameters
OWN: dict[str, dict[str, float]] = {  # these, as shipped
    "three": {},
    "babylon": {"bias": 0.01},
    "godot": {"shadow_bias": 0.1, "shadow_normal_bias": 2},
    "bevy": {"shadow_depth_bias": 0.02, "shadow_normal_bias": 1.8},
    "filament": {"constantBias": 0.001, "normalBias": 1, "polygonOffsetConstant": 0.5, "polygonOffsetSlope": 2},
    "unity": {"depth bias": 1, "normal bias": 1},
}


def main() -> int:
    """Write the page; a run folder of a study in benchmarks/motion/ has its name."""
    folder = Path(sys.argv[1])
    (run,) = read_runs([folder])
    study = Path("benchmarks") / "motion" / f"{folder.name}.toml"
    if (ROOT / study).exists():
        return write({MOTION: _moving(run, study)}, check=False)
    scores = run.frame.groupby("full_spec").agg({"iou": "mean", "ssim": "mean", "contact": "mean", "acne": "max"})
    rows = [row for engine in OWN for row in _rows(engine, scores)]
    lines = table(("preset", "bias", "1 − IoU", "1 − SSIM", "contact", "acne"), rows, texts=("bias",))
    return write({PAGE: completed(PAGE, MEASURED, [measured("shadowbench run -s presets"), "", *lines])}, check=False)


def _moving(run: Run, study: Path) -> str:
    """The page of motion with the means over a study's scenes; ms are predicted, time is that of the reference."""
    cells = pd.concat(one.cells for one in summaries(run, law_on_record()))
    specs = {
        parse_spec(one["spec"], techniques()).full_text: one["spec"] for one in read_toml(ROOT / study, "")["technique"]
    }
    cells = cells.assign(spec=cells["full_spec"].map(specs), error=1 - cells["iou"], time=cells["ratio"])
    moving = cells.pivot_table(["flicker", "pop"], "spec", "sequence")
    moving.columns = map(" ".join, moving.columns)
    means = cells.groupby("spec")[["error", "predicted_ms", "time"]].mean().join(moving)
    lines = means.loc[specs.values()].dropna(axis=1).rename_axis(None).to_string(float_format="{:.3g}".format)
    command = f"shadowbench run -s {study}"
    above, _, below = MOTION.read_text(encoding="utf-8").partition(f"{MEASURED}'{command}'")
    return f"{above}{measured(command)}\n\n```text\n{lines}\n```{below.split('```', 2)[2]}"


def _rows(engine: str, scores: pd.DataFrame) -> list[list[str]]:
    """Rows for the bias as shipped, the best multiple of it if any is better and clean, and biases of ours."""
    shipped = parse_spec(f"shadow-map:preset={engine}", techniques())
    scaled = shipped.params.bias.scaled  # type: ignore[attr-defined]
    multiples = {factor: shipped.with_(bias=scaled(factor)) for factor in FACTORS if OWN[engine] or factor == 1.0}
    clean = [factor for factor in multiples if factor == 1.0 or scores.acne[multiples[factor].full_text] <= CLEAN]
    best = max(clean, key=lambda factor: scores.iou[multiples[factor].full_text])
    biases = {_own(engine, factor): multiples[factor] for factor in (1.0, best)}
    biases |= {f"`{name}`": shipped.with_(bias=name) for name in ("texel", "two-planes")}
    rows = []
    for name, spec in biases.items():
        own = scores.loc[spec.full_text]
        figures = (f"{1 - own.iou:.4f}", f"{1 - own.ssim:.3f}", f"{own.contact:.3f}", f"{own.acne:.4f}")
        rows.append([f"`{engine}`", name, *figures])
    return rows


def _own(engine: str, factor: float) -> str:
    return ", ".join(f"`{name}` {factor * value:g}" for name, value in OWN[engine].items()) or "back faces cast"


if __name__ == "__main__":
    sys.exit(main())
