"""Studies from options and loaded scenes, without a command line."""

import json
from collections.abc import Callable
from pathlib import Path

import pytest

import shadowbench as sb
from shadowbench.errors import InputError
from shadowbench.options import Measuring, ViewOptions
from shadowbench.plugin.registry import techniques
from shadowbench.plugin.spec import parse_spec
from shadowbench.studies.study import Study, study_from_options

KNOWN = techniques()
SPEC = parse_spec("shadow-map", KNOWN)
SMALL = parse_spec("shadow-map:size=64", KNOWN)
FILE = """
scenes = ["cube-on-plane", "stairs"]
map_size = [64, 128]
phases = 2
rounds = 3
[[technique]]
spec = "shadow-map"
phases = 4
bias_sweep = [1, 2]
"""


@pytest.fixture
def file(tmp_path: Path) -> str:
    (tmp_path / "study.toml").write_text(FILE)
    return str(tmp_path / "study.toml")


def phases(study: Study) -> set[int]:
    return {cell.phase for cell in study.cells()}


def test_options_override_the_file(file: str) -> None:
    kept = study_from_options(KNOWN, study=file)
    assert (kept.rounds, kept.map_size, phases(kept)) == (3, (64, 128), {0, 1, 2, 3})
    measuring, view = Measuring(view_size=16, rounds=0), ViewOptions(light="lamp")
    asked = study_from_options(KNOWN, ["lamp-by-wall"], study=file, map_size=[32], measuring=measuring, view=view)
    assert (asked.scenes, asked.rounds, asked.map_size, asked.view_size) == (("lamp-by-wall",), 0, (32,), 16)
    assert (asked.lights, asked.views) == (("lamp",), ("file",))
    assert phases(study_from_options(KNOWN, study=file, measuring=Measuring(phases=3))) == {0, 1, 2}, (
        "also of what has a number of its own"
    )


def test_specs_have_the_phases_of_the_study_and_keep_their_place_in_its_sweeps(file: str) -> None:
    asked = study_from_options(KNOWN, specs=[SPEC], study=file)
    assert (asked.specs, phases(asked)) == ((SPEC,), {0, 1})
    assert asked.sweeps == study_from_options(KNOWN, study=file).sweeps


def test_specs_alone_are_measured_with_their_own_sizes() -> None:
    assert [cell.spec.text for cell in study_from_options(KNOWN, specs=[SPEC, SMALL]).cells()] == [
        "shadow-map",
        "shadow-map:size=64",
    ]
    sized = study_from_options(KNOWN, specs=[SPEC, SMALL], map_size=[32, 128])
    assert {cell.spec.map_size for cell in sized.cells()} == {32, 64, 128}
    assert sized.notes == ("shadow-map:size=64 names its size, which --map-size 32,128 leaves as it is",)
    averages = [parse_spec(f"light-samples{of}", KNOWN) for of in ("", ":of=shadow-map")]
    assert study_from_options(KNOWN, ["stairs"], averages).notes == ()
    assert study_from_options(KNOWN, ["stairs"], averages, map_size=(32,)).notes == (
        "light-samples:of=shadow-map: --map-size 32 leaves the map inside as it is; its size is written in the spec",
    )


@pytest.mark.parametrize(
    ("make", "line"),
    [
        (lambda: Study.of(["stairs"], [SPEC], view_size=0), "study: view_size: found 0; allowed: "),
        (lambda: Study.of([], [SPEC]), "study: scenes: found an empty list; allowed: 1 or more entries"),
        (lambda: Study.of(["stairs"], [SPEC], size=3), "study: unknown field 'size'"),
        (lambda: study_from_options(KNOWN, study="nothing"), "nothing: no such study file"),
    ],
)
def test_a_study_given_as_an_object_is_checked_like_a_file(make: Callable[[], Study], line: str) -> None:
    with pytest.raises(InputError, match=line):
        make()


def test_a_scene_that_is_loaded_is_measured_as_one_by_name(tmp_path: Path) -> None:
    named, loaded = (
        sb.run(one, "shadow-map:size=64", view_size=32, rounds=0, folder=tmp_path / name)
        for name, one in (("named", "cube-on-plane"), ("loaded", sb.load("cube-on-plane")))
    )
    sb.close()
    assert named.equals(loaded)
    assert (tmp_path / "loaded" / "table.csv").read_bytes() == (tmp_path / "named" / "table.csv").read_bytes()
    abouts = [json.loads((tmp_path / name / "run.json").read_text()) for name in ("named", "loaded")]
    assert abouts[0]["study"] == abouts[1]["study"]
