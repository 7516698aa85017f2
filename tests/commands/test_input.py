"""Invalid command lines: exit code 2, and one line with what was found, where, and what is allowed."""

import base64
import errno
import json
import os
import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from PIL import Image

pytestmark = pytest.mark.filterwarnings("error")

SCENE = '[light]\nkind = "directional"\ndirection = [0.5, -1, 0.2]\n[[mesh]]\nshape = "box"\n'
CAMERA = "[camera]\nposition = [0, 1, 5]\ntarget = [0, 0, 0]\n"
PLY = "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\n"


def gltf(primitive: dict[str, Any], data: bytes = b"", **parts: Any) -> str:
    uri = "data:application/octet-stream;base64," + base64.b64encode(data).decode()
    return json.dumps(
        {
            "asset": {"version": "2.0"},
            "scenes": [{"nodes": [0]}],
            "nodes": [{"mesh": 0}],
            "meshes": [{"primitives": [primitive]}],
            "buffers": [{"byteLength": len(data), "uri": uri}],
            "bufferViews": [{"buffer": 0, "byteOffset": 0, "byteLength": len(data)}],
            "accessors": [{"componentType": 5126, "count": 3, "type": "VEC3"}],
            **parts,
        }
    )


DRACO = gltf(
    {
        "attributes": {"POSITION": 0},
        "extensions": {"KHR_draco_mesh_compression": {"bufferView": 0, "attributes": {"POSITION": 0}}},
    },
    b"no Draco at all",
    extensionsRequired=["KHR_draco_mesh_compression"],
    extensionsUsed=["KHR_draco_mesh_compression"],
)

PYDANTIC = re.compile(
    r"Field required|should (be|have|match)|Value error|Unable to parse|validation|valid (string|integer|list|dict)"
)

