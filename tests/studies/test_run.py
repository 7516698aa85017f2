"""A study run in this process: its rows, its files, and that nothing is measured twice."""

import csv
import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image

from shadowbench.data import data_folder
from shadowbench.errors import InputError
from shadowbench.measure import pictures, scorer
from shadowbench.measure.executor import MemoryExceeded
from shadowbench.measure.machine import write_run_file
from shadowbench.measure.rows import Result, read_run_file
from shadowbench.measure.scoring import prepare_truth
from shadowbench.measure.session import Session
from shadowbench.scores.masks import mask_sha256, read_mask
from shadowbench.scores.metrics import METRICS, score
from shadowbench.studies.study import Study
from shadowbench.studies.tables import cells_frame, summary, write_table
from shadowbench.techniques.shadow_map import ShadowMap
from shadowbench.truths.cache import cached_truth
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
    """Result of one run of a study, with its table."""

    def __init__(self, bench: Any, folder: Path, text: str = STUDY) -> None:
        self.folder = folder
        self.study: Study = bench.study(folder.parent / "files", text)
        self.results: list[Result] = bench.run(self.study, folder)
        self.notes: list[str] = bench.notebook.notes
        self.calls: list[str] = list(bench.calls)
        frame = cells_frame(self.results)
        write_table(folder / "table.csv", [frame])
        self.tables = summary(frame)
        with (folder / "table.csv").open(newline="") as stream:
            self.cells = list(csv.DictReader(stream))


@pytest.fixture(scope="module")
def run(bench: Any, tmp_path_factory: pytest.TempPathFactory) -> Run:
    return Run(bench, tmp_path_factory.mktemp("run") / "out")


