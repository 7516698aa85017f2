"""What the terminal says of a window that was not closed."""

import subprocess
import sys
from pathlib import Path

import pytest

SCRIPT = """
import sys
from pathlib import Path
from shadowbench.gl.device import open_device
from shadowbench.scenes.library import load_scene
from shadowbench.plugin.registry import techniques
from shadowbench.plugin.spec import parse_spec
from shadowbench.viewer.drawing import Drawing
from shadowbench.viewer.state import ViewerState
from shadowbench.viewer.crash_reporter import CrashReporter

known = techniques([Path(sys.argv[1])])
scene = load_scene("post")
specs = tuple(parse_spec(text, known) for text in ("unshadowed", sys.argv[2]))
with CrashReporter() as reporter:
    drawing = Drawing(open_device())
    drawing.tell = reporter.tell
    drawing.draw(ViewerState(scene, scene.cameras[0], scene.lights[0], specs, 16), 16)
"""


@pytest.mark.parametrize(
    ("what", "line"),
    [("leave", "shadowbench: the window ended unexpectedly while drawing does:what=leave\n"), ("nothing", "")],
)
def test_a_window_that_ends_by_itself_names_its_technique(wild: Path, what: str, line: str) -> None:
    command = [sys.executable, "-c", SCRIPT, wild, f"does:what={what}"]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert (done.returncode, done.stderr) == (0, line)
