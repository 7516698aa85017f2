"""Measured tables and pictures of the documentation say which command made them, and with which versions."""

import re
from pathlib import Path

import ages
import pytest

PICTURE = re.compile(r"!\[[^\]]*\]\(([^)]*\.png)\)")
DECIMAL = re.compile(r"(?<![\w.])\d+\.\d+(?![\w.]*\.)")
DEFINED = {"axes.md", "install.md", "metrics.md"}  # their tables have decimals which nobody measured
CODE = re.compile(r"`[^`]*`|\]\([^)]*\)")


def measured_tables(page: Path) -> list[int]:
    """The first lines of tables in more than half of whose rows decimals stand outside code, counted from 0."""
    lines, found, start = [*ages.prose(page).splitlines(), ""], [], None
    for number, line in enumerate(lines):
        if line.startswith("|"):
            start = number if start is None else start
        elif start is not None:
            rows = lines[start + 2 : number]
            if len(rows) < 2 * sum(bool(DECIMAL.search(CODE.sub("", row))) for row in rows):
                found.append(start)
            start = None
    return found


def test_every_measured_table_names_its_command() -> None:
    without = [
        f"{page.relative_to(ages.ROOT)}:{table + 1}"
        for page in ages.pages()
        if page.name not in DEFINED
        for table in measured_tables(page)
        if not any(table in one.lines for one in ages.records(page))
    ]
    assert without == []


def test_every_picture_names_its_command_on_a_page_that_shows_it() -> None:
    recorded = {
        (page.parent / name).resolve()
        for page in ages.pages()
        for one in ages.records(page)
        for name in PICTURE.findall("\n".join(ages.prose(page).splitlines()[one.lines.start : one.lines.stop]))
    }
    pictures = set((ages.ROOT / "docs" / "pictures").rglob("*.png"))
    assert len(pictures) > 30 and pictures - recorded == set()


@pytest.fixture
def page(tmp_path: Path) -> Path:
    file = tmp_path / "page.md"
    made = ages.record("shadowbench run -s filters", ["shadow-map"])
    file.write_text(f"# A\n\n## B\n{made}\n```sh\n# no heading\n```\n### C\n## D\n", encoding="utf-8")
    return file


def test_a_record_holds_until_the_next_heading_of_its_level(page: Path) -> None:
    (found,) = ages.records(page)
    assert (found.command, found.lines) == ("shadowbench run -s filters", range(3, 8)) and found.changes == ""


@pytest.mark.parametrize(
    ("was", "other", "said"),
    [
        (r"score \d+", "score 0", "score 0, now"),
        (r"shaders \w+", "shaders 0a1b2c3d", "shaders 0a1b2c3d, now"),
        (r"draw.*?(?=, \d{4}-)", "unrecorded", "before versions were recorded"),
        (r"draw.*?, \d{4}(?=-)", "times, 2001", "later commits"),
    ],
)
def test_what_changed_since_is_said(page: Path, was: str, other: str, said: str) -> None:
    page.write_text(re.sub(was, other, page.read_text(encoding="utf-8")), encoding="utf-8")
    (found,) = ages.records(page)
    assert said in found.changes


def test_a_figure_made_again_is_current_and_a_malformed_record_is_refused(page: Path) -> None:
    page.write_text(page.read_text(encoding="utf-8").replace("score ", "score 9"), encoding="utf-8")
    ages.renew(page, "shadowbench run -s filters", ["shadow-map"])
    (found,) = ages.records(page)
    assert found.changes == ""
    page.write_text(f"{ages.START}'a command' -->", encoding="utf-8")
    with pytest.raises(SystemExit, match=r"page\.md:1: found"):
        list(ages.records(page))
