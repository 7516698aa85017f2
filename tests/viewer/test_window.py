"""The window itself, on a virtual display, driven by real events of a mouse and a keyboard."""

import json
import os
import re
import shutil
import subprocess
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from shadowbench.commands import view as view_command
from shadowbench.scores.masks import read_mask

HERE = Path(__file__).resolve().parent
ROOT = HERE.parents[1]
PAGE = ROOT / "docs" / "how-to" / "view.md"


@pytest.fixture(scope="module")
def display() -> Iterator[str]:
    """A virtual display of the window's size."""
    assert shutil.which("Xvfb") and shutil.which("xdotool"), "`tools/setup.sh Xvfb xdotool window` installs them"
    read, write = os.pipe()
    server = subprocess.Popen(
        ["Xvfb", "-displayfd", str(write), "-screen", "0", "1400x860x24", "-nolisten", "tcp"],
        pass_fds=[write],
        stderr=subprocess.DEVNULL,
    )
    os.close(write)
    with os.fdopen(read) as pipe:
        yield f":{pipe.readline().strip()}"
    server.kill()
    server.wait()


@pytest.mark.slow
@pytest.mark.timeout(900)
def test_the_tour_of_the_documentation(display: str, tmp_path: Path, shadowbench: Callable[..., Any]) -> None:
    """What was copied is the spec; `render` of the state gives the mask that the window held, bit for bit."""
    environment = {**os.environ, "DISPLAY": display, "PYTHONPATH": str(ROOT)}
    command = [sys.executable, str(HERE / "tour.py"), str(tmp_path)]
    done = subprocess.run(command, env=environment, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout + done.stderr
    assert "unexpectedly" not in done.stderr
    notes, masks = json.loads((tmp_path / "notes.json").read_text()), np.load(tmp_path / "masks.npy")
    assert notes["copied"] == notes["specs"][0]
    for number, spec in enumerate(notes["specs"]):
        mask, picture = tmp_path / f"mask-{number}.png", tmp_path / f"picture-{number}.png"
        answer = shadowbench("render", tmp_path / "view.toml", "-t", spec, "-o", picture, "--mask", mask)
        assert answer.code == 0, answer.err
        assert np.array_equal(read_mask(mask), masks[number])
        scored = shadowbench("score", tmp_path / "view.toml", mask, "--json")
        metrics = json.loads(scored.out)["metrics"]
        assert notes["scores"][number]["iou"] == pytest.approx(metrics["iou"], abs=1e-12)


@pytest.mark.slow
@pytest.mark.timeout(300)
def test_labels_are_whole_in_a_small_window_and_a_switch_changes_the_lights_projection(display: str) -> None:
    environment = {**os.environ, "DISPLAY": display, "PYTHONPATH": str(ROOT)}
    command = [sys.executable, str(HERE / "narrow.py")]
    done = subprocess.run(command, env=environment, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout + done.stderr


@pytest.mark.slow
@pytest.mark.parametrize("what", ["leave", "segv,after=1"])  # while it is drawn, and while its work is counted
def test_a_technique_that_ends_the_window_is_named_in_the_terminal(display: str, wild: Path, what: str) -> None:
    environment = {**os.environ, "DISPLAY": display, "PYTHONPATH": str(ROOT)}
    spec = f"does:what={what}"
    words = ["view", "post", "-t", "unshadowed", "-t", spec, "--plugin", wild, "--view-size", "64"]
    command = [sys.executable, "-m", "shadowbench", *words]
    done = subprocess.run(command, env=environment, capture_output=True, text=True, check=False)
    assert done.stderr.splitlines()[-1] == f"shadowbench: the window ended unexpectedly while drawing {spec}"


def test_the_pages_tour_is_the_one_that_is_driven() -> None:
    step = re.compile(r'^def \w+\(d: Driver\) -> None:\n    """(.+)"""$', re.MULTILINE)
    steps = step.findall((HERE / "tour.py").read_text())
    page = " ".join(PAGE.read_text().split())
    assert len(steps) == 10
    for line in steps:
        assert line in page


def test_without_a_display_one_line_says_what_to_do(
    shadowbench: Callable[..., Any], monkeypatch: pytest.MonkeyPatch
) -> None:
    for name in ("DISPLAY", "WAYLAND_DISPLAY"):
        monkeypatch.delenv(name, raising=False)
    answer = shadowbench("view", "post", "--view-size", "64")
    assert answer.code == 2
    assert answer.err.startswith("shadowbench: no window can be opened here (X11: The DISPLAY environment variable is")
    assert "shadowbench render" in answer.err and "xvfb-run" in answer.err
    assert len(answer.err.splitlines()) == 1


@pytest.mark.parametrize(
    ("python", "told"),
    [
        ((3, 13), "view needs imgui_bundle; pip install '.[viewer]' in a checkout of shadowbench installs it"),
        (
            (3, 14),
            "view needs imgui-bundle below 1.92, which has no wheel for Python 3.14; allowed: Python 3.11 to 3.13",
        ),
    ],
)
def test_without_the_extra_one_line_says_what_to_install(
    shadowbench: Callable[..., Any], monkeypatch: pytest.MonkeyPatch, python: tuple[int, int], told: str
) -> None:
    monkeypatch.setattr(view_command, "sys", SimpleNamespace(version_info=python))
    monkeypatch.setitem(sys.modules, "imgui_bundle", None)
    for name in [name for name in sys.modules if name == "shadowbench.viewer.window"]:
        monkeypatch.delitem(sys.modules, name)
    answer = shadowbench("view", "post")
    assert answer.code == 2
    assert answer.err == f"shadowbench: {told}\n"


@pytest.mark.parametrize(
    ("words", "told"),
    [
        ((), "view: found no scene; allowed: SCENE, such as sphere-and-torus or a mesh file, or --state FILE.toml"),
        (("post", "--state", "x.toml"), "view: found SCENE and --state; allowed: SCENE, "),
        (("--state", "x.toml", "--cell", "abc"), "view: found --state and --cell; allowed: one"),
        (("post", "-t", "shadow-map", "-t", "shadow-volume", "-t", "hybrid"), "--technique: found 3; allowed"),
        (("--state", "x.toml"), "x.toml: no such file"),
        (("results", "--cell", "abc"), "rows.jsonl"),
        ((".",), ".: found a folder; allowed with --cell KEY"),
        (("--state", "x.toml", "--sun"), "options on how a SCENE is read, such as --view or --sun, are for one"),
    ],
)
def test_invalid_options_are_one_line(shadowbench: Callable[..., Any], words: tuple[str, ...], told: str) -> None:
    answer = shadowbench("view", *words)
    assert answer.code == 2
    assert told in answer.err and len(answer.err.splitlines()) == 1
