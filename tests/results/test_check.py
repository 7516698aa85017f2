"""`check` as a command: its output, pictures, files and exit codes."""

import json
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image

from shadowbench.scores.difference import FALSE_LIGHT, FALSE_SHADOW
from shadowbench.scores.masks import write_mask
from shadowbench.scores.metrics import METRICS
from tests.conftest import key_of
from tests.runs import CHANGING

Shadowbench = Callable[..., Any]
GOOD = {name: 0.9 if metric.better == "higher" else 0.1 for name, metric in METRICS.items()}
WORSE = GOOD | {"iou": 0.8, "ssim": 0.85}
SIDE = 16
TIME = {"machine": "m", "clock": "wall", "reference": "shadow-map:size=1024", "n": 9, "ratio": 2.0, "ratio_iqr": 0.02}


def cell(spec: str = "shadow-map", scene: str = "s", size: int | None = 512, **score: Any) -> dict[str, Any]:
    return {
        "schema": 1, "kind": "score", "key": key_of(scene, spec, size), "scene": scene,
        "view": "camera", "light": "sun", "phase": 0, "technique": spec.partition(":")[0], "spec": spec,
        "full_spec": spec, "map_size": size, "view_size": SIDE, "coordinates": "relative", "renderer": "llvmpipe",
        "status": "ok", "metrics": GOOD, "receivers": 9, "undecided": 1, "mask_sha256": None, "gpu_bytes": 100,
        "work": {"draws": 2, "primitives": 100, "fragments": 1000}, "facts": {}, "assumptions": [],
    } | score  # fmt: skip


def timed(score: dict[str, Any], **time: Any) -> dict[str, Any]:
    return {"schema": 1, "kind": "time", "key": score["key"], "frame_ms": 2.0, "passes": {}, **TIME} | time


def rows(folder: Path, *records: dict[str, Any]) -> Path:
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "rows.jsonl").write_text("".join(json.dumps(record) + "\n" for record in records))
    return folder


@pytest.fixture
def now(tmp_path: Path) -> Callable[..., Path]:
    return lambda *records: rows(tmp_path / "now", *records)


@pytest.fixture
def then(tmp_path: Path) -> Callable[..., Path]:
    return lambda *records: rows(tmp_path / "then", *records)


def test_the_same_cells_pass(shadowbench: Shadowbench, now: Callable[..., Path], then: Callable[..., Path]) -> None:
    answer = shadowbench("check", now(cell()), "--baseline", then(cell()))
    assert (answer.code, answer.err) == (0, "")
    assert answer.out.startswith("1 cell compared with ") and answer.out.endswith(": 0 regressed, 0 improved\n")


def test_regressions_are_listed_worst_first_and_fail(
    shadowbench: Shadowbench, now: Callable[..., Path], then: Callable[..., Path]
) -> None:
    better = cell("cube-map", metrics=GOOD | {"acne": 0.01})
    found = now(cell(metrics=GOOD | {"iou": 0.89}), cell(scene="t", metrics=WORSE), better)
    answer = shadowbench("check", found, "--baseline", then(cell(), cell(scene="t"), cell("cube-map")))
    assert answer.code == 1
    lines = answer.out.splitlines()
    assert lines[0].strip() == "regressed, worst first"
    words = ["t", "camera", "sun", "shadow-map", "512", "iou", "0.9", "→", "0.8", "100.0", "ssim"]
    assert lines[2].split() == words
    assert lines[3].split() == ["s", *words[1:8], "0.89", "10.0"]
    assert lines[5].strip() == "improved, largest change first"
    assert lines[7].split()[3:] == ["cube-map", "512", "acne", "0.1", "→", "0.01", "90.0"]
    assert lines[-1].endswith(": 2 regressed, 1 improved")


def test_json_has_all_columns(shadowbench: Shadowbench, now: Callable[..., Path], then: Callable[..., Path]) -> None:
    missing = cell("cube-map")
    answer = shadowbench("check", now(cell(metrics=WORSE)), "--baseline", then(cell(), missing), "--json")
    found = json.loads(answer.out)
    assert answer.code == 1
    assert (found["compared"], found["equal_masks"], found["timed"], found["improved"]) == (1, 0, 0, [])
    gone, iou, ssim = found["regressed"]
    assert (gone["spec"], gone["what"], gone["after"], gone["tolerances"]) == ("cube-map", "status", "missing", None)
    assert (iou["what"], iou["before"], iou["after"]) == ("iou", 0.9, 0.8)
    assert iou["tolerances"] == pytest.approx(100)
    assert ssim["what"] == "ssim"


