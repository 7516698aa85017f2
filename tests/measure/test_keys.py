"""Row keys: they depend on everything that affects a result, and on nothing else."""

import importlib.util
import shutil
import sys
from collections.abc import Callable, Iterator, Mapping
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from shadowbench import files, versions
from shadowbench.gl.device import Device
from shadowbench.gl.program import compose
from shadowbench.measure import keys
from shadowbench.measure.cells import Cell
from shadowbench.measure.keys import cell_key, shader_names, view_key
from shadowbench.measure.machine import machine_key
from shadowbench.measure.rendering import LoadedScene
from shadowbench.plugin import stage
from shadowbench.plugin.base import Technique
from shadowbench.plugin.registry import techniques
from shadowbench.plugin.spec import parse_spec
from shadowbench.scenes.library import load_scene
from shadowbench.scenes.model import Coordinates, View, view_digest, view_of
from shadowbench.scores.metrics import METRICS
from shadowbench.techniques.shadow_map import ShadowMap

DRAWER = {"renderer": "r", "embree": "e"}
KNOWN = techniques()


def key(
    spec: str = "shadow-map",
    view: str = "v",
    phase: int = 0,
    coordinates: Coordinates = "relative",
    **drawer: str,
) -> str:
    return cell_key(Cell(parse_spec(spec, KNOWN), phase), view, coordinates, DRAWER | drawer)


@pytest.fixture
def fresh() -> Iterator[Callable[[], None]]:
    """Clears the cached digests of shaders and plug-ins."""

    def clear() -> None:
        keys._sources.cache_clear()
        keys.glsl.cache_clear()

    clear()
    yield clear
    clear()


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
        "shadow-map:cull=false",
        "unshadowed",
    ],
)
def test_every_parameter_is_in_the_key(spec: str) -> None:
    assert key(spec) != key()


def test_a_machine_s_key_has_its_renderer_and_its_clock() -> None:
    def of(renderer: str = "r", clock: str = "wall", processor: str = "p") -> str:
        drawer: Any = SimpleNamespace(info=SimpleNamespace(renderer=renderer, clock=clock), machine={"cpu": processor})
        return machine_key(drawer)

    assert len({of(), of(renderer="another"), of(clock="another"), of(processor="another")}) == 4


def test_every_parameter_is_varied_above() -> None:
    assert set(ShadowMap.Params.model_fields) == {
        "size", "depth", "reversed", "bias", "filter", "fit", "wrap", "far_rule", "cull",
    }  # fmt: skip


def test_a_default_that_is_written_is_the_same_cell_and_a_changed_one_is_another(changed_default: Any) -> None:
    before = key(), key("shadow-map:size=512")
    assert key("shadow-map:bias=texel,size=1024") == key("shadow-map:bias=texel(scale=1)") == before[0]
    with changed_default(ShadowMap, "size", 512):
        assert key() != before[0]
        assert key() == before[1]
    assert key() == before[0]


def test_phase_coordinates_view_and_what_draws_and_traces_are_in_the_key() -> None:
    others = {
        key(phase=1),
        key(coordinates="absolute"),
        key(renderer="another driver"),
        key(embree="another processor"),
        key(view="another view"),
        key(),
    }
    assert len(others) == 6


def test_declared_versions_and_libraries_are_in_the_key(monkeypatch: pytest.MonkeyPatch) -> None:
    found, installed = [key()], versions.installed
    for version in ("DRAW", "TRACE", "SCORE"):
        with monkeypatch.context() as patch:
            patch.setattr(versions, version, getattr(versions, version) + 1)
            found.append(key())
    for library in ("embreex", "moderngl", "numpy", "pyglm", "scipy"):
        monkeypatch.setattr(versions, "installed", lambda name, library=library: name == library or installed(name))
        found.append(key())
    assert len(set(found)) == 9


def test_a_plug_in_s_metric_is_in_the_key_by_its_name_and_file(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    keys = [key()]
    for name, text in (("one", "def metric(): 1"), ("two", "def metric(): 1"), ("two", "def metric(): 2")):
        file, scope = tmp_path / "metrics.py", dict[str, Any]()
        file.write_text(text)
        exec(compile(text, file, "exec"), scope)
        with monkeypatch.context() as patch:
            patch.setitem(METRICS, name, replace(METRICS["iou"], name=name, function=scope["metric"]))
            keys.append(key())
    assert len(set(keys)) == 4


def test_a_view_differs_with_all_that_can_move_a_shadow(cube: View) -> None:
    camera, light, scene = cube.camera, cube.light, cube.scene
    plane = scene.meshes[0]
    joint = replace(plane, vertices=scene.geometry.vertices, faces=scene.geometry.faces)
    zeros = replace(plane, normals=np.zeros((len(plane.faces), 3, 3), np.float32))
    smooth = [replace(mesh, normals=np.ones((len(mesh.faces), 3, 3), np.float32)) for mesh in scene.meshes[1:]]
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
        replace(cube, scene=replace(scene, meshes=(joint,))),
        *(replace(cube, scene=replace(scene, meshes=(ground, *smooth))) for ground in (plane, zeros)),
    ]
    assert len({view_digest(view) for view in views}) == len(views)


