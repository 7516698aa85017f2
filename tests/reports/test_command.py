"""`report` as a command: every format, the verdict in the terminal, and notes on missing data."""

import csv
import io
import json
import re
import shutil
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image

from shadowbench.commands import console
from shadowbench.commands import report as command
from shadowbench.plugin.registry import preset_names
from shadowbench.reports.gallery import difference
from shadowbench.scores.difference import FALSE_LIGHT, FALSE_SHADOW
from shadowbench.scores.masks import read_mask, write_mask
from tests.reports.conftest import CELLS, SIDE, Cell, data_of, galleries, parts_of

Page = Callable[..., str]
SOFTWARE = "for trends only, not representative of a GPU"
TWO = [replace(cell, scene=scene) for scene in ("stairs", "terrace") for cell in CELLS]


@pytest.fixture
def markdown_of(shadowbench, tmp_path) -> Page:
    """The Markdown report of folders."""

    def make(*folders: Path) -> str:
        assert shadowbench("report", *folders, "--format", "md", "-o", tmp_path / "table.md", "-q").code == 0
        return (tmp_path / "table.md").read_text(encoding="utf-8")

    return make


# The page


def test_a_page_shows_machine_command_assumptions_and_statuses(run_folder, page_of) -> None:
    page = page_of(run_folder(pictures=True)).replace("<wbr>", "")
    assert "shadowbench run stairs -t 'shadow-map:bias=&lt;b&gt;'" in page
    for told in ("A processor", "no camera: assumed one", "no light: assumed a sun", "finish+wall", SOFTWARE):
        assert told in page
    assert "unsupported: no receiver is a plane" in page and "failed: the worker died" in page
    (part,) = parts_of(page)
    assert len(part["rows"]) == len([cell for cell in CELLS if cell.status == "ok"])
    assert sum(row["front"] for row in part["rows"]) == 6
    row = next(row for row in part["rows"] if row["spec"] == "shadow-map" and row["map"] == 512)
    assert row["values"]["cost, ms"] == [5.0, "5.00"] and row["values"]["map"] == [512, "512"]
    assert row["values"]["1 − IoU"] == [pytest.approx(0.04), "0.0400"]
    assert all(set(part["columns"]) <= set(row["values"]) for row in part["rows"])


def test_the_verdict_and_the_matrix_are_in_the_page_itself(run_folder, page_of) -> None:
    page = page_of(run_folder()).replace("<wbr>", "")
    assert "<code>shadow-map at 2048</code> is the cheapest real-time setting, 20.0 ms a frame." in page
    (cells,) = re.findall(r'<tr><th scope="row">shadow-map</th>(.*?)</tr>', page, re.DOTALL)
    assert re.findall(r"<b>(.*?)</b>", cells) == ["5.00 ms", "20.0 ms", "–"]
    assert re.findall(r'class="(\w+)" aria', cells) == ["all", "all", "none"]
    nothing = page_of(run_folder(CELLS[-2:], name="nothing"))
    assert "Nothing here has a score." in nothing
    assert 'class="matrix"' not in nothing and "Nothing here was timed: the cost" not in nothing


def test_presets_say_what_they_stand_for(run_folder, page_of, markdown_of) -> None:
    spec, name = next((spec, name) for spec, name in preset_names().items() if name == "shadow-map:preset=course")
    folder = run_folder([*CELLS, Cell(spec, 512, 0.01, 3.0)])
    page = page_of(folder).replace("<wbr>", "")
    assert f"<dt>{name}</dt><dd><code>{spec}</code></dd>" in page
    assert f'title="{spec}[512]' in page, "the full spec, over the cell of the matrix"
    assert f"- `{name}`: `{spec}`\n" in markdown_of(folder)


def test_several_scenes_have_a_part_each_and_one_of_all(run_folder, page_of) -> None:
    parts = parts_of(page_of(run_folder(TWO, pictures=True)))
    assert [part["gallery"] is not None for part in parts] == [False, True, True]
    keys = [(row["spec"], row["map"]) for row in parts[0]["rows"]]
    assert len(keys) == len(set(keys)) == len(parts[1]["rows"]), "a line over all for each setting"
    assert {row["values"]["scenes"][1] for row in parts[0]["rows"]} == {"2 of 2"}