FILES = {
    "broken.toml": "[camera\n",
    "unknown.toml": CAMERA + SCENE + "colour = 3\n",
    "away.toml": CAMERA.replace("target = [0, 0, 0]", "target = [0, 1, 9]") + SCENE,
    "range.toml": CAMERA + "fov_y = 180\n" + SCENE,
    "good.toml": CAMERA + SCENE,
    "sky.toml": CAMERA + SCENE.replace("[[mesh]]", "angular_radius = 90\n[[mesh]]"),
    "points.obj": "v 0 0 0\nv 1 0 0\nv 0 1 0\n",
    "nan.obj": "v 0 0 0\nv nan 0 0\nv 0 1 0\nf 1 2 3\n",
    "beyond.obj": "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 7\n",
    "strip.ply": PLY
    + "element tristrips 1\nproperty list int int vertex_indices\nend_header\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n",
    "beyond.ply": PLY
    + "element face 1\nproperty list uchar int vertex_indices\nend_header\n0 0 0\n1 0 0\n0 1 0\n3 0 1 7\n",
    "empty.glb": "",
    "broken.glb": "glTF and then nothing",
    "broken.gltf": "{",
    "nothing.gltf": json.dumps({"asset": {"version": "2.0"}}),
    "draco.gltf": DRACO,
    "empty.py": "",
    "broken.py": "def technique(:\n",
    "raises.py": "raise RuntimeError('no')\n",
    "nameless.py": "from shadowbench.plugin.base import Technique\n\nclass Nameless(Technique):\n    pass\n",
    "study.toml": 'scenes = ["cube-on-plane"]\nround = 3\n',
    "broken-study.toml": "scenes = \n",
    "text.toml": 'scenes = ["cube-on-plane"]\nrounds = "many"\n',
    "views.toml": 'scenes = ["cube-on-plane"]\nviews = [3]\n',
    "sizes.toml": 'scenes = ["cube-on-plane"]\nmap_size = [512, 70000]\n',
    "limit.toml": 'scenes = ["cube-on-plane"]\ntime_limit = inf\n',
    "polar.toml": 'scenes = ["cube-on-plane"]\ncoordinates = "polar"\n',
    "nothing.toml": "scenes = []\n",
    "none.toml": "rounds = 3\n",
    "fov.toml": CAMERA + "fovy = 30\n" + SCENE,
    "crossed.toml": 'scenes = ["cube-on-plane"]\n[[technique]]\nspec = "shadow-map"\nfilters = ["hard"]\n',
    "size.toml": 'scenes = ["cube-on-plane"]\n[[technique]]\nspec = "shadow-map"\nsize = 0\n',
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
    "a part beyond the last": (["stress", "--part", "4/3", "-o", "{out}"], ["--part", "'4/3'", "K/N"]),
    "more parts than cells": (
        ["run", "stairs", "-t", "unshadowed", "--part", "1/2", "-o", "{out}"],
        ["--part 1/2", "found 1", "allowed: 1 to 1 parts"],
    ),
    "a folder to merge that is missing": (["merge", "{in}/gone", "-o", "{out}"], ["gone", "no such folder"]),
    "a folder to merge that is no run": (["merge", "{in}", "-o", "{out}"], ["no rows.jsonl", "shadowbench run"]),
    "a missing scene file": (["run", "{in}/gone.toml", "-o", "{out}"], ["gone.toml", "no such file"]),
    "a missing mesh": (["truth", "{in}/none.obj", "-o", "{out}.npz"], ["none.obj", "no such file"]),
    "a misspelt scene": (["run", "cube-on-plain", "-o", "{out}"], ["cube-on-plain", "did you mean 'cube-on-plane'"]),
    "no kind of scene": (["truth", "{in}/empty.py", "-o", "{out}.npz"], ["empty.py", ".toml", ".glb"]),
    "broken TOML": (["run", "{in}/broken.toml", "-o", "{out}"], ["broken.toml", "not TOML", "line 1"]),
    "an unknown field": (["run", "{in}/unknown.toml", "-o", "{out}"], ["unknown.toml", "'colour'", "color"]),
    "a value out of range": (["run", "{in}/range.toml", "-o", "{out}"], ["range.toml", "fov_y", "180"]),
    "no triangles": (["run", "{in}/points.obj", "-o", "{out}"], ["points.obj", "no triangles"]),
    "a NaN vertex": (["run", "{in}/nan.obj", "-o", "{out}"], ["nan.obj", "NaN"]),
    "an index too high": (["run", "{in}/beyond.obj", "-o", "{out}"], ["beyond.obj"]),
    "an index too high in a PLY": (["run", "{in}/beyond.ply", "-o", "{out}"], ["beyond.ply", "vertex 7"]),
    "triangle strips": (["run", "{in}/strip.ply", "-o", "{out}"], ["strip.ply", "strips"]),
    "an empty glTF": (["run", "{in}/empty.glb", "-o", "{out}"], ["empty.glb", "empty"]),
    "a broken GLB": (["run", "{in}/broken.glb", "-o", "{out}"], ["broken.glb"]),
    "a broken glTF": (["run", "{in}/broken.gltf", "-o", "{out}"], ["broken.gltf"]),
    "a glTF of nothing": (["run", "{in}/nothing.gltf", "-o", "{out}"], ["nothing.gltf", "no triangles"]),
    "Draco that fails": (["truth", "{in}/draco.gltf", "-o", "{out}.npz"], ["draco.gltf"]),
    "a camera that shows nothing": (
        ["run", "{in}/away.toml", "-t", "unshadowed", "--view-size", "16", "-o", "{out}"],
        ["camera 'camera'", "away", "shows nothing"],
    ),
    "a truth of nothing": (
        ["truth", "{in}/away.toml", "--view-size", "16", "-o", "{out}.npz"],
        ["camera 'camera'", "away", "shows nothing"],
    ),
    "a view's size as its name": (["needs", "post", "--view", "384x384"], ["'384x384'", "square", "--view-size 384"]),
    "an unknown technique": ([*RUN, "-t", "no-map"], ["no-map", "shadow-map", "unshadowed"]),
    "an unknown parameter": ([*RUN, "-t", "shadow-map:taps=3"], ["taps", "filter"]),
    "an unknown row": ([*RUN, "-t", "shadow-map:filter=velvet"], ["velvet", "pcf"]),
    "an unknown preset": ([*RUN, "-t", "shadow-map:preset=nice"], ["nice", "course"]),
    "a broken spec": ([*RUN, "-t", "shadow-map:filter=pcf("], ["shadow-map:filter=pcf("]),
    "an empty spec": ([*RUN, "-t", ""], ["technique"]),
    "a parameter out of range": ([*RUN, "-t", "shadow-map:bias=texel(scale=-1)"], ["scale", "-1"]),
    "map size 0 in a spec": ([*RUN, "-t", "shadow-map:size=0"], ["size", "found 0"]),
    "map size 0": ([*RUN, "--map-size", "0"], ["--map-size", "'0'", "from 1"]),
    "a map size of words": ([*RUN, "--map-size", "512,big"], ["--map-size", "'512,big'", "whole numbers"]),
    "an empty map size": ([*RUN, "--map-size", ""], ["--map-size"]),
    "a map size beyond all": ([*RUN, "--map-size", "99999999"], ["--map-size", "99999999", "65536"]),
    "a map beyond the driver": ([*RUN, "-t", "shadow-map", "--map-size", "65536"], ["map size 65536", "allows 1 to"]),
    "a map beyond the driver in a spec": ([*RUN, "-t", "shadow-map:size=65536"], ["map size 65536", "allows 1 to"]),
    "a picture beyond the driver": (
        ["render", "cube-on-plane", "-t", "shadow-map:size=65536", "-o", "{out}.png"],
        ["map size 65536", "allows 1 to"],
    ),
    "view size 0": ([*RUN, "--view-size", "0"], ["--view-size", "1"]),
    "rounds below 0": ([*RUN, "--rounds", "-1"], ["--rounds"]),
    "an unknown option": ([*RUN, "--fast"], ["--fast"]),
    "an unknown command": (["rum"], ["rum"]),
    "no scene": (["truth", "-o", "{out}.npz"], ["SCENE"]),
    "no technique": (["render", "cube-on-plane", "-o", "{out}.png"], ["--technique"]),
    "an unknown view": ([*RUN, "--view", "low"], ["'low'", "camera"]),
    "an unknown light": ([*RUN, "--light", "moon"], ["'moon'", "allowed: light"]),
    "an unknown view of a truth": (["truth", "cube-on-plane", "--view", "low", "-o", "{out}.npz"], ["'low'", "camera"]),
    "an unknown light of a picture": (
        ["render", "cube-on-plane", "-t", "unshadowed", "--light", "moon", "-o", "{out}.png"],
        ["light: found 'moon'", "allowed: light"],
    ),
    "a step of neither camera nor light": ([*RUN, "--step", "box"], ["step", "'box'", "'camera' or 'light'"]),
    "a missing study": (["run", "-s", "{in}/gone.toml", "-o", "{out}"], ["gone.toml", "no such study"]),
    "a broken study": (["run", "-s", "{in}/broken-study.toml", "-o", "{out}"], ["broken-study.toml", "not TOML"]),
    "an unknown field of a study": (
        ["run", "-s", "{in}/study.toml", "-o", "{out}"],
        ["study.toml", "'round'", "rounds"],
    ),
    "map size 0 in a study": (
        ["run", "-s", "{in}/size.toml", "-o", "{out}"],
        ["size.toml", "technique 1", "size", "0"],
    ),
    "words for a number in a study": (
        ["run", "-s", "{in}/text.toml", "-o", "{out}"],
        ["text.toml: rounds: found 'many'; allowed: a whole number"],
    ),
    "a number for a view in a study": (
        ["run", "-s", "{in}/views.toml", "-o", "{out}"],
        ["views.toml: views 1: found 3; allowed: text or a table"],
    ),
    "the second of two sizes in a study": (
        ["run", "-s", "{in}/sizes.toml", "-o", "{out}"],
        ["sizes.toml: map_size 2: found 70000; allowed: less than or equal to 65536"],
    ),
    "no limit in a study": (
        ["run", "-s", "{in}/limit.toml", "-o", "{out}"],
        ["limit.toml: time_limit: found inf; allowed: "],
    ),
    "one of two words in a study": (
        ["run", "-s", "{in}/polar.toml", "-o", "{out}"],
        ["polar.toml: coordinates: found 'polar'; allowed: 'relative' or 'absolute'"],
    ),
    "no scene in a study": (
        ["run", "-s", "{in}/nothing.toml", "-o", "{out}"],
        ["nothing.toml: scenes: found an empty list; allowed: 1 or more entries"],
    ),
    "a study without scenes": (
        ["run", "-s", "{in}/none.toml", "-o", "{out}"],
        ["none.toml: scenes: found none; it must be given"],
    ),
    "a missing plug-in": ([*RUN, "--plugin", "{in}/none.py"], ["--plugin", "none.py", "no such file"]),
    "an empty plug-in": ([*RUN, "--plugin", "{in}/empty.py"], ["--plugin", "empty.py", "Technique"]),
    "a broken plug-in": ([*RUN, "--plugin", "{in}/broken.py"], ["--plugin", "broken.py", "SyntaxError"]),
    "a plug-in that raises": ([*RUN, "--plugin", "{in}/raises.py"], ["--plugin", "raises.py", "RuntimeError: no"]),
    "a plug-in without a name": ([*RUN, "--plugin", "{in}/nameless.py"], ["--plugin", "Nameless", "name"]),
    "a plug-in that is no Python": ([*RUN, "--plugin", "{in}/nan.obj"], ["--plugin", "nan.obj", ".py"]),
    "an output that is a file": (
        ["run", "cube-on-plane", "-t", "unshadowed", "--view-size", "16", "-o", "{in}/good.toml"],
        ["good.toml", "cannot be written"],
    ),
    "an output that nobody may write": (
        ["run", "cube-on-plane", "-t", "unshadowed", "--view-size", "16", "-o", "/proc/shadowbench"],
        ["/proc/shadowbench", "cannot be written"],
    ),
    "a truth into nowhere": (["truth", "cube-on-plane", "-o", "{out}/none/t.npz"], ["none", "cannot write"]),
    "a truth onto a folder": (["truth", "cube-on-plane", "-o", "{in}"], ["is a folder"]),
    "a picture into nowhere": (
        ["render", "cube-on-plane", "-t", "unshadowed", "-o", "{out}/none/p.png"],
        ["none", "cannot write"],
    ),
    "a mask into nowhere": (
        ["render", "cube-on-plane", "-t", "unshadowed", "-o", "{out}.png", "--mask", "{out}/none/m.png"],
        ["none", "cannot write"],
    ),
    "a picture and a mask in one file": (
        ["render", "cube-on-plane", "-t", "unshadowed", "-o", "{out}.png", "--mask", "{out}.png"],
        ["out.png", "twice"],
    ),
    "a picture that is no PNG": (
        ["render", "cube-on-plane", "-t", "unshadowed", "-o", "{out}.jpg"],
        ["out.jpg", "found", "'.jpg'", "allowed: .png"],
    ),
    "a picture of no kind": (
        ["render", "cube-on-plane", "-t", "unshadowed", "-o", "{out}"],
        ["out", "'no suffix'", "allowed: .png"],
    ),
    "a mask that is no PNG": (
        ["render", "cube-on-plane", "-t", "unshadowed", "-o", "{out}.png", "--mask", "{out}.exr"],
        ["out.exr", "allowed: .png"],
    ),
    "a truth that is no npz": (["truth", "cube-on-plane", "-o", "{out}.npy"], ["out.npy", "allowed: .npz"]),
    "tint of a technique without": (
        ["render", "cube-on-plane", "-t", "shadow-map", "--tint", "-o", "{out}.png"],
        ["--tint", "shadow-map", "cascades"],
    ),
    "a picture by two techniques": (
        ["render", "cube-on-plane", "-t", "unshadowed", "-t", "shadow-map", "-o", "{out}.png"],
        ["--technique", "unshadowed and shadow-map", "allowed: one"],
    ),
    "a map of what has none": (
        ["render", "cube-on-plane", "-t", "unshadowed", "--view-size", "16", "-o", "{out}.png", "--map", "{out}.m.png"],
        ["--map", "unshadowed has no map"],
    ),
    "a picture that is unsupported": (
        ["render", "room-with-lamp", "-t", "shadow-map", "--view-size", "16", "-o", "{out}.png"],
        ["shadow-map", "room-with-lamp", "point light"],
    ),
    "a missing assets folder": ([*RUN[:1], "{in}/good.toml", "--assets", "{in}/none", "-o", "{out}"], ["--assets"]),
    "map sizes by spaces": (
        ["run", "cube-on-plane", "--map-size", "512", "1024", "2048", "-o", "{out}"],
        ["--map-size", "'512' and '1024' as separate arguments", "allowed: 512,1024,2048"],
    ),
    "a run into somebody's folder": ([*RUN[:-1], "{in}"], ["/in: found other files, such as away.toml", "rows.jsonl"]),
    "a sweep into somebody's folder": (["stress", "--quick", "-o", "{in}"], ["/in: found other files", "rows.jsonl"]),
    "a search into somebody's folder": (["tune", "-t", "shadow-map", "-o", "{in}"], ["/in: found other files"]),
    "a choice into somebody's folder": (["recommend", "stairs", "-o", "{in}"], ["/in: found other files"]),
    "an export into somebody's folder": (
        ["export", "cube-on-plane", "{in}"],
        ["/in: found other files, such as away.toml; allowed: a new folder, an empty one, or one with view.json"],
    ),
    "a near miss of a technique": ([*RUN, "-t", "shadow-mop"], ["did you mean 'shadow-map'? allowed: cascades"]),
    "a near miss of a parameter": ([*RUN, "-t", "shadow-map:filtre=pcf"], ["'filtre'; did you mean 'filter'?"]),
    "a near miss of a row": ([*RUN, "-t", "shadow-map:bias=polygonoffset"], ["did you mean 'polygon-offset'?"]),
    "a near miss of a row's parameter": ([*RUN, "-t", "shadow-map:filter=pcf(tap=3)"], ["did you mean 'taps'?"]),
    "a near miss of a preset": ([*RUN, "-t", "shadow-map:preset=WebGL1"], ["did you mean 'webgl'? presets of"]),
    "a near miss of an axis": (["stress", "--axis", "elevaton", "-o", "{out}"], ["did you mean 'elevation'? allowed"]),
    "a near miss of a study": (["run", "-s", "presest", "-o", "{out}"], ["did you mean 'presets'? ours: "]),
    "a near miss of a metric": (
        ["check", "{in}", "--baseline", "{in}", "--tolerance", "ancne=3"],
        ["--tolerance: found 'ancne=3'; did you mean 'acne'? allowed: METRIC=X"],
    ),
    "a near miss of a listed metric": (["list", "metrics", "edge_pix"], ["did you mean 'edge_px'?"]),
    "a near miss of a list": (["list", "scene"], ["did you mean 'scenes'?"]),
    "a near miss of a scene's field": (
        ["run", "{in}/unknown.toml", "-o", "{out}"],
        ["unknown field 'colour'; did you mean 'color'? allowed with box"],
    ),
    "a near miss of a camera's field": (["run", "{in}/fov.toml", "-o", "{out}"], ["'fovy'; did you mean 'fov_y'?"]),
    "a near miss of a study's field": (["run", "-s", "{in}/study.toml", "-o", "{out}"], ["did you mean 'rounds'?"]),
    "a near miss of a study's parameter": (
        ["run", "-s", "{in}/crossed.toml", "-o", "{out}"],
        ["unknown parameter 'filters'; did you mean 'filter'? parameters of shadow-map"],
    ),
    "a near miss of a searched parameter": (["tune", "-t", "shadow-map", "--params", "bais"], ["did you mean 'bias'?"]),
    "a near miss of a light": ([*RUN, "--light", "lihgt"], ["found 'lihgt'; did you mean 'light'? allowed: light"]),
    "a near miss of nothing": ([*RUN, "-t", "shadow-map:zzz=3"], ["unknown field 'zzz'; allowed: fit, size"]),
    **{
        f"a sun as wide as the sky, for {arguments[0]}": (
            [text.replace("cube-on-plane", "{in}/sky.toml") for text in arguments], ["sky.toml", "90", "less than 90"]
        )
        for arguments in OF_A_SCENE
    },
    **{
        f"an up axis for {arguments[0]} of a scene that has one": (
            [*arguments, "--up", "z"], ["--up z", "cube-on-plane specifies its up axis", ".stl"]
        )
        for arguments in OF_A_SCENE
    },
    "an unknown list": (["list", "shaders"], ["'shaders'", "techniques, scenes, metrics, studies"]),
}  # fmt: skip


