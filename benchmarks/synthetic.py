"""Run folders of any number of cells, as `shadowbench run` writes them, with made-up scores, times and pictures.

python -m benchmarks.synthetic FOLDER --cells 100000 --seed 1
"""

import argparse
import hashlib
import json
from collections.abc import Iterator
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np

from shadowbench.scores.masks import write_mask
from shadowbench.scores.metrics import METRICS

SIDE = 64  # pixels of a view
RENDERER = "llvmpipe (LLVM 15.0.6, 256 bits), 4.5 (Core Profile) Mesa 22.3.6"
_SPECS = tuple(
    f"shadow-map:bias={bias},filter={kind}"
    for bias in ("none", "texel", "slope", "plane", "normal", "constant", "cone", "second-depth")
    for kind in ("hard", "pcf", "bilinear", "pcss", "poisson")
)
_SIZES = (256, 512, 1024, 2048, 4096)
_PHASES = (0, 1)
_STUDY = {"scenes": [], "specs": list(_SPECS), "reference": "shadow-map:size=1024", "view_size": SIDE, "rounds": 9}


def records(cells: int, seed: int = 0) -> Iterator[dict[str, Any]]:
    """Score records of cells, each of phase 0 followed by its time record.

    seed: of the times, and of the hundredth of the cells whose scores differ from those of other seeds.
    """
    random, changes = np.random.default_rng(0), np.random.default_rng(seed)
    hard = [name for name, metric in METRICS.items() if metric.kind != "soft"]
    for index, (scene, spec, size, phase) in zip(range(cells), _cells(), strict=False):
        digest = hashlib.sha256(f"{scene} {spec} {size} {phase}".encode()).hexdigest()
        values = dict(zip(hard, random.random(len(hard)).tolist(), strict=True))
        counts = random.integers(1, 1 << 20, 4).tolist()
        if changes.random() < 0.01:
            values["iou"] = float(changes.random())
        yield {
            "schema": 1, "kind": "score", "key": digest[:24], "scene": scene, "view": "camera", "light": "sun",
            "phase": phase, "technique": "shadow-map", "spec": spec, "full_spec": f"{spec},size={size},cull=true",
            "map_size": size, "view_size": SIDE, "coordinates": "relative", "renderer": RENDERER, "status": "ok",
            "metrics": dict.fromkeys(METRICS) | values, "receivers": SIDE * SIDE, "undecided": index % 7,
            "gpu_bytes": 4 * size * size, "facts": {"texel_m": values["iou"], "parts_closed": 3.0},
            "work": dict(zip(("draws", "primitives", "vertices", "fragments"), counts, strict=True)),
            "mask_sha256": digest, "surface_mismatch": 1, "assumptions": ["no light: a sun of 45 degrees is assumed"],
            "command": "shadowbench run -s synthetic.toml -o results/synthetic",
        }  # fmt: skip
        if phase == 0:
            ms = (1 + index % 29) * float(changes.uniform(0.9, 1.1))
            passes = {
                name: {"ms": share * ms, "iqr_ms": 0.1, "n": 9, "changes": change}
                for name, share, change in (("fit", 0.1, "view"), ("depth", 0.5, "light"), ("resolve", 0.4, "frame"))
            }
            yield {
                "schema": 1, "kind": "time", "key": digest[:24], "reference_key": "0" * 24, "machine": "synthetic",
                "clock": "finish+wall", "n": 9, "frame_ms": ms, "frame_iqr_ms": 0.2, "wall_ms": None, "added_ms": ms,
                "reference": "shadow-map:size=1024", "reference_ms": 10.0, "ratio": ms / 10, "ratio_iqr": 0.02,
                "no_ratio": None, "prepare_ms": 1.0,
                "passes": passes, "still_ms": 0.4 * ms, "camera_ms": 0.5 * ms, "light_ms": ms,
            }  # fmt: skip


def write_folder(folder: Path, cells: int, seed: int = 0, pictures: bool = False) -> Path:
    """Write a run folder of so many cells; pictures: with a mask of each, and the truths. Returns the folder."""
    folder.mkdir(parents=True, exist_ok=True)
    keys = []
    random = np.random.default_rng(seed)
    with (folder / "rows.jsonl").open("w", encoding="utf-8") as stream:
        for record in records(cells, seed):
            stream.write(json.dumps(record) + "\n")
            if record["kind"] == "score":
                keys.append(record["key"])
                if pictures:
                    _write_pictures(folder, record, random)
    about = {
        "schema": 1, "command": "shadowbench run -s synthetic.toml", "finished": "2026-01-02T03:04:05+00:00",
        "versions": {"shadowbench": "0.1.0"}, "machine_key": "synthetic", "clock": "finish+wall", "assumptions": [],
        "machine": {"processor": "a processor", "cores": 2, "memory_gib": 8.0, "system": "Linux"},
        "device": {"renderer": RENDERER, "software": True, "version": 450, "subpixel_bits": 8},
        "study": _STUDY, "keys": keys,
    }  # fmt: skip
    (folder / "run.json").write_text(json.dumps(about), encoding="utf-8")
    return folder


def _cells() -> Iterator[tuple[str, str, int, int]]:
    scene = 0
    while True:
        yield from product([f"scene-{scene:03d}"], _SPECS, _SIZES, _PHASES)
        scene += 1


def _write_pictures(folder: Path, record: dict[str, Any], random: np.random.Generator) -> None:
    """Write a noisy square shadow as the cell's mask, and the square as its truth."""
    truth = np.ones((SIDE, SIDE), dtype=np.float32)
    truth[SIDE // 4 : SIDE // 2, SIDE // 4 : SIDE // 2] = 0
    for name in ("masks", "truth"):
        (folder / name).mkdir(exist_ok=True)
    stem = folder / "truth" / ".".join(str(record[name]) for name in ("scene", "view", "light", "view_size"))
    if not stem.with_name(f"{stem.name}.png").exists():
        write_mask(stem.with_name(f"{stem.name}.png"), truth)
        write_mask(stem.with_name(f"{stem.name}.undecided.png"), np.zeros_like(truth))
    noisy = np.where(random.random(truth.shape) < 0.05, 1 - truth, truth).astype(np.float32)
    write_mask(folder / "masks" / f"{record['key']}.png", noisy)


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--cells", type=int, default=100_000)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--pictures", action="store_true")
    found = parser.parse_args()
    write_folder(found.folder, found.cells, found.seed, found.pictures)
