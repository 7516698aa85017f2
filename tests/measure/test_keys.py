"""Row keys: they depend on everything that affects a result, and on nothing else."""

import shutil
from collections.abc import Callable, Iterator, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from shadowbench import files, versions
from shadowbench.gl.device import Device
from shadowbench.gl.program import compose
from shadowbench.measure import keys
from shadowbench.measure.campaign import Cell
from shadowbench.measure.keys import cell_key, shader_names, view_key
from shadowbench.measure.session import LoadedScene
from shadowbench.options import ViewSize
from shadowbench.plugin import stage
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
        keys._shader.cache_clear()

    clear()
    yield clear
    clear()


@pytest.fixture
def cube() -> View:
    scene = load_scene("cube-on-plane")
    return view_of(scene, scene.cameras[0], scene.lights[0], 64)


CHANGES: dict[str, dict[str, Any]] = {
    "nothing": {},
    "map size": {"spec": "shadow-map:size=512"},
    "a bias's parameter": {"spec": "shadow-map:bias=texel(scale=1.001)"},
    "a filter's parameter": {"spec": "shadow-map:filter=pcf(taps=5)"},
    "technique": {"spec": "unshadowed"},
    "phase": {"phase": 1},
    "coordinates": {"coordinates": "absolute"},
    "renderer": {"renderer": "another driver"},
    "rounding of Embree": {"embree": "another processor"},
    "view": {"view": "another view"},
}


def test_every_parameter_and_what_draws_and_traces_are_in_the_key() -> None:
    assert len({key(**change) for change in CHANGES.values()}) == len(CHANGES)


def test_a_default_that_is_written_is_the_same_cell() -> None:
    assert key("shadow-map:bias=texel,size=1024") == key("shadow-map:bias=texel(scale=1)") == key()


def test_declared_versions_and_libraries_are_in_the_key(monkeypatch: pytest.MonkeyPatch) -> None:
    digests, installed = [key()], versions.installed
    for version in ("DRAW", "TRACE", "SCORE"):
        with monkeypatch.context() as patch:
            patch.setattr(versions, version, getattr(versions, version) + 1)
            digests.append(key())
    for library in ("embreex", "moderngl", "numpy", "pyglm", "scipy"):
        monkeypatch.setattr(versions, "installed", lambda name, library=library: name == library or installed(name))
        digests.append(key())
    assert len(set(digests)) == 9


