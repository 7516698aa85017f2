"""Table of failures of soft shadows and of the metrics that see them.

    shadowbench run -s soft-failures -o DIR && python tools/soft_failures.py DIR

Each value is a metric's error as a share of its largest in the table; the largest of each row is its own failure's.
"""

import sys
from pathlib import Path

import pandas as pd

FAILURES = {
    "bleed": "light where casters overlap or end: a variance map without reduction, over a long range",
    "false_dark": "acne: a wide kernel with too small a bias",
    "noise": "two random taps per pixel",
    "banding": "six taps at the same places for all pixels",
    "width": "a hard edge",
    "hardening": "a kernel of fixed width",
}
"""What goes wrong in each row of the study, in its order, by the metric that is to see it."""


def failure_table(folder: Path) -> pd.DataFrame:
    """(6, 6) errors by failure (rows) and metric (columns), each as a share of the column's largest."""
    found = pd.read_csv(folder / "table.csv")
    errors = found[list(FAILURES)].abs()
    errors["hardening"] = (found["hardening"] - 1).abs()
    errors.index = pd.Index(list(FAILURES))
    return errors / errors.max()


def main() -> None:
    """Print the table as Markdown."""
    found = failure_table(Path(sys.argv[1]))
    print(f"| failure | {' | '.join(f'`{name}`' for name in found)} |\n|---|{'---|' * len(found)}")
    for name, row in found.iterrows():
        cells = (f"**{value:.2f}**" if metric == name else f"{value:.2f}" for metric, value in row.items())
        print(f"| {FAILURES[str(name)]} | {' | '.join(cells)} |")


if __name__ == "__main__":
    main()
