"""Cells drawn and scored in the frames of a sequence."""

import json
import re
from collections.abc import Callable
from contextlib import closing
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image

from shadowbench.measure.campaign import Block, Cell, LogReporter
from shadowbench.measure.frames import OF_AREA, Truths
from shadowbench.measure.gl_drawer import GLDrawer
from shadowbench.measure.rows import Record
from shadowbench.measure.worker import CellFailed, Limits, MemoryExceeded
from shadowbench.plugin.registry import techniques
from shadowbench.plugin.spec import parse_spec
from shadowbench.scenes.library import builtin_light, hard_names
from shadowbench.scenes.opening import chosen_view
from shadowbench.scenes.sequences import BUILT_IN, frames_of
from shadowbench.scores.masks import read_mask
from shadowbench.scores.metrics import METRICS
from shadowbench.scores.motion import MOTION
from shadowbench.strict import read_toml
from shadowbench.truths.cache import cached_truth

SIZE, FRAMES = 64, 4


@pytest.fixture(scope="module")
def block() -> Block:
    view = chosen_view("cube-on-plane", SIZE)
    spec = parse_spec("shadow-map:size=128,fit=view", techniques())
    return Block(frames_of(view, BUILT_IN["pan"], FRAMES), (Cell(spec),), place={"sequence": "pan", "frames": FRAMES})


@dataclass
class Failing:
    """A worker whose calls fail by their number, and draw the number of the frame otherwise."""

    failures: dict[int, Exception]
    indices: list[int] = field(default_factory=list)
    limits: Limits = field(default_factory=Limits)

    def call(self, method: Any, *_: Any, index: int, **__: Any) -> int:
        self.indices.append(index)
        if failure := self.failures.get(len(self.indices)):
            raise failure
        return index


def test_after_memory_ran_out_a_cell_is_drawn_from_the_first_frame_on_and_no_frame_comes_twice(block: Block) -> None:
    """In the new worker nothing is remembered of the frames before."""
    worker: Any = Failing({3: MemoryExceeded("ate memory")})
    assert list(GLDrawer(worker, {}).draw(block, block.cells[0])) == [0, 1, 2, 3]
    assert worker.indices == [0, 1, 2, 0, 1, 2, 3]


def test_what_draws_its_map_in_some_frames_only_has_no_time(shadowbench: Callable[..., Any], tmp_path: Path) -> None:
    """In a still view, in which cells are timed, it would draw none."""
    specs = [f"shadow-map:size=64{more}" for more in ("", ",update=every", ",update=needed", ",history=exponential")]
    command = ["run", "cube-on-plane", "stairs", *(word for spec in specs for word in ("-t", spec))]
    more = ("--view-size", "32", "--sequence", "pan", "--frames", "2", "--rounds", "1", "-o", tmp_path)
    answer = shadowbench(*command, *more)
    assert answer.code == 0, answer.err
    rows = [json.loads(line) for line in (tmp_path / "rows.jsonl").read_text().splitlines()]
    timed = {row["key"] for row in rows if row["kind"] == "time"}
    specs_of = {row["key"]: row["spec"].partition(":")[2] for row in rows if row["kind"] == "score"}
    assert {specs_of[key] for key in specs_of.keys() - timed} == {"update=every", "update=needed"}
    assert {specs_of[key] for key in timed} == {"", "history=exponential"}
    assert answer.err.count("not timed, as some frames") == 2, "not again in each scene"


def test_a_cell_whose_worker_crashes_in_any_frame_fails_as_a_whole(block: Block) -> None:
    worker: Any = Failing({3: CellFailed("crashed: SIGSEGV")})
    with pytest.raises(CellFailed):
        list(GLDrawer(worker, {}).draw(block, block.cells[0]))
    assert worker.indices == [0, 1, 2]


