"""Plug-ins as users write them: a package with an entry point, and a single file."""

import csv
import json
import os
import subprocess
import sys
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image

BLOBS = '''\
"""Blob shadows: a disc for each closed caster."""

import numpy as np

from shadowbench.gl.program import Sampling
from shadowbench.plugin.base import Technique, TechniqueParams, param


class BlobShadows(Technique):
    """A disc as wide as its caster, cast along the light onto whatever looks up: what games drew before 1998."""

    name = "blob-shadows"

    class Params(TechniqueParams):
        """Parameters of blob-shadows."""

        width: float = param(1.0, "times the mean width of a caster", gt=0, le=4)

    @classmethod
    def unsupported(cls, params, view, device):
        closed = any(mesh.casts and mesh.closed for mesh in view.scene.meshes)
        return None if closed and view.light.kind == "directional" else "blobs need a sun and a closed caster"

    def build(self, stage):
        casters = [mesh.vertices for mesh in stage.scene.meshes if mesh.casts and mesh.closed]
        low, high = (np.array([end(v, axis=0) for v in casters]) for end in (np.min, np.max))
        discs = np.column_stack([(low + high) / 2, (high - low)[:, [0, 2]].mean(axis=1) / 2])
        self.discs = stage.texture((len(discs), 1), 4)
        self.discs.write(discs.astype(np.float32).tobytes())
        self.program = stage.program("fullscreen.vert", "blobs.frag", params=self.params)
        self.fullscreen = stage.fullscreen(self.program)
        self.visibility = stage.texture()
        self.target = stage.target(self.visibility)

    def draw(self, frame):
        with frame.timed("resolve", changes="view"):
            self.program.set(light=frame.light_uniform)
            self.fullscreen.draw(self.target, frame.surface.inputs | {"discs": (self.discs, Sampling())})
        return self.visibility
'''

BLOBS_SHADER = """\
#include "receiver.glsl"
uniform sampler2D discs;  // a texel each: centre, radius
uniform float width;
out float visibility;

void main() {
    Receiver r = receiver_at(ivec2(gl_FragCoord.xy));
    visibility = 1.0;
    if (!r.facing || r.normal.y < 0.9) return;
    for (int i = 0; i < textureSize(discs, 0).x; ++i) {
        vec4 disc = texelFetch(discs, ivec2(i, 0), 0);
        float ahead = (disc.y - r.position.y) / r.to_light.y;
        vec2 beside = (r.position + ahead * r.to_light - disc.xyz).xz;
        if (ahead > 0.0 && length(beside) < width * disc.w) visibility = 0.0;
    }
}
"""

SCREEN_SPACE = '''\
"""Screen-space shadows in one file."""

from shadowbench.gl.gbuffer import view_projection
from shadowbench.plugin.base import Technique, TechniqueParams, param

RESOLVE = """
#include "receiver.glsl"
uniform mat4 world_to_clip;
uniform vec3 eye;
uniform float reach, thickness;
out float visibility;

void main() {
    Receiver r = receiver_at(ivec2(gl_FragCoord.xy));
    visibility = 1.0;
    if (!r.facing) return;
    for (int i = 1; i <= STEPS; ++i) {
        vec3 p = r.position + r.to_light * (reach * float(i) / STEPS);
        vec4 clip = world_to_clip * vec4(p, 1.0);
        if (any(greaterThan(abs(clip.xy), vec2(clip.w)))) return;
        ivec2 pixel = ivec2((0.5 + 0.5 * clip.xy / clip.w) * textureSize(surface_position, 0));
        vec4 seen = texelFetch(surface_position, pixel, 0);
        float behind = distance(p, eye) - distance(seen.xyz, eye);
        if (seen.w > 0.5 && behind > 0.02 * thickness && behind < thickness) { visibility = 0.0; return; }
    }
}
"""


class ScreenSpace(Technique):
    """Marches from each pixel towards the light through what the camera sees; what it does not see casts nothing."""

    name = "screen-space"

    class Params(TechniqueParams):
        """Parameters of screen-space."""

        steps: int = param(96, "points along the ray", ge=1, le=1024)
        reach: float = param(2.0, "length of the ray", gt=0, metres=True)
        thickness: float = param(0.8, "of everything that is seen", gt=0, metres=True)

    def build(self, stage):
        self.program = stage.program("fullscreen.vert", RESOLVE, params=self.params)
        self.fullscreen = stage.fullscreen(self.program)
        self.visibility = stage.texture()
        self.target = stage.target(self.visibility)

    def draw(self, frame):
        with frame.timed("resolve", changes="view"):
            self.program.set(light=frame.light_uniform, eye=frame.camera.position)
            self.program.set(world_to_clip=view_projection(frame.view))
            self.fullscreen.draw(self.target, frame.surface.inputs)
        return self.visibility
'''
SIZE = 128


@dataclass(frozen=True)
class Plugin:
    """A plug-in: its technique, files, and the options that load it."""

    technique: str
    files: tuple[Path, ...]
    flags: tuple[str, ...]
    python_path: str
    least_iou: float  # a little below what was found

    def command(self, *arguments: str | Path) -> str:
        """Output of `shadowbench …` in a separate process."""
        done = subprocess.run(
            [sys.executable, "-m", "shadowbench", *map(str, arguments), *self.flags],
            env=os.environ | {"PYTHONPATH": self.python_path},
            capture_output=True,
            text=True,
            check=False,
        )
        assert done.returncode == 0, done.stderr
        return done.stdout


