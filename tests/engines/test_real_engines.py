"""Engines themselves, installed from their lock files: an independent truth, and the presets named after them."""

from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pandas as pd
import psutil
import pytest

from shadowbench.files import data_folder
from tests.conftest import Answer
from tests.samples import todays

pytestmark = [pytest.mark.slow, pytest.mark.usefixtures("installed")]

Command = Callable[..., Answer]
SIZE = ["--view-size", "256", "--rounds", "0"]


@pytest.fixture(scope="module")
def installed() -> Iterator[None]:
    """three.js, Babylon.js and OGRE; where they have been installed before, nothing is downloaded."""
    from shadowbench.engines.programs import install, needed_programs
    from shadowbench.plugin.registry import engines

    with pytest.MonkeyPatch.context() as patch:
        patch.delenv("SHADOWBENCH_CACHE")
        for name in ("three", "babylon", "ogre"):
            assert not needed_programs(engines()[name])
            install(engines()[name])
        yield


def test_ogre_s_shadow_volumes_agree_with_the_truth(tmp_path: Path, shadowbench: Command) -> None:
    """Somebody else's exact shadows, of closed meshes that 16 bits can index; also from within the scene's bounds."""
    parallel, text = tmp_path / "parallel.toml", (data_folder("scenes") / "stairs.toml").read_text(encoding="utf-8")
    text = text.replace("fov_y = 38.0", 'kind = "orthographic"\nheight = 4.0')
    parallel.write_text(text.replace('"stairs"', '"parallel"', 1), encoding="utf-8")
    scenes = ["cube-on-plane", "stairs", "railings", "street", "colonnade", "spot-lamp", "room-with-lamp", parallel]
    wide = ["--view-size", "320x180", "--rounds", "0"]
    answer = shadowbench("run", *todays(scenes, 2), "-t", "ogre", *wide, "-o", tmp_path / "out", "-q")
    assert answer.code == 0, answer.err
    for row in pd.read_csv(tmp_path / "out" / "table.csv").itertuples():
        assert 1 - row.iou <= 5e-4, row.scene


@pytest.mark.parametrize(
    ("engine", "preset"),
    [("three:cast=back", "shadow-map:preset=three"), ("babylon:preset=documented", "shadow-map:preset=babylon")],
)
def test_a_preset_named_after_an_engine_draws_as_it_does(
    engine: str, preset: str, tmp_path: Path, shadowbench: Command
) -> None:
    """Medians over phases, as both have texels of their own: IoU within 0.01, acne within 0.005."""
    scenes = ["cube-on-plane", "sphere-and-torus"]
    specs = ["-t", engine, "-t", preset]
    answer = shadowbench("run", *scenes, *specs, *SIZE, "--phases", "8", "-o", tmp_path / "out", "-q")
    assert answer.code == 0, answer.err
    table = pd.read_csv(tmp_path / "out" / "table.csv")
    medians = table.groupby(["scene", "technique"])[["iou", "acne"]].median().unstack()
    theirs, ours = engine.partition(":")[0], "shadow-map"
    assert (medians["iou"][theirs] - medians["iou"][ours]).abs().max() <= 0.01
    assert (medians["acne"][theirs] - medians["acne"][ours]).abs().max() <= 0.005


def test_a_preset_named_after_an_engine_flickers_as_it_does(tmp_path: Path, shadowbench: Command) -> None:
    """As the sun moves slowly, and the map with it."""
    specs = ["-t", "three:cast=back,size=1024", "-t", "shadow-map:preset=three,size=1024"]
    moving = ["--sequence", "slow-sun", "--frames", "6", "-o", tmp_path / "out", "-q"]
    answer = shadowbench("run", "stairs", *specs, *SIZE, *moving)
    assert answer.code == 0, answer.err
    theirs, ours = pd.read_csv(tmp_path / "out" / "table.csv").sort_values("technique")["flicker"][::-1]
    assert theirs > 0.01 and abs(theirs - ours) <= 0.2 * theirs


def test_a_run_that_is_killed_leaves_no_program(
    tmp_path: Path, start: Any, records: Callable[..., list[dict[str, Any]]]
) -> None:
    out = tmp_path / "out"
    specs = [part for bias in range(1, 9) for part in ("-t", f"three:bias=-0.000{bias}")]
    run = start("run", "cube-on-plane", "-t", "ogre", *specs, *SIZE, "--phases", "8", "-o", out)
    run.until(lambda: out.joinpath("rows.jsonl").exists() and len(records(out)) > 2)
    family = run.family()
    names = {one.name() for one in family}
    assert "Xvfb" in names and any("chrom" in name for name in names)
    run.process.kill()
    run.process.communicate()
    assert psutil.wait_procs(family, timeout=30)[1] == []
