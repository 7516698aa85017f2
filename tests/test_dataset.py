"""The data set: complete, as its digests say, and usable without shadowbench as its README shows."""

import json
import re
import shutil
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import dataset
import numpy as np
import pandas as pd
import pytest
from PIL import Image

from shadowbench.errors import InputError
from shadowbench.scores.masks import write_mask
from tests.runs import CHANGING

Shadowbench = Callable[..., Any]
SCENES = "stairs,tree,post"  # flat, cut out, and a soft light


@pytest.fixture(scope="module")
def source(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A run of two techniques, one of them unsupported under some light."""
    folder = tmp_path_factory.mktemp("source")
    options = ["--view-size", "64", "--rounds", "0", "--quiet", "-o", str(folder)]
    specs = ["-t", "shadow-map:size=128", "-t", "cube-map:size=64"]
    command = [sys.executable, "-m", "shadowbench", "run", *SCENES.split(","), *specs, *options]
    subprocess.run(command, capture_output=True, check=True)
    return folder


@pytest.fixture(scope="module")
def whole(source: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("whole") / "dataset"
    dataset.write_dataset([source], folder)
    return folder


@pytest.fixture
def made(whole: Path, tmp_path: Path) -> Path:
    return Path(shutil.copytree(whole, tmp_path / "dataset"))


def checked(folder: Path) -> int:
    """Exit status of the documented check."""
    (command,) = re.findall(r"```sh\n(.+)\n```", (folder / "README.md").read_text(encoding="utf-8"))
    return subprocess.run(command.split(), cwd=folder, capture_output=True, check=False).returncode


def test_digests_cover_every_file_and_notice_a_changed_byte(made: Path) -> None:
    assert checked(made) == 0
    named = {line.split("  ")[1] for line in (made / "SHA256SUMS").read_text(encoding="utf-8").splitlines()}
    assert named == {file.relative_to(made).as_posix() for file in made.rglob("*") if file.is_file()} - {"SHA256SUMS"}
    package = json.loads((made / "datapackage.json").read_text(encoding="utf-8"))
    for resource in package["resources"]:
        file = made / resource["path"]
        assert resource["hash"] == f"sha256:{dataset._sha256(file)}" and resource["bytes"] == file.stat().st_size
    by_others = {"README.md", "LICENSE", "cite.bib", "datapackage.json"}
    assert {resource["path"] for resource in package["resources"]} == named - by_others
    assert dataset._sha256(made / "datapackage.json") in (made / "cite.bib").read_text(encoding="utf-8")
    file = next((made / "masks").iterdir())
    file.write_bytes(file.read_bytes()[:-1] + b"x")
    assert checked(made) != 0


def test_every_successful_row_has_its_mask_and_every_view_its_files(made: Path) -> None:
    rows = pd.read_csv(made / "rows.csv")
    assert set(rows.scene) == set(SCENES.split(",")) and (rows.status != "ok").any()
    assert {file.stem for file in (made / "masks").iterdir()} == set(rows.key[rows.status == "ok"])
    files = {"scene.glb", "view.json", "truth.npz", "truth.png", "undecided.png", "facets.png"}
    assert all({file.name for file in view.iterdir()} == files for view in (made / "views").iterdir())
    assert {view.name.split(".")[0] for view in (made / "views").iterdir()} == set(SCENES.split(","))
    for view in (made / "views").iterdir():
        truth = np.load(view / "truth.npz")
        assert np.abs(np.asarray(Image.open(view / "truth.png")) / 65535 - truth["visibility"]).max() < 1 / 65535
        assert np.array_equal(np.asarray(Image.open(view / "undecided.png")) == 255, truth["undecided"])


def test_the_readme_loads_a_row_and_finds_its_score_and_its_surface(
    made: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(made)
    text = (made / "README.md").read_text(encoding="utf-8")
    found: dict[str, Any] = {}
    for block in re.findall(r"```python\n(.*?)```", text, re.DOTALL):
        exec(block, found)
    assert "import shadowbench" not in text
    assert found["row"].scene == "stairs" and found["iou"] == pytest.approx(found["row"].iou, abs=1e-12)
    seen = found["truth"]["triangle"] >= 0
    normal = found["normal"][seen] / np.linalg.norm(found["normal"][seen], axis=-1, keepdims=True)
    off = np.einsum("ix,ix->i", found["position"][seen] - found["corners"][seen][:, 0], normal)
    assert seen.any() and np.abs(off).max() < 1e-5  # metres; scene.glb has float32
    toward = -np.array(json.loads((made / found["folder"] / "view.json").read_text())["light"]["direction"])
    lit = found["truth"]["receivers"][seen]
    assert np.abs(np.abs(normal @ toward) - found["truth"]["cosine"][seen])[lit].max() < 1e-5


def test_arrays_are_those_that_the_readme_describes(made: Path) -> None:
    text = (made / "README.md").read_text(encoding="utf-8")
    described = set(re.findall(r"`(\w+)`", text.split("## Arrays")[1].split("## Check")[0].replace("`truth.npz`", "")))
    for view in (made / "views").iterdir():
        assert {*np.load(view / "truth.npz")} <= described


def test_made_again_it_is_the_same(made: Path, source: Path) -> None:
    before = (made / "SHA256SUMS").read_text(encoding="utf-8")
    (made / "masks" / "left.png").write_bytes(b"")
    dataset.write_dataset([source], made)
    assert (made / "SHA256SUMS").read_text(encoding="utf-8") == before and checked(made) == 0


def test_masks_that_were_not_scored_and_scenes_of_others_are_refused(
    source: Path, tmp_path: Path, shadowbench: Shadowbench
) -> None:
    other = shutil.copytree(source, tmp_path / "other")
    mask = next((other / "masks").iterdir())
    write_mask(mask, np.ones((64, 64)))
    with pytest.raises(InputError, match="not the mask that was scored"):
        dataset.write_dataset([other], tmp_path / "dataset")
    (tmp_path / "changing.toml").write_text(CHANGING)
    answer = shadowbench(
        "run", tmp_path / "changing.toml", "-t", "unshadowed", "--view-size", "32", "-o", tmp_path / "own"
    )
    assert answer.code == 0
    with pytest.raises(InputError, match="allowed: built-in scenes"):
        dataset.write_dataset([tmp_path / "own"], tmp_path / "dataset")
    assert not (tmp_path / "dataset").exists()
    (tmp_path / "full").mkdir()
    (tmp_path / "full" / "mine.txt").write_text("")
    with pytest.raises(InputError, match=r"mine\.txt"):
        dataset.write_dataset([source], tmp_path / "full")
