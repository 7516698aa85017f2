"""Submissions: written, read and checked; each fault of one is told in a line."""

import os
import platform
import re
import stat
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from shadowbench.errors import InputError
from shadowbench.gl.clock import WALL
from shadowbench.measure.clock_rates import clock_rates, device_name
from shadowbench.measure.session import CellRequest, Session
from shadowbench.measure.worker import Worker
from shadowbench.plugin.registry import techniques
from shadowbench.results import submission as module
from shadowbench.results.submission import (
    IDENTITY,
    WORK,
    ClockRates,
    Noise,
    Submission,
    counted_work,
    kind_of,
    known_submissions,
    objections,
    read_submission,
    write_submission,
)
from shadowbench.scenes.opening import chosen_view
from shadowbench.studies.study import find_study, read_study

from .submissions import changed, submission

RATES = {"driver": "1", "graphics_mhz": 1980, "memory_mhz": 2619, "most_graphics_mhz": 1980, "power_limit_w": None}
DEVICES = Path(module.__file__).parents[2] / "benchmarks" / "devices"


def of_cells(change: Callable[[int], Any], field: str) -> Submission:
    whole = submission()
    return changed(whole, **{field: [change(at) for at in range(len(whole.cells))]})


def with_(**fields: Any) -> Submission:
    return submission().model_copy(update=fields)


def some_cells(count: int) -> Submission:
    whole = submission()
    return whole.model_copy(update={"cells": whole.cells[:count]})


def test_what_is_written_is_read(tmp_path: Path) -> None:
    file = write_submission(submission(), tmp_path)
    assert file.name == "some-gpu.json" and read_submission(file) == submission()
    assert len(file.read_text().splitlines()) == len(submission().cells) + 14, "a line a cell, to be compared by eye"


@pytest.mark.parametrize(
    ("made", "line"),
    [
        (lambda: with_(software=True), "is a software renderer"),
        (lambda: of_cells(lambda _: WALL, "clock"), r"no time is by the GPU's own timer \(gl_time_elapsed\)"),
        (lambda: with_(noise=Noise(ratio=1.2, worst=1.3, n=45)), "took 1.200 times"),
        (lambda: with_(noise=Noise(ratio=1.0, worst=1.0, n=0)), "in 0 rounds; at most 1.05, in 9 or more"),
        (lambda: with_(device="Other GPU"), "device: found 'Other GPU', but the renderer is Some GPU, 4.6"),
        (lambda: with_(versions={}), "versions: shadowbench's is missing"),
        (lambda: with_(view_size=64), "found 64² pixels and shadow-map:size=1024; the study has 1024²"),
        (
            lambda: with_(clocks=ClockRates(**RATES | {"graphics_mhz": 495})),
            "clock rates: 495 of 1980 MHz; at least 80%",
        ),
        (lambda: of_cells(lambda at: 7 if at == 3 else submission().cells[at].gpu_bytes, "gpu_bytes"), "1 cells have"),
        (lambda: of_cells(lambda at: 9 if at else 3, "n"), "rounds: 3; at least 9"),
        (lambda: of_cells(lambda at: 1.9 if at == 4 else 1.2, "frame_ms"), "takes 0.2 ms, but 0.9 beside some"),
        (lambda: of_cells(lambda at: 0.5 if at % 3 == 0 else 0.1, "ratio_iqr"), "33% of the times have"),
        (lambda: some_cells(-5), r"5 of the study's \d+ cells are missing"),
        (lambda: of_cells(lambda at: "other" if at == 7 else "light", "light"), "1 cells are not of the study"),
        (lambda: of_cells(lambda at: 0.3 if at == 2 else submission().cells[at].iou, "iou"), "1 cells are drawn other"),
    ],
    ids=[
        *("software", "wall-clock", "noise", "no-noise", "device", "versions", "view", "slow", "bytes"),
        *("rounds", "drift", "rough", "missing", "unknown", "drawn"),
    ],
)
def test_each_fault_is_told(made: Callable[[], Submission], line: str) -> None:
    assert not objections(submission())
    assert any(re.search(line, one) for one in objections(made()))


@pytest.mark.parametrize("file", sorted(DEVICES.glob("*.json")), ids=lambda file: file.stem)
def test_nothing_speaks_against_those_on_record(file: Path) -> None:
    assert file.name == read_submission(file).file_name
    assert not objections(read_submission(file))


def test_the_counted_work_is_of_the_study() -> None:
    study = read_study(find_study(module.STUDY), techniques())
    cells = {
        (block.view.scene.name, block.view.light.name, cell.spec.sizeless_text, cell.spec.map_size or -1)
        for block in study.blocks()
        for cell in block.cells
        if block.view.light.hard_kind in cell.spec.technique.lights
    }
    counted = counted_work()[list(IDENTITY)].fillna({"map_size": -1})
    without_a_plane = {("terrain", "light", "planar-projection", -1)}
    assert set(counted.itertuples(index=False, name=None)) == cells - without_a_plane


