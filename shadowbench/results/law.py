"""Milliseconds that a device which is not here would take, from the work that a software renderer counts.

A file of `benchmarks/devices/` is a device's law: nanoseconds for what a frame counts beyond one of `unshadowed`, each
vertex, texture read and byte of its maps alike in all techniques; each frame, fragment and triangle of the casters by
the kind of technique. `tools/fit_device.py` fits them to a run on the device.
"""

import json
import re
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from typing import Any

from shadowbench.errors import InputError
from shadowbench.files import data_folder
from shadowbench.measure.rows import Record, size_of
from shadowbench.scores.metrics import is_soft

SHARED = ("vertices", "reads", "gpu_bytes")
OWN = ("frames", "fragments", "triangles")
FLOOR = "unshadowed"
SHORTEST_MS = 0.1
"""To which shorter predicted times are raised, as measured ones cannot be told apart below."""
WORST, LEAST_SCENES = 1.5, 3
"""Median factor of the errors above which, and scenes below which, a kind gets no times: what takes it is uncounted."""
_MASK_BYTES = 4  # a pixel of the mask, which `unshadowed` draws too


@dataclass(frozen=True)
class Law:
    """A device's nanoseconds for each count.

    timed: the day; cells: to which it was fitted; shared: by the counts of SHARED; kinds: by `kind_of` those of OWN,
    and of the errors in scenes left out of the fit, as factors, the `median` and the 90th percentile, `most`, with the
    number of `scenes`.
    """

    device: str
    timed: str
    cells: int
    shared: Mapping[str, float]
    kinds: Mapping[str, Mapping[str, float]]

    def holds(self, kind: str) -> bool:
        """Whether it gives times of a kind of technique."""
        own = self.kinds.get(kind)
        return kind == FLOOR or (own is not None and own["median"] <= WORST and own["scenes"] >= LEAST_SCENES)

    def share(self, kind: str, counts: Mapping[str, float]) -> float:
        """Milliseconds of a frame of a kind for which it holds, by the given counts of SHARED and OWN."""
        if kind == FLOOR:
            return 0.0
        shared = sum(self.shared[name] * counts.get(name, 0) for name in SHARED)
        own = sum(self.kinds[kind][name] * {"frames": 1, **counts}.get(name, 0) for name in OWN)
        return (shared + own) / 1e6

    def of_row(self, row: Record) -> float | None:
        """Milliseconds of a score row that a software renderer drew; None where the law gives no time."""
        kind = kind_of(row["spec"])
        if "triangles" not in row or "vertices" not in row["work"] or is_soft(row["metrics"]) or not self.holds(kind):
            return None
        return 0.0 if kind == FLOOR else max(self.share(kind, counts_of(row, row["triangles"])), SHORTEST_MS)


def kind_of(spec: str) -> str:
    """The technique of a spec, with the parameters that change its passes: `shadow-map fit=scene`."""
    name, named = spec.partition(":")[0], "fit|rest|where"
    if name == FLOOR:  # which costs nothing alone
        named += "|contact"
    kind = " ".join([name, *re.findall(rf"\b(?:{named})=\w+", spec)])
    return kind.removesuffix(" fit=visible") if name == "shadow-map" else kind  # its default, with parameters


def counts_of(row: Record, triangles: int) -> dict[str, float]:
    """The counts of a score row beyond those of `unshadowed`; triangles: of the scene."""
    work, pixels = row["work"], size_of(row).pixels
    return {
        "vertices": work["vertices"] + work["geometry"],
        "reads": work.get("reads", 0),
        "gpu_bytes": row["gpu_bytes"] - _MASK_BYTES * pixels,
        "fragments": work["fragments"] - pixels,
        "triangles": triangles,
    }


@cache
def laws() -> Mapping[str, Law]:
    """The laws of all devices on record, by their names."""
    files = sorted((data_folder("benchmarks") / "devices").glob("*.json"))
    read: list[Any] = [json.loads(file.read_text(encoding="utf-8")) for file in files]
    return {one["device"]: Law(**one) for one in read}


def law_on_record() -> Law | None:
    """The law of the first device, which ranks where none is named and nothing can be timed."""
    return next(iter(laws().values()), None)


def find_law(name: str) -> Law:
    """The law of the only device with these words in its name. Raises InputError if it is not one device."""
    asked = set(re.findall(r"\w+", name.lower()))
    named = [law for device, law in laws().items() if asked and asked <= set(re.findall(r"\w+", device.lower()))]
    named = [laws()[name]] if name in laws() else named
    if len(named) != 1:
        raise InputError(f"--device: {name!r:.60} names {len(named)} devices with times; allowed: {', '.join(laws())}")
    return named[0]
