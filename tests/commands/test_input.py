"""Invalid command lines: exit code 2, and one line with what was found, where, and what is allowed."""

import errno
import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from PIL import Image

pytestmark = pytest.mark.filterwarnings("error")

SCENE = '[light]\nkind = "directional"\ndirection = [0.5, -1, 0.2]\n[[mesh]]\nshape = "box"\n'
CAMERA = "[camera]\nposition = [0, 1, 5]\ntarget = [0, 0, 0]\n"


PYDANTIC = re.compile(
    r"Field required|should (be|have|match)|Value error|Unable to parse|validation|valid (string|integer|list|dict)"
)

FILES = {
    "unknown.toml": CAMERA + SCENE + "colour = 3\n",
    "away.toml": CAMERA.replace("target = [0, 0, 0]", "target = [0, 1, 9]") + SCENE,
    "range.toml": CAMERA + "fov_y = 180\n" + SCENE,
    "good.toml": CAMERA + SCENE,
    "sky.toml": CAMERA + SCENE.replace("[[mesh]]", "angular_radius = 90\n[[mesh]]"),
    "broken.py": "def technique(:\n",
    "nameless.py": "from shadowbench.plugin.base import Technique\n\nclass Nameless(Technique):\n    pass\n",
    "text.toml": 'scenes = ["cube-on-plane"]\nrounds = "many"\n',
    "sizes.toml": 'scenes = ["cube-on-plane"]\nmap_size = [512, 70000]\n',
}

OF_A_SCENE = [
    ["run", "cube-on-plane", "-t", "unshadowed", "-o", "{out}"],
    ["truth", "cube-on-plane", "-o", "{out}.npz"],
    ["render", "cube-on-plane", "-t", "unshadowed", "-o", "{out}.png"],
    ["export", "cube-on-plane", "{out}"],
    ["score", "cube-on-plane", "{in}/white.png"],
    ["needs", "cube-on-plane"],
    ["recommend", "cube-on-plane", "-o", "{out}"],
]
RUN = OF_A_SCENE[0]
CASES: dict[str, tuple[list[str], list[str]]] = {
    "a part of none": (["run", "stairs", "--part", "0/0", "-o", "{out}"], ["--part", "'0/0'", "K/N"]),
    "a folder to merge that is no run": (["merge", "{in}", "-o", "{out}"], ["no rows.jsonl", "shadowbench run"]),
    "a missing scene file": (["run", "{in}/gone.toml", "-o", "{out}"], ["gone.toml", "no such file"]),
    "a value out of range": (["run", "{in}/range.toml", "-o", "{out}"], ["range.toml", "fov_y", "180"]),
    "a camera that shows nothing": (
        ["run", "{in}/away.toml", "-t", "unshadowed", "--view-size", "16", "-o", "{out}"],
        ["camera 'camera'", "away", "shows nothing"],
    ),
    "a view of no width": ([*RUN, "--view-size", "0x64"], ["view_size", "'0x64'", "1280x720"]),
    "a view of three sides": ([*OF_A_SCENE[1], "--view-size", "8x8x8"], ["view_size", "'8x8x8'", "1 to 16384"]),
    "map size 0": ([*RUN, "--map-size", "0"], ["--map-size", "'0'", "from 1"]),
    "a map beyond the driver": ([*RUN, "-t", "shadow-map", "--map-size", "65536"], ["map size 65536", "allows 1 to"]),
    "an option before the command": (["-q", "run"], ["-q", "--help lists what is allowed"]),
    "an unknown option": ([*RUN, "--fast"], ["--fast"]),
    "no scene": (["truth", "-o", "{out}.npz"], ["SCENE"]),
    "an unknown view": ([*RUN, "--view", "low"], ["'low'", "camera"]),
    "an unknown sequence": ([*RUN, "--sequence", "doly"], ["--sequence", "'doly'; did you mean 'dolly'"]),
    "frames of no sequence": ([*RUN, "--frames", "8"], ["frames 8: is for a sequence, which is not given"]),
    "words for a number in a study": (
        ["run", "-s", "{in}/text.toml", "-o", "{out}"],
        ["text.toml: rounds: found 'many'; allowed: a whole number"],
    ),
    "the second of two sizes in a study": (
        ["run", "-s", "{in}/sizes.toml", "-o", "{out}"],
        ["sizes.toml: map_size 2: found 70000; allowed: less than or equal to 65536"],
    ),
    "a broken plug-in": ([*RUN, "--plugin", "{in}/broken.py"], ["--plugin", "broken.py", "SyntaxError"]),
    "a plug-in without a name": ([*RUN, "--plugin", "{in}/nameless.py"], ["--plugin", "Nameless", "name"]),
    "an output that is a file": (
        ["run", "cube-on-plane", "-t", "unshadowed", "--view-size", "16", "-o", "{in}/good.toml"],
        ["good.toml", "cannot be written"],
    ),
    "a truth into nowhere": (["truth", "cube-on-plane", "-o", "{out}/none/t.npz"], ["none", "cannot write"]),
    "a picture and a mask in one file": (
        ["render", "cube-on-plane", "-t", "unshadowed", "-o", "{out}.png", "--mask", "{out}.png"],
        ["out.png", "twice"],
    ),
    "a picture that is no PNG": (
        ["render", "cube-on-plane", "-t", "unshadowed", "-o", "{out}.jpg"],
        ["out.jpg", "found", "'.jpg'", "allowed: .png"],
    ),
    "tint of a technique without": (
        ["render", "cube-on-plane", "-t", "shadow-map", "--tint", "-o", "{out}.png"],
        ["--tint", "shadow-map", "cascades"],
    ),
    "a picture that is unsupported": (
        ["render", "room-with-lamp", "-t", "shadow-map", "--view-size", "16", "-o", "{out}.png"],
        ["shadow-map", "room-with-lamp", "point light"],
    ),
    "a run into somebody's folder": ([*RUN[:-1], "{in}"], ["/in: found other files, such as away.toml", "rows.jsonl"]),
    "a near miss of a technique": ([*RUN, "-t", "shadow-mop"], ["did you mean 'shadow-map'? allowed: cascades"]),
    "a near miss of an axis": (["stress", "--axis", "elevaton", "-o", "{out}"], ["did you mean 'elevation'? allowed"]),
    "a near miss of a metric": (
        ["check", "{in}", "--baseline", "{in}", "--tolerance", "ancne=3"],
        ["--tolerance: found 'ancne=3'; did you mean 'acne'? allowed: METRIC=X"],
    ),
    "a sun as wide as the sky": (["needs", "{in}/sky.toml"], ["sky.toml", "90", "less than 90"]),
    **{
        f"an up axis for {arguments[0]} of a scene that has one": (
            [*arguments, "--up", "z"], ["--up z", "cube-on-plane specifies its up axis", ".stl"]
        )
        for arguments in OF_A_SCENE
    },
}  # fmt: skip