def test_the_times_of_two_machines_share_no_chart_column_or_verdict(run_folder, page_of) -> None:
    slow, fast = (Cell("a", 512, 0.004, ms, machine=machine) for machine, ms in (("m1", 50.0), ("m2", 5.0)))
    other = run_folder([fast], name="fast", software=False, processor="Another processor")
    page = page_of(run_folder([slow], name="slow"), other)
    assert "A processor" in page and "times of renderer of Another processor" in page
    parts = parts_of(page)
    assert [part["charts"]["front"]["data"]["values"][0]["cost"] for part in parts] == [50.0, 5.0]
    assert [[row["values"]["cost, ms"][0] for row in part["rows"]] for part in parts] == [[50.0], [5.0]]
    for found in (r'<div class="verdict".*?</div>', r'<table class="matrix">.*?</table>'):
        said = re.findall(found, page, re.DOTALL)
        assert [("50.0 ms" in one, "5.00 ms" in one) for one in said] == [(True, False), (False, True)]


def test_a_page_asks_nothing_of_a_network_and_counts_one_thing_as_one(run_folder, page_of) -> None:
    page = page_of(run_folder([Cell("a", 512, 0.1, 3.0)], pictures=True))
    markup = re.sub(r"<script.*?</script>", "", page, flags=re.DOTALL)
    assert not re.search(r'(?:src|href)="(?!data:|#)', markup) and "@import" not in markup and "url(" not in markup
    assert "1 cell on" in page and "1 cell, all that" in page
    assert not re.search(r"\b1 (cells|pictures|records|times|configurations)\b", page)


def test_every_cell_has_its_pictures_in_the_page(run_folder, page_of) -> None:
    folder = run_folder(pictures=True)
    (shown,) = galleries(page_of(folder))
    held = [cell for cell in CELLS if cell.status == "ok"]
    assert len(shown["cells"]) == len(held) and shown["notes"] == []
    assert all(re.fullmatch(r"shadowbench view \S+ --cell [0-9a-f]{24}", cell["command"]) for cell in shown["cells"])
    for cell in shown["cells"]:
        assert cell["mask"].startswith("data:image/webp;base64,") and cell["picture"] is None
    (view,) = shown["views"].values()
    assert list(shown["views"]) == ["camera, sun"]
    assert list(view) == ["truth", "undecided", "facets", "lit", "ambient"]
    assert all(image.startswith("data:image/webp;base64,") for image in view.values())
    for file in (folder / "truth").glob("*.lit.png"):
        file.unlink()
    (shown,) = galleries(page_of(folder))
    assert all(cell["picture"].startswith("data:image/webp;base64,") for cell in shown["cells"]), "without shading"


def test_missing_pictures_are_named(run_folder, page_of) -> None:
    folder = run_folder(pictures=True)
    for file in [*(folder / "pictures").iterdir(), *(folder / "truth").iterdir()]:
        file.unlink()
    (shown,) = galleries(page_of(folder))
    assert shown["notes"] == ["run has no truth and no shading for some of these cells."]
    page = page_of(run_folder(name="none"))
    assert galleries(page) == [] and "neither pictures/ nor masks/ of these cells" in page


def test_the_difference_is_signed() -> None:
    truth = np.array([[0, 1], [1, 0]], dtype=np.float32)
    mask = np.array([[1, 0], [1, 1]], dtype=np.float32)
    picture = difference(mask, truth, np.array([[False, False], [False, True]]))
    assert tuple(picture[0, 0]) == FALSE_LIGHT and tuple(picture[0, 1]) == FALSE_SHADOW
    grey = picture[1]
    assert (grey == grey[:, :1]).all() and grey[0, 0] > grey[1, 0], "also where it is undecided"


# A page whose data are scripts beside it


def delivered(folder: Path) -> dict[str, Any]:
    """The values of data files, by the names that they deliver."""
    found = [re.fullmatch(r"deliver\((\".*?\"), (.*)\);\n", file.read_text(), re.DOTALL) for file in folder.iterdir()]
    return {json.loads(one[1]): json.loads(one[2]) for one in found if one}


def test_a_split_page_has_the_same_data_in_files_beside_it(shadowbench, run_folder, page_of, tmp_path) -> None:
    run = run_folder(TWO, pictures=True)
    assert shadowbench("report", run, "-o", tmp_path / "split.html", "--split", "-q").code == 0
    files, text = delivered(tmp_path / "split.files"), (tmp_path / "split.html").read_text()
    assert {Path(name).parent.name for name in files} == {"split.files"} and "data:image" not in text

    def inlined(value: Any) -> Any:
        if isinstance(value, dict):
            return {name: inlined(part) for name, part in value.items()}
        if isinstance(value, list):
            return list(map(inlined, value))
        return inlined(files[value]) if isinstance(value, str) and value in files else value

    assert inlined(data_of(text)) == data_of(page_of(run))


