"""`report` as a command: every format, and notes on missing data."""

import csv
import io
import re
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
import pytest
from PIL import Image
from rich.console import Console

from shadowbench.commands import console
from shadowbench.plugin.registry import preset_names
from shadowbench.reports import gallery, report
from shadowbench.reports.gallery import difference
from shadowbench.results import folder as folder_of_cells
from shadowbench.scores.difference import FALSE_LIGHT, FALSE_SHADOW
from tests.reports.conftest import CELLS, SIDE, Cell, galleries, image_of, scripts

Shadowbench = Callable[..., Any]
Write = Callable[..., Path]
SOFTWARE = "for trends only, not representative of a GPU"


def test_a_page_shows_machine_command_assumptions_and_statuses(run_folder: Write, page_of: Callable[..., str]) -> None:
    page = page_of(run_folder(pictures=True)).replace("<wbr>", "")
    assert "shadowbench run stairs -t 'shadow-map:bias=&lt;b&gt;'" in page
    for told in ("A processor", "no camera: assumed one", "no light: assumed a sun", "finish+wall", SOFTWARE):
        assert told in page
    assert "unsupported: no receiver is a plane" in page and "failed: the worker died" in page
    (part,) = scripts(page)
    assert len(part["rows"]) == len([cell for cell in CELLS if cell.status == "ok"])
    assert sum(row["front"] for row in part["rows"]) == 6


def test_the_verdict_and_the_matrix_are_in_the_page_itself(run_folder: Write, page_of: Callable[..., str]) -> None:
    page = page_of(run_folder()).replace("<wbr>", "")
    assert "<code>shadow-map at 2048</code> is the cheapest real-time setting, 20.0 ms a frame." in page
    (cells,) = re.findall(r'<tr><th scope="row">shadow-map</th>(.*?)</tr>', page, re.DOTALL)
    assert re.findall(r"<b>(.*?)</b>", cells) == ["5.00 ms", "20.0 ms", "–"]
    assert re.findall(r'class="(\w+)" aria', cells) == ["all", "all", "none"]


def test_presets_say_what_they_stand_for(
    run_folder: Write, page_of: Callable[..., str], shadowbench: Shadowbench, tmp_path: Path
) -> None:
    spec, name = next((spec, name) for spec, name in preset_names().items() if name == "shadow-map:preset=course")
    folder = run_folder([*CELLS, Cell(spec, 512, 0.01, 3.0)])
    page = page_of(folder).replace("<wbr>", "")
    assert f"<dt>{name}</dt><dd><code>{spec}</code></dd>" in page
    assert f'title="{spec}[512]' in page, "the full spec, over the cell of the matrix"
    assert shadowbench("report", folder, "--format", "md", "-o", tmp_path / "table.md", "-q").code == 0
    assert f"- `{name}`: `{spec}`\n" in (tmp_path / "table.md").read_text(encoding="utf-8")


def test_table_values_have_sort_keys_and_texts(run_folder: Write, page_of: Callable[..., str]) -> None:
    (part,) = scripts(page_of(run_folder()))
    row = next(row for row in part["rows"] if row["spec"] == "shadow-map" and row["map"] == 512)
    assert row["values"]["cost, ms"] == [5.0, "5.00"] and row["values"]["map"] == [512, "512"]
    assert row["values"]["1 − IoU"] == [pytest.approx(0.04), "0.0400"]
    assert all(set(part["columns"]) <= set(row["values"]) for row in part["rows"])


def test_several_scenes_have_a_part_each_and_one_of_all(run_folder: Write, page_of: Callable[..., str]) -> None:
    cells = [replace(cell, scene=scene) for scene in ("stairs", "terrace") for cell in CELLS]
    parts = scripts(page_of(run_folder(cells, pictures=True)))
    assert [part["gallery"] is not None for part in parts] == [False, True, True]
    keys = [(row["spec"], row["map"]) for row in parts[0]["rows"]]
    assert len(keys) == len(set(keys)) == len(parts[1]["rows"]), "a line over all for each setting"
    assert {row["values"]["scenes"][1] for row in parts[0]["rows"]} == {"2 of 2"}


def test_a_page_asks_nothing_of_a_network(run_folder: Write, page_of: Callable[..., str]) -> None:
    page = page_of(run_folder(pictures=True))
    markup = re.sub(r"<script.*?</script>", "", page, flags=re.DOTALL)
    assert not re.search(r'(?:src|href)="(?!data:|#)', markup) and "@import" not in markup and "url(" not in markup


