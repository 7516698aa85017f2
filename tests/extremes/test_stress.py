"""Sweeps of `stress` in this process: rows, breaking points, operating ranges and exit codes."""

import csv
import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image
from scipy.ndimage import binary_dilation

from shadowbench.extremes.axes import AXES
from shadowbench.extremes.model import Axis
from shadowbench.measure.worker import Limits
from shadowbench.plugin.spec import parse_spec
from shadowbench.results.ranges import Failure, failure, operating_range
from shadowbench.scores.masks import mask_sha256, read_mask
from shadowbench.scores.metrics import METRICS
from shadowbench.scores.motion import MOTION
from shadowbench.studies.stress import SWEEPING, spec_at, stress

Records = Callable[..., list[dict[str, Any]]]

ELEVATION, MESH, MAP_SIZE = AXES["elevation"], AXES["mesh"], AXES["map-size"]


def short(axis: Axis, *values: float | str) -> Axis:
    """An axis with its default and some other values, under a sun only."""
    kept = tuple(value for value in axis.values if value in (axis.default, *values))
    return replace(axis, values=kept, quick=kept, lights=("directional",))


def row(axis: Axis, value: float | str, status: str = "ok", **metrics: float | None) -> dict[str, Any]:
    """A row at an axis value; metrics that are not given are perfect."""
    perfect = {"iou": 1.0, "acne": 0.0, "leak": 0.0}
    about = {"technique": "t", "home_spec": "t", "light_kind": "directional", "axis": axis.name, "axis_value": value}
    return {**about, "status": status, "metrics": perfect | metrics} if status == "ok" else {**about, "status": status}


KINDS = {
    "crashed: SIGSEGV": "crash",
    "hung: no answer within 120 s": "hang",
    "ate memory: 4.20 GiB, allowed are 4": "memory",
    "ValueError: t drew visibility is NaN or infinite in 3 of 9 pixels (worker.py:1)": "nan",
    "ValueError: t: fact 'texel_m' is -inf; allowed: finite numbers (session.py:1)": "nan",
    "RuntimeError: OpenGL error GL_INVALID_VALUE in drawing t (device.py:1)": "gl-error",
    "ZeroDivisionError: no direction in [0 0 0] (model.py:1)": "error",
}


def test_worker_messages_map_to_kinds_of_failure() -> None:
    for reason, kind in KINDS.items():
        assert failure(row(ELEVATION, 1.0, f"failed: {reason}")) == Failure(kind, text=reason)


@pytest.mark.parametrize(
    ("metrics", "found"),
    [
        ({}, None),
        ({"iou": 0.95, "acne": 0.01, "leak": 0.01}, None),
        ({"iou": None}, Failure("unjudged", text="neither the truth nor the mask has a shadow that is decided")),
        ({"iou": 0.9499}, Failure("iou", 0.9499)),
        ({"acne": 0.02, "leak": 0.5}, Failure("leak", 0.5)),
        ({"iou": 0.2, "acne": 0.02}, Failure("acne", 0.02)),
        ({"iou": 0.2, "acne": 0.5, "rmse": 0.05, "rmse_pen": 0.2, "bleed": 0.01}, None),
        ({"rmse": 0.06, "rmse_pen": 0.2, "false_dark": 0.02, "bleed": 0.03}, Failure("bleed", 0.03)),
    ],
)
def test_a_cell_fails_by_the_metric_that_exceeds_its_tolerance_most(
    metrics: dict[str, float | None], found: Failure | None
) -> None:
    assert failure(row(ELEVATION, 1.0, **metrics)) == found
    assert failure(row(ELEVATION, 1.0, flicker=0.05)) == Failure("flicker", 0.05)
    assert failure(row(ELEVATION, 1.0, "unsupported: no plane")) is None


def test_a_range_ends_at_the_first_value_out_of_tolerance_on_either_side_of_the_default() -> None:
    rows = [row(ELEVATION, value) for value in ELEVATION.values if value not in (85.0, 2.0, 0.5)]
    whole = operating_range(ELEVATION, rows)
    assert (whole.plain, whole.text) == ("0.1…89.9°", "0.1…89.9°; 18 of 21 values")
    rows += [row(ELEVATION, 85.0, leak=0.4), row(ELEVATION, 2.0, acne=0.041), row(ELEVATION, 0.5, "failed: hung: 1 s")]
    found = operating_range(ELEVATION, rows)
    assert found.in_tolerance[0] == 75.0 and found.in_tolerance[-1] == 3.0
    assert found.text == "breaks at 85°: leak 40.00%; breaks at 2°: acne 4.10%"


