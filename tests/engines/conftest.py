"""An engine that draws the truth, installed as another package would have it: its entry point names it."""

import shutil
import sys
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from shadowbench.engines.engine_session import probe_view
from shadowbench.engines.programs import environment
from shadowbench.options import ViewSize
from shadowbench.plugin import registry
from shadowbench.plugin.engine import Engine
from shadowbench.scenes.model import View
from shadowbench.scenes.opening import chosen_view
from shadowbench.scenes.vectors import unit
from shadowbench.truths.cache import cached_truth

SIZE = ViewSize(64, 48)  # of the fake engine's pictures
DECLARATION = '''
"""An engine of another package."""

from shadowbench.plugin.engine import Engine


class Fake(Engine):
    """Fake: draws what a file says."""

    name = "fake"
    package = "fake"
    host = "python"
    lights = frozenset({"directional"})
    presets = {"shipped": "", "documented": ""}
    seconds = 20.0
'''
ENTRY_POINTS = """
[shadowbench.engines]
fake = fake_engine_package:Fake
absent = no_such_package:Absent
"""


@pytest.fixture
def view(truth_cache: None) -> View:
    return chosen_view("cube-on-plane", SIZE)


def learn(package: Path, view: View) -> None:
    """Have the fake engine know a view, by its camera and light."""
    truth, probe = cached_truth(view, 1), view.scene.name == "probe"
    known = f"{view.camera.target[0]:.6f} {unit(view.light.direction)[0]:.6f}.npz"
    np.savez(package / known, cosine=truth.cosine, visibility=truth.visibility, probe=probe)


@pytest.fixture
def engine(tmp_path: Path, view: View, monkeypatch: pytest.MonkeyPatch) -> Iterator[type[Engine]]:
    """The fake engine, of a package on the path; what it is to do wrongly stands in its file `fault`."""
    site, package = tmp_path / "site", tmp_path / "site" / "fake_engine_package"
    package.mkdir(parents=True)
    (package / "__init__.py").write_text(DECLARATION)
    (package / "requirements.txt").write_text("fake==1.0\n")
    (package / "fault").write_text("none")
    shutil.copy(Path(__file__).parent / "fake_engine.py", package / "draw.py")
    for one in (view, probe_view(SIZE)):
        learn(package, one)
    (site / "fake-1.0.dist-info").mkdir()
    (site / "fake-1.0.dist-info" / "METADATA").write_text("Metadata-Version: 2.1\nName: fake\nVersion: 1.0\n")
    (site / "fake-1.0.dist-info" / "entry_points.txt").write_text(ENTRY_POINTS)
    monkeypatch.syspath_prepend(site)
    monkeypatch.delitem(sys.modules, "fake_engine_package", raising=False)
    monkeypatch.setenv("SHADOWBENCH_CACHE", str(tmp_path / "cache"))
    for table in (registry.engines, registry.preset_names):
        table.cache_clear()
    fake = registry.engines()["fake"]
    python = environment(fake) / "bin" / "python"
    python.parent.mkdir(parents=True)
    python.write_text(f'#!/bin/sh\nexec {sys.executable} "$@"\n')
    python.chmod(0o755)
    yield fake
    for table in (registry.engines, registry.preset_names):
        table.cache_clear()