def test_a_page_is_split_anew_and_other_files_are_kept(shadowbench, run_folder, tmp_path) -> None:
    run, page, files = run_folder(pictures=True), tmp_path / "report.html", tmp_path / "report.files"
    assert shadowbench("report", run, "-o", page, "--split").code == 0
    first = delivered(files)
    shutil.rmtree(run / "masks")
    assert shadowbench("report", run, "-o", page, "--split").code == 0
    assert delivered(files) != first
    (files / "mine.txt").write_text("mine")
    answer = shadowbench("report", run, "-o", page, "--split")
    assert answer.code == 2 and "report.files: found other files" in answer.err and answer.err.count("\n") == 1
    assert (files / "mine.txt").exists()


def test_a_large_page_says_what_to_do(shadowbench, run_folder, tmp_path, monkeypatch) -> None:
    run, page = run_folder(), tmp_path / "report.html"
    monkeypatch.setattr(command, "_LARGE", 1000)
    assert "with --split the pictures are files beside it" in shadowbench("report", run, "-o", page).err
    assert shadowbench("report", run, "-o", page, "--split").err == ""


# Other formats


def test_markdown_has_a_table_for_each_scene(run_folder, markdown_of) -> None:
    text = markdown_of(run_folder())
    assert f"## stairs, {SIDE}² view" in text and SOFTWARE in text
    assert "Bold: on the Pareto front" in text
    assert "| **`shadow-map`** | 512 | 0.0400 |" in text and "| `shadow-map:bias=none` | 1024 | 0.600 |" in text
    assert "- `planar-projection`: unsupported: no receiver is a plane" in text
    for table in re.findall(r"(?:^\|.*\n)+", text, re.MULTILINE):
        assert len({line.count("|") for line in table.splitlines()}) == 1


def test_soft_shadows_have_columns_of_their_own(run_folder, markdown_of) -> None:
    soft = [
        Cell("shadow-map", 512, 0.04, 10.0, rmse_pen=0.2),
        Cell("shadow-map:filter=pcf", 512, 0.05, 12.0, rmse_pen=0.1),
        Cell("sampled", None, 0.01, 90.0, rmse_pen=0.004),
    ]
    lines = markdown_of(run_folder(soft)).splitlines()
    head = next(index for index, line in enumerate(lines) if line.startswith("| spec |"))
    assert lines[head].startswith("| spec | map | RMSE | RMSE pen | IoU | SSIM | bleed |")
    assert "**`sampled`** |  | <0.00200 | <0.00800 | 0.990 |" in lines[head + 2]  # the truth cannot tell
    assert "**`shadow-map:filter=pcf`** | 512 | 0.0250 | 0.100 | 0.950 |" in lines[head + 3]
    assert "**`shadow-map`** | 512 | 0.0500 | 0.200 | 0.960 |" in lines[head + 4]


def test_csv_joins_the_cells_of_all_folders(run_folder, shadowbench, tmp_path) -> None:
    other = [Cell("shadow-map", 512, 0.1, 3.0, passes=(("moments", 1.0),))]
    folders = [run_folder(name="one"), run_folder(other, name="two", processor="Another processor")]
    assert shadowbench("report", *folders, "--format", "csv", "-o", tmp_path / "cells.csv").code == 0
    rows = list(csv.DictReader(io.StringIO((tmp_path / "cells.csv").read_text(encoding="utf-8"))))
    assert len(rows) == len(CELLS) + 1
    assert list(rows[0])[:4] == ["run", "processor", "software", "scene"]
    assert (rows[-1]["run"], rows[-1]["processor"], rows[-1]["pass_moments_ms"]) == ("two", "Another processor", "1.0")


def captions_in(folder: Path) -> dict[str, str]:
    return dict(re.findall(r"\*\*(.*?)\*\*: (.*)", (folder / "captions.md").read_text(encoding="utf-8")))