def test_unsupported_values_end_a_range_without_a_break() -> None:
    rows = [row(MAP_SIZE, value, "unsupported: too large" if value > 4096 else "ok") for value in MAP_SIZE.values]
    found = operating_range(MAP_SIZE, rows)
    assert found.text == "16…4096 texels; refused: 8192, 16384"
    assert (found.breaks, found.unsupported) == ((), (8192, 16384))
    assert operating_range(MAP_SIZE, [row(MAP_SIZE, 1024, "unsupported: never")]).plain == "unsupported"


def test_values_of_unordered_axes_are_judged_separately() -> None:
    rows = [row(MESH, value, iou=0.5 if value in ("slivers", "open") else 1.0) for value in MESH.values]
    assert operating_range(MESH, rows).text == "breaks at slivers, open: IoU 0.500"
    assert operating_range(MESH, [row(MESH, value) for value in MESH.values]).text == "all 7"


def test_an_axis_of_parameters_is_swept_for_techniques_that_have_them(bench: Any) -> None:
    spec = parse_spec("shadow-map", bench.techniques)
    setting = MAP_SIZE.at(64, "directional")
    changed = spec_at(spec, setting)
    assert changed is not None and changed.map_size == 64
    assert spec_at(parse_spec("unshadowed", bench.techniques), setting) is None
    assert spec_at(spec, ELEVATION.at(5.0, "directional")) == spec


class Swept:
    """A sweep of a few specs along short axes, with its rows."""

    def __init__(self, bench: Any, folder: Path, specs: list[str], *axes: Axis) -> None:
        self.steps: list[str] = []
        parsed = [parse_spec(text, bench.techniques) for text in specs]
        bench.calls.clear()
        self.rows = stress(parsed, axes, bench.campaign(folder, self, **SWEEPING), quick=True).rows
        self.calls = list(bench.calls)

    def note(self, line: str) -> None:
        raise AssertionError(line)

    def stage(self, name: str, total: int | None, *, timed: int = 0) -> None:
        self.total = total

    def step(self, what: str) -> None:
        self.steps.append(what)


ENDS = [
    ("does:what=abort", "crash"),
    ("does:what=nan", "nan"),
    ("does:what=raise", "error"),
    ("half", "leak"),
    ("shadow-map", ""),
]
WILD = ["does:what=abort", "does:what=nan", "does:what=raise", "half", "shadow-map:size=256"]


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("stress")


@pytest.fixture(scope="module")
def swept(bench: Any, folder: Path) -> Swept:
    bench.worker.limits = Limits()
    return Swept(bench, folder, WILD, short(ELEVATION, 5.0), short(AXES["camera-step"]))


def test_a_crash_costs_only_its_own_cells(swept: Swept) -> None:
    kinds = [(one["axis_value"], one["spec"], getattr(failure(one), "kind", "")) for one in swept.rows]
    ends = [(value, *end) for value in (50.0, 5.0, 0.05) for end in ENDS]
    assert kinds == [*ends[:-1], (0.05, "shadow-map", "swim")]
    assert len(swept.steps) == swept.total == 15


def test_a_row_is_a_score_record_with_its_place_on_the_axis(swept: Swept, folder: Path, records: Records) -> None:
    written = records(folder, "score")
    assert [one["key"] for one in written] == [one["key"] for one in swept.rows]
    assert len({one["key"] for one in written}) == len(written)
    last = swept.rows[-1]
    assert (last["axis"], last["axis_value"], last["axis_unit"]) == ("camera-step", 0.05, "texels of 5.9 mm a frame")
    assert (last["technique"], last["map_size"], last["view_size"], last["phase"]) == ("shadow-map", 256, 256, 0)
    assert (last["scene"], last["light"], last["light_kind"]) == ("camera-step-0.05", "sun", "directional")
    assert set(last["metrics"]) == {*METRICS, *MOTION} and set(swept.rows[4]["metrics"]) == set(METRICS)
    assert 0.01 < last["metrics"]["swim"] < 0.1, (
        "the window of a map that is fitted to what is seen moves with the camera"
    )
    assert swept.rows[4]["mask_sha256"] == last["mask_sha256"], "the first frame of a movement is the base scene"
    assert swept.rows[4]["key"] != last["key"]


def test_masks_and_truth_are_kept_of_what_is_out_of_tolerance(swept: Swept, folder: Path) -> None:
    out = {one["key"] for one in swept.rows if one["status"] == "ok" and failure(one)}
    assert all({file.stem for file in (folder / name).iterdir()} == out for name in ("masks", "pictures"))
    half = swept.rows[3]
    assert mask_sha256(read_mask(folder / "masks" / f"{half['key']}.png")) == half["mask_sha256"]
    assert (folder / "truth" / "elevation-5.camera.sun.256.undecided.png").exists()


