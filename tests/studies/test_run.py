"""A study: its table, its rows and its images."""

import csv
import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image

import shadowbench as sb
from shadowbench.scores.masks import mask_sha256, read_mask
from shadowbench.scores.metrics import METRICS
from tests.runs import SMALL

Records = Callable[..., list[dict[str, Any]]]

STUDY = """
scenes = ["cube-on-plane", "room-with-lamp"]
map_size = [64, 128]
view_size = 96
rounds = 2
phases = 2
[[technique]]
spec = "unshadowed"
[[technique]]
spec = "shadow-map"
"""


class Run:
    """A run of a study into a folder, with its table."""

    def __init__(self, shadowbench: Any, folder: Path, text: str = STUDY, *options: str | Path) -> None:
        self.folder = folder
        file = folder.parent / "files" / "study.toml"
        file.parent.mkdir(parents=True, exist_ok=True)
        file.write_text(text, encoding="utf-8")
        answer = shadowbench("run", "-s", file, *options, "--json", "-o", folder)
        assert answer.code == 0, answer.err
        self.tables = json.loads(answer.out)
        with (folder / "table.csv").open(newline="") as stream:
            self.cells = list(csv.DictReader(stream))


@pytest.fixture(scope="module")
def made() -> dict[str, Run]:
    return {}


@pytest.fixture
def run(shadowbench: Any, made: dict[str, Run], tmp_path_factory: pytest.TempPathFactory) -> Run:
    """STUDY, run once."""
    if not made:
        made["run"] = Run(shadowbench, tmp_path_factory.mktemp("run") / "out")
    return made["run"]


@pytest.fixture(scope="module")
def truths() -> dict[str, sb.Truth]:
    """Those of STUDY's scenes."""
    return {scene: sb.truth(scene, view_size=96) for scene in ("cube-on-plane", "room-with-lamp")}


def test_the_table_has_the_promised_columns_in_their_order(run: Run) -> None:
    columns = list(run.cells[0])
    passes = [column for column in columns if column.startswith("pass_")]
    work = [column for column in columns if column.startswith("work_")]
    promised = [
        *["scene", "view", "light", "phase", "technique", "spec", "map_size", "view_size", "view_width"],
        *["renderer", "status"],
        *METRICS,
        *["frame_ms", "frame_iqr_ms", "added_ms", "ratio", "n", "clock"],
        *passes,
        *work,
        "gpu_bytes",
        "prepare_ms",
    ]
    assert columns[: len(promised)] == promised
    assert passes == ["pass_depth_ms", "pass_fit_ms", "pass_resolve_ms"]
    assert "work_draws" in work


def test_the_table_has_a_row_for_every_cell(run: Run) -> None:
    named = [(c["scene"], c["spec"], c["map_size"], c["phase"], c["status"].split(":")[0]) for c in run.cells]
    one_scene = [
        ("unshadowed", "", "0"),
        ("shadow-map", "64", "0"),
        ("shadow-map", "128", "0"),
        ("shadow-map", "64", "1"),
        ("shadow-map", "128", "1"),
    ]
    assert named == [
        *(("cube-on-plane", *cell, "ok") for cell in one_scene),
        *(("room-with-lamp", *cell, "ok" if cell[0] == "unshadowed" else "unsupported") for cell in one_scene),
    ]


def test_an_unsupported_combination_is_never_a_number(run: Run) -> None:
    refused = [cell for cell in run.cells if cell["status"].startswith("unsupported")]
    assert len(refused) == 4
    for cell in refused:
        assert "point light" in cell["status"]
        assert [cell[name] for name in (*METRICS, "frame_ms", "ratio", "gpu_bytes", "mask_sha256")] == [""] * (
            len(METRICS) + 4
        )
    rows = {row["spec"]: row for row in run.tables["room-with-lamp"]}
    assert rows["shadow-map"]["cells"] == 0 and rows["shadow-map"]["refused"][0].startswith("unsupported")
    assert [rows["shadow-map"][name] for name in METRICS] == [None] * len(METRICS)


def test_a_light_that_the_reference_does_not_answer_has_a_reference_of_its_own(run: Run) -> None:
    (cell,) = [c for c in run.cells if c["scene"] == "room-with-lamp" and c["status"] == "ok"]
    assert cell["reference"] == "cube-map:size=1024"
    assert float(cell["ratio"]) > 0 and float(cell["reference_ms"]) > 0
    others = {c["reference"] for c in run.cells if c["scene"] == "cube-on-plane" and c["frame_ms"]}
    assert others == {"shadow-map:size=1024"}