@pytest.mark.parametrize("kept", [1, 1 << 30])
def test_truths_are_those_of_each_frame_whether_or_not_all_of_them_are_kept(
    block: Block, kept: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("shadowbench.measure.frames.KEPT_BYTES", kept)
    with closing(Truths(block.views)) as truths:
        for _ in range(2):  # cells
            for index, view in enumerate(block.views):
                np.testing.assert_array_equal(truths[index].truth.visibility, cached_truth(view).visibility)
                assert len(truths._kept) <= (2 if kept == 1 else FRAMES)


def test_a_row_of_a_sequence_has_means_of_its_masks_metrics_and_those_of_motion(
    bench: Any, block: Block, tmp_path: Path
) -> None:
    def row_of(block: Block, folder: str) -> Record:
        with bench.campaign(tmp_path / folder, LogReporter()) as campaign:
            ((result,),) = campaign.measure([block])
        return result.score

    moving = row_of(block, "moving")
    still = [row_of(Block((view,), block.cells), f"still-{index}") for index, view in enumerate(block.views)]
    assert (moving["sequence"], moving["frames"]) == ("pan", FRAMES)
    assert set(moving["metrics"]) == {*METRICS, *MOTION}
    for name in METRICS:
        values = [row["metrics"][name] for row in still]
        known = [value for value in values[: 1 if name in OF_AREA else None] if value is not None]
        assert moving["metrics"][name] == (pytest.approx(np.mean(known)) if known else None), name
    assert moving["by_frame"]["iou"] == [row["metrics"]["iou"] for row in still]
    assert all(len(curve) == FRAMES for curve in moving["by_frame"].values())
    assert moving["mask_sha256"] == still[0]["mask_sha256"]
    with Image.open(tmp_path / "moving" / "masks" / f"{moving['key']}.frames.png") as film:
        assert (film.n_frames, film.size) == (FRAMES, (3 * SIZE, SIZE))
        for index, row in enumerate(still):
            film.seek(index)
            mask = read_mask(tmp_path / f"still-{index}" / "masks" / f"{row['key']}.png")
            truth = cached_truth(block.views[index])
            valid = truth.receivers & ~truth.undecided
            drawn = np.asarray(film.convert("L"))[:, SIZE : 2 * SIZE] / 255
            np.testing.assert_allclose(drawn[valid], mask[valid], atol=1 / 255)


@pytest.mark.slow
@pytest.mark.parametrize("name", BUILT_IN)
def test_the_truth_drawn_anew_in_each_frame_has_no_error_in_any_sequence(bench: Any, tmp_path: Path, name: str) -> None:
    """Also where casters move, so that each frame is another scene to the process that draws."""
    views = frames_of(chosen_view("walker", SIZE), BUILT_IN[name], FRAMES)
    with bench.campaign(tmp_path, LogReporter()) as campaign:
        ((result,),) = campaign.measure([Block(views, (Cell(parse_spec("ray-traced", techniques())),))])
    metrics = result.score["metrics"]
    assert metrics["iou"] == 1 and metrics["flicker"] == metrics["pop"] == 0
    assert {metrics[score] for score in ("false_change", "swim", "lag", "lag_bias")} <= {None, 0}


def test_what_the_page_says_of_boxes_and_of_godots_threads_stands_in_its_tables() -> None:
    page = Path(__file__).parents[2] / "docs" / "explanation" / "motion.md"
    tables = re.findall(r"```text\n +(.*)\n((?:.*\n)*?)```", page.read_text(encoding="utf-8"))
    stability, zoom, sun = (
        {
            spec.removeprefix("cascades:"): dict(zip(re.split(r"  +", head), map(float, values), strict=True))
            for spec, *values in map(str.split, rows.splitlines())
        }
        for head, rows in tables
    )
    default, loose, snapped = (stability[one] for one in ("cascades", "box=sphere", "box=sphere,stable=true"))
    assert snapped["flicker pan"] < 0.2 * loose["flicker pan"] and snapped["predicted_ms"] == loose["predicted_ms"]
    assert snapped["error"] == pytest.approx(loose["error"], rel=0.02)
    assert default["error"] == pytest.approx(0.7 * snapped["error"], rel=0.05)
    assert default["flicker pan"] == pytest.approx(1.8 * snapped["flicker pan"], rel=0.05)
    assert max(stability, key=lambda one: stability[one]["flicker pan"]) == "preset=babylon"
    suns = [name for name in hard_names() if builtin_light(name) == "directional"]
    study = read_toml(Path(__file__).parents[2] / "benchmarks" / "motion" / "stability.toml", "")
    assert study["scenes"] == [name for name in suns if name != "room-with-window"] and len(study["scenes"]) == 15
    quiet, moves = "preset=godot,filter=castano(5)", ("flicker pan", "flicker zoom")
    assert all(zoom["preset=godot"][move] > 0.01 for move in moves)
    assert 10 * zoom[quiet]["flicker pan"] < min(zoom["preset=godot"]["flicker pan"], zoom[quiet]["flicker zoom"])
    fitted, larger = (zoom[f"{quiet},{cure}"] for cure in ("box=scene,stable=false", "size=4096"))
    assert max(one["flicker zoom"] for one in (fitted, larger)) < zoom[quiet]["flicker zoom"] / 3
    assert fitted["predicted_ms"] < larger["predicted_ms"] / 3
    assert all(zoom[f"{quiet},history=exponential"][move] > zoom[quiet][move] for move in moves)
    cures = ",box=scene,stable=false", ",update=every(4)", ""
    rotated, rare, shipped = (sun[f"preset=godot{cure}"] for cure in cures)
    assert rare["pop slow-sun"] > shipped["pop slow-sun"] > 10 * rotated["pop slow-sun"]
    assert rotated["flicker slow-sun"] >= shipped["flicker slow-sun"]