def test_the_picture_of_a_break_is_drawn_with_the_mask_beside_it(bench: Any, tmp_path: Path) -> None:
    """Lit pixels look as they do without any shadows, and those in shadow are darker.

    Where surfaces meet the picture is anti-aliased, so that a lit pixel may take from a shadow up to 5 px away.
    """
    bench.worker.limits = Limits()
    specs = ["unshadowed", "shadow-map:bias=none,filter=hard,size=128", "shadow-map:filter=hard,size=16"]
    (_, lit), *others = (
        [np.asarray(Image.open(tmp_path / kind / f"{one['key']}.png"), float) for kind in ("masks", "pictures")]
        for one in Swept(bench, tmp_path, specs, short(AXES["light-step"])).rows
    )
    for mask, picture in others:
        dark, bright, shown = mask == 0, lit.mean(axis=-1), picture.mean(axis=-1)
        assert 0.005 < dark.mean() < 0.9, "there is something to see"
        away = ~binary_dilation(dark, np.ones((3, 3)), iterations=5)
        assert away.mean() > 0.25 and np.array_equal(shown[away], bright[away])
        assert (shown[~dark] == bright[~dark]).mean() > 0.97
        assert (shown[dark] < bright[dark]).mean() > 0.99


def test_a_map_that_does_not_fit_is_refused_before_it_is_made(bench: Any, tmp_path: Path) -> None:
    bench.worker.limits = Limits(bytes=3 << 29)
    axis = replace(short(MAP_SIZE), values=(1024, 2048, 16384, 65536), quick=(1024, 2048, 16384, 65536))
    swept = Swept(bench, tmp_path, ["shadow-map"], axis)
    assert [one["status"][:11] for one in swept.rows] == ["ok", "ok", "unsupported", "unsupported"]
    assert "takes 1 GiB or more; a cell may take 0.75 GiB" in swept.rows[2]["status"]
    assert "map size 65536" in swept.rows[3]["status"] and " allows 1 to " in swept.rows[3]["status"]
    again = Swept(bench, tmp_path, ["shadow-map"], axis)
    assert again.rows == swept.rows and "draw" not in again.calls


def run(shadowbench: Any, plugins: tuple[Path, Path], folder: Path, what: str, *more: str) -> Any:
    """`shadowbench stress`, with a plug-in that breaks in one way or another."""
    few = ["--quick", "--axis", "depth-format", "--axis", "through-up", "-o", folder]
    given = [word for plugin in plugins for word in ("--plugin", plugin)]
    return shadowbench("stress", "-t", f"does:what={what}", "-t", "half", *given, *few, *more)


@pytest.mark.parametrize(
    ("what", "code", "said"),
    [
        ("nan", 1, "NaN, infinity or an OpenGL error in 6 of 12 cells; the first: does:what=nan at through-up 5"),
        ("raise", 3, "a crash, hang or error in 6 of 12 cells"),
    ],
)
def test_exit_code_says_what_a_technique_did(
    shadowbench: Any, wild: Path, half: Path, tmp_path: Path, what: str, code: int, said: str
) -> None:
    answer = run(shadowbench, (wild, half), tmp_path, what)
    assert answer.code == code, answer.err
    assert said in answer.err


def test_breaking_points_are_what_was_asked_for(shadowbench: Any, wild: Path, half: Path, tmp_path: Path) -> None:
    answer = run(shadowbench, (wild, half), tmp_path, "nothing", "--json")
    assert answer.code == 0, answer.err
    ranges = json.loads(answer.out)
    written, cells = (
        list(csv.DictReader((tmp_path / f"{name}.csv").read_text().splitlines())) for name in ("ranges", "table")
    )
    assert [one["range"] for one in written] == [one["range"] for one in ranges]
    assert [(one["spec"], one["light"]) for one in ranges] == [
        (spec, light) for light in ("directional", "spot") for spec in ("does", "half")
    ]
    assert all(one["axis"] == "through-up" and one["range"].startswith("breaks at 5°: leak") for one in ranges)
    assert len(cells) == 12
    assert {one["axis_value"] for one in cells} == {"5.0", "1e-05", "0.0"}
    assert all(one["failure"].startswith("leak") for one in cells)
    assert json.loads((tmp_path / "run.json").read_text())["study"]["view_size"] == 256
