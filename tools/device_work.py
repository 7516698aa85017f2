"""Counts the work of the study `device` on Mesa's software renderer, into benchmarks/devices/work.csv.

python tools/device_work.py [DIR]: of a run folder of that study, or of one that it measures without times in minutes.
To be called after a change of the study or of what techniques draw; the submissions beside it must then be made again.
"""

import subprocess
import sys
from pathlib import Path

import pandas as pd

from shadowbench.results.frame import read_runs
from shadowbench.results.submission import IDENTITY, WORK
from shadowbench.scenes.library import load_scene

ROOT = Path(__file__).resolve().parent.parent
FILE = ROOT / "benchmarks" / "devices" / "work.csv"


def main() -> int:
    """Measure if no folder is given, then write the counts."""
    folder = Path(sys.argv[1]) if len(sys.argv) > 1 else ROOT / "build" / "device-work"
    if len(sys.argv) == 1:
        command = ["-m", "shadowbench", "run", "-s", "device", "--rounds", "0", "-o", folder]
        subprocess.run([sys.executable, *command], cwd=ROOT, check=True)
    (run,) = read_runs([folder])
    rows = [row for row in run.last.rows if row["status"] == "ok"]
    triangles = {name: len(load_scene(name).geometry.faces) for name in {row["scene"] for row in rows}}
    lines = [
        {name: row[name] for name in IDENTITY}
        | {"iou": row["metrics"]["iou"], "gpu_bytes": row["gpu_bytes"], "triangles": triangles[row["scene"]]}
        | {name: row["work"].get(name, 0) for name in WORK}
        for row in rows
    ]
    FILE.parent.mkdir(exist_ok=True)
    pd.DataFrame(lines).astype({"map_size": "Int64"}).to_csv(FILE, index=False, float_format="%.6f")
    print(f"{FILE}: {len(lines)} cells")
    return 0


if __name__ == "__main__":
    sys.exit(main())
