"""Every fenced block of the README and of docs/ is run as it stands, on smaller views, and prints what the page shows.

Outputs are compared by kind: numbers, specs, keys and lists of metrics may differ, words may not, and lines may come in
another order. A line of `…` stands for lines left out. CONTRIBUTING.md has the rules for authors.
"""

import re
import shlex
import subprocess
import sys
import tomllib
from collections.abc import Callable, Sequence
from contextlib import nullcontext
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image

from shadowbench.api import load
from shadowbench.api import truth as ray_traced
from shadowbench.gl.device import Device
from shadowbench.plugin.registry import ENGINES, GROUP, own_techniques, techniques
from shadowbench.scores.metrics import METRICS
from shadowbench.studies.study import read_study

ROOT = Path(__file__).resolve().parents[1]
PAGES = [ROOT / "README.md", *sorted((ROOT / "docs").rglob("*.md"))]
FENCE = re.compile(r"(?m)^(?:<!-- not run: (?P<reason>.+) -->\n)?```(?P<language>.*)\n(?P<text>(?:.*\n)*?)```$")
MOST_NOT_RUN = 12
MOST_WORDS = 900  # of the README
BUILT = "{"  # begins the name of a directive, which the build of docs/ runs
LINE = "stairs  cascades:count=3  512  0.031 [0.029, 0.033]"  # of a page
SIZE = 128  # pixels along a side of the views
SMALLER = {  # by command, the largest values of options
    "run": ("--view-size", str(SIZE), "--rounds", "1"),
    **dict.fromkeys(("export", "render", "truth", "needs"), ("--view-size", str(SIZE))),
}
OTHER_PROGRAMS = {
    "pytest": [sys.executable, "-m", "pytest", "-p", "no:cacheprovider"],
    **{name: [name] for name in ("cut", "ls", "sed")},
}
TECHNIQUES = "|".join([*(one.name for one in own_techniques()), "my-shadows", "sphere-proxies"])
KINDS = [  # what may differ between two outputs of the same kind, and the word that stands for it
    (r"\b[0-9a-f]{8,}\b", "#"),
    (rf"\b({TECHNIQUES})(:[\w(][^\s;]*)?( at \d+)?(?=[\s;]|$)", "SPEC"),
    (rf"\b({'|'.join(sorted(METRICS, key=len, reverse=True))})\b", "METRIC"),
    (r"METRIC( METRIC)+", "METRIC"),
    (r"[~<>+-]?\d+([,.]\d+)*(e-?\d+)?", "#"),
    (r"\[#, #\]", "#"),
    (r"\b[kM]B\b", "B"),
    (r"#( #)+", "#"),
]


@dataclass(frozen=True)
class Block:
    """A fenced block of a page."""

    page: Path
    language: str
    text: str
    reason: str | None

    @property
    def place(self) -> str:
        """The page and the first line, for messages."""
        return f"{self.page.relative_to(ROOT)}: {self.text.splitlines()[0]}"


def blocks_of(page: Path) -> list[Block]:
    found = FENCE.finditer(page.read_text(encoding="utf-8"))
    return [Block(page, each["language"], each["text"], each["reason"]) for each in found]


BLOCKS = [block for page in PAGES for block in blocks_of(page) if not block.language.startswith(BUILT)]
RUN = [
    page
    for page in PAGES
    if page.name != "commands.md" and any(b.page == page and b.language in ("sh", "console") for b in BLOCKS)
]
"""Pages with commands; `commands.md` is compared with what its generator writes."""


def kind(line: str) -> str:
    """A line with everything that may differ replaced."""
    line = " ".join(line.split())
    for pattern, word in KINDS:
        line = re.sub(pattern, word, line)
    return line


def assert_same_kind(shown: Sequence[str], printed: Sequence[str], where: str) -> None:
    # Commands are run with fewer rounds than pages show, which a note says. Slow machines print their progress.
    printed = [line for line in printed if not re.match(r" *\w+: \d+( of \d+)?, ", line)]
    wanted, found = ({kind(line) for line in lines} - {""} for lines in (shown, printed))
    missing, extra = wanted - found - {"…"}, found - wanted if "…" not in wanted else set()
    assert not missing and not extra, f"{where}\nnot printed: {missing}\nnot shown: {extra}"


def commands_of(block: Block) -> list[tuple[list[str], list[str]]]:
    """The words of each command of a block, and the lines that it shows below."""
    if block.language == "sh":
        return [(shlex.split(line, comments=True), []) for line in block.text.splitlines()]
    parts = re.split(r"(?m)^\$ ", block.text)[1:]
    return [(shlex.split(lines[0], comments=True), lines[1:]) for lines in (part.splitlines() for part in parts)]