def test_names_of_scene_view_and_light_are_in_the_key(cube: View) -> None:
    views = [
        cube,
        *(replace(cube, **{part: replace(getattr(cube, part), name="other")}) for part in ("scene", "camera", "light")),
    ]
    assert len({view_key(view) for view in views}) == len({key(view=view_key(view)) for view in views}) == 4


def test_names_and_colours_are_not_in_the_digest_of_a_view(cube: View) -> None:
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
    """A copy of the shaders, which keys use instead of the originals."""
    copy = tmp_path / "shaders"
    shutil.copytree(files.data_folder("shaders"), copy)
    monkeypatch.setattr(keys, "data_folder", lambda kind: tmp_path / kind)
    return copy


@pytest.mark.parametrize(
    ("file", "spec", "differs"),
    [
        ("shadow-map/resolve.frag", "shadow-map", True),
        ("shadow-map/resolve.frag", "unshadowed", False),
        ("shadow-map/resolve.frag", "light-samples:of=shadow-map", True),
        ("shadow-volume/count.frag", "soft-volume", True),
        ("unshadowed/resolve.frag", "unshadowed", True),
        ("receiver.glsl", "shadow-map", True),
        ("map/cube.glsl", "cube-map", True),
        ("fullscreen.vert", "shadow-map", True),
        ("gbuffer/gbuffer.frag", "unshadowed", True),
        ("bias/texel.glsl", "shadow-map", True),
        ("bias/slope.glsl", "shadow-map:bias=slope+texel", True),
        ("filter/disc.glsl", "shadow-map:filter=pcss", True),  # included by its shader
        ("filter/disc.glsl", "light-samples:of=shadow-map(filter=pcss)", True),
    ],
)
def test_a_key_knows_the_shaders_that_its_cell_uses(
    shaders: Path, fresh: Callable[[], None], file: str, spec: str, differs: bool
) -> None:
    before = key(spec)
    text = shaders / file
    text.write_text(text.read_text() + "float another;\n")
    fresh()
    assert (key(spec) != before) == differs


def test_comments_and_layout_of_shaders_are_in_no_key(shaders: Path, fresh: Callable[[], None]) -> None:
    before = {name: key(name) for name in KNOWN}
    file = shaders / "receiver.glsl"
    file.write_text(
        "// another comment\n\n" + file.read_text().replace("\n", " // and here\n    ") + "/* and\n here */\n"
    )
    fresh()
    assert {name: key(name) for name in KNOWN} == before


def test_a_new_shader_file_is_in_no_key_of_a_technique_that_draws_alone(
    shaders: Path, fresh: Callable[[], None]
) -> None:
    alone = [name for name, technique in KNOWN.items() if not technique.catalogue.builds_on]
    before = {name: key(name) for name in alone}
    (shaders / "filter" / "new.glsl").write_text("float another;\n")
    receiver = shaders / "receiver.glsl"
    receiver.rename(shaders / "part.glsl")
    receiver.write_text('#include "part.glsl"\n')
    fresh()
    assert {name: key(name) for name in alone} == before


