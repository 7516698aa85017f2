"""Row keys: they depend on everything that affects a result, and on nothing else."""

import importlib.util
import shutil
import sys
import tomllib
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from shadowbench import data
from shadowbench.measure import keys
from shadowbench.measure.cells import Cell
from shadowbench.measure.keys import cell_key
from shadowbench.scenes.digest import view_digest
from shadowbench.scenes.library import load_scene
from shadowbench.scenes.model import Coordinates, View, view_of
from shadowbench.techniques.base import Technique
from shadowbench.techniques.registry import source_file, techniques
from shadowbench.techniques.shadow_map import ShadowMap
from shadowbench.techniques.spec import parse_spec

ROOT = Path(__file__).resolve().parents[2]
FAULTS = [
    (name, tests.split()[2], texts[::3])
    for tests, faults in tomllib.loads((ROOT / "tests" / "faults" / "faults.toml").read_text(encoding="utf-8")).items()
    for name, texts in faults.items()
    if tests.startswith("cells of ")
]
KNOWN = techniques()


def key(
    spec: str = "shadow-map",
    view: str = "v",
    phase: int = 0,
    renderer: str = "r",
    coordinates: Coordinates = "relative",
) -> str:
    return cell_key(Cell(parse_spec(spec, KNOWN), phase), view, coordinates, renderer)


@pytest.fixture
def fresh() -> Iterator[Callable[[], None]]:
    """Clears the cached digests of sources."""
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
        "shadow-map:cull=false",
        "unshadowed",
    ],
)
def test_every_parameter_is_in_the_key(spec: str) -> None:
    assert key(spec) != key()


def test_every_parameter_is_varied_above() -> None:
    assert set(ShadowMap.Params.model_fields) == {
        "size", "depth", "reversed", "bias", "filter", "fit", "wrap", "far_rule", "cull",
    }  # fmt: skip


def test_a_default_that_is_written_is_the_same_cell() -> None:
    assert key("shadow-map:bias=texel,size=1024") == key()
    assert key("shadow-map:bias=texel(scale=1)") == key()


def test_a_changed_default_is_another_cell(changed_default: Any) -> None:
    before = key(), key("shadow-map:size=512")
    with changed_default(ShadowMap, "size", 512):
        assert key() != before[0]
        assert key() == before[1]
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


def test_rows_have_names_and_so_has_their_key(cube: View) -> None:
    """Two lights that shine alike are two rows of a table."""
    named = [replace(cube, light=replace(cube.light, name="b")), replace(cube, camera=replace(cube.camera, name="b"))]
    assert len({key(view=keys.view_key(view)) for view in (cube, *named)}) == 3


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
    """A copy of the shaders, which keys use instead of the originals."""
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


EDITED = [
    ("techniques/shadow_map.py", "shadow-map", True),
    ("techniques/shadow_map.py", "unshadowed", False),
    ("techniques/unshadowed.py", "shadow-map", False),
    ("techniques/unshadowed.py", "unshadowed", True),
    ("techniques/ray_traced.py", "shadow-map", False),
    ("techniques/shadow_map.py", "light-samples:of=shadow-map", True),
    ("techniques/shadow_map.py", "light-samples:of=ray-traced", False),
    ("../shaders/shadow-volume/count.frag", "soft-volume", True),
    ("../shaders/shadow-volume/count.frag", "light-samples:of=ray-traced", False),
    ("techniques/base.py", "shadow-map", True),
    ("techniques/biases.py", "unshadowed", True),
    ("techniques/params.py", "unshadowed", True),
    ("gl/gbuffer.py", "unshadowed", True),
    ("truths/rays.py", "unshadowed", True),
    ("scores/ssim.py", "unshadowed", True),
    ("scenes/model.py", "unshadowed", True),
    ("geometry/planes.py", "planar-projection", True),
    ("geometry/topology.py", "shadow-volume", True),
    ("geometry/topology.py", "shadow-map", False),
    ("gl/raw.py", "unshadowed", True),
    ("truths/cache.py", "unshadowed", True),
    ("measure/session.py", "unshadowed", True),
    ("measure/loaded_scene.py", "unshadowed", True),
    ("measure/scoring.py", "unshadowed", True),
    ("studies/tables.py", "unshadowed", False),
    ("commands/run.py", "unshadowed", False),
]


@pytest.fixture
def edit(monkeypatch: pytest.MonkeyPatch, fresh: Callable[[], None]) -> Callable[..., None]:
    """Makes files read as if a line were appended, without writing to them, as other processes may read them."""
    read = Path.read_bytes

    def edited(*files: Path) -> None:
        assert all(file.is_file() for file in files)
        monkeypatch.setattr(Path, "read_bytes", lambda self: read(self) + b"# edited\n" * (self in files))
        fresh()

    return edited


@pytest.mark.parametrize(("file", "spec", "differs"), EDITED)
def test_a_key_knows_the_code_that_its_result_rests_on(
    edit: Callable[..., None], file: str, spec: str, differs: bool
) -> None:
    before = key(spec)
    edit((Path(data.__file__).parent / file).resolve())
    assert (key(spec) != before) == differs


