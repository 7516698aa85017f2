"""`check` as a command: its output, pictures, files and exit codes."""

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image

from shadowbench.reports.regressions import GAP, WIDTH
from shadowbench.scores.difference import FALSE_LIGHT, FALSE_SHADOW
from shadowbench.scores.masks import write_mask
from shadowbench.scores.metrics import leading_error
from tests.conftest import key_of
from tests.results.cells import GOOD, SIDE, WORSE, cell, read, rows, timed

Shadowbench = Callable[..., Any]
Row = dict[str, Any]


@pytest.fixture
def check(shadowbench: Shadowbench, tmp_path: Path) -> Callable[..., Any]:
    """`check` of a folder with some rows, `now`, against one with others, `then`."""

    def call(now: list[Row], then: list[Row], *words: str | Path) -> Any:
        folders = rows(tmp_path / "now", *now), rows(tmp_path / "then", *then)
        return shadowbench("check", folders[0], "--baseline", folders[1], *words)

    return call


def test_regressions_are_listed_worst_first_and_fail(check: Callable[..., Any]) -> None:
    better = cell("cube-map", metrics=GOOD | {"acne": 0.01})
    found = [cell(metrics=GOOD | {"iou": 0.89}), cell(scene="t", metrics=WORSE), better]
    answer = check(found, [cell(), cell(scene="t"), cell("cube-map")])
    assert answer.code == 1
    lines = answer.out.splitlines()
    assert lines[0].strip() == "regressed, worst first"
    words = ["t", "camera", "sun", "shadow-map", "512", "iou", "0.9", "→", "0.8", "100.0", "ssim"]
    assert lines[2].split() == words
    assert lines[3].split() == ["s", *words[1:8], "0.89", "10.0"]
    assert lines[5].strip() == "improved, largest change first"
    assert lines[7].split()[3:] == ["cube-map", "512", "acne", "0.1", "→", "0.01", "90.0"]
    assert lines[-2].endswith(": 2 regressed, 1 improved")


def test_a_kind_of_error_is_named_before_the_metrics_that_follow_from_it(check: Callable[..., Any]) -> None:
    """As `score` does: of acne on a quarter of the light, edges are many times their tolerance apart."""
    hard = {**GOOD, "acne": 0.0, "leak": 0.0, "contact": 0.0, "rmse_pen": None}
    acne = hard | {"acne": 0.23, "leak": 0.002, "edge_px": 60.0}
    few = hard | {"acne": 0.005, "edge_px": 60.0}
    answer = check(
        [cell(metrics=acne), cell("cube-map", metrics=few)], [cell(metrics=hard), cell("cube-map", metrics=hard)]
    )
    lines = {line.split()[3]: line.split()[5:] for line in answer.out.splitlines()[2:4]}
    assert lines["shadow-map"][0] == "acne" and lines["shadow-map"][-2:] == ["edge_px", "leak"]
    assert lines["cube-map"][0] == "edge_px" and lines["cube-map"][-1] == "acne"
    assert leading_error(acne) == "acne" and leading_error(few) is None


def test_a_missing_cell_fails_and_an_extra_one_is_a_note(check: Callable[..., Any]) -> None:
    answer = check([cell()], [cell(), cell("cube-map")])
    assert answer.code == 1
    assert answer.out.splitlines()[-2].endswith("0 regressed, 1 missing, 0 improved")
    answer = check([cell(), cell("cube-map")], [cell()])
    assert (answer.code, answer.err) == (0, "note: 1 cell is not in the baseline\n")
    assert check([cell(), cell("cube-map")], [cell()], "--quiet").err == ""


def test_the_cells_of_the_last_command_are_compared_alone(
    check: Callable[..., Any], shadowbench: Shadowbench, tmp_path: Path
) -> None:
    """One that it found measured counts as it was, whatever a run that was interrupted has appended since."""
    first, earlier, engine = cell(), cell("cube-map"), cell("my-engine", content="c")
    folder = tmp_path / "now"
    folder.mkdir()
    (folder / "run.json").write_text(json.dumps({"schema": 1, "keys": [first["key"]]}))
    answer = check([first, cell(key=key_of("another text"), metrics=WORSE), earlier, engine], [first, earlier, engine])
    assert answer.code == 1 and answer.out.splitlines()[-2].endswith("0 regressed, 1 missing, 0 improved")
    assert answer.err == f"note: 1 cell of earlier commands in {folder} left out; run.json lists those of the last\n"
    assert shadowbench("check", folder, "--baseline", tmp_path / "new", "--update").code == 0
    assert read(tmp_path / "new") == [first, engine]
    (folder / "run.json").write_text(json.dumps({"schema": 1, "keys": [key_of("no row")]}))
    rows(folder, earlier)
    answer = shadowbench("check", folder, "--baseline", tmp_path / "new", "--update")
    assert answer.code == 2 and "--update: found no cell; allowed: " in answer.err
    assert read(tmp_path / "new") == [first, engine]


