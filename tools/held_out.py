"""Prints how much worse settings are in held-out scenes and phases than in those that they were chosen on.

    python tools/held_out.py RUN... [--reference SPEC] [--chosen SCENE,SCENE,...]

RUN are folders of `shadowbench run -s held-out`; settings were chosen on the scenes that --chosen names, by default
all built-in ones, and all others count as held out. Errors are √((1 − IoU) · (1 − SSIM)), as geometric means over
scenes. Held-out scenes may be harder, so a setting is compared there with a reference: the last column is its error
over that of the reference in held-out scenes, divided by the same where it was chosen. Above 1 it lost, as one does
that is tuned too closely. In brackets are 95% bootstrap intervals over scenes.
"""

import argparse
import sys
from collections import defaultdict
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pandas as pd

from shadowbench.errors import InputError
from shadowbench.measure.rows import Record
from shadowbench.plugin.registry import preset_names
from shadowbench.results.frame import read_runs
from shadowbench.scenes.library import builtin_names
from shadowbench.scores.metrics import is_soft, ranking

FIRST_PHASE = 8
"""Phases from here on are held out."""
CHOSEN, PHASES, SCENES = "chosen on", "other phases", "held-out scenes"
HEADINGS = ("setting", CHOSEN, PHASES, SCENES, "phases: ratio", "to reference", "held out", "scenes: ratio")
_DRAWS = 10_000
_LEAST = 1e-4  # of errors, whose logarithms are averaged

Errors = dict[str, pd.Series]
"""Of a setting: by part, the logarithm of its error by scene."""


def main() -> int:
    """Print the table of the folders that the command line names."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folders", metavar="RUN", type=Path, nargs="+")
    parser.add_argument("--reference", metavar="SPEC", default="shadow-map")
    parser.add_argument("--chosen", metavar="SCENE,SCENE,...", default=",".join(builtin_names()))
    asked = parser.parse_args()
    try:
        rows = [row for run in read_runs(asked.folders) for row in run.rows]
        lines = table(rows, asked.reference, asked.chosen.split(","))
    except InputError as error:
        print(f"error: {error}", file=sys.stderr)
        return 2
    print("\n".join(lines))
    return 0


def table(rows: Sequence[Record], reference: str, chosen: Sequence[str]) -> list[str]:
    """Lines of a Markdown table, one per setting; chosen: the scenes that settings were chosen on.

    Raises InputError without a row of the reference.
    """
    drawn = [row for row in rows if row["status"] == "ok"]
    parts = {name: [row for row in drawn if row["spec"] == name] for name in {row["spec"]: 0 for row in drawn}}
    found = {name: _errors(own, chosen) for name, own in parts.items()}
    if reference not in found:
        raise InputError(f"--reference: found no row of {reference!r:.60}; allowed: {', '.join(found) or 'none'}")
    lines = [_line(name, errors, found[reference]) for name, errors in found.items()]
    return [f"| {' | '.join(cells)} |" for cells in (HEADINGS, ["---", *["---:"] * (len(HEADINGS) - 1)], *lines)]


def _part(row: Record, chosen: Sequence[str]) -> str:
    if row["scene"] not in chosen:
        return SCENES
    return PHASES if row["phase"] >= FIRST_PHASE else CHOSEN


def _errors(rows: Sequence[Record], chosen: Sequence[str]) -> Errors:
    parts = {name: [row for row in rows if _part(row, chosen) == name] for name in (CHOSEN, PHASES, SCENES)}
    return {name: _log_error(own) for name, own in parts.items() if own}


def _log_error(rows: Sequence[Record]) -> pd.Series:
    """Mean of log √((1 − IoU) · (1 − SSIM)) by scene, of soft shadows with RMSE in place of 1 − IoU."""
    errors = defaultdict(list)
    for row in rows:
        metrics = row["metrics"]
        ranked_by = ranking(is_soft(metrics))
        if metrics[ranked_by.name] is not None and metrics["ssim"] is not None:
            error = max(ranked_by.error(metrics[ranked_by.name]), _LEAST, row.get("truth_error", 0.0))
            errors[row["scene"]].append(np.log(error * max(1 - metrics["ssim"], _LEAST)) / 2)
    return pd.Series({scene: np.mean(values) for scene, values in errors.items()}, dtype=float)


def _line(name: str, errors: Errors, reference: Errors) -> list[str]:
    means = [f"{np.exp(errors[part].mean()):.4f}" if part in errors else "" for part in (CHOSEN, PHASES, SCENES)]
    moved = (errors[PHASES] - errors[CHOSEN]).dropna() if PHASES in errors and CHOSEN in errors else pd.Series()
    beside = {
        part: (errors[part] - reference[part]).dropna() if part in errors and part in reference else pd.Series()
        for part in (CHOSEN, SCENES)
    }
    ratios = [f"{np.exp(values.mean()):.2f}" if len(values) else "" for values in beside.values()]
    gap = _ratio(beside[SCENES], beside[CHOSEN]) if errors is not reference and all(ratios) else ""
    return [f"`{preset_names().get(name, name)}`", *means, _ratio(moved) if len(moved) else "", *ratios, gap]


def _ratio(over: pd.Series, under: pd.Series | None = None) -> str:
    """exp(mean over − mean under) with its interval; scenes of both are drawn apart."""
    random = np.random.default_rng(0)
    parts = [(1, over), (-1, under)] if under is not None else [(1, over)]
    value = sum(sign * values.mean() for sign, values in parts)
    draws = sum(sign * random.choice(values, (_DRAWS, len(values))).mean(axis=1) for sign, values in parts)
    low, high = np.exp(np.percentile(draws, [2.5, 97.5]))
    return f"{np.exp(value):.3g} [{low:.3g}, {high:.3g}]"


if __name__ == "__main__":
    sys.exit(main())