def test_a_technique_s_own_file_is_in_no_key_of_a_spec_that_does_not_name_it(edit: Callable[..., None]) -> None:
    before = {name: key(name) for name in KNOWN}
    for technique in KNOWN.values():
        edit(source_file(technique))
        named = [name for name in KNOWN if technique in parse_spec(name, KNOWN).techniques]
        assert [other for other in KNOWN if key(other) != before[other]] == named


@pytest.mark.parametrize(("technique", "files"), [pytest.param(*of, id=name) for name, *of in FAULTS])
def test_a_planted_fault_changes_the_keys_of_its_technique(
    edit: Callable[..., None], technique: str, files: list[str]
) -> None:
    before = key(technique)
    for file in files:
        edit(ROOT / file)
        assert key(technique) != before


@pytest.mark.parametrize("room", ["reports", "commands", "advice", "check", "extremes", "engines", "survey"])
def test_edits_to_reports_and_commands_change_no_key(edit: Callable[..., None], room: str) -> None:
    before = {name: key(name) for name in KNOWN}
    files = sorted((ROOT / "shadowbench" / room).rglob("*.py"))
    assert files
    edit(*files)
    assert {name: key(name) for name in KNOWN} == before


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
        return cell_key(Cell(parse_spec("half", {"half": load(file, name)}), 0), "v", "relative", "r")

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
    (tmp_path / "beside.py").write_text("")
    (package / "notes.txt").write_text("")
    assert plugged(file) == found[0]
    for other in ("soft/helper.py", "soft/shaders/deep/half.frag", "common.py"):
        (package / other).write_text("// new\n")
        found.append(plugged(file))
    assert len(set(found)) == 4


def test_modules_that_a_plug_in_package_imports_from_shadowbench_are_in_its_key(
    half: Path, tmp_path: Path, edit: Callable[..., None], plugged: Callable[..., str]
) -> None:
    package = tmp_path / "package"
    package.mkdir()
    (package / "__init__.py").write_text("")
    file = package / "half.py"
    shutil.copy(half, file)
    (package / "helper.py").write_text("from shadowbench.techniques import culling\n")
    (package / "template.py").write_text("{{ no Python }}")
    before = plugged(file)
    edit(ROOT / "shadowbench" / "techniques" / "layers.py")
    assert plugged(file) == before
    edit(ROOT / "shadowbench" / "techniques" / "culling.py")
    assert plugged(file) != before


FILTER = """
from shadowbench.techniques.filters import Hard


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
        return cell_key(Cell(parse_spec(spec.format(name), techniques([file])), 0), "v", "relative", "r")

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


def test_a_plug_in_that_inherits_from_another_rests_on_its_file_too(
    half: Path, tmp_path: Path, plugged: Callable[..., str]
) -> None:
    parent, heir = tmp_path / "parent" / "half.py", tmp_path / "heir.py"
    parent.parent.mkdir()
    shutil.copy(half, parent)
    load(parent)
    heir.write_text(INHERITS.format(module="plugin_in_test_half", parent="Half"))
    before = plugged(heir, "Heir")
    parent.write_text(parent.read_text() + "# changed\n")
    assert plugged(heir, "Heir") != before


def test_a_plug_in_whose_parameters_are_another_s_rests_on_its_file_too(
    half: Path, tmp_path: Path, plugged: Callable[..., str]
) -> None:
    parent, heir = tmp_path / "parent" / "half.py", tmp_path / "heir.py"
    parent.parent.mkdir()
    shutil.copy(half, parent)
    load(parent)
    text = half.read_text().replace("class Params(TechniqueParams)", "class Params(Other.Params)")
    heir.write_text("from plugin_in_test_half import Half as Other\n" + text)
    before = plugged(heir)
    parent.write_text(parent.read_text() + "# changed\n")
    assert plugged(heir) != before


@pytest.mark.parametrize(("file", "differs"), [("techniques/shadow_map.py", True), ("techniques/ray_traced.py", False)])
def test_a_plug_in_that_inherits_from_ours_rests_on_its_file_too(
    tmp_path: Path, edit: Callable[..., None], plugged: Callable[..., str], file: str, differs: bool
) -> None:
    heir = tmp_path / "heir.py"
    heir.write_text(INHERITS.format(module=ShadowMap.__module__, parent="ShadowMap"))
    before = plugged(heir, "Heir")
    edit((Path(data.__file__).parent / file).resolve())
    assert (plugged(heir, "Heir") != before) == differs


@pytest.mark.parametrize(("file", "differs"), [("shadow-map/resolve.frag", True), ("unshadowed/resolve.frag", False)])
def test_a_plug_in_that_inherits_from_ours_rests_on_its_shaders_too(
    tmp_path: Path, shaders: Path, plugged: Callable[..., str], file: str, differs: bool
) -> None:
    heir = tmp_path / "heir.py"
    heir.write_text(INHERITS.format(module=ShadowMap.__module__, parent="ShadowMap"))
    before = plugged(heir, "Heir")
    (shaders / file).write_text("// another text\n")
    assert (plugged(heir, "Heir") != before) == differs
