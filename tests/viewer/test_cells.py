"""A cell of a run folder is shown as it was measured, to the bit."""

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from shadowbench.errors import InputError
from shadowbench.gl.device import Device
from shadowbench.plugin.registry import techniques
from shadowbench.scenes.library import load_scene
from shadowbench.scores.masks import mask_sha256
from shadowbench.viewer.drawing import Drawing
from shadowbench.viewer.state_files import cell_state, ply_of

KNOWN = techniques()
LITTLE = ["--map-size", "64", "--view-size", "64", "--rounds", "0", "--quiet"]


def rows_of(folder: Path) -> list[dict[str, Any]]:
    rows = [json.loads(line) for line in (folder / "rows.jsonl").read_text().splitlines()]
    return [row for row in rows if row["kind"] == "score" and row["status"] == "ok"]


def test_cells_of_runs_and_of_a_sweep_are_redrawn(
    shadowbench: Callable[..., object], device: Device, tmp_path: Path
) -> None:
    """In two phases, of a mesh file with the up axis and the sun of its run, and at values of an axis."""
    run, own, sweep, mesh = (tmp_path / name for name in ("run", "own", "stress", "model.ply"))
    mesh.write_bytes(ply_of(load_scene("post").meshes))
    shadowbench("run", "stairs", "fence", "-t", "shadow-map", "--phases", "2", "-o", run, *LITTLE)
    shadowbench("run", mesh, "-t", "shadow-map", "--up", "z", "--sun", "-o", own, *LITTLE)
    shadowbench("stress", "-t", "shadow-map:size=64", "--axis", "distance-absolute", "--quick", "-o", sweep, "--quiet")
    some = [(folder, row) for folder in (run, own, sweep) for row in rows_of(folder)[:4]]
    assert {row["coordinates"] for _, row in some} == {"relative", "absolute"} and len(some) >= 8
    drawing = Drawing(device)
    for folder, row in some:
        state = cell_state(folder, row["key"][:20], KNOWN)
        assert state.scene.name == row["scene"]
        drawn = drawing.draw(state, state.size)
        assert mask_sha256(drawing.visibility(drawn, drawn.masks[0])) == row["mask_sha256"]
        drawn.release()
    drawing.reload()
    for folder, key, told in (
        (run, "xyz", "--cell 'xyz': no such cell in"),
        (run, "", "--cell '': 4 cells begin so in"),
        (tmp_path / "nothing", "a", r"rows\.jsonl"),
    ):
        with pytest.raises(InputError, match=told):
            cell_state(folder, key, KNOWN)


def test_a_cell_of_a_studys_own_camera_is_one_line(shadowbench: Callable[..., object], tmp_path: Path) -> None:
    study, folder = tmp_path / "study.toml", tmp_path / "run"
    low = 'views = [{ name = "low", position = [0, 1, 5], target = [0, 0, 0] }]'
    study.write_text(f'scenes = ["post"]\nview_size = 64\nrounds = 0\n{low}\n[[technique]]\nspec = "unshadowed"\n')
    shadowbench("run", "-s", study, "-o", folder, "--quiet")
    with pytest.raises(InputError, match=r"is of a camera or a light of its study, .*: view: found 'low'"):
        cell_state(folder, rows_of(folder)[0]["key"], KNOWN)
