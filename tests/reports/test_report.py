"""`report` as a command: every format, the verdict in the terminal, and notes on missing data."""

import csv
import io
import re
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import pytest
from PIL import Image

from shadowbench.plugin.registry import preset_names
from tests.reports.conftest import CELLS, POINTS, SIDE, Cell, galleries, parts_of

SOFTWARE = "for trends only, not representative of a GPU"
TWO = [replace(cell, scene=scene) for scene in ("stairs", "terrace") for cell in CELLS]


@pytest.fixture
def text_of(shadowbench, tmp_path) -> Callable[..., str]:
    """The report of folders in a format that is text."""

    def make(form: str, *folders: Path) -> str:
        assert shadowbench("report", *folders, "--format", form, "-o", tmp_path / f"table.{form}", "-q").code == 0
        return (tmp_path / f"table.{form}").read_text(encoding="utf-8")

    return make


# The page


def test_a_page_shows_machine_command_assumptions_statuses_and_the_verdict(run_folder, page_of) -> None:
    page = page_of(run_folder(pictures=True)).replace("<wbr>", "")
    words = ("A processor", "no camera: assumed one", "no light: assumed a sun", "finish+wall", SOFTWARE)
    statuses = ("unsupported: no receiver is a plane", "failed: the worker died")
    for text in ("shadowbench run stairs -t 'shadow-map:bias=&lt;b&gt;'", *words, *statuses):
        assert text in page
    assert "<code>shadow-map at 2048</code> is the cheapest real-time setting, 20.0 ms a frame." in page
    (cells,) = re.findall(r'<tr><th scope="row">shadow-map</th>(.*?)</tr>', page, re.DOTALL)
    assert re.findall(r"<b>(.*?)</b>", cells) == ["5.00 ms", "20.0 ms", "–"]
    (part,) = parts_of(page)
    assert len(part["rows"]) == len([cell for cell in CELLS if cell.status == "ok"])
    row = next(row for row in part["rows"] if row["spec"] == "shadow-map" and row["map"] == 512)
    assert row["values"]["cost, ms"] == [5.0, "5.00"] and row["values"]["map"] == [512, "512"]
    assert row["values"]["1 − IoU"] == [pytest.approx(0.04), "0.0400"]
    assert all(set(part["columns"]) <= set(row["values"]) for row in part["rows"])
    assert "Nothing here has a score." in page_of(run_folder(CELLS[-2:], name="nothing"))


def test_presets_say_what_they_stand_for(run_folder, page_of, text_of) -> None:
    spec, name = next((spec, name) for spec, name in preset_names().items() if name == "shadow-map:preset=course")
    folder = run_folder([*CELLS, Cell(spec, 512, 0.01, 3.0)])
    page = page_of(folder).replace("<wbr>", "")
    assert f"<dt>{name}</dt><dd><code>{spec}</code></dd>" in page
    assert f'title="{spec}[512]' in page, "the full spec, over the cell of the matrix"
    assert f"- `{name}`: `{spec}`\n" in text_of("md", folder)


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
    parts = parts_of(page)
    assert [part["charts"]["front"]["data"]["values"][0]["cost"] for part in parts] == [50.0, 5.0]
    assert [[row["values"]["cost, ms"][0] for row in part["rows"]] for part in parts] == [[50.0], [5.0]]
    for found in (r'<div class="verdict".*?</div>', r'<table class="matrix">.*?</table>'):
        said = re.findall(found, page, re.DOTALL)
        assert [("50.0 ms" in one, "5.00 ms" in one) for one in said] == [(True, False), (False, True)]


def test_a_page_asks_nothing_of_a_network(run_folder, page_of) -> None:
    page = page_of(run_folder([Cell("a", 512, 0.1, 3.0)], pictures=True))
    markup = re.sub(r"<script.*?</script>", "", page, flags=re.DOTALL)
    assert not re.search(r'(?:src|href)="(?!data:|#)', markup) and "@import" not in markup and "url(" not in markup
    assert not re.search(r"\b1 (cells|pictures|records|times|configurations)\b", page)


def test_every_cell_has_its_pictures_in_the_page_and_missing_ones_are_named(run_folder, page_of) -> None:
    folder = run_folder(pictures=True)
    (shown,) = galleries(page_of(folder))
    assert len(shown["cells"]) == len([cell for cell in CELLS if cell.status == "ok"]) and shown["notes"] == []
    for cell in shown["cells"]:
        assert re.fullmatch(r"shadowbench view \S+ --cell [0-9a-f]{24}", cell["command"])
        assert cell["mask"].startswith("data:image/webp;base64,") and cell["picture"] is None
    assert [*shown["views"]["camera, sun"]] == ["truth", "undecided", "facets", "lit", "ambient"]
    for file in (folder / "truth").iterdir():
        file.unlink()
    (shown,) = galleries(page_of(folder))
    assert all(cell["picture"].startswith("data:image/webp;base64,") for cell in shown["cells"]), "without shading"
    page = page_of(run_folder(name="none"))
    assert galleries(page) == [] and "neither pictures/ nor masks/ of these cells" in page


# Other formats


