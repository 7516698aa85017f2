"""Times of a device in one small file, which others send: what it holds, and whether it can be believed."""

import json
import re
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any, Literal

import numpy as np
import pandas as pd
from pydantic import Field, FiniteFloat, ValidationError

from shadowbench.errors import InputError
from shadowbench.files import data_folder, replace_file
from shadowbench.gl.clock import QUERIES
from shadowbench.measure.clock_rates import device_name
from shadowbench.measure.drawer import DeviceInfo
from shadowbench.measure.rows import Count, NonNegative, Result, Size
from shadowbench.results.frame import Run
from shadowbench.results.times import ROUGH
from shadowbench.strict import Strict, explain

STUDY = "device"
"""The built-in study that is measured."""
VIEW_SIZE, REFERENCE = 1024, "shadow-map:size=1024"
"""Those of the study."""
LEAST_ROUNDS = 9
MOST_NOISE = 1.05
"""Largest ratio of a cell's time to its own, timed as if it were two."""
LEAST_RATE = 0.8
"""Least rate of a GPU's graphics clock right after it was at work, relative to its highest."""
MOST_DRIFT = 1.5
"""Largest time of `unshadowed` beside a cell, relative to its median: the same picture by other clock rates."""
MOST_ROUGH = 1 / 4
"""Largest share of cells whose interquartile range is above a third of their time."""
MOST_OFF = 0.005
"""Largest difference of an IoU from that on Mesa's software renderer: four times the largest on the GPUs so far."""
SHORTEST_MS = 0.1
"""To which shorter predicted times are raised, as measured ones cannot be told apart below."""
IDENTITY = ("scene", "light", "spec", "map_size")
WORK = ("vertices", "geometry", "fragments", "reads")


class ClockRates(Strict):
    """Rates in MHz and the power limit in W that the driver told while the device was at work."""

    driver: str
    graphics_mhz: NonNegative | None
    memory_mhz: NonNegative | None
    most_graphics_mhz: NonNegative | None
    power_limit_w: NonNegative | None


class Noise(Strict):
    """Ratio of a cell's time to its own over `n` interleaved rounds; worst: of the series of nine among them."""

    ratio: NonNegative
    worst: NonNegative
    n: Count


class TimedCell(Strict):
    """A cell: what was drawn, its IoU and memory, and its times over `n` rounds, as in `rows.jsonl`."""

    scene: str
    light: str
    spec: str
    map_size: Size | None
    iou: FiniteFloat | None
    gpu_bytes: Count
    clock: str
    n: Count
    frame_ms: NonNegative
    added_ms: FiniteFloat
    ratio: NonNegative
    ratio_iqr: NonNegative

    @property
    def floor_ms(self) -> float:
        """Time of `unshadowed` in the same rounds, the same picture in every view."""
        return self.frame_ms - self.added_ms


class Submission(Strict):
    """Times of the study `device` on one device: what drew, how fast its clocks ran, how noisy times are, the cells.

    clocks: None where the driver does not tell them.
    """

    format: Literal[1]
    device: str = Field(pattern=r"^[\w .,()/+@-]*[A-Za-z0-9][\w .,()/+@-]*$", max_length=200)
    renderer: str
    vendor: str
    software: bool
    clocks: ClockRates | None
    noise: Noise
    machine: dict[str, Any]
    versions: dict[str, str]
    finished: str
    view_size: Size
    reference: str
    cells: tuple[TimedCell, ...] = Field(min_length=1)

    @property
    def file_name(self) -> str:
        """Name of its file, after the device."""
        return re.sub(r"[^a-z0-9]+", "-", self.device.lower()).strip("-") + ".json"


def submission_of(run: Run, info: DeviceInfo, clocks: Mapping[str, Any] | None, noise: Noise) -> Submission:
    """The submission of a run of the study. Raises InputError if it has no times."""
    cells = [_cell(result) for result in run.last.results if result.status == "ok" and result.time is not None]
    if not cells:
        raise InputError(f"{run.folder}: no cell was timed; allowed: a run with 1 round or more")
    about = run.about
    system, *_, architecture = about["machine"]["system"].split()  # without the release, which may name a host
    machine = about["machine"] | {"system": f"{system} {architecture}"}
    return Submission(
        format=1,
        device=device_name(info.renderer),
        renderer=info.renderer,
        vendor=info.vendor,
        software=info.software,
        clocks=None if clocks is None else ClockRates(**clocks),
        noise=noise,
        machine=dict(machine),
        versions=about["versions"],
        finished=about["finished"],
        view_size=about["study"]["view_size"],
        reference=about["study"]["reference"],
        cells=tuple(cells),
    )


def _cell(result: Result) -> TimedCell:
    row, time = result.score, result.time
    assert time is not None
    scored = {name: row[name] for name in ("scene", "light", "spec", "map_size", "gpu_bytes")}
    timed = {name: time[name] for name in ("clock", "n", "frame_ms", "added_ms", "ratio", "ratio_iqr")}
    return TimedCell(**scored, **timed, iou=row["metrics"]["iou"])


def write_submission(submission: Submission, folder: Path) -> Path:
    """Write it into a folder, a line a cell; returns the file."""
    head = submission.model_dump(mode="json", exclude={"cells"})
    lines = [f"{json.dumps(name)}: {json.dumps(value, ensure_ascii=False)}" for name, value in head.items()]
    cells = ",\n".join(json.dumps(cell.model_dump(mode="json"), separators=(",", ":")) for cell in submission.cells)
    file = folder / submission.file_name
    with replace_file(file) as temporary:
        temporary.write_text("{" + ",\n".join([*lines, f'"cells": [\n{cells}\n]']) + "}\n", encoding="utf-8")
    return file


