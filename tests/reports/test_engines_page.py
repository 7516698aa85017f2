"""The page of other engines, from rows of known scores."""

import json
import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image

from shadowbench.plugin.registry import engines
from shadowbench.plugin.spec import parse_spec
from shadowbench.reports.defect_text import defect_of, write_defect
from shadowbench.reports.engine_defects import strip
from shadowbench.reports.engines_page import write_engines_page
from shadowbench.results.engine_settings import engine_results
from shadowbench.results.folder import read_runs
from shadowbench.scores.metrics import METRICS
from tests.conftest import key_of
from tests.reports.conftest import MEASURED, SCORE, SIDE, run_file, write_folder

LLVMPIPE = "llvmpipe (LLVM 15.0.6, 256 bits)"


def row(name: str, scene: str, error: float = 0.0, version: str = "1", **given: Any) -> dict[str, Any]:
    """The row of a spec at 1024 in a scene; given: its status or metrics."""
    spec = parse_spec(name, engines()).with_(size=1024)
    status = given.pop("status", "ok")
    made = SCORE | {
        "key": key_of(name, scene, version), "scene": scene, "light": "sun", "status": status,
        "technique": spec.technique.name, "spec": spec.sizeless_text, "full_spec": spec.full_text, "map_size": 1024,
    }  # fmt: skip
    if status == "ok":
        made |= MEASURED | {"metrics": dict.fromkeys(METRICS, 0.0) | {"iou": 1 - error, "rmse_pen": None} | given}
        made["engine"] = {"version": version, "renderer": LLVMPIPE, "box": "given", "phase": "box"}
    return made


ROWS = [
    row("three", "stairs", 0.5, acne=0.4, edge_px=8.0),
    row("three", "street", 0.1),
    row("three", "terrain", 0.2),
    row("three:preset=documented", "stairs", 0.25, acne=0.3),
    row("three:preset=documented", "street", 0.2),
    row("three:sides=double", "stairs", 0.125, leak=0.1),
    row("three:bias=-0.5", "stairs", 0.3125),
    row("ogre", "stairs", status="unsupported: no such light"),
    row("ogre", "street", status="unsupported: no such light"),
]


@pytest.fixture
def page_of(tmp_path: Path, shadowbench: Callable[..., Any]) -> Callable[..., str]:
    """The page of folders with these rows."""

    def make(*folders: list[dict[str, Any]], pictures: bool = True) -> str:
        about = run_file(True, "A processor")
        made = [write_folder(tmp_path / f"run{at}", rows, about, pictures) for at, rows in enumerate(folders)]
        answer = shadowbench("engines", "page", *made)
        assert (answer.code, answer.err) == (0, "")
        return (tmp_path / "run0" / "engines.md").read_text(encoding="utf-8")

    return make


def line_of(page: str, heading: str, start: str) -> list[str]:
    """The cells of a line of a section's table."""
    section = page.partition(f"\n## {heading}\n")[2].partition("\n## ")[0]
    (line,) = [line for line in section.splitlines() if line.startswith(f"| {start} |")]
    return [cell.strip() for cell in line.strip("|").split("|")]


def test_medians_are_over_scenes_and_the_best_setting_is_first(page_of: Callable[..., str]) -> None:
    page = page_of(ROWS)
    shipped = "`three:preset=shipped,sides=closed` at 1024"
    assert line_of(page, "Settings", shipped)[1:5] == ["1", "given", "0.200 (3)", "0"]
    section = page.partition("\n## Settings\n")[2].partition("\n## ")[0]
    names = [line.split("`")[1] for line in section.splitlines() if line.startswith("| `")]
    parts = [
        "preset=shipped,sides=double",
        "preset=shipped,sides=closed",
        "preset=documented,sides=closed",
        "bias=-0.5",
    ]
    assert names == [f"three:{part}" for part in parts]
    assert line_of(page, "1 − IoU by scene", shipped)[1:] == ["0.500", "0.100", "0.200"]


def test_a_gap_has_its_reason_once(page_of: Callable[..., str]) -> None:
    page = page_of(ROWS)
    gaps = line_of(page, "1 − IoU by scene", "`ogre:preset=shipped,sides=closed` at 1024")[1:]
    assert gaps[0] == gaps[1] != gaps[2] and all(gap.startswith("– (") for gap in gaps)
    assert page.count("unsupported: no such light") == 1 and page.count(") not measured\n") == 1
    assert line_of(page, "1 − IoU by scene", "`babylon`")[1].startswith("– (")
    assert "To compare versions" in page
    assert "### ogre\n" in page and "No setting has a score." in page