@pytest.fixture
def files(tmp_path: Path) -> Path:
    folder = tmp_path / "in"
    folder.mkdir()
    for name, text in FILES.items():
        (folder / name).write_text(text)
    Image.new("L", (16, 16), 255).save(folder / "white.png")
    return folder


@pytest.mark.parametrize("case", CASES)
def test_bad_input_is_one_line_and_exit_2(
    shadowbench: Callable[..., Any], files: Path, tmp_path: Path, case: str
) -> None:
    arguments, words = CASES[case]
    before = sorted(tmp_path.rglob("*"))
    answer = shadowbench(
        *(text.replace("{in}", str(files)).replace("{out}", str(tmp_path / "out")) for text in arguments)
    )
    assert answer.code == 2
    complaints = [line for line in answer.err.splitlines() if not line.startswith("note: ")]
    assert len(complaints) == 1
    assert complaints[0].startswith("shadowbench: ")
    assert [word for word in words if word not in complaints[0]] == []
    assert PYDANTIC.search(complaints[0]) is None
    assert answer.out == ""
    assert sorted(tmp_path.rglob("*")) == before


def test_tune_takes_an_up_axis_too(shadowbench: Callable[..., Any], tmp_path: Path) -> None:
    answer = shadowbench("tune", "-t", "shadow-map", "--scenes", "cube-on-plane", "--up", "z", "-o", tmp_path)
    assert answer.code == 2
    assert "--up z: cube-on-plane specifies its up axis" in answer.err


