"""Keys: everything that a result rests on, and nothing else."""

import importlib.util
import shutil
import sys
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path

import pytest

from shadowbench import data
from shadowbench.scenes.digest import view_digest
from shadowbench.scenes.library import load_scene
from shadowbench.scenes.model import View, view_of
from shadowbench.studies import keys
from shadowbench.studies.keys import cell_key
from shadowbench.studies.study import Cell
from shadowbench.techniques.base import Technique
from shadowbench.techniques.registry import techniques
from shadowbench.techniques.shadow_map import ShadowMap
from shadowbench.techniques.spec import parse_spec

KNOWN = techniques()


def key(spec: str = "shadow-map", view: str = "v", phase: int = 0, renderer: str = "r", **options: str) -> str:
    return cell_key(Cell(parse_spec(spec, KNOWN), phase), view, options.get("coordinates", "relative"), renderer)  # type: ignore[arg-type]


@pytest.fixture
def fresh() -> Iterator[Callable[[], None]]:
    """Forgets the digests of sources, which a process reads once."""
    keys._sources.cache_clear()
    yield keys._sources.cache_clear
    keys._sources.cache_clear()


@pytest.fixture
def cube() -> View:
    scene = load_scene("cube-on-plane")
    return view_of(scene, scene.cameras[0], scene.lights[0], 64)


@pytest.mark.parametrize(
    "spec",
    [
        "shadow-map:size=512",
        "shadow-map:depth=d24",
        "shadow-map:reversed=true",
        "shadow-map:bias=none",
        "shadow-map:bias=texel(scale=1.001)",
        "shadow-map:filter=hard",
        "shadow-map:filter=pcf(taps=5)",
        "shadow-map:fit=scene",
        "shadow-map:wrap=edge",
        "shadow-map:far_rule=none",
        "unshadowed",
    ],
)
def test_every_parameter_is_in_the_key(spec: str) -> None:
    assert key(spec) != key()


def test_every_parameter_is_varied_above() -> None:
    assert set(ShadowMap.Params.model_fields) == {
        "size", "depth", "reversed", "bias", "filter", "fit", "wrap", "far_rule",
    }  # fmt: skip


def test_a_default_that_is_written_is_the_same_cell() -> None:
    assert key("shadow-map:bias=texel,size=1024") == key()
    assert key("shadow-map:bias=texel(scale=1)") == key()


def test_a_changed_default_is_another_cell(monkeypatch: pytest.MonkeyPatch) -> None:
    before = key(), key("shadow-map:size=512")
    monkeypatch.setattr(ShadowMap.Params.model_fields["size"], "default", 512)
    ShadowMap.Params.model_rebuild(force=True)
    try:
        assert key() != before[0]
        assert key() == before[1]
    finally:
        monkeypatch.undo()
        ShadowMap.Params.model_rebuild(force=True)
    assert key() == before[0]


def test_phase_coordinates_renderer_and_view_are_in_the_key() -> None:
    others = {
        key(phase=1),
        key(coordinates="absolute"),
        key(renderer="another driver"),
        key(view="another view"),
        key(),
    }
    assert len(others) == 5


def test_a_view_differs_with_all_that_can_move_a_shadow(cube: View) -> None:
    camera, light, scene = cube.camera, cube.light, cube.scene
    plane = scene.meshes[0]
    lower = replace(scene, meshes=(replace(plane, vertices=plane.vertices - [0, 1e-12, 0]), *scene.meshes[1:]))
    views = [
        cube,
        replace(cube, size=65),
        replace(cube, camera=replace(camera, position=(2.3, 2.2, 3.0000001))),
        replace(cube, camera=replace(camera, target=(0.4, 0.2, -0.1))),
        replace(cube, camera=replace(camera, up=(0.1, 1.0, 0.0))),
        replace(cube, camera=replace(camera, fov_y=camera.fov_y * 1.001)),
        replace(cube, camera=replace(camera, near=0.1)),
        replace(cube, camera=replace(camera, far=99.0)),
        replace(cube, light=replace(light, direction=(0.85, -0.8, -0.5000001))),
        replace(cube, light=replace(light, radius=0.1)),
        replace(cube, light=replace(light, kind="point", position=(0.0, 3.0, 0.0))),
        replace(cube, light=replace(light, kind="spot", position=(0.0, 3.0, 0.0), angle=1.0)),
        replace(cube, scene=lower),
        replace(cube, scene=replace(scene, meshes=(replace(plane, casts=False), *scene.meshes[1:]))),
        replace(cube, scene=replace(scene, meshes=(replace(plane, receives=False), *scene.meshes[1:]))),
        replace(cube, scene=replace(scene, meshes=scene.meshes[:1])),
        replace(cube, scene=replace(scene, meshes=scene.meshes[::-1])),
    ]
    assert len({view_digest(view) for view in views}) == len(views)


