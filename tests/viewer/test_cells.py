"""A cell of a run folder is shown as it was measured, to the bit."""

import json
from collections.abc import Callable
from pathlib import Path

import pytest

from shadowbench.errors import InputError
from shadowbench.gl.device import Device
from shadowbench.plugin.registry import techniques
from shadowbench.scenes.library import load_scene
from shadowbench.scores.masks import mask_sha256
from shadowbench.viewer.drawing import Drawing
from shadowbench.viewer.state import ViewerState
from shadowbench.viewer.state_files import cell_state, ply_of

KNOWN = techniques()


def rows_of(folder: Path) -> list[dict]:
    rows = [json.loads(line) for line in (folder / "rows.jsonl").read_text().splitlines()]
    return [row for row in rows if row["kind"] == "score" and row["status"] == "ok"]


def digest(device: Device, state: ViewerState) -> str:
    drawing = Drawing(device)
    drawn = drawing.draw(state, state.size)
    found = mask_sha256(drawing.visibility(drawn, drawn.masks[0]))
    drawn.release()
    drawing.reload()
    return found


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("runs")


def test_cells_of_a_run_and_of_a_sweep_are_redrawn(
    shadowbench: Callable[..., object], device: Device, folder: Path
) -> None:
    run, sweep = folder / "run", folder / "stress"
    options = ["--map-size", "64", "--view-size", "64", "--rounds", "0", "--phases", "2", "--quiet"]
    shadowbench("run", "stairs", "fence", "-t", "shadow-map", "-o", run, *options)
    shadowbench("stress", "-t", "shadow-map:size=64", "--axis", "distance-absolute", "--quick", "-o", sweep, "--quiet")
    rows = rows_of(run)
    assert len(rows) == 4, "two scenes in two phases"
    some = [*rows, *rows_of(sweep)[:3]]
    assert {row["coordinates"] for row in some} == {"relative", "absolute"}
    for row in some:
        shown = cell_state(sweep if "axis" in row else run, row["key"][:20], KNOWN)
        assert shown.scene.name == row["scene"]
        assert digest(device, shown) == row["mask_sha256"]


def test_a_key_that_names_no_cell_or_several_is_one_line(folder: Path) -> None:
    with pytest.raises(InputError, match="--cell 'xyz': no such cell in"):
        cell_state(folder / "run", "xyz", KNOWN)
    with pytest.raises(InputError, match="--cell '': 4 cells begin so in"):
        cell_state(folder / "run", "", KNOWN)
    with pytest.raises(InputError, match=r"rows\.jsonl"):
        cell_state(folder / "nothing", "a", KNOWN)


def test_a_cell_has_the_axis_and_the_sun_of_its_run(
    shadowbench: Callable[..., object], device: Device, tmp_path: Path
) -> None:
    mesh, folder = tmp_path / "model.ply", tmp_path / "run"
    mesh.write_bytes(ply_of(load_scene("post").meshes))
    options = ["--map-size", "64", "--view-size", "64", "--rounds", "0", "--quiet"]
    shadowbench("run", mesh, "-t", "shadow-map", "--up", "z", "--sun", "-o", folder, *options)
    row, *_ = rows_of(folder)
    shown = cell_state(folder, row["key"], KNOWN)
    assert shown.light.radius > 0
    assert digest(device, shown) == row["mask_sha256"]


def test_a_cell_of_a_studys_own_camera_is_one_line(shadowbench: Callable[..., object], tmp_path: Path) -> None:
    study, folder = tmp_path / "study.toml", tmp_path / "run"
    low = 'views = [{ name = "low", position = [0, 1, 5], target = [0, 0, 0] }]'
    study.write_text(f'scenes = ["post"]\nview_size = 64\nrounds = 0\n{low}\n[[technique]]\nspec = "unshadowed"\n')
    shadowbench("run", "-s", study, "-o", folder, "--quiet")
    with pytest.raises(InputError, match=r"is of a camera or a light of its study, .*: view: found 'low'"):
        cell_state(folder, rows_of(folder)[0]["key"], KNOWN)