def test_the_worst_defect_is_named_with_its_cure_and_a_picture(page_of: Callable[..., str], tmp_path: Path) -> None:
    page = page_of(ROWS)
    named = (
        "`three:preset=shipped,sides=closed` at 1024 in stairs, 1 − IoU 0.500; acne 0.400, leak 0, contact 0, edge px"
    )
    assert f"Worst defect: acne, of {named} 8.00." in page
    assert "Cure: `three:preset=shipped,sides=double` at 1024, 1 − IoU 0.500 before and 0.125 after." in page
    closed = [f"three:preset={preset},sides=closed at 1024" for preset in ("shipped", "documented")]
    shown = "; ".join(["truth", closed[0], "three:preset=shipped,sides=double at 1024", closed[1]])
    assert f"![stairs, from left to right: {shown}](engines/three.png)" in page
    with Image.open(tmp_path / "run0" / "engines" / "three.png") as picture:
        assert picture.size == (4 * SIDE + 3 * 4, SIDE)


def test_an_edge_in_pixels_stands_out_by_its_share_of_the_width(page_of: Callable[..., str]) -> None:
    page = page_of([row("three", "stairs", 0.5, acne=0.4, edge_px=0.41 * SIDE)], pictures=False)
    assert "Worst defect: edge px, of " in page and "Cure: none of the measured settings." in page
    assert "No picture: there is no truth/stairs.camera.sun.32.png in run0." in page


def test_a_setting_that_takes_less_than_half_of_an_error_off_is_no_cure(page_of: Callable[..., str]) -> None:
    page = page_of([row("three", "stairs", 0.5), row("three:sides=double", "stairs", 0.375)], pictures=False)
    best = "the best is `three:preset=shipped,sides=double` at 1024, 1 − IoU 0.500 before and 0.375 after."
    assert f"Cure: none of the measured settings; {best}" in page


def test_without_an_error_there_is_no_defect(page_of: Callable[..., str]) -> None:
    assert "No defect: 1 − IoU is 0 in every scene" in page_of([row("three", "stairs")])


def test_versions_of_several_folders_are_compared_in_their_common_cells(page_of: Callable[..., str]) -> None:
    page = page_of(ROWS, [row("three", scene, error, "2") for scene, error in (("stairs", 0.25), ("street", 0.05))])
    lines = [line for line in page.partition("\n## Versions\n")[2].splitlines() if line.startswith("| `")]
    setting = "`three:preset=shipped,sides=closed` at 1024"
    assert lines == [f"| {setting} | 1 | 0.300 | 2 |", f"| {setting} | 2 | 0.150 | 2 |"]
    assert line_of(page, "Settings", setting)[1:4] == ["2", "given", "0.150 (2)"]
    assert "To compare versions" not in page


def test_versions_in_one_folder_are_compared_too(page_of: Callable[..., str]) -> None:
    page = page_of([*ROWS, row("three", "stairs", 0.25, "2")])
    lines = [line for line in page.partition("\n## Versions\n")[2].splitlines() if line.startswith("| `")]
    assert [line.split(" | ")[1:] for line in lines] == [["1", "0.500", "1 |"], ["2", "0.250", "1 |"]]
    assert "**Left out** of three: 6 cells of another version or view size." in page


def test_a_strip_is_as_wide_as_its_pictures_at_most_256_each() -> None:
    mask = np.ones((512, 512), np.float32)
    picture = strip([mask, 0 * mask])
    assert picture.shape == (256, 516)
    assert (picture[:, :256] == 255).all() and (picture[:, 260:] == 0).all() and (picture[:, 256:260] == 128).all()


def test_a_folder_without_engines_is_refused(run_folder: Callable[..., Path], shadowbench: Callable[..., Any]) -> None:
    answer = shadowbench("engines", "page", run_folder())
    assert answer.code == 2 and "found no cell of another engine" in answer.err


def text_of(rows: list[dict[str, Any]], folder: Path, pictures: bool = True) -> str | None:
    """The text for three.js' issue tracker, from rows; None if it has no defect."""
    about = run_file(True, "A processor")
    about["study"] |= {"scenes": ["stairs", "terrain"]}
    shutil.rmtree(folder, ignore_errors=True)
    write_folder(folder, rows, about, pictures)
    found = list(engine_results(read_runs([folder])).values())
    defect = defect_of(next(one for one in found if one.engine.name == "three"), found)
    if defect is None:
        return None
    write_defect(defect, folder / "three-defect")
    return (folder / "three-defect.md").read_text(encoding="utf-8")