def test_a_missing_cell_fails_and_an_extra_one_is_a_note(
    shadowbench: Shadowbench, now: Callable[..., Path], then: Callable[..., Path]
) -> None:
    answer = shadowbench("check", now(cell()), "--baseline", then(cell(), cell("cube-map")))
    assert answer.code == 1
    assert answer.out.splitlines()[-1].endswith("0 regressed, 1 missing, 0 improved")
    answer = shadowbench("check", now(cell(), cell("cube-map")), "--baseline", then(cell()))
    assert (answer.code, answer.err) == (0, "note: 1 cell is not in the baseline\n")
    assert shadowbench("check", now(cell(), cell("cube-map")), "--baseline", then(cell()), "--quiet").err == ""


def test_a_cell_of_an_earlier_study_does_not_stand_in_for_one_that_is_missing(
    shadowbench: Shadowbench, now: Callable[..., Path], then: Callable[..., Path]
) -> None:
    stale, engine = cell("shadow-map"), cell("my-engine", content="c")
    folder = now(stale, cell("cube-map"), engine)
    (folder / "table.csv").write_text(f"key,scene\n{key_of('s', 'cube-map', 512)},s\n")
    answer = shadowbench("check", folder, "--baseline", then(cell(), cell("cube-map"), engine))
    assert answer.code == 1
    assert answer.out.splitlines()[-1].endswith("0 regressed, 1 missing, 0 improved")
    assert answer.err == f"note: 1 cell of earlier commands in {folder} left out; run.json lists those of the last\n"


def test_a_cell_that_the_last_study_found_measured_counts_as_it_was(
    shadowbench: Shadowbench, now: Callable[..., Path], then: Callable[..., Path], tmp_path: Path
) -> None:
    first, second = cell(), cell(key=key_of("another text"), metrics=WORSE)
    folder, baseline = now(first, second), then(first)
    (folder / "table.csv").write_text(f"key\n{first['key']}\n")
    answer = shadowbench("check", folder, "--baseline", baseline)
    assert (answer.code, answer.err) == (0, "")
    assert answer.out.startswith("1 cell compared")
    assert shadowbench("check", folder, "--baseline", tmp_path / "new", "--update").code == 0
    assert json.loads((tmp_path / "new" / "rows.jsonl").read_text()) == first


def test_rows_of_a_run_that_was_interrupted_are_no_part_of_the_last_study(
    shadowbench: Shadowbench, now: Callable[..., Path], then: Callable[..., Path]
) -> None:
    done, begun = [cell(), cell("cube-map")], cell(key=key_of("another text"), metrics=WORSE)
    folder = now(*done, begun)
    (folder / "table.csv").write_text("key\n" + "".join(f"{one['key']}\n" for one in done))
    answer = shadowbench("check", folder, "--baseline", then(*done))
    assert answer.code == 0 and answer.out.endswith(": 0 regressed, 0 improved\n")


@pytest.mark.parametrize("before", [True, False])
def test_update_refuses_a_folder_without_a_cell_of_its_table(
    shadowbench: Shadowbench, now: Callable[..., Path], tmp_path: Path, before: bool
) -> None:
    folder, baseline = now(cell()), tmp_path / "then"
    (folder / "table.csv").write_text(f"key\n{key_of('no row')}\n")
    if before:
        rows(baseline, cell())
    answer = shadowbench("check", folder, "--baseline", baseline, "--update", "--quiet")
    assert answer.code == 2 and "--update: found no cell; allowed: " in answer.err
    kept = baseline / "rows.jsonl"
    assert (json.loads(kept.read_text()) == cell()) if before else not kept.exists()


def test_tolerances_are_the_metrics_or_ones_own(
    shadowbench: Shadowbench, now: Callable[..., Path], then: Callable[..., Path]
) -> None:
    words = ["check", now(cell(metrics=WORSE)), "--baseline", then(cell())]
    assert shadowbench(*words, "--tolerance", "iou=0.2").code == 1
    assert shadowbench(*words, "--tolerance", "iou=0.2", "--tolerance", "ssim=0.1").code == 0


