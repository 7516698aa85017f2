"""Generates docs/explanation/devices.md from benchmarks/devices/; --check reports a stale page."""

import sys
from collections.abc import Iterator
from pathlib import Path

import ages
import numpy as np
import pandas as pd
from pages import compare

from shadowbench.advice.law import WORST, Law, law_of
from shadowbench.results.submission import SHORTEST_MS, Submission, beside_work, counted_work, known_submissions

FILE = Path(__file__).resolve().parent.parent / "docs" / "explanation" / "devices.md"
FILTERED = ("shadow-map:filter=pcf", 4096)
"""The spec that others are compared with, in scenes that have it."""


def main() -> int:
    """Write or check the page."""
    devices = ["\n".join(_device(one, law_of(one))) for one in known_submissions()]
    text = Path(__file__).with_suffix(".md").read_text(encoding="utf-8")
    text = text.replace("@WORST@", str(WORST)).replace("@DEVICES@", "\n\n".join(devices))
    if "--check" in sys.argv:
        return compare(FILE, text, Path(__file__).name)
    FILE.write_text(text, encoding="utf-8")
    return 0


def _device(one: Submission, law: Law) -> Iterator[str]:
    clocks = one.clocks
    rates = "clock rates unknown"
    if clocks:
        told = {"graphics": clocks.graphics_mhz, "at most": clocks.most_graphics_mhz, "memory": clocks.memory_mhz}
        mhz = (f"{name} {value:.0f} MHz" for name, value in told.items() if value)
        rates = f"driver {clocks.driver}, {', '.join(mhz)}"
    yield f"## {one.device}\n"
    yield f"{ages.START}'shadowbench submit'; times, {one.finished[:10]} -->\n"
    yield (
        f"{len(one.cells)} cells, {one.finished[:10]}, shadowbench {one.versions['shadowbench']}; {rates}; beside "
        f"{one.machine.get('processor')}. A cell takes {one.noise.ratio:.3f} times its own time.\n"
    )
    than = f"`{FILTERED[0]}` at {FILTERED[1]}"
    yield f"Milliseconds beyond `unshadowed`, over scenes; ×: median relative to {than}, in scenes that have it.\n"
    yield "| spec | map | scenes | median, ms | least | most | × | least IoU |"
    yield "|---|---:|---:|---:|---:|---:|---:|---:|"
    table = beside_work(one, counted_work()).fillna({"map_size": 0})
    table = table[table["kind"] != "unshadowed"]
    filtered = table[(table["spec"] == FILTERED[0]) & (table["map_size"] == FILTERED[1])].set_index("scene")["added_ms"]
    table = table.assign(relative=table["added_ms"] / table["scene"].map(filtered))
    for (spec, size), part in table.groupby(["spec", "map_size"]):
        ms, relative = part["added_ms"], part["relative"].median()
        shown = [f"{value:.2f}" for value in (ms.median(), ms.min(), ms.max())]
        times = "" if pd.isna(relative) else f"{relative:.2f}"
        yield f"| `{spec}` | {size or ''} | {len(part)} | {' | '.join(shown)} | {times} | {part['iou'].min():.4f} |"
    own_counts = "per frame | per million fragments | per 1000 triangles"
    yield f"\n| by the law | scenes | median error | 9 of 10 cells | by the spec's median | {own_counts} |"
    yield "|---|---:|---:|---:|---:|---:|---:|---:|"
    for kind, error in law.errors.items():
        own = [law.nanoseconds[f"{kind} {count}"] * many for count, many in _OWN]
        times = " | ".join(f"{value:.3g} ms" for value in own) if error.holds else "– | – | –"
        simple = _simple_error(table[table["kind"] == kind])
        yield f"| `{kind}` | {error.scenes} | ×{error.median:.2f} | ×{error.most:.2f} | ×{simple:.2f} | {times} |"
    shared = [f"{law.nanoseconds[count] * many:.2g} ms for {what}" for count, many, what in _SHARED]
    yield f"\nIn all techniques: {', '.join(shared)}."


def _simple_error(table: pd.DataFrame) -> float:
    """Median factor between times and the medians of the same specs in the other scenes."""
    ms = table["added_ms"].clip(lower=SHORTEST_MS)
    others = [
        ms[(table["spec"] == row.spec) & (table["map_size"] == row.map_size) & (table["scene"] != row.scene)].median()
        for row in table.itertuples()
    ]
    return float(np.exp(np.abs(np.log(others / ms)).median()))


_OWN = (("frames", 1e-6), ("fragments", 1.0), ("triangles", 1e-3))  # nanoseconds to the milliseconds of a column
_SHARED = (
    ("vertices", 1.0, "a million vertices"),
    ("reads", 1.0, "a million texture reads"),
    ("gpu_bytes", 2**20 * 16e-6, "16 MiB of maps"),
)


if __name__ == "__main__":
    sys.exit(main())