def read_submission(file: Path) -> Submission:
    """A submission. Raises InputError for any other file."""
    if file.exists() and not file.is_file():  # reading a named pipe would block
        raise InputError(f"{file}: is not a file")
    try:
        return Submission.model_validate_json(file.read_bytes())
    except OSError as error:
        raise InputError(f"{file}: cannot be read ({error.strerror or error})") from None
    except ValidationError as error:
        raise explain(str(file), error) from None


def known_submissions() -> list[Submission]:
    """Those that come with shadowbench, by name of their files."""
    return [read_submission(file) for file in sorted(_folder().glob("*.json"))]


def counted_work() -> pd.DataFrame:
    """The work of each cell of the study and its IoU, by Mesa's software renderer: one line a cell.

    Columns: IDENTITY, `kind` as by `kind_of`, `iou`, `gpu_bytes`, `triangles` of the casters, and WORK. Other drivers
    count fragments in their own ways: NVIDIA's counts none that write depth alone.
    """
    work = pd.read_csv(_folder() / "work.csv", dtype={"map_size": "Int64"})
    return work.assign(kind=work["spec"].map(kind_of))


def kind_of(spec: str) -> str:
    """The technique of a spec, with the parameters that change its passes: `shadow-map fit=scene`."""
    return " ".join([spec.partition(":")[0], *re.findall(r"\b(?:fit|rest|where)=\w+", spec)])


def _folder() -> Path:
    return data_folder("benchmarks") / "devices"


def beside_work(one: Submission, work: pd.DataFrame) -> pd.DataFrame:
    """The cells that `counted_work` has too, with the columns of both; of what both have, work's end with `_here`."""
    cells = pd.DataFrame([cell.model_dump() for cell in one.cells]).astype({"map_size": "Int64"})
    return cells.merge(work, on=list(IDENTITY), suffixes=("", "_here"))


def objections(one: Submission) -> list[str]:
    """Why a submission cannot be taken, a line each; none if it can."""
    return [*_about_device(one), *_about_times(one), *_about_cells(one, counted_work())]


def _about_device(one: Submission) -> Iterator[str]:
    if one.software:
        yield f"{one.device} is a software renderer, whose times are not those of a GPU"
    elif not any(cell.clock == QUERIES for cell in one.cells):
        yield f"no time is by the GPU's own timer ({QUERIES})"
    if one.device != device_name(one.renderer):
        yield f"device: found {one.device!r}, but the renderer is {one.renderer}"
    if "shadowbench" not in one.versions:
        yield "versions: shadowbench's is missing"
    if (one.view_size, one.reference) != (VIEW_SIZE, REFERENCE):
        yield f"found {one.view_size}² pixels and {one.reference}; the study has {VIEW_SIZE}² and {REFERENCE}"
    if (rates := one.clocks) and (rates.graphics_mhz or 0) < LEAST_RATE * (rates.most_graphics_mhz or 0):
        yield f"clock rates: {rates.graphics_mhz:.0f} of {rates.most_graphics_mhz:.0f} MHz; at least {LEAST_RATE:.0%}"


def _about_times(one: Submission) -> Iterator[str]:
    if not (1 <= one.noise.ratio <= MOST_NOISE and one.noise.n >= LEAST_ROUNDS):
        noise = f"{one.noise.ratio:.3f} times its own time in {one.noise.n} rounds"
        yield f"noise: a cell took {noise}; at most {MOST_NOISE}, in {LEAST_ROUNDS} or more"
    few = min(cell.n for cell in one.cells)
    if few < LEAST_ROUNDS:
        yield f"rounds: {few}; at least {LEAST_ROUNDS}"
    floors = [cell.floor_ms for cell in one.cells if cell.clock == QUERIES]
    if floors and max(floors) > MOST_DRIFT * np.median(floors):
        varied = f"{np.median(floors):.2g} ms, but {max(floors):.2g} beside some cells"
        yield f"clock rates: a frame without shadows takes {varied}; at most {MOST_DRIFT} times as long"
    rough = np.mean([cell.ratio_iqr > ROUGH * cell.ratio for cell in one.cells])
    if rough > MOST_ROUGH:
        yield f"{rough:.0%} of the times have an interquartile range above a third of them; at most {MOST_ROUGH:.0%}"


def _about_cells(one: Submission, work: pd.DataFrame) -> Iterator[str]:
    both = beside_work(one, work).drop_duplicates(list(IDENTITY))
    if len(both) < len(one.cells):
        yield f"{len(one.cells) - len(both)} cells are not of the study, or there twice"
    if len(both) < len(work):
        yield f"{len(work) - len(both)} of the study's {len(work)} cells are missing"
    if (other := both["gpu_bytes"] != both["gpu_bytes_here"]).any():
        yield f"{other.sum()} cells have textures and buffers of other sizes than on a software renderer"
    off = (both["iou"].astype(float).fillna(0) - both["iou_here"].fillna(0)).abs().to_numpy()
    if (off > MOST_OFF).any():
        worst = both.iloc[int(off.argmax())]
        drawn = f"{worst['spec']} in {worst['scene']}: IoU {worst['iou']}, not {worst['iou_here']}"
        yield f"{(off > MOST_OFF).sum()} cells are drawn otherwise than on a software renderer: {drawn}"