def test_times_warn_and_fail_only_when_asked(
    shadowbench: Shadowbench, now: Callable[..., Path], then: Callable[..., Path]
) -> None:
    words = ["check", now(cell(), timed(cell(), ratio=2.5)), "--baseline", then(cell(), timed(cell()))]
    answer = shadowbench(*words)
    assert answer.code == 0
    assert answer.out.startswith("slower; ratios to the reference; a warning only (--time makes it fail)")
    assert answer.out.splitlines()[-1].endswith("0 regressed, 0 improved, 1 slower")
    answer = shadowbench(*words, "--time")
    assert answer.code == 1
    assert "warning only" not in answer.out
    answer = shadowbench("check", now(cell()), "--baseline", then(cell(), timed(cell())), "--time")
    assert (answer.code, answer.err[:26]) == (0, "note: no time was compared")


def test_a_mask_hash_alone_fails_nothing(
    shadowbench: Shadowbench, now: Callable[..., Path], then: Callable[..., Path]
) -> None:
    answer = shadowbench("check", now(cell(mask_sha256="a")), "--baseline", then(cell(mask_sha256="b")))
    assert answer.code == 0


def test_an_equal_mask_against_another_truth_fails(
    shadowbench: Shadowbench, now: Callable[..., Path], then: Callable[..., Path]
) -> None:
    found, baseline = now(cell(mask_sha256="a", metrics=WORSE)), then(cell(mask_sha256="a"))
    answer = shadowbench("check", found, "--baseline", baseline)
    assert answer.code == 1 and "identical" not in answer.out
    assert "1 of them identical" in shadowbench("check", now(cell(mask_sha256="a")), "--baseline", baseline).out


def masks(folder: Path, score: dict[str, Any], visibility: np.ndarray) -> None:
    (folder / "masks").mkdir(exist_ok=True)
    (folder / "truth").mkdir(exist_ok=True)
    write_mask(folder / "masks" / f"{score['key']}.png", visibility)
    truth = np.ones((SIDE, SIDE))
    truth[8:] = 0
    write_mask(folder / "truth" / f"s.camera.sun.{SIDE}.png", truth)
    write_mask(folder / "truth" / f"s.camera.sun.{SIDE}.undecided.png", np.zeros((SIDE, SIDE)))


def test_the_worst_differences_are_drawn_before_beside_after(
    shadowbench: Shadowbench, now: Callable[..., Path], then: Callable[..., Path]
) -> None:
    spec = "shadow-map:filter=pcf(taps=5)"
    hard = {"rmse_pen": None}
    bad, good = cell(spec, metrics=WORSE | hard), cell(spec, metrics=GOOD | hard)
    other = cell("cube-map", metrics=GOOD | hard)
    found, baseline = now(bad, other), then(good, other)
    (found / "check").mkdir()
    (found / "check" / "of-the-last-time.png").touch()
    masks(found, bad, np.ones((SIDE, SIDE)))
    answer = shadowbench("check", found, "--baseline", baseline)
    assert "1 picture, after" in answer.out
    (picture,) = (found / "check").iterdir()
    assert picture.name == "1.s.shadow-map_filter=pcf_taps=5_.512.png"
    after = np.asarray(Image.open(picture))
    assert (after[8:] == FALSE_LIGHT).all() and not (after[:8] == FALSE_LIGHT).all(axis=-1).any()

    masks(baseline, good, np.zeros((SIDE, SIDE)))
    assert "before and after" in shadowbench("check", found, "--baseline", baseline).out
    both = np.asarray(Image.open(picture))
    assert both.shape == (SIDE, 2 * SIDE + 8, 3)
    assert (both[:8, :SIDE] == FALSE_SHADOW).all() and (both[:, -SIDE:] == after).all()


