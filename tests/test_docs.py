"""The documentation agrees with the code, and its links are valid."""

import math
import re
import shutil
import subprocess
import sys
from importlib import import_module
from pathlib import Path
from typing import Any

import pytest
from pages import compare

ROOT = Path(__file__).resolve().parents[1]
PAGES = [*sorted(ROOT.glob("*.md")), *sorted((ROOT / "docs").rglob("*.md"))]
INCLUDED = re.compile(r"(?m)^```\{include\} (.+)$")
GENERATED = ("technique_docs", "reference_docs", "choosing_page")  # others have tests of their own
TECHNIQUES = ROOT / "docs" / "reference" / "techniques"


def page(technique: str) -> str:
    return (TECHNIQUES / f"{technique}.md").read_text(encoding="utf-8")


def anchors(file: Path) -> set[str]:
    """The anchors of a page's headings, and of those of the page that it includes."""
    text = file.read_text(encoding="utf-8")
    included = [anchor for name in INCLUDED.findall(text) for anchor in anchors(file.parent / name)]
    headings = re.findall(r"^#+ (.+)$", text, re.MULTILINE)
    return {re.sub(r"[^\w -]", "", heading.lower()).replace(" ", "-") for heading in headings} | set(included)


def build(docs: Path, site: Path) -> subprocess.CompletedProcess[str]:
    """What `make docs` does, into another folder."""
    options = ["-W", "--keep-going", "-n", "-q", "-d", site / "doctrees"]
    command = [sys.executable, "-m", "sphinx", *options, docs, site / "html"]
    return subprocess.run(command, capture_output=True, text=True, check=False)


@pytest.mark.parametrize("tool", GENERATED)
def test_generated_pages_are_up_to_date(tool: str, monkeypatch: pytest.MonkeyPatch, capsys: Any) -> None:
    monkeypatch.setenv("COLUMNS", "80")
    monkeypatch.setattr(sys, "argv", [f"{tool}.py", "--check"])
    assert import_module(tool).main() == 0, capsys.readouterr()


def test_a_changed_default_makes_the_page_stale_and_a_changed_number_does_not(tmp_path: Path) -> None:
    made, file = page("shadow-map"), tmp_path / "shadow-map.md"
    assert compare(file, made) == 1
    file.write_text(made, encoding="utf-8")
    assert compare(file, made) == 0
    measured = re.sub(r"(?m)^(Measured .*IoU )\S+,", r"\g<1>0.1234,", made)
    assert measured != made and compare(file, measured) == 0
    default = made.replace("`1024`", "`2048`", 1)
    assert default != made and compare(file, default) == 1


def test_every_link_leads_to_a_file_and_a_heading() -> None:
    for file in PAGES:
        text = re.sub(r"```.*?```", "", file.read_text(encoding="utf-8"), flags=re.DOTALL)
        links = [link for link in re.findall(r"\]\(([^)\s]+)\)", text) if not link.startswith(("http://", "https://"))]
        for link in links:
            path, _, anchor = link.partition("#")
            there = (file.parent / path).resolve() if path else file
            assert there.exists(), (file, link)
            assert not anchor or anchor in anchors(there), (file, link)


FIRST, COLUMNS = 50, 90  # lines before the first example, and characters of a line: less than two screens
EXAMPLE = re.compile(r"(?m)^```|!\[|<img ")
LIST = "changelog.md"


def test_a_page_shows_an_example_within_two_screens() -> None:
    for file in (page for page in PAGES if page.name.lower() != LIST):
        text = INCLUDED.sub(
            lambda name, folder=file.parent: (folder / name[1]).read_text(encoding="utf-8"),
            file.read_text(encoding="utf-8"),
        )
        text = re.sub(r"(?ms)^```\{(toctree|eval-rst)\}.*?^```$", "", text)
        example = EXAMPLE.search(text)
        assert example, file
        above = text[: example.start()].splitlines()
        assert sum(max(1, math.ceil(len(line) / COLUMNS)) for line in above) <= FIRST, file


def test_every_picture_is_shown_on_a_page() -> None:
    shown = "".join(file.read_text(encoding="utf-8") for file in PAGES)
    assert [file.name for file in (ROOT / "docs").rglob("*.png") if file.name not in shown] == []


SEARCHES = {
    "place a camera": "Mesh files",
    "lamp": "Choosing a technique",
    "foliage": "Gallery of artefacts",
    "LaTeX": "See what accuracy costs",
    "my GPU": "What shadows cost",
    "notebook": "Notebooks",
    "held out": "Held-out scenes: report what was not tuned for",
    "blocky": "Gallery of artefacts",
    "texel bias": "Biases",
}


@pytest.mark.slow
def test_the_site_is_built_without_a_warning_and_can_be_searched_from_a_disk(tmp_path: Path) -> None:
    done = build(ROOT / "docs", tmp_path)
    assert done.returncode == 0, done.stderr
    from tests.reports.browsing import chromium  # playwright, of slow tests alone

    with chromium() as browser:
        tab = browser.new_page()
        for words, expected in SEARCHES.items():
            tab.goto((tmp_path / "html" / "search.html").as_uri() + "?q=" + words.replace(" ", "+"))
            tab.locator("#search-results li a", has_text=expected).first.wait_for()


@pytest.mark.slow
@pytest.mark.parametrize("link", ["[a heading](#missing)", "![a picture](missing.png)"])
def test_a_link_that_leads_nowhere_fails_the_build(tmp_path: Path, link: str) -> None:
    docs = tmp_path / "docs"
    docs.mkdir()
    shutil.copy(ROOT / "docs" / "conf.py", docs)
    shutil.copytree(ROOT / "docs" / "_templates", docs / "_templates")
    (docs / "index.md").write_text(f"# Title\n\n{link}\n", encoding="utf-8")
    done = build(docs, tmp_path)
    assert done.returncode == 1 and "missing" in done.stderr, done.stderr