FIGURE = re.compile(r"(?<![\w.-])[~<]?(\d[\d,]*(?:\.\d+)?)(?![\w.]*\w)")
TUTORIALS = sorted((ROOT / "docs" / "tutorial").glob("*.md"))
WITH_FIGURES = [ROOT / "README.md", *TUTORIALS]
"""Pages of which no figure may be wrong; docs/explanation/choosing.md is generated."""


def figures(text: str) -> list[str]:
    """The numbers of a text, in order, without those inside of words, specs and keys."""
    return [figure.replace(",", "") for figure in FIGURE.findall(text)]


def same_figures(shown: str, printed: str) -> bool:
    """Whether two lines of one kind have the same numbers, but for what another processor rounds otherwise.

    That is two units of the last decimal, and of long integers a thousandth.
    """

    def same(one: str, other: str) -> bool:
        decimals = len(one.partition(".")[2])
        return abs(float(one) - float(other)) <= (2.001 * 10**-decimals if decimals else 0.001 * float(other))

    pairs = list(zip(figures(shown), figures(printed), strict=False))
    return (
        kind(shown) == kind(printed) and len(figures(shown)) == len(figures(printed)) and all(same(*p) for p in pairs)
    )


@pytest.mark.parametrize(
    ("shown", "printed", "same"),
    [
        ("iou 0.9967", "iou 0.9965", True),
        ("iou 0.9967", "iou 0.9867", False),
        ("map 1024", "map 1040", False),
        ("size 3391", "size 3392", True),
        ("0.38 ms", "0.41 ms", False),
        ("map 1024", "maps 1024", False),
    ],
)
def test_figures_are_the_same_but_for_rounding(shown: str, printed: str, same: bool) -> None:
    assert same_figures(shown, printed) == same


def smaller(words: Sequence[str]) -> list[str]:
    """A command of shadowbench on a small view."""
    kept, options = list(words), SMALLER.get(words[0], ()) if "--help" not in words else ()
    for name, value in zip(options[::2], options[1::2], strict=True):
        if name in kept:
            at = kept.index(name) + 1
            kept[at] = str(min(int(kept[at]), int(value)))
        else:
            kept += [name, value]
    return kept


def write_model(file: Path) -> None:
    """A torus as OBJ."""
    mesh = load("sphere-and-torus").meshes[-1]
    lines = [f"v {x} {y} {z}" for x, y, z in mesh.vertices] + [f"f {a} {b} {c}" for a, b, c in mesh.faces + 1]
    file.write_text("\n".join(lines), encoding="utf-8")


def write_screenshots(folder: Path) -> None:
    """What a renderer with every kind of error draws of `stairs`: lit, shadowed and an upside-down mask."""
    truth, random = ray_traced("stairs", view_size=SIZE), np.random.default_rng(7)
    drawn = np.maximum(np.roll(truth.visibility, 1, axis=1), 0.66)  # of sRGB levels: a shadow of 0.38
    drawn[truth.blocker < 0.015 * truth.diagonal] = 1.0
    drawn[random.random(drawn.shape) < 0.002] = 0.0
    light = np.where(random.random(drawn.shape) < 0.01, 0.0, 180.0)
    folder.mkdir(exist_ok=True)
    for name, levels in (("lit", light), ("shadowed", light * drawn)):
        Image.fromarray(levels.astype(np.uint8)).save(folder / f"{name}.png")
    Image.fromarray((255 * truth.visibility[::-1]).astype(np.uint8)).save(folder.parent / "upside-down.png")