@pytest.mark.parametrize(
    ("words", "named"),
    [
        (["--tolerance", "speed=1"], "speed=1"),
        (["--tolerance", "iou"], "''"),
        (["--tolerance", "iou=-1"], "'-1'"),
        (["--tolerance", "iou=nan"], "'nan'"),
        (["--baseline", "nowhere"], "nowhere"),
    ],
)
def test_bad_input_is_one_line(
    shadowbench: Shadowbench, now: Callable[..., Path], then: Callable[..., Path], words: list[str], named: str
) -> None:
    answer = shadowbench("check", now(cell()), "--baseline", then(cell()), *words)
    assert (answer.code, answer.out, answer.err.count("\n")) == (2, "", 1)
    assert named in answer.err and "allowed" in answer.err


def test_no_cell_in_common_is_bad_input(
    shadowbench: Shadowbench, now: Callable[..., Path], then: Callable[..., Path]
) -> None:
    answer = shadowbench("check", now(cell()), "--baseline", then(cell(size=1024)))
    assert (answer.code, answer.err.count("\n")) == (2, 1)
    assert "no cell in common" in answer.err and "--update" not in answer.err, "it would overwrite the baseline"


def test_update_makes_the_run_the_baseline_and_says_what_changed(
    shadowbench: Shadowbench, now: Callable[..., Path], then: Callable[..., Path]
) -> None:
    found, baseline = now(cell(metrics=WORSE), timed(cell())), then(cell(), cell("cube-map"))
    answer = shadowbench("check", found, "--baseline", baseline, "--update")
    assert answer.code == 0
    assert answer.out.startswith("regressed, worst first")
    assert "1 cell, the baseline from now on" in answer.out
    assert not (found / "check").exists()
    assert [json.loads(line) for line in (baseline / "rows.jsonl").read_text().splitlines()] == [
        cell(metrics=WORSE),
        timed(cell()),
    ]
    assert shadowbench("check", found, "--baseline", baseline, "--time").code == 0


def test_update_makes_a_first_baseline(shadowbench: Shadowbench, now: Callable[..., Path], tmp_path: Path) -> None:
    found, baseline = now(cell(), cell("cube-map")), tmp_path / "new" / "baseline"
    assert shadowbench("check", found, "--baseline", baseline).code == 2
    answer = shadowbench("check", found, "--baseline", baseline, "--update", "--quiet")
    assert (answer.code, answer.out, answer.err) == (0, "", "")
    assert shadowbench("check", found, "--baseline", baseline).code == 0


def test_neither_a_broken_cell_nor_a_measured_folder_is_overwritten_by_update(
    shadowbench: Shadowbench, now: Callable[..., Path], then: Callable[..., Path]
) -> None:
    answer = shadowbench("check", now(cell(status="failed: hung")), "--baseline", then(cell()), "--update")
    assert answer.code == 2 and "failed: hung" in answer.err
    baseline = then(cell())
    (baseline / "run.json").write_text("{}")
    answer = shadowbench("check", now(cell(metrics=WORSE)), "--baseline", baseline, "--update")
    assert answer.code == 2 and "is a run folder" in answer.err
    assert json.loads((baseline / "rows.jsonl").read_text())["metrics"] == GOOD


SMALL = 'scenes = ["cube-on-plane"]\nview_size = 32\nrounds = 0\n[[technique]]\nspec = "unshadowed"\n'


def test_update_brings_the_study_that_makes_the_cells(shadowbench: Shadowbench, tmp_path: Path) -> None:
    study, found, baseline = tmp_path / "mine.toml", tmp_path / "now", tmp_path / "baseline"
    study.write_text(SMALL)
    assert shadowbench("run", "-s", study, "-o", found).code == 0
    answer = shadowbench("check", found, "--baseline", baseline, "--update")
    assert str(tmp_path) not in (baseline / "rows.jsonl").read_text(), "what it was called with is nobody's business"
    assert answer.code == 0 and f"study.toml is a copy of {study}" in answer.out
    assert (baseline / "study.toml").read_text() == SMALL
    assert {file.name for file in baseline.iterdir()} == {"rows.jsonl", "study.toml"}
    again = tmp_path / "again"
    assert shadowbench("run", "-s", baseline / "study.toml", "-o", again).code == 0
    assert shadowbench("check", again, "--baseline", baseline).code == 0

    study.write_text(SMALL.replace("32", "64"))  # it no longer says what was run
    assert "study.toml" not in shadowbench("check", found, "--baseline", tmp_path / "other", "--update").out
    assert not (tmp_path / "other" / "study.toml").exists()