@pytest.fixture(scope="module")
def installed(tmp_path_factory: pytest.TempPathFactory) -> Plugin:
    """An installed package, made without pip: its folder, and metadata with the entry point."""
    site = tmp_path_factory.mktemp("site")
    package, record = site / "blobs", site / "blobs-1.0.dist-info"
    package.mkdir()
    record.mkdir()
    (package / "__init__.py").write_text(BLOBS, encoding="utf-8")
    (package / "blobs.frag").write_text(BLOBS_SHADER, encoding="utf-8")
    (record / "METADATA").write_text("Metadata-Version: 2.1\nName: blobs\nVersion: 1.0\n", encoding="utf-8")
    (record / "entry_points.txt").write_text("[shadowbench.techniques]\nblobs = blobs:BlobShadows\n", encoding="utf-8")
    files = sorted(path for path in site.rglob("*") if path.is_file())
    (record / "RECORD").write_text("".join(f"{path.relative_to(site)},,\n" for path in files), encoding="utf-8")
    return Plugin("blob-shadows", tuple(package.iterdir()), (), str(site), 0.28)


@pytest.fixture(scope="module")
def single(tmp_path_factory: pytest.TempPathFactory) -> Plugin:
    """One file, its shader inside."""
    file = tmp_path_factory.mktemp("single") / "screen_space.py"
    file.write_text(SCREEN_SPACE, encoding="utf-8")
    return Plugin("screen-space", (file,), ("--plugin", str(file)), "", 0.73)


@pytest.fixture(params=["single", pytest.param("installed", marks=pytest.mark.slow)])
def plugin(request: pytest.FixtureRequest) -> Plugin:
    found: Plugin = request.getfixturevalue(request.param)
    return found


def test_a_technique_takes_fewer_than_60_lines_with_its_shader(plugin: Plugin) -> None:
    assert sum(len(file.read_text(encoding="utf-8").splitlines()) for file in plugin.files) < 60


def test_a_plug_in_is_listed_with_its_parameters(plugin: Plugin) -> None:
    listed = {row["name"]: row for row in json.loads(plugin.command("list", "techniques", "--json"))}
    assert {plugin.technique, "shadow-map", "unshadowed"} <= set(listed)
    assert listed[plugin.technique]["parameters"]


def test_a_plug_in_scores_better_than_no_shadow(plugin: Plugin, tmp_path: Path) -> None:
    plugin.command(
        "run", "cube-on-plane", "-t", plugin.technique, "-t", "unshadowed",
        "--view-size", str(SIZE), "--rounds", "1", "-o", tmp_path,
    )  # fmt: skip
    with (tmp_path / "table.csv").open(newline="", encoding="utf-8") as stream:
        rows: dict[str, dict[str, Any]] = {row["technique"]: row for row in csv.DictReader(stream)}
    assert set(rows) == {plugin.technique, "unshadowed"}
    own, floor = rows[plugin.technique], rows["unshadowed"]
    assert own["status"] == "ok" and float(own["frame_ms"]) > 0 and float(own["pass_resolve_ms"]) > 0
    assert float(floor["iou"]) == 0 and float(own["iou"]) > plugin.least_iou
    assert float(own["ssim"]) > float(floor["ssim"])


def rendered(plugin: Plugin, folder: Path, spec: str) -> np.ndarray:
    """The mask of a technique on cube-on-plane, in [0, 1]."""
    picture, mask = folder / "picture.png", folder / "mask.png"
    plugin.command("render", "cube-on-plane", "-t", spec, "-o", picture, "--mask", mask, "--view-size", SIZE)
    with Image.open(picture) as image:
        assert image.size == (SIZE, SIZE) and len(image.getcolors(1 << 20)) > 3
    with Image.open(mask) as image:
        return np.asarray(image, dtype=np.float64) / 65535


@pytest.mark.slow
def test_the_package_s_mask_is_a_disc_on_the_plane(installed: Plugin, tmp_path: Path, builtin: Callable) -> None:
    """With half the cube's width, moved along the light from the cube's centre."""
    view = builtin("cube-on-plane", SIZE)
    right, up, back = view.camera.basis()
    across = (2 * np.arange(SIZE) + 1) / SIZE - 1
    slope = np.tan(view.camera.fov_y / 2)
    rays = slope * (across[None, :, None] * right - across[:, None, None] * up) - back
    eye, sun = np.array(view.camera.position), np.array(view.light.direction)
    ground = eye + rays * (-eye[1] / rays[..., 1])[..., None]
    centre = np.array([0.0, 0.5, 0.0]) + sun * (0.5 / -sun[1])
    expected = np.linalg.norm(ground - centre, axis=2) < 0.25
    shadow = rendered(installed, tmp_path, "blob-shadows:width=0.5") < 0.5
    # The cube hides the rest of the disc.
    assert shadow.sum() > 0.5 * expected.sum() and not (shadow & ~expected).any()


@pytest.mark.slow
def test_the_single_file_s_shadow_is_the_true_one_where_the_camera_sees_the_caster(
    single: Plugin, tmp_path: Path, truth_of: Callable
) -> None:
    truth = truth_of("cube-on-plane", SIZE)
    shadow = rendered(single, tmp_path, "screen-space:steps=256") < 0.5
    assert not shadow[~truth.receivers & ~truth.undecided].any()
    both = shadow & (truth.visibility < 0.5)
    assert both.sum() > 0.75 * shadow.sum()