@pytest.fixture
def desk(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A working folder with what the pages take for granted: the repository's folders, a model, screenshots."""
    folder = tmp_path / "desk"
    folder.mkdir()
    for name in ("docs", "examples"):
        (folder / name).symlink_to(ROOT / name)
    for name in ("my-model", "armadillo", "post"):
        write_model(folder / f"{name}.obj")
    Image.fromarray(np.array([[0, 255]], np.uint8)).save(folder / "leaf.png")
    (folder / "study.toml").write_text('scenes = ["stairs"]\n[[technique]]\nspec = "unshadowed"\n', encoding="utf-8")
    write_screenshots(folder / "shots")
    monkeypatch.chdir(folder)
    monkeypatch.setenv("COLUMNS", "80")
    return folder


def test_every_block_says_what_it_is() -> None:
    assert {block.language for block in BLOCKS} <= {"sh", "console", "python", "toml", "text", "gdscript"}
    assert all(block.reason for block in BLOCKS if block.language == "gdscript")
    for page in PAGES:
        text, found = page.read_text(encoding="utf-8"), blocks_of(page)
        assert len(re.findall(r"(?m)^\s*```", text)) == 2 * len(found), page
        assert text.count("<!-- not run") == sum(block.reason is not None for block in found), page


@pytest.mark.parametrize(
    ("shown", "printed", "same"),
    [
        ([LINE], ["stairs  shadow-map:size=64   32  0.25 [0.2, 0.3]"], True),
        ([LINE], ["street  shadow-map:size=64   32  0.25"], False),
        ([LINE, "…"], ["stairs  shadow-mop:size=64   32  0.25"], False),
        (["a", "…"], ["b", "a"], True),
        (["a"], ["b", "a"], False),
    ],
)
def test_numbers_and_specs_may_differ_and_words_may_not(shown: list[str], printed: list[str], same: bool) -> None:
    with nullcontext() if same else pytest.raises(AssertionError):
        assert_same_kind(shown, printed, "test")


def test_the_readme_is_short_and_few_blocks_are_not_run() -> None:
    assert len((ROOT / "README.md").read_text(encoding="utf-8").split()) <= MOST_WORDS
    not_run = [f"{block.place} ({block.reason})" for block in BLOCKS if block.reason]
    assert len(not_run) <= MOST_NOT_RUN, not_run


def test_python_is_a_file_that_the_page_names_or_stands_on_a_page_that_is_a_script() -> None:
    python = [block for block in BLOCKS if block.language == "python"]
    others = {block.page.name for block in python if not block.text.startswith("# test_")}
    assert others == {"api.md", "python.md"}  # tests/test_python.py runs them


@pytest.mark.parametrize("block", [b for b in BLOCKS if b.language == "toml"], ids=lambda block: block.page.stem)
def test_toml_is_a_scene_or_a_study_or_registers_a_technique(block: Block, desk: Path) -> None:
    table, file = tomllib.loads(block.text), desk / "shown.toml"
    file.write_text(block.text, encoding="utf-8")
    if "technique" in table:
        assert read_study(file, techniques()).specs
    elif "mesh" in table:
        assert load(file).name == table.get("name", "shown")
    else:
        assert {*table["project"]["entry-points"]} <= {GROUP, ENGINES}


@pytest.mark.slow
@pytest.mark.parametrize("page", [page for page in RUN if page not in TUTORIALS], ids=lambda page: page.stem)
def test_the_commands_of_a_page_print_what_it_shows(
    page: Path, shadowbench: Callable[..., Any], desk: Path, only_device: Device
) -> None:
    if not only_device.software:
        pytest.skip("the pages show what a software renderer prints, which ranks by work")
    for block in (block for block in BLOCKS if block.page == page and block.reason is None):
        if block.language == "python" and block.text.startswith("# test_"):
            (desk / block.text.splitlines()[0].removeprefix("# ")).write_text(block.text, encoding="utf-8")
        for (program, *words), shown in commands_of(block) if block.language in ("sh", "console") else ():
            if program == "shadowbench":
                answer = shadowbench(*smaller(words))
                code, printed = answer.code, (answer.err + answer.out).replace(f"{desk}/", "").splitlines()
                if words[0] == "export" and "--help" not in words:
                    write_screenshots(Path(words[2]))
            else:
                done = subprocess.run([*OTHER_PROGRAMS[program], *words], capture_output=True, text=True, check=False)
                code, printed = done.returncode, (done.stderr + done.stdout).splitlines()
            if block.language == "sh":
                assert code == 0, (block.place, words, printed)
            else:
                assert_same_kind(shown, printed, f"{block.place}: {shlex.join(words)}")


@pytest.mark.slow
@pytest.mark.parametrize("page", [*TUTORIALS, ROOT / "docs/explanation/choosing.md"], ids=lambda page: page.stem)
def test_a_tutorial_shows_the_numbers_that_its_commands_print(
    page: Path, shadowbench: Callable[..., Any], desk: Path, shared_scenes: Path, only_device: Device
) -> None:
    if not only_device.software:
        pytest.skip("the pages show what a software renderer prints")
    (desk / "my-model.obj").unlink()
    (desk / "my-model.obj").symlink_to(shared_scenes.resolve() / "armadillo.obj")
    for block in (block for block in BLOCKS if block.page == page and block.language == "console"):
        for (_, *words), shown in commands_of(block):
            answer = shadowbench(*words)
            printed = (answer.err + answer.out).splitlines()
            for line in shown:
                assert line == "…" or any(same_figures(line, one) for one in printed), (
                    f"{block.place}: {line}\n{printed}"
                )


@pytest.mark.parametrize("page", WITH_FIGURES, ids=lambda page: page.stem)
def test_every_figure_in_the_prose_of_a_tutorial_stands_in_an_output_or_a_command(page: Path) -> None:
    prose = re.sub(r"\]\([^)]*\)", "]", FENCE.sub("", page.read_text(encoding="utf-8")))
    code = [*(block.text for block in blocks_of(page)), *re.findall(r"`[^`]+`", prose)]
    known = {figure for text in code for split in (text, re.sub("[=,×²`]", " ", text)) for figure in figures(split)}
    lines = [re.sub(r"`[^`]+`|²|^#.*|^\*\*\d\.", " ", line) for line in prose.splitlines()]
    assert [(line, figure) for line in lines for figure in figures(line) if figure not in known] == []