def test_pictures_masks_and_truths_lie_in_the_folder(run: Run, records: Records) -> None:
    keys = {record["key"] for record in records(run.folder, "score") if record["status"] == "ok"}
    assert {file.name for file in (run.folder / "masks").iterdir()} == {f"{key}.png" for key in keys}
    assert {file.name for file in (run.folder / "pictures").iterdir()} == {f"{key}.png" for key in keys}
    views = ["cube-on-plane.camera.light.96", "room-with-lamp.camera.light.96"]
    assert {file.name for file in (run.folder / "truth").iterdir()} == {
        f"{view}{kind}.png" for view in views for kind in ("", ".undecided", ".facets", ".lit", ".ambient")
    }
    for file in (run.folder / "pictures").iterdir():
        with Image.open(file) as picture:
            assert (picture.mode, picture.size) == ("RGB", (96, 96))


def test_the_truth_that_is_shown_is_the_truth(run: Run, truths: dict[str, sb.Truth]) -> None:
    for scene, truth in truths.items():
        shown = read_mask(run.folder / "truth" / f"{scene}.camera.light.96.png")
        undecided = read_mask(run.folder / "truth" / f"{scene}.camera.light.96.undecided.png")
        assert np.array_equal(shown, truth.visibility)
        assert np.array_equal(undecided > 0.5, truth.undecided)


def test_scoring_a_stored_mask_again_gives_the_stored_scores(
    run: Run, truths: dict[str, sb.Truth], records: Records
) -> None:
    held = [record for record in records(run.folder, "score") if record["status"] == "ok"]
    assert held
    for record in held:
        mask = read_mask(run.folder / "masks" / f"{record['key']}.png")
        assert sb.score(mask, truths[record["scene"]]) == record["metrics"]
        assert mask_sha256(mask) == record["mask_sha256"]


def test_without_any_shadow_there_is_no_iou(shadowbench: Any, tmp_path: Path) -> None:
    plane = '[[mesh]]\nshape = "plane"\nscale = 4\ncasts = false\n'
    for cell in extreme(shadowbench, tmp_path, scene_text(SUN, mesh=plane), SMALL).values():
        assert cell["status"] == "ok"
        assert [cell[m] for m in ("iou", "boundary_iou", "leak", "contact", "edge_px", "ssim_edge")] == [""] * 6
        assert (float(cell["acne"]), float(cell["mae"])) == (0, 0)


def extreme(shadowbench: Any, tmp_path: Path, scene: str, text: str = SMALL) -> dict[str, dict[str, str]]:
    """Cells of a study on this scene file, by technique."""
    (tmp_path / "files").mkdir()
    (tmp_path / "files" / "extreme.toml").write_text(scene)
    run = Run(shadowbench, tmp_path / "out", text.replace("cube-on-plane", "extreme.toml"))
    return {cell["technique"]: cell for cell in run.cells}


CAMERA = "position = [2.3, 2.2, 3.0]\ntarget = [0.4, 0.2, -0.2]"
CUBE = '[[mesh]]\nshape = "plane"\nscale = 8\n[[mesh]]\nshape = "box"\ntranslate = [0, 0.5, 0]\n'


def scene_text(light: str, camera: str = CAMERA, mesh: str = CUBE) -> str:
    return f"[camera]\n{camera}\n[light]\n{light}\n{mesh}"


SUN = 'kind = "directional"\ndirection = [0.85, -0.8, -0.5]'
LARGE = SMALL.replace("size=64", "size=512")


WIDE = 'kind = "spot"\nposition = [0.8, 2, 0.6]\ndirection = [-0.1, -1, -0.1]\nangle = 170'
INSIDE = "position = [0.1, 0.6, 0.2]\ntarget = [0.4, 0.2, -0.2]"


@pytest.mark.parametrize(
    ("scene", "least"),
    [
        (scene_text(SUN, INSIDE), 0.0),
        (scene_text(WIDE), 0.5),
    ],
    ids=["a camera inside a mesh", "a spot of 170 degrees"],
)
def test_an_extreme_scene_gives_a_result(shadowbench: Any, tmp_path: Path, scene: str, least: float) -> None:
    cells = extreme(shadowbench, tmp_path, scene, LARGE)
    assert {cell["status"] for cell in cells.values()} == {"ok"}
    assert float(cells["shadow-map"]["iou"] or 1) >= least


FILTERS = {"hard": 1, "hardware": 1, "pcf(taps=5)": 25, "dither-4": 4}


def test_work_counts_reads_of_the_map_and_sums_up_to_a_cost(shadowbench: Any, tmp_path: Path) -> None:
    filters = ", ".join(f'"{name}"' for name in FILTERS)
    text = SMALL.replace("rounds = 1", "rounds = 0").replace('size=64"', f'size=64"\nfilter = [{filters}]')
    _, *cells = Run(shadowbench, tmp_path / "out", text).cells
    assert [int(cell["work_reads"]) for cell in cells] == [64 * 64 * reads for reads in FILTERS.values()]
    for cell in cells:
        if cell["work_fragments"]:
            parts = ("vertices", "geometry", "fragments", "reads")
            assert int(cell["work_cost"]) == sum(int(cell[f"work_{name}"]) for name in parts)