@pytest.mark.parametrize("form", ["png", "svg", "pdf"])
def test_figures_are_files_with_captions_apart(form, run_folder, shadowbench, tmp_path) -> None:
    folder = tmp_path / "figures"
    assert shadowbench("report", run_folder(pictures=True), "--format", form, "-o", folder).code == 0
    charts = [f"stairs.{SIDE}.{kind}.{form}" for kind in ("front", "passes", "sizes")]
    strip = f"stairs.{SIDE}.strip.png"
    captions = captions_in(folder)
    assert sorted(captions) == sorted(file.name for file in folder.glob("stairs*")) == sorted([*charts, strip])
    assert SOFTWARE in captions[charts[0]] and "shadow-map at 512 (IoU 0.96)" in captions[strip]
    assert not re.search(r"\. (medians|maps|scored)", captions[charts[0]])
    for file in charts:
        content = (folder / file).read_bytes()
        if form == "png":
            with Image.open(io.BytesIO(content)) as image:
                assert image.width > 1900 and len(image.getcolors(1 << 20)) > 20
        else:
            assert content.startswith({"svg": b"<svg", "pdf": b"%PDF"}[form])
            assert b">ms: time relative" not in content, "as a line of a title"


def test_a_strip_enlarges_the_place_that_is_most_wrong(run_folder, shadowbench, tmp_path) -> None:
    run = run_folder(pictures=True)
    truth = read_mask(next((run / "truth").glob(f"*.{SIDE}.png")))
    key = next(cell.key for cell in CELLS if (cell.spec, cell.map_size) == ("shadow-map", 1024))
    wrong = truth.copy()
    wrong[20:24, 12:16] = 1 - wrong[20:24, 12:16]
    write_mask(run / "masks" / f"{key}.png", wrong)
    options = ("--format", "svg", "-o", tmp_path / "figures", "--picture", "shadow-map at 1024")
    assert shadowbench("report", run, *options).code == 0
    strip = np.asarray(Image.open(tmp_path / "figures" / f"stairs.{SIDE}.strip.png"))
    assert strip.shape == (3 * SIDE + 16, 2 * SIDE + 8, 3), "truth and one setting"
    enlarged = strip[2 * SIDE + 16 :, SIDE + 8 :].astype(int)
    assert (abs(enlarged[..., 0] - enlarged[..., 2]) > 100).mean() == pytest.approx(16 / 64), "4² pixels of 8²"


def test_latex_has_a_table_for_each_scene_and_no_character_of_its_own(run_folder, shadowbench, tmp_path) -> None:
    file = tmp_path / "tables.tex"
    assert shadowbench("report", run_folder(TWO), "--format", "tex", "-o", file, "-q").code == 0
    text = file.read_text(encoding="utf-8")
    assert text.count(r"\begin{table}") == text.count(r"\end{table}") == 2
    assert rf"\caption{{Stairs, {SIDE}$^2$ view." in text and SOFTWARE in text
    assert r"\textbf{\texttt{shadow-map}} & 512 & 0.0400 &" in text
    rows = [line for line in text.splitlines() if line.endswith(r" \\")]
    assert len({line.count("&") for line in rows}) == 1
    assert text.isascii() and not re.search(r"(?<!\\)[%#_]", text.partition("\n")[2].replace("{table}", ""))


# The verdict in the terminal


@pytest.fixture
def told(shadowbench, run_folder, tmp_path) -> Callable[..., list[str]]:
    """The lines that `report` prints on folders, or on a run of cells, with single blanks between words."""

    def tell(*folders: Path, cells: Sequence[Cell] = ()) -> list[str]:
        answer = shadowbench("report", *(folders or [run_folder(cells)]), "-o", tmp_path / "report.html")
        assert (answer.code, answer.err) == (0, "")
        return [" ".join(line.split()) for line in answer.out.splitlines()]

    return tell