def test_the_table_has_the_promised_columns_in_their_order(run: Run) -> None:
    columns = list(run.cells[0])
    passes = [column for column in columns if column.startswith("pass_")]
    work = [column for column in columns if column.startswith("work_")]
    promised = [
        *["scene", "view", "light", "phase", "technique", "spec", "map_size", "view_size", "renderer", "status"],
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
    rows = {row.spec: row for row in run.tables["room-with-lamp"]}
    assert rows["shadow-map"].cells == 0 and rows["shadow-map"].refused[0].startswith("unsupported")
    assert set(rows["shadow-map"].values.values()) == {None}


def test_a_light_that_the_reference_does_not_answer_has_a_reference_of_its_own(run: Run) -> None:
    (cell,) = [c for c in run.cells if c["scene"] == "room-with-lamp" and c["status"] == "ok"]
    assert cell["reference"] == "cube-map:size=1024"
    assert float(cell["ratio"]) > 0 and float(cell["reference_ms"]) > 0
    others = {c["reference"] for c in run.cells if c["scene"] == "cube-on-plane" and c["frame_ms"]}
    assert others == {"shadow-map:size=1024"}


def test_the_first_phase_alone_is_timed(run: Run) -> None:
    held = [cell for cell in run.cells if cell["status"] == "ok"]
    assert {(cell["phase"], cell["frame_ms"] != "") for cell in held} == {("0", True), ("1", False)}
    assert run.calls.count("time_frame") == 2 * ((3 + 1) + (1 + 1))  # rounds × cells and the reference, of two scenes


def test_numbers_are_in_their_range(run: Run) -> None:
    held = [cell for cell in run.cells if cell["status"] == "ok"]
    assert len(held) == 6
    for cell in held:
        assert 0 <= float(cell["iou"]) <= 1
        assert cell["view_size"] == "96"
        if cell["phase"] == "0":
            assert float(cell["frame_ms"]) > 0 and cell["n"] == "2"
        assert int(cell["receivers"]) <= 96 * 96
        assert int(cell["surface_mismatch"]) <= 0.01 * int(cell["receivers"])
    first = [cell for cell in held if (cell["scene"], cell["phase"]) == ("cube-on-plane", "0")]
    cube = {(cell["spec"], cell["map_size"]): float(cell["iou"]) for cell in first}
    assert cube["unshadowed", ""] == 0
    assert 0.5 < cube["shadow-map", "64"] < cube["shadow-map", "128"] < 1


def test_phases_move_the_grid(run: Run, records: Records) -> None:
    masks = {
        (record["full_spec"], record["phase"]): record["mask_sha256"]
        for record in records(run.folder, "score")
        if record["technique"] == "shadow-map" and record["status"] == "ok"
    }
    assert len(masks) == 4
    assert len(set(masks.values())) == 4


def test_pictures_masks_and_truths_lie_in_the_folder(run: Run, records: Records) -> None:
    keys = {record["key"] for record in records(run.folder, "score") if record["status"] == "ok"}
    assert {file.name for file in (run.folder / "masks").iterdir()} == {f"{key}.png" for key in keys}
    assert {file.name for file in (run.folder / "pictures").iterdir()} == {f"{key}.png" for key in keys}
    views = ["cube-on-plane.camera.light.96", "room-with-lamp.camera.light.96"]
    assert {file.name for file in (run.folder / "truth").iterdir()} == {
        f"{view}{kind}.png" for view in views for kind in ("", ".undecided", ".lit", ".ambient")
    }
    for file in (run.folder / "pictures").iterdir():
        with Image.open(file) as picture:
            assert (picture.mode, picture.size) == ("RGB", (96, 96))


def test_the_truth_that_is_shown_is_the_truth(run: Run) -> None:
    for block in run.study.blocks():
        truth = cached_truth(block.view)
        shown = read_mask(run.folder / "truth" / f"{block.view.name}.png")
        undecided = read_mask(run.folder / "truth" / f"{block.view.name}.undecided.png")
        assert np.array_equal(shown, truth.visibility)
        assert np.array_equal(undecided > 0.5, truth.undecided)


def test_scoring_a_stored_mask_again_gives_the_stored_scores(run: Run, records: Records) -> None:
    references = {block.scene.name: prepare_truth(cached_truth(block.view)) for block in run.study.blocks()}
    held = [record for record in records(run.folder, "score") if record["status"] == "ok"]
    assert held
    for record in held:
        mask = read_mask(run.folder / "masks" / f"{record['key']}.png")
        assert score(mask, references[record["scene"]]) == record["metrics"]
        assert mask_sha256(mask) == record["mask_sha256"]


def test_mismatched_surfaces_are_counted(bench: Any, run: Run, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    call = bench.worker.call

    def turned(method: Callable[..., Any], *arguments: Any, **options: Any) -> Any:
        answer = call(method, *arguments, **options)
        return answer + 100 if method is Session.surface else answer

    monkeypatch.setattr(bench.worker, "call", turned)
    text = STUDY.replace("phases = 2", "").replace("rounds = 2", "rounds = 0")
    for result in Run(bench, tmp_path / "out", text).results:
        if result.score["status"] == "ok":
            truth = result.score["receivers"] - result.score["undecided"]
            assert result.score["surface_mismatch"] == truth > 0


def test_run_json_says_how_it_was_made(bench: Any, run: Run, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("sys.argv", ["/somewhere/shadowbench", "run", "-s", "a study.toml"])
    file = run.folder / "run.json"
    scores = [result.score for result in run.results]
    write_run_file(file, bench.worker, ["an assumption", "b\udcff.obj, no UTF-8"], run.study.facts, scores)
    text = json.loads(file.read_text())
    assert text == read_run_file(file)
    assert text["keys"] == [cell["key"] for cell in run.cells]
    assert text["schema"] == 1
    assert text["command"] == "shadowbench run -s 'a study.toml'"
    assert text["assumptions"] == ["an assumption", "b?.obj, no UTF-8"]
    assert text["clock"] == text["device"]["clock"]
    assert {"shadowbench", "python", "moderngl", "numpy", "embreex"} <= set(text["versions"])
    assert {"processor", "cores", "memory_gib", "system"} == set(text["machine"])
    assert text["study"]["specs"] == ["unshadowed", "shadow-map"]
    assert (text["study"]["view_size"], text["study"]["rounds"], text["study"]["phases"]) == (96, 2, 2)
    assert text["device"]["renderer"] == run.cells[0]["renderer"]
    assert (", arithmetic " in text["device"]["renderer"]) == text["device"]["software"]


def test_a_second_call_measures_nothing(bench: Any, run: Run, tmp_path: Path) -> None:
    before = (run.folder / "rows.jsonl").read_bytes()
    again = Run(bench, run.folder)
    assert again.calls == []
    assert (run.folder / "rows.jsonl").read_bytes() == before
    assert again.cells == run.cells


def test_two_runs_give_the_same_masks_and_score_records(bench: Any, run: Run, tmp_path: Path, records: Records) -> None:
    other = Run(bench, tmp_path / "out")
    assert records(other.folder, "score") == records(run.folder, "score")
    masks = sorted((run.folder / "masks").iterdir())
    assert masks
    for mask in masks:
        assert (other.folder / "masks" / mask.name).read_bytes() == mask.read_bytes()


def test_a_changed_parameter_measures_only_what_changed(bench: Any, tmp_path: Path, records: Records) -> None:
    folder = tmp_path / "out"

    def rows(text: str) -> tuple[int, int]:
        """Score and time records that this run adds."""
        before = len(records(folder, "score")), len(records(folder, "time"))
        cells = Run(bench, folder, text).cells
        assert [cell["status"] for cell in cells] == ["ok", "ok"]
        return len(records(folder, "score")) - before[0], len(records(folder, "time")) - before[1]

    assert rows(SMALL) == (2, 2)
    assert rows(SMALL.replace("size=64", "size=64,filter=hard")) == (1, 1)
    assert rows(SMALL) == (0, 0)
    assert rows(SMALL.replace("view_size = 64", "view_size = 65")) == (2, 2)
    assert rows(SMALL.replace("size=64", "size=32")) == (1, 1)


def test_a_changed_default_measures_only_what_changed(
    bench: Any, tmp_path: Path, changed_default: Any, records: Records
) -> None:
    folder = tmp_path / "out"
    Run(bench, folder, SMALL)
    with changed_default(ShadowMap, "wrap", "edge"):
        Run(bench, folder, SMALL)
    before = records(folder)
    assert [record["spec"] for record in records(folder, "score")] == ["unshadowed", "shadow-map", "shadow-map"]
    Run(bench, folder, SMALL)
    assert records(folder) == before


def test_rounds_come_later_without_scoring_again(bench: Any, tmp_path: Path, records: Records) -> None:
    folder = tmp_path / "out"
    silent = Run(bench, folder, SMALL.replace("rounds = 1", "rounds = 0"))
    assert {cell["frame_ms"] for cell in silent.cells} == {""}
    assert "prepare_timing" not in silent.calls
    assert records(folder, "time") == []
    timed = Run(bench, folder, SMALL)
    assert timed.calls.count("release_timed") == 1
    assert "" not in {cell["frame_ms"] for cell in timed.cells}
    assert len(records(folder, "score")) == 2


def test_cells_that_exceed_the_memory_are_timed_in_several_groups(
    bench: Any, tmp_path: Path, records: Records, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("shadowbench.measure.timing._GROUP_SHARE", 1e-9)
    run = Run(bench, tmp_path / "out", SMALL)
    assert run.calls.count("release_timed") == 2
    assert [record["reference"] for record in records(run.folder, "time")] == ["unshadowed"] * 2
    assert all(float(cell["ratio"]) > 0 for cell in run.cells)


def test_a_cell_is_not_failed_for_the_memory_of_cells_that_wait_to_be_timed(
    bench: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    call, kept = bench.worker.call, []

    def full(method: Callable[..., Any], *arguments: Any, **options: Any) -> Any:
        if method is Session.draw:
            kept.append(options.get("keep", 0))
            if kept[-1] and len(kept) > 1:
                bench.worker.stop()
                raise MemoryExceeded("ate memory")
        return call(method, *arguments, **options)

    monkeypatch.setattr(bench.worker, "call", full)
    run = Run(bench, tmp_path / "out", SMALL)
    assert [bool(bytes) for bytes in kept] == [True, True, False]
    assert [cell["status"] for cell in run.cells] == ["ok", "ok"]
    assert "" not in {cell["ratio"] for cell in run.cells}


def test_a_cell_is_not_failed_for_the_memory_that_earlier_cells_left(
    bench: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    call, draws = bench.worker.call, []

    def full(method: Callable[..., Any], *arguments: Any, **options: Any) -> Any:
        if method is Session.draw:
            draws.append(arguments[1].spec)
            if len(draws) == 2:
                bench.worker.stop()
                raise MemoryExceeded("ate memory")
        return call(method, *arguments, **options)

    monkeypatch.setattr(bench.worker, "call", full)
    run = Run(bench, tmp_path / "out", SMALL.replace("rounds = 1", "rounds = 0"))
    assert len(draws) == 3
    assert draws[1] == draws[2]
    assert [cell["status"] for cell in run.cells] == ["ok", "ok"]


@pytest.mark.parametrize(
    ("name", "scene"),
    [
        ("nothing casts", '[[mesh]]\nshape = "plane"\nscale = 4\ncasts = false\n'),
        ("nothing is in the way", '[[mesh]]\nshape = "plane"\nscale = 4\n'),
    ],
)
def test_without_any_shadow_there_is_no_iou(bench: Any, tmp_path: Path, name: str, scene: str) -> None:
    (tmp_path / "files").mkdir()
    head = "[camera]\nposition = [0, 3, 3]\ntarget = [0, 0, 0]\n"
    sun = '[light]\nkind = "directional"\ndirection = [0.3, -1, 0]\n'
    (tmp_path / "files" / "bare.toml").write_text(head + sun + scene)
    run = Run(bench, tmp_path / "out", SMALL.replace("cube-on-plane", "bare.toml"))
    assert [cell["status"] for cell in run.cells] == ["ok", "ok"]
    for cell in run.cells:
        assert [cell[m] for m in ("iou", "boundary_iou", "leak", "contact", "edge_px", "ssim_edge")] == [""] * 6
        assert (float(cell["acne"]), float(cell["mae"])) == (0, 0)


def extreme(bench: Any, tmp_path: Path, scene: str, text: str = SMALL) -> dict[str, dict[str, str]]:
    """Cells of a study on this scene file, by technique."""
    (tmp_path / "files").mkdir()
    (tmp_path / "files" / "extreme.toml").write_text(scene)
    run = Run(bench, tmp_path / "out", text.replace("cube-on-plane", "extreme.toml"))
    return {cell["technique"]: cell for cell in run.cells}


CAMERA = "position = [2.3, 2.2, 3.0]\ntarget = [0.4, 0.2, -0.2]"
CUBE = '[[mesh]]\nshape = "plane"\nscale = 8\n[[mesh]]\nshape = "box"\ntranslate = [0, 0.5, 0]\n'


def scene_text(light: str, camera: str = CAMERA, mesh: str = CUBE) -> str:
    return f"[camera]\n{camera}\n[light]\n{light}\n{mesh}"


SUN = 'kind = "directional"\ndirection = [0.85, -0.8, -0.5]'
LARGE = SMALL.replace("size=64", "size=512")


def test_a_light_from_straight_above_gives_a_result(bench: Any, tmp_path: Path) -> None:
    noon = 'kind = "directional"\ndirection = [0, -1, 0]'
    cells = extreme(bench, tmp_path, scene_text(noon, mesh=CUBE.replace("0.5, 0]", "1.5, 0]")), LARGE)
    assert cells["shadow-map"]["status"] == "ok"
    assert float(cells["shadow-map"]["iou"]) > 0.8


def test_a_camera_inside_a_mesh_gives_a_result(bench: Any, tmp_path: Path) -> None:
    inside = "position = [0.1, 0.6, 0.2]\ntarget = [0.4, 0.2, -0.2]"
    cells = extreme(bench, tmp_path, scene_text(SUN, inside), LARGE)
    assert {cell["status"] for cell in cells.values()} == {"ok"}


@pytest.mark.parametrize("metres", [1e6, 1e-4])
def test_scenes_of_any_size_give_the_same_result(bench: Any, tmp_path: Path, metres: float) -> None:
    def at(scale: float, folder: Path) -> float:
        folder.mkdir()
        position, target = ([scale * part for part in point] for point in ((2.3, 2.2, 3.0), (0.4, 0.2, -0.2)))
        plane = f'[[mesh]]\nshape = "plane"\nscale = {8 * scale}\n'
        cube = f'[[mesh]]\nshape = "box"\nscale = {scale}\ntranslate = [0, {scale / 2}, 0]\n'
        camera, mesh = f"position = {position}\ntarget = {target}", plane + cube
        cell = extreme(bench, folder, scene_text(SUN, camera, mesh), LARGE)["shadow-map"]
        assert cell["status"] == "ok"
        return float(cell["iou"])

    assert at(metres, tmp_path / "there") == pytest.approx(at(1.0, tmp_path / "here"), abs=0.02)


def test_a_spot_of_170_degrees_gives_a_result(bench: Any, tmp_path: Path) -> None:
    spot = 'kind = "spot"\nposition = [0.8, 2, 0.6]\ndirection = [-0.1, -1, -0.1]\nangle = 170'
    cells = extreme(bench, tmp_path, scene_text(spot), LARGE)
    assert cells["shadow-map"]["status"] == "ok"
    assert float(cells["shadow-map"]["iou"]) > 0.5


def test_a_view_of_one_pixel_gives_a_result(bench: Any, tmp_path: Path) -> None:
    run = Run(bench, tmp_path / "out", SMALL.replace("view_size = 64", "view_size = 1"))
    assert [(cell["status"], cell["view_size"], cell["ssim"]) for cell in run.cells] == [("ok", "1", "")] * 2


def test_a_map_of_one_texel_gives_a_result(bench: Any, tmp_path: Path) -> None:
    cell = Run(bench, tmp_path / "out", SMALL.replace("size=64", "size=1")).cells[1]
    assert (cell["status"], cell["map_size"]) == ("ok", "1")


def test_a_file_s_technique_is_measured_and_named(bench: Any, tmp_path: Path) -> None:
    text = SMALL.replace('"unshadowed"', '"half:level=0.25"')
    cell = Run(bench, tmp_path / "out", text).cells[0]
    assert (cell["technique"], cell["spec"], cell["status"]) == ("half", "half:level=0.25", "ok")
    assert (cell["iou"], cell["map_size"]) != ("", "64")
    assert "pass_fill_ms" in cell


def test_work_is_that_of_one_draw(bench: Any, tmp_path: Path) -> None:
    cells = Run(bench, tmp_path / "out", SMALL.replace('"unshadowed"\n[[', '"half"\n[[')).cells
    assert cells[0]["technique"] == "half"
    assert cells[0]["work_draws"] == "1"


def test_the_same_scene_under_another_name_has_rows_of_its_own(bench: Any, tmp_path: Path) -> None:
    scene = (data_folder("scenes") / "cube-on-plane.toml").read_text()
    (tmp_path / "files").mkdir()
    (tmp_path / "files" / "twin.toml").write_text(scene.replace('name = "cube-on-plane"', 'name = "twin"'))
    run = Run(bench, tmp_path / "out", SMALL.replace('"cube-on-plane"', '"cube-on-plane", "twin.toml"'))
    assert [cell["scene"] for cell in run.cells] == ["cube-on-plane"] * 2 + ["twin"] * 2


def test_a_truth_is_prepared_for_scoring_once_per_view(
    bench: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    made: list[Any] = []

    def counted(truth: Any) -> Any:
        made.append(prepare_truth(truth))
        return made[-1]

    monkeypatch.setattr(scorer, "prepare_truth", counted)
    Run(bench, tmp_path / "out")
    assert len(made) == 2  # scenes, of five cells each


def test_a_failing_write_ends_the_run(bench: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def full(file: Path, visibility: Any) -> None:
        raise InputError(f"{file}: no space left")

    monkeypatch.setattr(pictures, "write_mask", full)
    with pytest.raises(InputError, match="no space left"):
        Run(bench, tmp_path / "out", SMALL)
    assert (tmp_path / "out" / "rows.jsonl").read_text() == ""


def test_work_counts_reads_of_the_map_and_sums_up_to_a_cost(run: Run) -> None:
    for cell in run.cells:
        if cell["technique"] != "shadow-map" or cell["status"] != "ok":
            continue
        assert int(cell["work_reads"]) == 96 * 96 * 1  # the default filter: one read of the hardware's
        parts = ("vertices", "geometry", "fragments", "reads")
        if cell["work_fragments"]:
            assert int(cell["work_cost"]) == sum(int(cell[f"work_{name}"]) for name in parts)


def test_totals_grow_with_what_has_moved(run: Run) -> None:
    for cell in run.cells:
        if cell["frame_ms"]:
            still, camera, light = (float(cell[f"{moved}_ms"]) for moved in ("still", "camera", "light"))
            assert 0 == still < camera <= light
