"""The window itself, on a virtual display, driven by real events of a mouse and a keyboard; and its command."""

import json
import os
import shutil
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import psutil
import pytest

from shadowbench.commands import view as view_command
from shadowbench.options import ViewSize
from shadowbench.scores.masks import read_mask
from shadowbench.viewer.drawing import Viewer
from shadowbench.viewer.state import ViewerState, save_state

ROOT = Path(__file__).resolve().parents[2]


@pytest.fixture(scope="module")
def display() -> Iterator[dict[str, str]]:
    """The environment of programs that see a virtual display of the window's size."""
    assert shutil.which("Xvfb") and shutil.which("xdotool"), "`tools/setup.sh Xvfb xdotool window` installs them"
    read, write = os.pipe()
    server = subprocess.Popen(
        ["Xvfb", "-displayfd", str(write), "-screen", "0", "1400x860x24", "-nolisten", "tcp"],
        pass_fds=[write],
        stderr=subprocess.DEVNULL,
    )
    os.close(write)
    with os.fdopen(read) as pipe:
        yield {**os.environ, "DISPLAY": f":{pipe.readline().strip()}", "PYTHONPATH": str(ROOT)}
    server.kill()
    server.wait()


@pytest.mark.slow
@pytest.mark.timeout(900)
def test_the_tour_of_the_documentation(
    display: dict[str, str], tmp_path: Path, shadowbench: Callable[..., Any]
) -> None:
    """`render` of the saved state gives the mask that the window held, bit for bit, and `score` its scores."""
    command = [sys.executable, str(ROOT / "tests" / "viewer" / "tour.py"), str(tmp_path)]
    done = subprocess.run(command, env=display, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout + done.stderr
    notes, masks = json.loads((tmp_path / "notes.json").read_text()), np.load(tmp_path / "masks.npy")
    for note, mask in zip(notes, masks, strict=True):
        file = tmp_path / "mask.png"
        words = (tmp_path / "view.toml", "-t", note["spec"], "-o", tmp_path / "picture.png", "--mask", file)
        answer = shadowbench("render", *words)
        assert answer.code == 0, answer.err
        assert np.array_equal(read_mask(file), mask)
        metrics = json.loads(shadowbench("score", tmp_path / "view.toml", file, "--json").out)["metrics"]
        assert note["scores"]["iou"] == pytest.approx(metrics["iou"], abs=1e-12)


@pytest.mark.slow
def test_a_window_that_is_killed_leaves_no_process_behind(display: dict[str, str]) -> None:
    command = [sys.executable, "-m", "shadowbench", "view", "post", "--view-size", "64"]
    window = psutil.Popen(command, env=display, stderr=subprocess.DEVNULL)
    end = time.monotonic() + 60.0
    while not (children := window.children(recursive=True)) or time.monotonic() < end - 55.0:
        assert time.monotonic() < end
        time.sleep(0.1)
    window.kill()
    window.wait()
    assert not psutil.wait_procs(children, timeout=30.0)[1]


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


def test_without_the_extra_one_line_says_what_to_install(
    shadowbench: Callable[..., Any], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, "imgui_bundle", None)
    monkeypatch.delitem(sys.modules, "shadowbench.viewer.window", raising=False)
    answer = shadowbench("view", "post")
    assert answer.code == 2
    assert answer.err == (
        "shadowbench: view needs imgui_bundle; pip install '.[viewer]' in a checkout of shadowbench installs it (its "
        "wheels end at Python 3.13)\n"
    )


def test_invalid_options_are_one_line(shadowbench: Callable[..., Any]) -> None:
    for words, message in (
        ((), "view: found no scene; allowed: a SCENE, such as sphere-and-torus, or --state FILE.toml"),
        (("post", "--state", "x.toml"), "view: found SCENE and --state; allowed: a SCENE, "),
        (("--state", "x.toml", "--cell", "abc"), "view: --cell KEY is for a folder of a run"),
        (("post", "-t", "shadow-map", "-t", "shadow-volume", "-t", "hybrid"), "--technique: found 3; allowed"),
        (("--state", "x.toml"), "x.toml: no such file"),
        (("results", "--cell", "abc"), "rows.jsonl"),
        ((".",), "a folder is shown by --cell KEY"),
        (("--state", "x.toml", "--sun"), "options on how a SCENE is read, such as --view or --sun, are for one"),
    ):
        answer = shadowbench("view", *words)
        assert answer.code == 2
        assert message in answer.err and len(answer.err.splitlines()) == 1


def test_the_command_opens_a_state_as_a_scene_and_a_mesh_from_a_side(
    shadowbench: Callable[..., Any], viewer: Viewer, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    shown: list[ViewerState] = []
    window = SimpleNamespace(run=lambda: None)
    monkeypatch.setattr(view_command, "_window", lambda: lambda state, _: (shown.append(state), window)[1])
    save_state(replace(viewer.state, overlay="mask", size=ViewSize(48, 27)), tmp_path / "state.toml")
    (tmp_path / "own.obj").write_text("v 0 0 0\nv 1 0 0\nv 0 0 1\nv 0 1 0\nf 1 2 3\nf 1 2 4\n")
    for words in (
        ["state.toml"],
        ["state.toml", "--camera", "top"],
        ["own.obj", "--camera", "left", "--lamp", "0,9,0"],
    ):
        answer = shadowbench("view", tmp_path / words[0], *words[1:])
        assert answer.code == 0, answer.err
    state, scene, own = shown
    assert (state.overlay, state.size) == ("mask", (48, 27))
    assert (scene.overlay, scene.camera.name) == ("picture", "top")  # options read the file as any other scene
    assert (own.camera.name, own.light.name) == ("left", "lamp 0 9 0") and own.specs[0].text == "cube-map"