def test_names_and_colours_are_not_in_the_key(cube: View) -> None:
    scene = cube.scene
    meshes = tuple(replace(mesh, name="x", color=(0.1, 0.2, 0.3)) for mesh in scene.meshes)
    renamed = View(
        replace(scene, name="other", meshes=meshes, notes=("a note",)),
        replace(cube.camera, name="other"),
        replace(cube.light, name="other"),
        cube.size,
    )
    assert view_digest(renamed) == view_digest(cube)


@pytest.fixture
def shaders(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A copy of the shaders that keys read in place of ours."""
    copy = tmp_path / "shaders"
    shutil.copytree(data.data_folder("shaders"), copy)
    monkeypatch.setattr(keys, "data_folder", lambda kind: tmp_path / kind)
    return copy


@pytest.mark.parametrize(
    ("file", "spec", "differs"),
    [
        ("shadow-map/resolve.frag", "shadow-map", True),
        ("shadow-map/resolve.frag", "unshadowed", False),
        ("unshadowed/resolve.frag", "shadow-map", False),
        ("unshadowed/resolve.frag", "unshadowed", True),
        ("receiver.glsl", "shadow-map", True),
        ("receiver.glsl", "unshadowed", True),
        ("fullscreen.vert", "shadow-map", True),
    ],
)
def test_a_key_knows_the_shaders_of_its_technique_and_the_shared(
    shaders: Path, fresh: Callable[[], None], file: str, spec: str, differs: bool
) -> None:
    before = key(spec)
    text = shaders / file
    text.write_text(text.read_text() + "// another word\n")
    fresh()
    assert (key(spec) != before) == differs


def test_a_shared_row_s_shader_is_in_the_key(shaders: Path, fresh: Callable[[], None]) -> None:
    before = key()
    (shaders / "bias").mkdir(exist_ok=True)
    (shaders / "bias" / "new.glsl").write_text("// a new bias\n")
    fresh()
    assert key() != before


def load(file: Path) -> type[Technique]:
    spec = importlib.util.spec_from_file_location("plugin_in_test", file)
    assert spec is not None and spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules[spec.name] = module
    spec.loader.exec_module(module)
    return module.Half  # type: ignore[no-any-return]


def test_a_plug_in_s_source_and_the_shaders_beside_it_are_in_its_key(
    half: Path, tmp_path: Path, fresh: Callable[[], None]
) -> None:
    file = tmp_path / "half.py"
    shutil.copy(half, file)

    def plugged() -> str:
        fresh()
        return cell_key(Cell(parse_spec("half", {"half": load(file)}), 0), "v", "relative", "r")

    before = plugged()
    assert plugged() == before
    (tmp_path / "notes.txt").write_text("nothing to do with it")
    assert plugged() == before
    (tmp_path / "half.frag").write_text("// a shader beside it\n")
    beside = plugged()
    assert beside != before
    file.write_text(file.read_text() + "# changed\n")
    assert plugged() != beside


def test_a_key_does_not_know_another_technique_s_file(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, fresh: Callable[[], None]
) -> None:
    own = {technique: keys.source_file(technique) for technique in keys.OWN}
    changed = tmp_path / own[ShadowMap].name
    changed.write_text(own[ShadowMap].read_text() + "# changed\n")
    before = key("shadow-map"), key("unshadowed")

    def moved(technique: type[Technique]) -> Path:
        return changed if technique is ShadowMap else own[technique]

    shared = list(keys._shared(ShadowMap))
    assert own[ShadowMap] not in shared
    monkeypatch.setattr(keys, "_shared", lambda technique: shared)
    monkeypatch.setattr(keys, "source_file", moved)
    fresh()
    assert key("shadow-map") != before[0]
    assert key("unshadowed") == before[1]