@pytest.mark.parametrize(
    "spec", [f"{name}:{more}".rstrip(":") for name in KNOWN for more in KNOWN[name].catalogue.variants]
)
def test_every_shader_that_a_technique_composes_is_in_its_key(
    device: Device, cube: View, spec: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    composed: set[str] = set()

    def watched(source: Path | str, roots: Any, defines: Any, slots: Mapping[str, str], **others: Any) -> str:
        text = compose(source, roots, defines, slots)
        composed.update(name for name, _ in text.places if name)
        return text

    monkeypatch.setattr(stage, "compose", watched)
    parsed, loaded = parse_spec(spec, KNOWN), LoadedScene(device, cube.scene, "relative")
    loaded.build(parsed, 32)[1].release()
    loaded.release()
    names = shader_names(parsed.techniques, map(type, parsed.components), plugged=False)
    assert composed <= set().union(*(keys.glsl(name)[1] for name in names))


def load(file: Path, name: str = "Half") -> type[Technique]:
    """A technique of a file."""
    spec = importlib.util.spec_from_file_location(f"plugin_in_test_{file.stem}", file)
    assert spec is not None and spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules[spec.name] = module
    spec.loader.exec_module(module)
    return getattr(module, name)  # type: ignore[no-any-return]


@pytest.fixture
def plugged(fresh: Callable[[], None]) -> Callable[..., str]:
    """The key of a technique loaded again from a file."""

    def read(file: Path, name: str = "Half") -> str:
        fresh()
        return cell_key(Cell(parse_spec("half", {"half": load(file, name)}), 0), "v", "relative", DRAWER)

    return read


def test_a_plug_in_s_source_and_the_shaders_beside_it_are_in_its_key(
    half: Path, tmp_path: Path, plugged: Callable[..., str]
) -> None:
    file = tmp_path / "half.py"
    shutil.copy(half, file)
    found = [plugged(file)]
    for beside in ("notes.txt", "other.py"):  # nothing to do with it
        (tmp_path / beside).write_text("")
        assert plugged(file) == found[0]
    (tmp_path / "half.frag").write_text("// a shader beside it\n")
    found.append(plugged(file))
    (tmp_path / "filters").mkdir()
    (tmp_path / "filters" / "half.glsl").write_text("// a shader below it\n")
    found.append(plugged(file))
    file.write_text(file.read_text() + "# changed\n")
    found.append(plugged(file))
    assert len(set(found)) == 4


def test_the_whole_package_of_a_plug_in_is_in_its_key(half: Path, tmp_path: Path, plugged: Callable[..., str]) -> None:
    package = tmp_path / "package"
    (package / "soft" / "shaders" / "deep").mkdir(parents=True)
    for folder in (package, package / "soft"):
        (folder / "__init__.py").write_text("")
    file = package / "soft" / "half.py"
    shutil.copy(half, file)
    found = [plugged(file)]
    for other in ("soft/helper.py", "soft/shaders/deep/half.frag", "common.py"):
        (package / other).write_text("// new\n")
        found.append(plugged(file))
    (tmp_path / "beside.py").write_text("")
    (package / "notes.txt").write_text("")
    assert plugged(file) == found[-1] and len(set(found)) == 4


FILTER = """
from shadowbench.maps.filters import Hard


class Plugged(Hard):
    name = "plugged"
    shader = "plugged.glsl"
"""


@pytest.mark.parametrize("spec", ["shadow-map:filter={}", "light-samples:of=shadow-map(filter={})"])
def test_a_plugged_filter_s_file_and_shader_are_in_the_keys_of_the_cells_that_use_it(
    tmp_path: Path, fresh: Callable[[], None], spec: str
) -> None:
    file, shader = tmp_path / "plugged.py", tmp_path / "plugged.glsl"
    file.write_text(FILTER)

    def found(name: str) -> str:
        fresh()
        return cell_key(Cell(parse_spec(spec.format(name), techniques([file])), 0), "v", "relative", DRAWER)

    plugged, other = [found("plugged")], found("hard")
    for changed in (file, shader):
        with changed.open("a") as stream:
            stream.write("# changed\n")
        plugged.append(found("plugged"))
        assert found("hard") == other
    assert found("plugged") == plugged[-1]
    assert len({*plugged, other}) == 4


INHERITS = """
from {module} import {parent}


class Heir({parent}):
    name = "half"
"""


@pytest.mark.parametrize("whole", [True, False])
def test_a_plug_in_whose_class_or_parameters_are_derived_from_another_s_rests_on_its_file_too(
    half: Path, tmp_path: Path, plugged: Callable[..., str], whole: bool
) -> None:
    parent, heir = tmp_path / "parent" / "half.py", tmp_path / "heir.py"
    parent.parent.mkdir()
    shutil.copy(half, parent)
    load(parent)
    text = half.read_text().replace("class Params(TechniqueParams)", "class Params(Other.Params)")
    params = "from plugin_in_test_half import Half as Other\n" + text
    heir.write_text(INHERITS.format(module="plugin_in_test_half", parent="Half") if whole else params)
    before = plugged(heir, "Heir" if whole else "Half")
    parent.write_text(parent.read_text() + "# changed\n")
    assert plugged(heir, "Heir" if whole else "Half") != before


@pytest.mark.parametrize(
    ("file", "differs"),
    [("shadow-map/resolve.frag", True), ("shadow_map.glsl", True), ("unshadowed/resolve.frag", False)],
)
def test_a_plug_in_that_inherits_from_ours_rests_on_its_shaders_too(
    tmp_path: Path, shaders: Path, plugged: Callable[..., str], file: str, differs: bool
) -> None:
    heir = tmp_path / "heir.py"
    heir.write_text(INHERITS.format(module=ShadowMap.__module__, parent="ShadowMap"))
    before = plugged(heir, "Heir")
    (shaders / file).write_text("float another;\n")
    assert (plugged(heir, "Heir") != before) == differs