def test_the_verdict_names_the_cheapest_for_each_accuracy(told) -> None:
    lines = told(cells=CELLS)
    assert lines[:9] == [
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
    assert "report.html: 9 cells, " in lines[9] and len(lines) == 10


def test_a_run_without_a_technique_or_a_score_has_no_cheapest(told, run_folder) -> None:
    traced = told(cells=[cell for cell in CELLS if cell.spec == "ray-traced"])
    assert traced[:2] == ["No real-time technique here has a score.", ""]
    assert traced[3] == "ray-traced 60.0 ms 60.0 ms 60.0 ms"
    assert told(run_folder(CELLS[-2:], name="unscored"))[0] == "Nothing here has a score."


def test_the_verdict_over_scenes_counts_those_that_a_technique_supports(told) -> None:
    lamp = "unsupported: a lamp shines all round"
    cells = [
        *CELLS,
        Cell("shadow-map", 512, None, None, scene="lamp", status=lamp),
        Cell("cube-map", 512, 0.03, 7.0, scene="lamp"),
        Cell("cube-map", 1024, 0.005, 9.0, scene="lamp", ratio_iqr=0.3),
        Cell("shadow-volume", None, 0.0, 9.0, scene="lamp", ratio_iqr=0.3),
        Cell("ray-traced", None, 0.0, 60.0, scene="lamp"),
    ]
    lines = told(cells=cells)
    assert lines[4] == "lamp IoU ≥ 0.95 7.00 ms cube-map at 512"
    assert lines[5] == "IoU ≥ 0.99 9.00 ms shadow-volume, or 1 other within the noise", "the more accurate of the two"
    assert lines[8:11] == [
        "over 2 scenes IoU ≥ 0.95 IoU ≥ 0.99 IoU ≥ 0.999",
        "ray-traced 60.0 ms 60.0 ms 60.0 ms",
        "shadow-map 5.00 ms, 1 of 2 – –",
    ]
    assert lines[-2].endswith("n of 2: over the n that it supports.")


def test_of_two_machines_each_has_its_verdict(told, run_folder) -> None:
    faster = [replace(cell, ms=cell.ms and cell.ms / 2) for cell in CELLS]
    lines = told(run_folder(name="one"), run_folder(faster, name="two", software=False, processor="GPU"))
    heads = [lines.index("one, on renderer of A processor"), lines.index("two, on renderer of GPU")]
    assert [lines[head + 2] for head in heads] == [
        "stairs IoU ≥ 0.95 5.00 ms shadow-map at 512",
        "stairs IoU ≥ 0.95 2.50 ms shadow-map at 512",
    ]


def test_scenes_that_share_a_name_are_told_apart(told, run_folder) -> None:
    folder = run_folder([*CELLS, replace(CELLS[1], version=1)])
    *first, score, time = (folder / "rows.jsonl").read_text(encoding="utf-8").splitlines()
    score = score.replace(f'"view_size": {SIDE}', '"view_size": 64')
    (folder / "rows.jsonl").write_text("\n".join([*first, score, time]))
    lines = told(folder)
    assert lines[1].startswith(f"stairs, {SIDE}² view IoU ≥ 0.95 ") and lines[4].startswith(
        "stairs, 64² view IoU ≥ 0.95 "
    )


@pytest.mark.parametrize("width", [100, 80])
def test_the_verdict_on_three_scenes_fits_a_screen(run_folder, shadowbench, tmp_path, monkeypatch, width) -> None:
    monkeypatch.setattr(console.out(), "width", width)
    scenes = "room-with-lamp", "railings", "street"
    folder = run_folder([replace(cell, scene=scene) for scene in scenes for cell in CELLS])
    lines = shadowbench("report", folder, "-o", tmp_path / "report.html").out.splitlines()
    cost = next(line for line in lines if line.startswith("Cost: "))
    table = lines[: lines.index(cost)]
    assert len(table) + len(cost) // width + 1 <= 24
    assert max(map(len, table)) <= width


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (("nowhere",), "no such folder"),
        (("nowhere", "--format", "gif"), "--format: found 'gif'; allowed: html, md, csv, tex, png, svg, pdf"),
        (("nowhere", "--format", "md", "--split"), "--split: found --format md; allowed: html"),
        (("nowhere", "-o", "report.md"), "allowed: .html"),
        (("nowhere", "--format", "csv", "-o", "away/report.csv"), "cannot write into this folder"),
        ((), "Missing argument"),
    ],
)
def test_bad_input_is_one_line(arguments, said, shadowbench, tmp_path, monkeypatch) -> None:
    monkeypatch.chdir(tmp_path)
    answer = shadowbench("report", *arguments)
    assert answer.code == 2 and answer.err.count("\n") == 1 and said in answer.err
    assert list(tmp_path.iterdir()) == []


def test_cells_of_earlier_commands_are_counted_in_a_note(shadowbench, run_folder, tmp_path) -> None:
    last, *others = CELLS
    folder = run_folder()
    (folder / "table.csv").write_text(f"key\n{last.key}\n")
    words = ["report", folder, "--format", "md", "-o", tmp_path / "report.md"]
    note = f"{len(others)} of {len(CELLS)} cells are of earlier commands"
    answer = shadowbench(*words)
    assert (answer.code, answer.err) == (0, f"note: {folder}: {note}\n")
    quiet = shadowbench(*words, "--quiet")
    assert (quiet.out, quiet.err) == ("", "")
    (folder / "table.csv").write_text("key\n" + "".join(f"{cell.key}\n" for cell in CELLS))
    assert shadowbench(*words).err == ""