def test_every_cell_has_its_pictures_in_the_page(run_folder: Write, page_of: Callable[..., str]) -> None:
    (shown,) = galleries(page_of(run_folder(pictures=True)))
    held = [cell for cell in CELLS if cell.status == "ok"]
    assert len(shown["cells"]) == len(held) and shown["notes"] == []
    assert all(re.fullmatch(r"shadowbench view \S+ --cell [0-9a-f]{24}", cell["command"]) for cell in shown["cells"])
    for cell in shown["cells"]:
        assert cell["mask"].startswith("data:image/webp;base64,") and cell["picture"] is None
    (view,) = shown["views"].values()
    assert list(shown["views"]) == ["camera, sun"] and list(view) == ["truth", "undecided", "lit", "ambient"]
    assert all(image.startswith("data:image/webp;base64,") for image in view.values())


def test_without_shading_images_cells_show_their_own_pictures(run_folder: Write, page_of: Callable[..., str]) -> None:
    folder = run_folder(pictures=True)
    for file in (folder / "truth").glob("*.lit.png"):
        file.unlink()
    (shown,) = galleries(page_of(folder))
    assert all(cell["picture"].startswith("data:image/webp;base64,") for cell in shown["cells"])


def test_a_folder_without_pictures_says_so(run_folder: Write, page_of: Callable[..., str]) -> None:
    page = page_of(run_folder())
    assert galleries(page) == [] and "has neither pictures/ nor masks/" in page


def test_missing_pictures_are_named(run_folder: Write, page_of: Callable[..., str]) -> None:
    folder = run_folder(pictures=True)
    for file in [*(folder / "pictures").iterdir(), *(folder / "truth").iterdir()]:
        file.unlink()
    (shown,) = galleries(page_of(folder))
    assert shown["notes"] == ["run has no truth and no shading for some of these cells."]