def test_the_text_for_an_issue_tracker_has_picture_numbers_cure_and_folder(tmp_path: Path) -> None:
    text = text_of([*ROWS, row("babylon", "stairs", 0.0625)], tmp_path)
    assert text is not None
    assert text.startswith("# three.js 1: surfaces shadow themselves with the settings as shipped under a directional")
    assert "1 − IoU is 0.500. 40% of the lit surfaces, away from shadows, are dark (acne)." in text
    table = {line.split(" | ")[0]: line for line in text.splitlines() if line.startswith("| ")}
    assert "| `three:preset=shipped,sides=closed` at 1024 | 0.500 | 0.400 |" in table["| this setting"]
    assert "| `three:preset=shipped,sides=double` at 1024 | 0.125 |" in table["| the engine's best here"]
    assert "| `babylon:preset=shipped,sides=closed` at 1024 | 0.0625 |" in table["| best of others"]
    assert table["| `sides`"].endswith(" | `closed` | `double` |")
    assert "With `three:preset=shipped,sides=double` at 1024 the 1 − IoU is 0.125 instead of 0.500" in text
    assert "this is a software renderer" in text and LLVMPIPE in text
    assert "`shadowbench engines install three`" in text and "shadowbench run -s study.toml -o again\n" in text
    assert 'scenes = ["stairs"]' in (tmp_path / "three-defect" / "study.toml").read_text(encoding="utf-8")
    with Image.open(tmp_path / "three-defect.png") as picture:
        assert picture.size[0] == 3 * 320 + 2 * 8
    assert "![" not in (text_of(ROWS, tmp_path / "bare", pictures=False) or "![")


@pytest.mark.parametrize(
    "rows",
    [
        [row("three", "stairs", 0.09), row("three:sides=double", "stairs", 0.0)],  # hardly wrong
        [row("three", "stairs", 0.5), row("three:sides=double", "stairs", 0.2)],  # nothing is much better
        [row("three:bias=-0.5", "stairs", 0.5), row("three", "stairs", 0.0)],  # neither shipped nor documented
        [row("three", "stairs", 0.5), row("babylon", "stairs", 0.0) | {"map_size": 512}],
    ],
)
def test_there_is_no_text_without_a_defect_that_something_comparable_does_not_have(
    rows: list[dict[str, Any]], tmp_path: Path
) -> None:
    assert text_of(rows, tmp_path) is None


def test_what_an_engines_documentation_rules_out_is_no_defect(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    rows = [row("three", "stairs", 0.5), row("three:sides=double", "stairs"), row("three", "terrain", 0.2)]
    monkeypatch.setattr(engines()["three"], "ruled_out", {"shipped": ("stairs",)})
    assert text_of(rows, tmp_path) is None
    monkeypatch.setattr(engines()["three"], "ruled_out", {"documented": ("stairs",)})
    assert text_of(rows, tmp_path) is not None


def test_a_setting_that_nothing_of_the_engine_cures_is_told_as_such(tmp_path: Path) -> None:
    text = text_of([row("three", "stairs", 0.5, leak=0.3, contact=0.6), row("babylon", "stairs", 0.1)], tmp_path)
    assert text is not None and "shadows are cut off from what casts them with" in text.splitlines()[0]
    assert "60% of the shadow near its caster is lit (peter-panning). 30% of the shadows' interior is lit." in text
    assert "Nothing that was measured: of 1 setting of the engine none is better here; others were not tried." in text
    assert "the engine's best" not in text


def test_the_page_links_to_the_text_or_says_why_there_is_none(page_of: Callable[..., str], tmp_path: Path) -> None:
    page = page_of([*ROWS, row("babylon", "stairs", 0.0625)])
    assert "No text for its issue tracker: " in page, "its run.json names no scene"
    about = run_file(True, "A processor")
    about["study"] |= {"scenes": ["stairs"]}
    (tmp_path / "run0" / "run.json").write_text(json.dumps(about), encoding="utf-8")
    write_engines_page(read_runs([tmp_path / "run0"]), {}, tmp_path / "page.md")
    page = (tmp_path / "page.md").read_text(encoding="utf-8")
    assert "[A text for its issue tracker](page/three-defect.md)" in page
    assert (tmp_path / "page" / "three-defect.md").exists() and not (tmp_path / "page" / "babylon-defect.md").exists()