def test_a_scene_that_is_changed_back_has_its_first_results(shadowbench: Shadowbench, tmp_path: Path) -> None:
    scene, folder, baseline = tmp_path / "changing.toml", tmp_path / "now", tmp_path / "baseline"

    def run(text: str) -> bytes:
        """The truth's image after a run of this scene file."""
        scene.write_text(text)
        words = ["-t", "shadow-map:size=64", "--view-size", "32", "--rounds", "0", "-o", folder, "--quiet"]
        assert shadowbench("run", scene, *words).code == 0
        return (folder / "truth" / "changing.camera.sun.32.png").read_bytes()

    other = CHANGING.replace("[0.0, 0.5, 0.0]", "[1.0, 1.5, 0.0]")
    first = run(CHANGING)
    assert shadowbench("check", folder, "--baseline", baseline, "--update").code == 0
    assert run(other) != first
    assert shadowbench("check", folder, "--baseline", baseline).code == 1
    measured = (folder / "rows.jsonl").read_bytes()
    assert run(CHANGING) == first
    assert (folder / "rows.jsonl").read_bytes() == measured, "nothing was measured again"
    answer = shadowbench("check", folder, "--baseline", baseline)
    assert answer.code == 0 and "1 of them identical" in answer.out

    truth = folder / "truth" / "changing.camera.sun.32.png"
    kept = truth.stat().st_mtime_ns, truth.stat().st_ino
    assert run(CHANGING) == first and (truth.stat().st_mtime_ns, truth.stat().st_ino) == kept, "no need to write it"
    for spoil in (truth.unlink, partial(truth.write_text, "no picture")):
        spoil()
        assert run(CHANGING) == first


def test_run_json_names_the_machine_as_the_times_do(shadowbench: Shadowbench, tmp_path: Path) -> None:
    study, folder = tmp_path / "mine.toml", tmp_path / "now"
    study.write_text(SMALL.replace("rounds = 0", "rounds = 1"))
    assert shadowbench("run", "-s", study, "-o", folder).code == 0
    about = json.loads((folder / "run.json").read_text())
    records = [json.loads(line) for line in (folder / "rows.jsonl").read_text().splitlines()]
    assert [one["machine"] for one in records if one["kind"] == "time"] == [about["machine_key"]]


@pytest.mark.parametrize(
    ("changed", "line"),
    [
        ({"view_size": 32}, "view_size is 32 against 16"),
        ({"scene": "other", "view_size": 32}, "scene is other against s; view_size is 32 against 16"),
        ({"spec": "shadow-map:wrap=edge"}, "spec is shadow-map:wrap=edge against shadow-map:"),
    ],
)
def test_runs_without_a_cell_in_common_are_told_what_differs(
    shadowbench: Shadowbench, now: Callable[..., Path], then: Callable[..., Path], changed: dict[str, Any], line: str
) -> None:
    answer = shadowbench("check", now(cell(**changed)), "--baseline", then(cell()))
    assert answer.code == 2 and f" have no cell in common: {line}; allowed: " in answer.err


def test_runs_that_share_all_values_but_no_cell_are_told_so(
    shadowbench: Shadowbench, now: Callable[..., Path], then: Callable[..., Path]
) -> None:
    mine, theirs = (
        now(cell(scene="a", size=1), cell(scene="b", size=2)),
        then(cell(scene="a", size=2), cell(scene="b", size=1)),
    )
    answer = shadowbench("check", mine, "--baseline", theirs)
    assert answer.code == 2 and "each field has values in common, but no cell agrees in all of them" in answer.err


@pytest.mark.parametrize("side", ["now", "then"])
def test_a_line_that_was_cut_off_is_noted(
    shadowbench: Shadowbench, now: Callable[..., Path], then: Callable[..., Path], side: str
) -> None:
    folders = {"now": now(cell()), "then": then(cell())}
    file = folders[side] / "rows.jsonl"
    with file.open("a") as stream:
        stream.write(json.dumps(cell(scene="t"))[:-9])
    answer = shadowbench("check", folders["now"], "--baseline", folders["then"])
    assert (answer.code, answer.err) == (
        0, f"note: {file}: the last line is cut off and was ignored; its writer was stopped\n",
    )  # fmt: skip