def test_markdown_has_a_table_for_each_scene(run_folder, text_of) -> None:
    text = text_of("md", run_folder())
    assert f"## stairs, {SIDE}² view" in text and SOFTWARE in text
    assert "Bold: on the Pareto front" in text
    assert "| **`shadow-map`** | 512 | 0.0400 |" in text and "| `shadow-map:bias=none` | 1024 | 0.600 |" in text
    assert "- `planar-projection`: unsupported: no receiver is a plane" in text
    for table in re.findall(r"(?:^\|.*\n)+", text, re.MULTILINE):
        assert len({line.count("|") for line in table.splitlines()}) == 1
    soft = Cell("shadow-map", 512, 0.04, 10.0, rmse_pen=0.2), Cell("sampled", None, 0.01, 90.0, rmse_pen=0.004)
    text = text_of("md", run_folder(soft, name="soft"))
    assert "| spec | map | RMSE | RMSE pen | IoU | SSIM | bleed |" in text
    assert "| **`sampled`** |  | <0.00200 | <0.00800 | 0.990 |" in text, "the truth cannot tell"


def test_csv_joins_the_cells_of_all_folders(run_folder, sweep_folder, text_of) -> None:
    other = [Cell("shadow-map", 512, 0.1, 3.0, passes=(("moments", 1.0),))]
    folders = [run_folder(name="one"), run_folder(other, name="two", processor="Another processor"), sweep_folder()]
    rows = list(csv.DictReader(io.StringIO(text_of("csv", *folders))))
    assert len(rows) == len(CELLS) + 1 + len(POINTS)
    assert list(rows[0])[:4] == ["run", "processor", "software", "scene"]
    two = rows[len(CELLS)]
    assert (two["run"], two["processor"], two["pass_moments_ms"]) == ("two", "Another processor", "1.0")
    (one,) = [row for row in rows if (row["axis"], row["axis_value"], row["acne"]) == ("elevation", "0.2", "0.25")]
    assert (one["run"], one["failure"], one["range"]) == ("sweep", "acne 25.00%", "breaks at 0.2°: acne 25.00%")


def test_latex_has_a_table_for_each_scene_and_no_character_of_its_own(run_folder, text_of) -> None:
    text = text_of("tex", run_folder(TWO))
    assert text.count(r"\begin{table}") == text.count(r"\end{table}") == 2
    assert rf"\caption{{Stairs, {SIDE}$^2$ view." in text and SOFTWARE in text
    assert r"\textbf{\texttt{shadow-map}} & 512 & 0.0400 &" in text
    rows = [line for line in text.splitlines() if line.endswith(r" \\")]
    assert len({line.count("&") for line in rows}) == 1
    assert text.isascii() and not re.search(r"(?<!\\)[%#_]", text.partition("\n")[2].replace("{table}", ""))


@pytest.mark.parametrize("form", ["png", "svg", "pdf"])
def test_figures_are_files_with_captions_apart(form, run_folder, sweep_folder, shadowbench, tmp_path) -> None:
    folder = tmp_path / "figures"
    swept = sweep_folder([one for one in POINTS if one.axis == "mesh"])
    assert shadowbench("report", run_folder(), swept, "--format", form, "-o", folder).code == 0
    charts = [f"stairs.{SIDE}.{kind}.{form}" for kind in ("front", "passes", "sizes")]
    captions = dict(re.findall(r"\*\*(.*?)\*\*: (.*)", (folder / "captions.md").read_text(encoding="utf-8")))
    assert sorted(captions) == sorted([*charts, f"stability.mesh.{form}"])
    assert SOFTWARE in captions[charts[0]]
    for file in captions:
        content = (folder / file).read_bytes()
        if form == "png":
            with Image.open(io.BytesIO(content)) as image:
                assert image.width > 300 and len(image.getcolors(1 << 20)) > 20
        else:
            assert content.startswith({"svg": b"<svg", "pdf": b"%PDF"}[form])
            assert b">ms: time relative" not in content, "as a line of a title"


# The verdict in the terminal


def test_the_verdict_of_each_machine_is_printed(shadowbench, run_folder, tmp_path) -> None:
    faster = [replace(cell, ms=cell.ms and cell.ms / 2) for cell in CELLS]
    folders = run_folder(name="one"), run_folder(faster, name="two", software=False, processor="GPU")
    lines = shadowbench("report", *folders, "--format", "md", "-o", tmp_path / "a.md").out.splitlines()
    heads = [lines.index("one, on renderer of A processor"), lines.index("two, on renderer of GPU")]
    for head, ms in zip(heads, ("20.0", "10.0"), strict=True):
        assert f"`shadow-map at 2048` is the cheapest real-time setting, {ms} ms a frame." in lines[head + 1]


BAD = (
    (("nowhere",), "no such folder"),
    (("nowhere", "--format", "gif"), "--format: found 'gif'; allowed: html, md, csv, tex, png, svg, pdf"),
    (("nowhere", "-o", "report.md"), "allowed: .html"),
    (("nowhere", "--format", "csv", "-o", "away/report.csv"), "cannot write into this folder"),
    ((), "Missing argument"),
)


def test_bad_input_is_one_line_and_cells_of_earlier_commands_are_a_note(
    shadowbench, run_folder, tmp_path, monkeypatch
) -> None:
    monkeypatch.chdir(tmp_path)
    for arguments, said in BAD:
        answer = shadowbench("report", *arguments)
        assert answer.code == 2 and answer.err.count("\n") == 1 and said in answer.err
    assert list(tmp_path.iterdir()) == []
    folder = run_folder(about={"keys": [CELLS[0].key]})
    words = ["report", folder, "--format", "md", "-o", "report.md"]
    note = f"note: {folder}: {len(CELLS) - 1} of {len(CELLS)} cells are of earlier commands\n"
    assert shadowbench(*words).err == note and shadowbench(*words, "--quiet").err == ""