def test_a_plug_in_s_metric_is_in_the_key_by_its_name_and_file(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    digests = [key()]
    for name, text in (("one", "def metric(): 1"), ("two", "def metric(): 1"), ("two", "def metric(): 2")):
        file, scope = tmp_path / "metrics.py", dict[str, Any]()
        file.write_text(text)
        exec(compile(text, file, "exec"), scope)
        with monkeypatch.context() as patch:
            patch.setitem(METRICS, name, replace(METRICS["iou"], name=name, function=scope["metric"]))
            digests.append(key())
    assert len(set(digests)) == 4


def test_a_view_differs_with_all_that_can_move_a_shadow(cube: View) -> None:
    camera, light, scene = cube.camera, cube.light, cube.scene
    plane, box = scene.meshes
    views = [
        cube,
        replace(cube, size=65),
        *(replace(cube, camera=replace(camera, **change)) for change in (
            {"position": (2.3, 2.2, 3.0000001)}, {"target": (0.4, 0.2, -0.1)}, {"up": (0.1, 1.0, 0.0)},
            {"fov_y": camera.fov_y * 1.001}, {"near": 0.1}, {"far": 99.0},
        )),
        *(replace(cube, light=replace(light, **change)) for change in (
            {"direction": (0.85, -0.8, -0.5000001)}, {"radius": 0.1}, {"kind": "point", "position": (0.0, 3.0, 0.0)},
            {"kind": "spot", "position": (0.0, 3.0, 0.0), "angle": 1.0},
        )),
        *(replace(cube, scene=replace(scene, meshes=meshes)) for meshes in (
            (replace(plane, vertices=plane.vertices - [0, 1e-12, 0]), box), (replace(plane, casts=False), box),
            (replace(plane, receives=False), box), (box, plane),
            (plane, replace(box, normals=np.ones((len(box.faces), 3, 3), np.float32))),
        )),
    ]  # fmt: skip
    assert len({view_digest(view) for view in views}) == len(views)


def test_names_of_scene_view_and_light_are_in_the_key(cube: View) -> None:
    views = [
        cube,
        *(replace(cube, **{part: replace(getattr(cube, part), name="other")}) for part in ("scene", "camera", "light")),
    ]
    assert len({view_key(view) for view in views}) == len({key(view=view_key(view)) for view in views}) == 4
    assert len({view_digest(view) for view in views}) == 1


@pytest.fixture
def shaders(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A copy of the shaders, which keys use instead of the originals."""
    monkeypatch.setattr(keys, "data_folder", lambda kind: tmp_path / kind)
    return Path(shutil.copytree(files.data_folder("shaders"), tmp_path / "shaders"))


USES = (
    ("shadow-map/resolve.frag", "shadow-map", True),
    ("shadow-map/resolve.frag", "unshadowed", False),
    ("shadow-map/resolve.frag", "light-samples:of=shadow-map", True),
    ("shadow-volume/count.frag", "soft-volume", True),
    ("filter/disc.glsl", "light-samples:of=shadow-map(filter=pcss)", True),
)


def test_a_key_knows_the_shaders_that_its_cell_uses(shaders: Path, fresh: Callable[[], None]) -> None:
    for file, spec, differs in USES:
        fresh()
        before = key(spec)
        text = (shaders / file).read_text()
        (shaders / file).write_text(text + "float another;\n")
        fresh()
        assert (key(spec) != before) == differs, (file, spec)
        (shaders / file).write_text(text)


def test_comments_and_layout_of_shaders_are_in_no_key(shaders: Path, fresh: Callable[[], None]) -> None:
    before = {name: key(name) for name in KNOWN}
    file = shaders / "receiver.glsl"
    text = file.read_text().replace("\n", " // and here\n    ")
    file.write_text(f"// another comment\n\n{text}/* and\n here */\n")
    fresh()
    assert {name: key(name) for name in KNOWN} == before


def test_every_shader_that_a_technique_composes_is_in_its_key(
    device: Device, cube: View, monkeypatch: pytest.MonkeyPatch
) -> None:
    composed: set[str] = set()

    def watched(source: Path | str, roots: Any, defines: Any, slots: Mapping[str, str], **others: Any) -> str:
        text = compose(source, roots, defines, slots)
        composed.update(name for name, _ in text.places if name)
        return text

    monkeypatch.setattr(stage, "compose", watched)
    for spec in (f"{name}:{more}".rstrip(":") for name in KNOWN for more in KNOWN[name].catalogue.variants):
        composed.clear()
        parsed, loaded = parse_spec(spec, KNOWN), LoadedScene(device, cube.scene, cube.scene.placement)
        loaded.build(parsed, ViewSize(32, 32))[1].release()
        loaded.release()
        assert composed <= set(shader_names(parsed.techniques)), spec


INHERITS = f"""
from {ShadowMap.__module__} import ShadowMap


class Heir(ShadowMap):
    name = "heir"
"""


def test_a_plug_in_s_package_what_it_inherits_and_the_shaders_beside_it_are_in_its_key(
    half: Path, tmp_path: Path, shaders: Path, fresh: Callable[[], None]
) -> None:
    alone, package = tmp_path / "alone", tmp_path / "package"
    for folder in (alone, package / "soft"):
        folder.mkdir(parents=True)
        shutil.copy(half, folder / "half.py")
    for folder in (package, package / "soft"):
        (folder / "__init__.py").write_text("")
    (alone / "heir.py").write_text(INHERITS)
    table: list[tuple[Path, str, Path, bool]] = [
        (alone / "half.py", "half", alone / "half.py", True),
        (alone / "half.py", "half", alone / "deep" / "half.glsl", True),
        (alone / "half.py", "half", alone / "notes.txt", False),
        (alone / "half.py", "half", alone / "other.py", False),
        (package / "soft" / "half.py", "half", package / "common.py", True),
        (alone / "heir.py", "heir", shaders / "shadow-map" / "resolve.frag", True),
    ]
    for plugin, spec, changed, differs in table:

        def digest(plugin: Path = plugin, spec: str = spec) -> str:
            fresh()
            return cell_key(Cell(parse_spec(spec, techniques([plugin])), 0), "v", "relative", DRAWER)

        before = digest()
        changed.parent.mkdir(exist_ok=True)
        with changed.open("a") as stream:
            stream.write("# changed\n" if changed.suffix == ".py" else "// changed\nfloat another;\n")
        assert (digest() != before) == differs, (spec, changed)