def test_many_pictures_are_shown_smaller(
    run_folder: Write, page_of: Callable[..., str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(gallery, "MAX_PIXELS", 7 * SIDE * SIDE // 4)
    monkeypatch.setattr(gallery, "_MIN_SIZE", 4)
    (shown,) = galleries(page_of(run_folder(pictures=True)))
    assert shown["notes"] == [f"Scaled down from {SIDE}² to {SIDE // 2}² pixels."]
    assert {image_of(cell["mask"]).size for cell in shown["cells"]} == {(SIDE // 2, SIDE // 2)}


def test_the_difference_is_signed() -> None:
    truth = np.array([[0, 1], [1, 0]], dtype=np.float32)
    mask = np.array([[1, 0], [1, 1]], dtype=np.float32)
    undecided = np.array([[False, False], [False, True]])
    picture = difference(mask, truth, undecided)
    assert tuple(picture[0, 0]) == FALSE_LIGHT and tuple(picture[0, 1]) == FALSE_SHADOW
    grey = picture[1]
    assert (grey == grey[:, :1]).all() and grey[0, 0] > grey[1, 0]


def test_two_machines_have_charts_of_their_own(run_folder: Write, page_of: Callable[..., str]) -> None:
    page = page_of(run_folder(name="one"), run_folder(name="two", software=False, processor="Another processor"))
    parts = scripts(page)
    assert ["frame time" in part["charts"]["front"]["description"] for part in parts] == [True, True]
    assert "A processor" in page and "Another processor" in page and "times of renderer of Another processor" in page


def test_the_times_of_two_machines_share_no_column_and_no_verdict(
    run_folder: Write, page_of: Callable[..., str]
) -> None:
    slow, fast = (Cell("a", 512, 0.004, ms, machine=machine) for machine, ms in (("m1", 50.0), ("m2", 5.0)))
    page = page_of(run_folder([slow], name="slow"), run_folder([fast], name="fast", processor="Another processor"))
    columns = [[row["values"]["cost, ms"][0] for row in part["rows"]] for part in scripts(page)]
    assert columns == [[50.0], [5.0]]
    verdicts = re.findall(r'<div class="verdict".*?</div>', page, re.DOTALL)
    assert [("50.0 ms" in said, "5.00 ms" in said) for said in verdicts] == [(True, False), (False, True)]


def test_markdown_has_a_table_for_each_scene(run_folder: Write, shadowbench: Shadowbench, tmp_path: Path) -> None:
    answer = shadowbench("report", run_folder(), "--format", "md", "-o", tmp_path / "table.md")
    assert answer.code == 0
    text = (tmp_path / "table.md").read_text(encoding="utf-8")
    assert f"## stairs, {SIDE}² view" in text and SOFTWARE in text
    assert "| **`shadow-map`** | 512 | 0.0400 |" in text and "| `shadow-map:bias=none` | 1024 | 0.600 |" in text
    assert "- `planar-projection`: unsupported: no receiver is a plane" in text
    for table in re.findall(r"(?:^\|.*\n)+", text, re.MULTILINE):
        assert len({line.count("|") for line in table.splitlines()}) == 1


def test_soft_shadows_have_columns_of_their_own(run_folder: Write, shadowbench: Shadowbench, tmp_path: Path) -> None:
    soft = [
        Cell("shadow-map", 512, 0.04, 10.0, rmse_pen=0.2),
        Cell("shadow-map:filter=pcf", 512, 0.05, 12.0, rmse_pen=0.1),
        Cell("sampled", None, 0.01, 90.0, rmse_pen=0.004),
    ]
    assert shadowbench("report", run_folder(soft), "--format", "md", "-o", tmp_path / "table.md").code == 0
    lines = (tmp_path / "table.md").read_text(encoding="utf-8").splitlines()
    head = next(index for index, line in enumerate(lines) if line.startswith("| spec |"))
    assert lines[head].startswith("| spec | map | RMSE | RMSE pen | IoU | SSIM | bleed |")
    assert "**`sampled`** |  | <0.00200 | <0.00800 | 0.990 |" in lines[head + 2]  # the truth cannot tell
    assert "**`shadow-map:filter=pcf`** | 512 | 0.0250 | 0.100 | 0.950 |" in lines[head + 3]
    assert "**`shadow-map`** | 512 | 0.0500 | 0.200 | 0.960 |" in lines[head + 4]


def test_csv_joins_the_cells_of_all_folders(run_folder: Write, shadowbench: Shadowbench, tmp_path: Path) -> None:
    other = [Cell("shadow-map", 512, 0.1, 3.0, passes=(("moments", 1.0),))]
    folders = [run_folder(name="one"), run_folder(other, name="two", processor="Another processor")]
    assert shadowbench("report", *folders, "--format", "csv", "-o", tmp_path / "cells.csv").code == 0
    rows = list(csv.DictReader(io.StringIO((tmp_path / "cells.csv").read_text(encoding="utf-8"))))
    assert len(rows) == len(CELLS) + 1
    assert list(rows[0])[:4] == ["run", "processor", "software", "scene"]
    assert (rows[-1]["run"], rows[-1]["processor"], rows[-1]["pass_moments_ms"]) == ("two", "Another processor", "1.0")


def test_png_writes_a_file_for_each_chart(run_folder: Write, shadowbench: Shadowbench, tmp_path: Path) -> None:
    answer = shadowbench("report", run_folder(), "--format", "png", "-o", tmp_path / "charts")
    assert answer.code == 0
    files = sorted(file.name for file in (tmp_path / "charts").iterdir())
    assert files == [f"stairs.{SIDE}.{kind}.png" for kind in ("front", "passes", "sizes")]
    for file in files:
        with Image.open(tmp_path / "charts" / file) as image:
            assert image.width > 1900 and len(image.getcolors(1 << 20)) > 20


# The verdict in the terminal


def verdict_of(answer: Any) -> list[str]:
    """Its lines, with single blanks between words."""
    assert (answer.code, answer.err) == (0, "")
    return [" ".join(line.split()) for line in answer.out.splitlines()]


def test_the_verdict_names_the_cheapest_for_each_accuracy(
    run_folder: Write, shadowbench: Shadowbench, tmp_path: Path
) -> None:
    told = verdict_of(shadowbench("report", run_folder(), "-o", tmp_path / "report.html"))
    assert told[:9] == [
        "scene target cost cheapest real-time setting",
        "stairs IoU ≥ 0.95 5.00 ms shadow-map at 512",
        "IoU ≥ 0.99 20.0 ms shadow-map at 2048",
        "IoU ≥ 0.999 – none, best 0.995",
        "",
        "over 1 scene IoU ≥ 0.95 IoU ≥ 0.99 IoU ≥ 0.999",
        "shadow-map 5.00 ms 20.0 ms –",
        "ray-traced 60.0 ms 60.0 ms 60.0 ms",
        "Cost: frame time of shadows. Times of a software renderer: for trends only, not representative of a GPU.",
    ]
    assert told[9].startswith(f"{tmp_path / 'report.html'}: 9 cells, ") and len(told) == 10


def test_a_run_of_ray_tracing_alone_has_no_cheapest_technique(
    run_folder: Write, shadowbench: Shadowbench, tmp_path: Path
) -> None:
    traced = [cell for cell in CELLS if cell.spec == "ray-traced"]
    told = verdict_of(shadowbench("report", run_folder(traced), "-o", tmp_path / "report.html"))
    assert (
        told[:2] == ["No real-time technique here has a score.", ""] and told[3] == "ray-traced 60.0 ms 60.0 ms 60.0 ms"
    )


def test_the_verdict_over_scenes_counts_those_that_a_technique_supports(
    run_folder: Write, shadowbench: Shadowbench, tmp_path: Path
) -> None:
    lamp = "unsupported: a lamp shines all round"
    cells = [
        *CELLS,
        Cell("shadow-map", 512, None, None, scene="lamp", status=lamp),
        Cell("cube-map", 512, 0.03, 7.0, scene="lamp"),
        Cell("cube-map", 1024, 0.005, 9.0, scene="lamp", ratio_iqr=0.3),
        Cell("shadow-volume", None, 0.0, 9.0, scene="lamp", ratio_iqr=0.3),
        Cell("ray-traced", None, 0.0, 60.0, scene="lamp"),
    ]
    told = verdict_of(shadowbench("report", run_folder(cells), "-o", tmp_path / "report.html"))
    assert told[4] == "lamp IoU ≥ 0.95 7.00 ms cube-map at 512"
    assert told[5] == "IoU ≥ 0.99 9.00 ms shadow-volume, or 1 other within the noise", (
        "the more accurate of two that cost the same"
    )
    assert told[8:11] == [
        "over 2 scenes IoU ≥ 0.95 IoU ≥ 0.99 IoU ≥ 0.999",
        "ray-traced 60.0 ms 60.0 ms 60.0 ms",
        "shadow-map 5.00 ms, 1 of 2 – –",
    ]
    assert told[-2].endswith("n of 2: over the n that it supports.")


def test_the_verdict_says_what_is_out_of_reach_and_what_was_not_timed(
    run_folder: Write, shadowbench: Shadowbench, tmp_path: Path
) -> None:
    cells = [replace(cell, ms=None) for cell in CELLS if cell.spec == "shadow-map"]
    told = verdict_of(shadowbench("report", run_folder(cells), "-o", tmp_path / "report.html"))
    assert told[1:4] == [
        "stairs IoU ≥ 0.95 map 512 shadow-map at 512",
        "IoU ≥ 0.99 map 2048 shadow-map at 2048",
        "IoU ≥ 0.999 – none, best 0.995",
    ]
    assert told[7].startswith("Nothing here was timed")


def test_of_two_machines_each_has_its_verdict(run_folder: Write, shadowbench: Shadowbench, tmp_path: Path) -> None:
    faster = [replace(cell, ms=cell.ms and cell.ms / 2) for cell in CELLS]
    folders = run_folder(name="one"), run_folder(faster, name="two", software=False, processor="GPU")
    told = verdict_of(shadowbench("report", *folders, "-o", tmp_path / "report.html"))
    heads = [told.index("one, on renderer of A processor"), told.index("two, on renderer of GPU")]
    assert [told[head + 2] for head in heads] == [
        "stairs IoU ≥ 0.95 5.00 ms shadow-map at 512",
        "stairs IoU ≥ 0.95 2.50 ms shadow-map at 512",
    ]


def test_scenes_that_share_a_name_are_told_apart(run_folder: Write, shadowbench: Shadowbench, tmp_path: Path) -> None:
    folder = run_folder([*CELLS, replace(CELLS[1], version=1)])
    rows = (folder / "rows.jsonl").read_text(encoding="utf-8").splitlines()
    *first, score, time = rows
    (folder / "rows.jsonl").write_text(
        "\n".join([*first, score.replace(f'"view_size": {SIDE}', '"view_size": 64'), time])
    )
    told = verdict_of(shadowbench("report", folder, "-o", tmp_path / "report.html"))
    assert told[1].startswith(f"stairs, {SIDE}² view IoU ≥ 0.95 ") and told[4].startswith(
        "stairs, 64² view IoU ≥ 0.95 "
    )


@pytest.mark.parametrize("width", [100, 80])
def test_the_verdict_on_three_scenes_fits_a_screen(
    run_folder: Write, shadowbench: Shadowbench, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, width: int
) -> None:
    monkeypatch.setattr(console.out(), "width", width)
    scenes = "room-with-lamp", "railings", "street"
    folder = run_folder([replace(cell, scene=scene) for scene in scenes for cell in CELLS])
    told = shadowbench("report", folder, "-o", tmp_path / "report.html").out.splitlines()
    cost = next(line for line in told if line.startswith("Cost: "))
    table = told[: told.index(cost)]
    assert len(table) + len(cost) // width + 1 <= 24
    assert max(map(len, table)) <= width


def test_a_scene_without_a_score_has_neither_costs_nor_a_note_on_them(
    run_folder: Write, page_of: Callable[..., str]
) -> None:
    page = page_of(run_folder(CELLS[-2:]))
    assert "Nothing here has a score." in page
    assert 'class="matrix"' not in page and "Nothing here was timed: the cost" not in page


def test_without_a_score_there_is_no_verdict(run_folder: Write, shadowbench: Shadowbench, tmp_path: Path) -> None:
    told = verdict_of(shadowbench("report", run_folder(CELLS[-2:]), "-o", tmp_path / "report.html"))
    assert told[0] == "Nothing here has a score."
    assert shadowbench("report", run_folder(name="again"), "-q", "-o", tmp_path / "report.html").out == ""


@pytest.mark.parametrize(
    ("arguments", "told"),
    [
        (("nowhere",), "no such folder"),
        (("nowhere", "--format", "pdf"), "--format: found 'pdf'; allowed: html, md, csv, png"),
        (("nowhere", "-o", "report.md"), "allowed: .html"),
        (("nowhere", "--format", "csv", "-o", "away/report.csv"), "cannot write into this folder"),
        ((), "Missing argument"),
    ],
)
def test_bad_input_is_one_line(
    arguments: tuple[str, ...],
    told: str,
    shadowbench: Shadowbench,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.chdir(tmp_path)
    answer = shadowbench("report", *arguments)
    assert answer.code == 2 and answer.err.count("\n") == 1 and told in answer.err
    assert list(tmp_path.iterdir()) == []


def test_cells_of_earlier_commands_are_counted_in_a_note(
    shadowbench: Shadowbench, run_folder: Write, tmp_path: Path
) -> None:
    last, *others = CELLS
    folder = run_folder()
    (folder / "table.csv").write_text(f"key\n{last.key}\n")
    words = ["report", folder, "--format", "md", "-o", tmp_path / "report.md"]
    note = f"{len(others)} of {len(CELLS)} cells are of earlier commands"
    answer = shadowbench(*words)
    assert (answer.code, answer.err) == (0, f"note: {folder}: {note}\n")
    assert shadowbench(*words, "--quiet").err == ""
    (folder / "table.csv").write_text("key\n" + "".join(f"{cell.key}\n" for cell in CELLS))
    assert shadowbench(*words).err == ""


def test_the_progress_of_reading_and_drawing_is_shown(
    run_folder: Write, shadowbench: Shadowbench, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    terminal = Console(file=io.StringIO(), force_terminal=True, width=300)
    monkeypatch.setattr(console, "err", lambda: terminal)
    shown: dict[str, str] = {}

    def noted(module: ModuleType, name: str) -> Callable[..., Any]:
        function = getattr(module, name)

        def call(*arguments: Any) -> Any:
            shown[name] = terminal.file.getvalue()  # type: ignore[attr-defined]
            return function(*arguments)

        return call

    for module, name in ((folder_of_cells, "read_folders"), (report, "html_report")):
        monkeypatch.setattr(module, name, noted(module, name))
    folder, page = run_folder(), tmp_path / "page.html"
    assert shadowbench("report", folder, "-o", page).code == 0
    assert "reading" in shown["read_folders"] and str(folder) in shown["read_folders"]
    assert "charts and pictures" in shown["html_report"] and str(page) in shown["html_report"]