@pytest.fixture
def files(tmp_path: Path) -> Path:
    folder = tmp_path / "in"
    folder.mkdir()
    for name, text in FILES.items():
        (folder / name).write_text(text)
    Image.new("L", (16, 16), 255).save(folder / "white.png")
    return folder


def test_bad_input_is_one_line_and_exit_2(shadowbench: Callable[..., Any], files: Path, tmp_path: Path) -> None:
    before = sorted(tmp_path.rglob("*"))
    for case, (arguments, words) in CASES.items():
        answer = shadowbench(
            *(text.replace("{in}", str(files)).replace("{out}", str(tmp_path / "out")) for text in arguments)
        )
        complaints = [line for line in answer.err.splitlines() if not line.startswith("note: ")]
        assert (answer.code, answer.out, len(complaints)) == (2, "", 1), (case, answer.err)
        assert complaints[0].startswith("shadowbench: "), case
        assert [word for word in words if word not in complaints[0]] == [], (case, complaints[0])
        assert PYDANTIC.search(complaints[0]) is None, complaints[0]
        assert sorted(tmp_path.rglob("*")) == before, case


def test_a_rows_file_of_another_program_is_an_error_and_is_kept(
    shadowbench: Callable[..., Any], tmp_path: Path
) -> None:
    (tmp_path / "rows.jsonl").write_text("mine")
    answer = shadowbench("run", "cube-on-plane", "-t", "unshadowed", "--view-size", "16", "-o", tmp_path)
    assert answer.code == 2
    assert "rows.jsonl line 1" in answer.err
    assert [(file.name, file.read_text()) for file in tmp_path.iterdir()] == [("rows.jsonl", "mine")]


@pytest.mark.parametrize(
    ("error", "code", "last"),
    [
        (OSError(errno.ENOSPC, "full", "out/masks"), 2, "out/masks: cannot be written (no space left on device)"),
        (LookupError("a bug"), 3, "an internal error; please report it with the lines above"),
    ],
)
def test_a_full_disk_is_one_line_and_an_internal_error_shows_what_raised_it(
    shadowbench: Callable[..., Any], monkeypatch: pytest.MonkeyPatch, error: Exception, code: int, last: str
) -> None:
    def broken(*_: object) -> None:
        raise error

    monkeypatch.setattr("shadowbench.studies.catalogue.catalogue", broken)
    answer = shadowbench("list")
    *before, line = answer.err.splitlines()
    assert (answer.code, answer.out, line) == (code, "", f"shadowbench: {last}")
    assert ("LookupError: a bug" in before) == (code == 3) and (before == []) == (code == 2)
