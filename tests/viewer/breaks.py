"""Faults while the window is open, each told in it; run on a display: python tests/viewer/breaks.py FOLDER"""

import os
import shutil
import sys
from dataclasses import replace
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent))
from driver import Driver, drive  # type: ignore[import-not-found]

from shadowbench import files
from shadowbench.gl import gbuffer, picture
from shadowbench.plugin import stage
from shadowbench.plugin.registry import techniques
from shadowbench.plugin.spec import parse_spec
from shadowbench.scenes.library import load_scene
from shadowbench.viewer import changed_files, panes
from shadowbench.viewer.state import Origin, ViewerState

PLUGIN = """
from shadowbench.plugin.base import Technique
class Raises(Technique):
    '''Raises.'''
    name = "raises"
    def build(self, stage):
        pass
    def draw(self, frame):
        raise RuntimeError("as it does")
"""


def faults(d: Driver) -> None:
    viewer, file = d.viewer, Path("scene.toml")

    def told() -> str:
        return " ".join([viewer.message, viewer.broken, *viewer.mask_failures()])

    d.scored()
    d.choose("technique", "raises", "A", lambda: viewer.state.specs[0].text == "raises")
    d.until("what it raises", lambda: "RuntimeError: as it does" in told())
    d.choose("technique", "shadow-map", "A", lambda: viewer.state.specs[0].text == "shadow-map")
    d.scored()
    text = file.read_text()
    file.write_text("[[mesh]]\nshape = 3\n")
    d.until("nonsense", lambda: "scene.toml: [[mesh]] 1" in told())
    file.write_text(text.replace("direction = [", "direction = [0.1 + "))
    d.until("no TOML", lambda: "not TOML" in told())
    file.write_text(text)
    d.until("the scene again", lambda: "loaded again" in told())
    shader = Path("shaders/shadow-map/resolve.frag")
    source = shader.read_text()
    shader.write_text(source.replace("visibility =", "visible ="))
    d.until("a shader that does not compile", lambda: "ShaderError" in told() and "resolve.frag:7" in told())
    shader.write_text(source)
    d.until("the shader again", lambda: "ShaderError" not in told())
    spec = viewer.state.specs[0].with_(size=65536)
    viewer.change(replace(viewer.state, specs=(spec,)))
    d.until("the driver's no", lambda: "the driver refuses a map of 65536² texels" in told())
    d.click("undo")
    d.scored()


if __name__ == "__main__":
    os.chdir(sys.argv[1])
    Path("raises.py").write_text(PLUGIN)
    shutil.copy(files.data_folder("scenes") / "cube-on-plane.toml", "scene.toml")
    shutil.copytree(files.data_folder("shaders"), "shaders")
    for module in (gbuffer, picture, stage, panes, changed_files):
        module.data_folder = lambda kind: Path.cwd() / kind
    plugins = [Path("raises.py")]
    known, scene = techniques(plugins), load_scene("scene.toml")
    spec = parse_spec("shadow-map", known)
    state = ViewerState(scene, scene.cameras[0], scene.lights[0], (spec,), 128, Origin("scene.toml"))
    drive(state, known, faults, None, plugins)
