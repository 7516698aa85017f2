"""Registration of techniques: built in, from entry points and from files; broken ones are named."""

from importlib.metadata import EntryPoint
from pathlib import Path

import pytest

from shadowbench.errors import InputError
from shadowbench.maps.filters import PCF, Filter
from shadowbench.plugin import registry
from shadowbench.plugin.registry import own_techniques, shader_folder, source_file, techniques
from shadowbench.plugin.spec import parse_spec

PLUGIN = """
from shadowbench.plugin.base import Technique, TechniqueParams, param

class Dusk(Technique):
    name = "{name}"
    class Params(TechniqueParams):
        level: float = param(0.25, "visibility everywhere", ge=0, le=1)
    def build(self, stage):
        self.program = stage.program("fullscreen.vert", "dusk.frag", params=self.params)
        self.fullscreen = stage.fullscreen(self.program)
        self.visibility = stage.texture()
        self.target = stage.target(self.visibility)
    def draw(self, frame):
        self.program.set(light=frame.light_uniform)
        self.fullscreen.draw(self.target, frame.surface.inputs)
        return self.visibility
"""
SHADER = """
#include "receiver.glsl"
uniform float level;
out float visibility;
void main() { visibility = receiver_at(ivec2(gl_FragCoord.xy)).facing ? level : 1.0; }
"""
FILTER = """
from shadowbench.maps.filters import Filter, param

class Share(Filter):
    name = "{name}"
    shader = {shader!r}
    share: float = param(0.25, "visibility everywhere", ge=0, le=1)
    steps: int = param(1, "an int, which is a define", ge=1)
"""
FILTER_SHADER = """
uniform float filter_share;
float filter_visibility(ShadowCoord p) { return filter_share * float(FILTER_STEPS); }
"""
SHARE = FILTER.format(name="share", shader=FILTER_SHADER)


def plugin(folder: Path, text: str, file: str = "dusk.py") -> Path:
    path = folder / file
    path.parent.mkdir(exist_ok=True)
    path.write_text(text, encoding="utf-8")
    return path


@pytest.fixture
def entry_point(monkeypatch: pytest.MonkeyPatch):
    """Simulates an installed package with this entry point."""

    def install(value: str) -> None:
        point = EntryPoint("theirs", value, registry.GROUP)
        monkeypatch.setattr(registry, "entry_points", lambda group: [point] if group == registry.GROUP else [])

    return install


def test_a_file_brings_its_technique_and_the_shaders_beside_it(tmp_path: Path, studio, builtin, build) -> None:
    (tmp_path / "dusk.frag").write_text(SHADER, encoding="utf-8")
    file = plugin(tmp_path, PLUGIN.format(name="dusk"))
    known = techniques([file, file])
    assert shader_folder(known["dusk"]) == tmp_path and source_file(known["dusk"]) == file
    assert set(known) == {*techniques(), "dusk"}, "and only for those who asked for it"
    shot = studio.shot(builtin("cube-on-plane", 64))
    assert set(build("dusk:level=0.75", shot, known).draw(shot).ravel().tolist()) == {0.75, 1.0}


def test_a_file_may_bring_only_a_filter_for_every_technique_that_has_one(tmp_path: Path) -> None:
    """Until the next command; a file that has changed is loaded anew."""
    file = plugin(tmp_path, SHARE)
    known = techniques([file])
    assert set(known) == {one.name for one in own_techniques()}
    spec = parse_spec("cascades:filter=share(steps=2)", known)
    assert (spec.params.filter.share, spec.params.filter.steps) == (0.25, 2)
    assert spec.params.filter in spec.components
    with pytest.raises(InputError, match="share: found 2"):
        parse_spec("shadow-map:filter=share(2)", known)
    file.write_text(SHARE.replace("0.25", "0.75"))
    assert parse_spec("cascades:filter=share(steps=2)", techniques([file])).params.filter.share == 0.75
    with pytest.raises(InputError, match=r"cube-map.*unknown filter 'share'"):
        parse_spec("cube-map:filter=share", techniques())


@pytest.mark.parametrize("kind", ["text", "file", "file of a base"])
def test_the_shader_of_a_plugged_filter_is_text_or_a_file_beside_it(
    tmp_path: Path, studio, builtin, build, kind: str
) -> None:
    """Its parameters are passed as those of built-in filters, and it may include files beside it."""
    (tmp_path / "share.glsl").write_text('#include "uniforms.glsl"\n' + FILTER_SHADER.split(";", 1)[1])
    (tmp_path / "uniforms.glsl").write_text("uniform float filter_share;\n")
    text = SHARE if kind == "text" else FILTER.format(name="share", shader="share.glsl")
    if kind == "file of a base":
        text += "\nclass Heir(Share):\n    name = 'heir'\n"
    known = techniques([plugin(tmp_path, text)])
    name = "heir" if kind == "file of a base" else "share"
    shot = studio.shot(builtin("cube-on-plane", 32))
    mask = build(f"shadow-map:size=32,filter={name}(0.25,steps=3)", shot, known).draw(shot)
    assert set(mask.ravel().tolist()) == {0.75, 1.0}


def test_a_name_that_is_taken_is_an_error_that_names_both_files(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"two techniques are called 'shadow-map': .*shadow_map\.py and .*dusk\.py"):
        techniques([plugin(tmp_path, PLUGIN.format(name="shadow-map"))])
    with pytest.raises(InputError, match=r"two filters are called 'pcf': .*filters\.py and .*dusk\.py"):
        techniques([plugin(tmp_path, FILTER.format(name="pcf", shader=FILTER_SHADER))])
    assert Filter.table["pcf"] is PCF
    with pytest.raises(InputError, match=r"two filters are called 'share': .*a\.py and .*b\.py"):
        techniques([plugin(tmp_path, SHARE, f"{name}.py") for name in "ab"])


BROKEN = {
    "syntax": ("def (", "SyntaxError"),
    "raises": ("raise OSError('no such thing')", "OSError: no such thing"),
    "only imports the base": ("from shadowbench.plugin.base import Technique", "defines no subclass"),
    "nameless": (PLUGIN.replace('name = "{name}"', "pass"), "Dusk has no name"),
    "a nameless filter": ("from shadowbench.maps.filters import VSM\nclass A(VSM):\n    pass", "A has no name"),
    "a misnamed filter": (FILTER.format(name="no such!", shader=FILTER_SHADER), "name 'no such!' is not a valid name"),
    "incomplete": (
        "from shadowbench.plugin.base import Technique\nclass A(Technique):\n    name = 'a'\n",
        "A lacks build, draw; allowed",
    ),
}


def test_a_broken_plugin_is_one_line_that_names_the_file(tmp_path: Path) -> None:
    for text, wanted in BROKEN.values():
        file = plugin(tmp_path, text)
        with pytest.raises(InputError, match=wanted) as caught:
            techniques([file])
        assert str(file) in str(caught.value) and "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("value", "wanted"),
    [
        ("nothing_of_this_name:A", "cannot be imported"),
        ("shadowbench.techniques.shadow_map:np", "not a subclass of Technique"),
    ],
)
def test_a_broken_entry_point_is_left_out_and_named(entry_point, caplog, value: str, wanted: str) -> None:
    entry_point(value)
    assert set(techniques()) == {one.name for one in own_techniques()}
    (line,) = caplog.messages
    assert "entry point 'theirs'" in line and wanted in line and line.endswith("it is left out")