def test_times_warn_and_fail_only_when_asked(check: Callable[..., Any]) -> None:
    now, then = [cell(), timed(cell(), ratio=2.5)], [cell(), timed(cell())]
    answer = check(now, then)
    assert answer.code == 0
    assert answer.out.startswith("slower; ratios to the reference; a warning only (--time makes it fail)")
    assert answer.out.splitlines()[-1].endswith("0 regressed, 0 improved, 1 slower")
    answer = check(now, then, "--time")
    assert answer.code == 1 and "warning only" not in answer.out
    answer = check([cell()], then, "--time")
    assert (answer.code, answer.err[:26]) == (0, "note: no time was compared")


def masks(folder: Path, score: Row, visibility: np.ndarray) -> None:
    """Write a cell's mask, and a truth that is in shadow in its lower half."""
    truth = np.repeat([1.0, 0.0], SIDE // 2)[:, np.newaxis] * np.ones(SIDE)
    view = f"truth/s.camera.sun.{SIDE}"
    for name, values in ((f"masks/{score['key']}", visibility), (view, truth), (f"{view}.undecided", 0 * truth)):
        (folder / name).parent.mkdir(exist_ok=True)
        write_mask(folder / f"{name}.png", values)


def test_the_worst_cells_are_drawn_beside_the_truth_before_and_now(
    check: Callable[..., Any], shadowbench: Shadowbench, tmp_path: Path
) -> None:
    spec = "shadow-map:filter=pcf(taps=5)"
    hard = {"rmse_pen": None}
    bad, good = cell(spec, metrics=WORSE | hard), cell(spec, metrics=GOOD | hard)
    other = cell("cube-map", metrics=GOOD | hard)
    found, baseline = rows(tmp_path / "now"), tmp_path / "then"
    (found / "check").mkdir()
    (found / "check" / "of-the-last-time.png").touch()
    lit, right = np.ones((SIDE, SIDE)), np.repeat([1.0, 0.0], SIDE // 2)[:, np.newaxis] * np.ones(SIDE)
    masks(found, bad, lit)
    assert check([bad, other], [good, other]).out.endswith("check: summary.md, summary.json, 1 picture\n")
    (picture,) = (found / "check").glob("*.png")
    assert picture.name == "1.s.shadow-map_filter=pcf_taps=5_.512.png"
    columns = strip_columns(picture)
    assert len(columns) == 2
    assert [(colors(one) & DIFFERENT) for one in columns] == [set(), {FALSE_LIGHT}], "of the truth, and now"

    measured = rows(tmp_path / "measured", good, other)
    masks(measured, good, right)
    for kept in (["--masks"], []):
        shadowbench("check", measured, "--baseline", baseline, "--update", *kept)
        files = [file.name for file in (baseline / "masks").glob("*")]
        assert files == ([f"{good['key']}.png"] if kept else []), "none of an earlier update"
    masks(baseline, good, right)
    check([bad, other], [good, other])
    truth, before, now = strip_columns(picture)
    assert [(colors(one) & DIFFERENT) for one in (truth, before, now)] == [set(), set(), {FALSE_LIGHT}]
    assert (truth[100:-100] == before[100:-100]).all(), "below the labels"
    assert check([good, other], [good, other]).code == 0
    assert not any((found / "check").iterdir()), "nothing is left of a check that failed before"


DIFFERENT = {FALSE_SHADOW, FALSE_LIGHT}


def strip_columns(file: Path) -> list[np.ndarray]:
    """The columns of a strip, each a view's width after enlargement."""
    picture, side = np.asarray(Image.open(file)), WIDTH
    return [picture[:, left : left + side] for left in range(0, picture.shape[1], side + GAP)]


def colors(picture: np.ndarray) -> set[tuple[int, ...]]:
    return {color for _, color in Image.fromarray(picture).getcolors(picture.size)}


def test_the_summary_has_every_value_of_the_worst_cells_and_says_what_to_do(
    check: Callable[..., Any], tmp_path: Path
) -> None:
    bad = cell(metrics=WORSE)
    masks(rows(tmp_path / "now"), bad, np.ones((SIDE, SIDE)))
    answer = check([bad, cell(scene="t")], [cell(), cell(scene="t"), cell("cube-map")], "--json")
    text = (tmp_path / "now" / "check" / "summary.md").read_text(encoding="utf-8")
    assert text.startswith("## Shadows got worse\n")
    _, regressed, details = text.split("### ")
    assert [line.split(" | ")[1] for line in regressed.splitlines() if line.startswith("| s ")] == [
        "`cube-map`", "`shadow-map`",
    ]  # fmt: skip
    assert details.startswith("shadow-map at 512 in s camera sun\n\nPicture: `check/1.s.shadow-map.512.png`\n")
    assert (
        "| iou | 0.9 | 0.8 | 100.0 | Intersection over union" in details and "| ssim | 0.9 | 0.85 | 50.0 |" in details
    )
    assert f"shadowbench check {tmp_path / 'now'} --baseline {tmp_path / 'then'} --update`" in details
    found = json.loads((tmp_path / "now" / "check" / "summary.json").read_text(encoding="utf-8"))
    assert found == json.loads(answer.out)
    (file,) = found["pictures"]
    assert [one["picture"] for one in found["regressed"]] == [None, file, file]


def test_a_workflow_gets_annotations_and_a_summary(
    check: Callable[..., Any], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    summary = tmp_path / "summary.md"
    summary.write_text("of the step before\n")
    monkeypatch.setenv("GITHUB_STEP_SUMMARY", str(summary))
    spec = "shadow-map:filter=pcf(taps=5),wrap=edge"
    answer = check([cell(spec, metrics=WORSE)], [cell(spec), cell("100%")], "--github")
    assert answer.code == 1
    gone, worse = [line for line in answer.out.splitlines() if line.startswith("::")]
    assert gone == "::error title=100%25 at 512 in s camera sun::status ok → missing"
    title = "shadow-map%3Afilter=pcf(taps=5)%2Cwrap=edge at 512 in s camera sun"
    assert worse == f"::error title={title}::iou 0.9 → 0.8; 100.0 times its tolerance; also ssim"
    assert summary.read_text(encoding="utf-8").startswith("of the step before\n## Shadows got worse\n")
    summary.unlink()
    answer = check([cell(), timed(cell(), ratio=2.5)], [cell(), timed(cell())], "--github")
    assert answer.code == 0 and "::warning title=shadow-map at 512 in s camera sun::time 2 → 2.5;" in answer.out
    assert summary.read_text(encoding="utf-8").startswith("## Shadows are as good as they were\n")


BAD = (
    (["--tolerance", "speed=1"], "speed=1"),
    (["--tolerance", "iou"], "''"),
    (["--tolerance", "iou=-1"], "'-1'"),
    (["--tolerance", "iou=nan"], "'nan'"),
    (["--baseline", "nowhere"], "nowhere"),
    (["--json", "--github"], "--github"),
    (["--masks"], "--masks"),
)
APART = (
    (cell(view_size=32), "view_size is 32 against 16"),
    (cell(scene="other", view_size=32), "scene is other against s; view_size is 32 against 16"),
    (cell("shadow-map:wrap=edge"), "spec is shadow-map:wrap=edge against shadow-map"),
)


def test_bad_input_is_one_line(check: Callable[..., Any]) -> None:
    for words, named in BAD:
        answer = check([cell()], [cell()], *words)
        assert (answer.code, answer.out, answer.err.count("\n")) == (2, "", 1), words
        assert named in answer.err and "allowed" in answer.err
    for other, differs in APART:
        answer = check([other], [cell()])
        assert answer.code == 2 and f" have no cell in common: {differs}; allowed: " in answer.err
        assert "--update" not in answer.err, "it would overwrite the baseline"


def test_update_makes_the_run_the_baseline_and_says_what_changed(
    check: Callable[..., Any], shadowbench: Shadowbench, tmp_path: Path
) -> None:
    answer = check([cell(metrics=WORSE), timed(cell())], [cell(), cell("cube-map")], "--update")
    assert answer.code == 0
    assert answer.out.startswith("regressed, worst first")
    assert "1 cell, the baseline from now on" in answer.out
    found, baseline = tmp_path / "now", tmp_path / "then"
    assert not (found / "check").exists()
    assert (read(baseline), read(baseline, "time")) == ([cell(metrics=WORSE)], [timed(cell())])
    assert shadowbench("check", found, "--baseline", baseline, "--time").code == 0


def test_neither_a_broken_cell_nor_a_measured_folder_is_overwritten_by_update(
    check: Callable[..., Any], tmp_path: Path
) -> None:
    answer = check([cell(status="failed: hung")], [cell()], "--update")
    assert answer.code == 2 and "failed: hung" in answer.err
    (tmp_path / "then" / "run.json").write_text("{}")
    answer = check([cell(metrics=WORSE)], [cell()], "--update")
    assert answer.code == 2 and "is a run folder" in answer.err
    assert read(tmp_path / "then") == [cell()]


SMALL = 'scenes = ["cube-on-plane"]\nview_size = 32\nrounds = 1\n[[technique]]\nspec = "unshadowed"\n'


def test_update_brings_the_study_that_makes_the_cells(shadowbench: Shadowbench, tmp_path: Path) -> None:
    study, found, baseline = tmp_path / "mine.toml", tmp_path / "now", tmp_path / "new" / "baseline"
    study.write_text(SMALL)
    assert shadowbench("run", "-s", study, "-o", found).code == 0
    assert shadowbench("check", found, "--baseline", baseline).code == 2, "there is none yet"
    machine = json.loads((found / "run.json").read_text())["machine_key"]
    assert [time["machine"] for time in read(found, "time")] == [machine], "run.json names it as the times do"
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


def test_a_line_that_was_cut_off_is_noted(shadowbench: Shadowbench, tmp_path: Path) -> None:
    now, then = (rows(tmp_path / name, cell()) for name in ("now", "then"))
    file = then / "rows.jsonl"
    with file.open("a") as stream:
        stream.write(json.dumps(cell(scene="t"))[:-9])
    answer = shadowbench("check", now, "--baseline", then)
    note = f"note: {file}: the last line is cut off and was ignored; its writer was stopped\n"
    assert (answer.code, answer.err) == (0, note)