def test_another_file_is_refused_in_one_line(tmp_path: Path) -> None:
    file = tmp_path / "a.json"
    with pytest.raises(InputError, match=r"a\.json: cannot be read \(No such file"):
        read_submission(file)
    os.mkfifo(tmp_path / "pipe")
    with pytest.raises(InputError, match=r"pipe: is not a file"):
        read_submission(tmp_path / "pipe")
    for text, told in (("{}", "format"), ("[", "no JSON"), ('{"format": 2}', "format")):
        file.write_text(text)
        with pytest.raises(InputError, match=rf"a\.json: .*({told})"):
            read_submission(file)


@pytest.mark.parametrize(
    ("renderer", "name"),
    [
        ("NVIDIA H100 80GB HBM3/PCIe/SSE2, 4.1.0 NVIDIA 580.159.04", "NVIDIA H100 80GB HBM3"),
        ("AMD Radeon RX 6800 (radeonsi, navi21, LLVM 15.0.7, DRM 3.49), 4.6", "AMD Radeon RX 6800"),
        ("D3D12 (NVIDIA GeForce RTX 3080), 4.2", "NVIDIA GeForce RTX 3080"),
        ("Mesa Intel(R) UHD Graphics 620 (KBL GT2), 4.6", "Mesa Intel(R) UHD Graphics 620"),
    ],
)
def test_a_device_is_named_without_bus_and_driver(renderer: str, name: str) -> None:
    assert device_name(renderer) == name


def test_a_kind_is_a_technique_and_what_changes_its_passes() -> None:
    assert kind_of("shadow-map") == kind_of("shadow-map:filter=pcf(taps=5),depth=d16") == "shadow-map"
    assert kind_of("shadow-map:fit=scene,depth=d16") == "shadow-map fit=scene"
    assert kind_of("ray-traced:where=gpu") == "ray-traced where=gpu"


def test_clock_rates_are_those_of_the_gpu_that_draws(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("PATH", str(tmp_path))
    assert clock_rates("NVIDIA B, 4.6") is None, "no nvidia-smi"
    program = tmp_path / "nvidia-smi"
    program.write_text(
        "#!/bin/sh\necho 'NVIDIA A, 1.2, 100, 200, 300, 50.0'\necho 'NVIDIA B, 1.2, 1980, 2619, 1980, [N/A]'\n"
    )
    program.chmod(program.stat().st_mode | stat.S_IXUSR)
    assert clock_rates("NVIDIA B/PCIe, 4.6") == {
        "driver": "1.2",
        "graphics_mhz": 1980.0,
        "memory_mhz": 2619.0,
        "most_graphics_mhz": 1980.0,
        "power_limit_w": None,
    }
    assert clock_rates("AMD, 4.6") is None and clock_rates("NVIDIA B Ti/PCIe, 4.6") is None
    for told in (
        "echo 'No devices were found'; exit 6",
        "echo 'Field \"x\" is not a valid field'",
        "printf '\\377\\n\\n'",
    ):
        program.write_text(f"#!/bin/sh\n{told}\n")
        assert clock_rates("NVIDIA B/PCIe, 4.6") is None, told


def test_submit_measures_the_study_and_tells_what_speaks_against_it(
    shadowbench: Callable[..., Any], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    study = tmp_path / "small.toml"
    study.write_text(
        'scenes = ["cube-on-plane"]\nview_size = 64\nrounds = 1\n[[technique]]\nspec = "shadow-map"\nsize = [64, 128]\n'
    )
    monkeypatch.setattr(module, "STUDY", str(study))
    made = shadowbench("submit", "-o", tmp_path / "out")
    assert made.code == 1 and "software renderer" in made.err and "rounds: 1; at least 9" in made.err
    (file,) = (tmp_path / "out").glob("llvmpipe*.json")
    found = read_submission(file)
    assert [cell.map_size for cell in found.cells] == [64, 128] and found.software and found.noise.n == 45
    assert found.machine["system"] == f"{platform.system()} {platform.machine()}", "a kernel's release names its host"
    checked = shadowbench("submit", "--check", file)
    assert checked.code == 1 and checked.out == f"{file}: 2 timed cells of llvmpipe\n"
    on_record = shadowbench("submit", "--check", *sorted(DEVICES.glob("*h100*.json")))
    assert on_record.code == 0 and not on_record.err
    assert shadowbench("submit", "--check", tmp_path / "none.json").code == 2


def test_known_submissions_are_one_a_device() -> None:
    names = [one.device for one in known_submissions()]
    assert len(set(names)) == len(names) >= 1


def test_the_counts_are_those_of_what_is_drawn_now() -> None:
    view = chosen_view("cube-on-plane", module.VIEW_SIZE)
    counted = counted_work().query("scene == 'cube-on-plane'").fillna({"map_size": 0})
    with Worker() as worker:
        for spec, size in (
            ("unshadowed", 0),
            ("shadow-map", 512),
            ("shadow-map:fit=scene", 1024),
            ("shadow-volume", 0),
        ):
            text = f"{spec}{',' if ':' in spec else ':'}size={size}" if size else spec
            drawn = worker.call(Session.draw, view, CellRequest(text))
            (row,) = counted[(counted["spec"] == spec) & (counted["map_size"] == size)].to_dict("records")
            assert drawn.gpu_bytes == row["gpu_bytes"]
            for name in WORK:
                assert drawn.work.get(name, 0) == pytest.approx(row[name], rel=0.02), (spec, name)