def test_a_rows_file_of_another_program_is_an_error_and_is_kept(
    shadowbench: Callable[..., Any], tmp_path: Path
) -> None:
    (tmp_path / "rows.jsonl").write_text("mine")
    answer = shadowbench("run", "cube-on-plane", "-t", "unshadowed", "--view-size", "16", "-o", tmp_path)
    assert answer.code == 2
    assert "rows.jsonl line 1" in answer.err
    assert [(file.name, file.read_text()) for file in tmp_path.iterdir()] == [("rows.jsonl", "mine")]


def test_two_techniques_of_one_name_are_refused(shadowbench: Callable[..., Any], half: Path, tmp_path: Path) -> None:
    twin = tmp_path / "twin.py"
    twin.write_text(half.read_text())
    answer = shadowbench("list", "techniques", "--plugin", half, "--plugin", twin)
    assert answer.code == 2
    assert ["'half'" in answer.err, str(half) in answer.err, str(twin) in answer.err] == [True] * 3


def test_a_full_disk_is_one_line(shadowbench: Callable[..., Any], monkeypatch: pytest.MonkeyPatch) -> None:
    def full(*_: object) -> None:
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC), "out/masks")

    monkeypatch.setattr("shadowbench.commands.listing.catalogue", full)
    answer = shadowbench("list")
    assert (answer.code, answer.out) == (2, "")
    assert answer.err == "shadowbench: out/masks: cannot be written (no space left on device)\n"


def test_an_internal_error_is_exit_3(shadowbench: Callable[..., Any], monkeypatch: pytest.MonkeyPatch) -> None:
    def broken(*_: object) -> None:
        raise LookupError("a bug")

    monkeypatch.setattr("shadowbench.commands.listing.catalogue", broken)
    answer = shadowbench("list")
    assert answer.code == 3
    assert answer.err.splitlines()[-1].startswith("shadowbench: an internal error")
    assert "LookupError: a bug" in answer.err


@pytest.mark.parametrize("option", ["-q", "--quiet", "--json", "--map-size"])
def test_an_option_before_the_command_is_an_error_with_the_right_place(
    shadowbench: Callable[..., Any], option: str
) -> None:
    answer = shadowbench(option, "run", "cube-on-plane")
    assert (answer.code, answer.out) == (2, "")
    assert answer.err == f"shadowbench: {option} goes after the command: shadowbench COMMAND … {option}\n"


def test_an_unknown_option_has_no_such_hint(shadowbench: Callable[..., Any]) -> None:
    assert "after the command" not in shadowbench("--no-such", "run").err
