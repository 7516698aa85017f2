"""Names of scenes, cameras and lights: checked before any work, since they become file names and columns."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from shadowbench.errors import InputError
from shadowbench.scenes.library import load_scene
from shadowbench.scenes.model import View, view_of
from shadowbench.scenes.scene_tables import NAME
from tests.scenes.conftest import refused

BOX = '[[mesh]]\nshape = "box"\n'
OBJ = "v 0 0 0\nv 1 0 0\nv 0 0 -1\nf 1 2 3\n"
Write = Callable[..., Path]

BAD_STEMS = ["=cmd|' C calc'!A0", "+1", "-1", "@SUM(A1)", "two\nlines", "a\rb", "a\tb", "x" * 81]
"""Formulas to a spreadsheet, what breaks a line, what is too long."""


def test_a_scene_file_that_cannot_lend_its_name_is_told_to_state_one(scene_file: Write) -> None:
    for stem in BAD_STEMS:
        refused(scene_file(BOX, f"{stem}.toml"), 'name = "…"', "up to 80 letters")
        assert load_scene(scene_file('name = "mine"\n' + BOX, f"{stem}.toml")).name == "mine"


def test_a_mesh_file_may_lend_any_valid_name(mesh_file: Write) -> None:
    for stem, name in (
        ("=cmd|' C calc'!A0", "cmd-- C calc--A0"),
        ("-1", "1"),
        ("model (1)", "model -1-"),
        ("two\nlines", "two-lines"),
        ("Łuk 2.5+", "Łuk 2.5+"),
    ):
        assert load_scene(mesh_file(f"{stem}.obj", OBJ)).name == name


def test_a_mesh_file_without_a_valid_name_is_told_how_to_set_one(mesh_file: Write) -> None:
    for stem, word in (("x" * 81, 'name = "…"'), ("(((", 'name = "…"'), ("\udcff", "UTF-8")):
        refused(mesh_file(f"{stem}.obj", OBJ), word)


def test_names_in_a_gltf_begin_as_names_do(gltf_file: Write) -> None:
    cameras = [{"type": "perspective", "perspective": {"yfov": 1.0, "znear": 0.1}, "name": "=A1"}] * 3
    nodes: list[dict[str, Any]] = [
        {"mesh": 0},
        {"camera": 0, "translation": [0, 0, 5]},
        {"camera": 1, "name": "y" * 200},
        {"camera": 2, "name": "y" * 200},
        {"camera": 2, "name": "()"},
    ]
    scene = load_scene(gltf_file(nodes=nodes, cameras=cameras, scenes=[{"nodes": list(range(5))}]))
    names = [camera.name for camera in scene.cameras]
    assert names == ["A1", "y" * 80, "y" * 78 + "-2", "camera"]
    assert all(NAME.fullmatch(name) for name in names)


def test_the_file_names_of_a_view_fit_a_file_system(tmp_path: Path) -> None:
    """Three names of 80 characters each are within their limits, and too many bytes for one file name."""
    cube = load_scene("cube-on-plane")

    def view(scene: str, camera: str, light: str, size: int) -> View:
        named = replace(cube.cameras[0], name=camera), replace(cube.lights[0], name=light)
        return view_of(replace(cube, name=scene), *named, size)

    name = view("Ł" * 60, "c" * 20, "l" * 30, 16384).name
    (tmp_path / f".{name}.undecided.{'0' * 12}.png").touch()
    for names in (("s" * 80, "c" * 80, "l" * 80), ("漢" * 70, "camera", "light")):
        with pytest.raises(InputError, match=r"\d+ bytes together; allowed are 200"):
            view(*names, 64)


def test_a_note_never_steers_the_terminal(shadowbench: Callable[..., Any], mesh_file: Write, tmp_path: Path) -> None:
    file = mesh_file("a\x1b[2J\nb.obj", OBJ)
    answer = shadowbench("truth", file, "-o", tmp_path / "a.npz", "--view-size", "8", "--pixel-samples", "1")
    assert answer.code == 0
    assert "\x1b" not in answer.err and r"\x1b[2J" in answer.err
    assert all(line.startswith("note: ") for line in answer.err.splitlines())
