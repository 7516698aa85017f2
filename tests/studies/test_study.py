"""Study files: crossed parameters, and one-line errors for invalid fields."""

import json
import math
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from shadowbench.errors import InputError
from shadowbench.measure.campaign import Block
from shadowbench.options import DEFAULT_SIZE, Measuring, ViewOptions
from shadowbench.plugin.registry import techniques
from shadowbench.plugin.spec import parse_spec
from shadowbench.studies.stress import default_specs
from shadowbench.studies.study import Study, read_study, study_from_options

SCENE = 'scenes = ["cube-on-plane"]\n'
KNOWN = techniques()
ReadStudy = Callable[[str], Study]

TWO_OF_EACH = """
name = "pair"
[[camera]]
position = [2, 2, 3]
target = [0, 0.5, 0]
[[camera]]
name = "low"
position = [0, 0.4, 4]
target = [0, 0.5, 0]
[[light]]
kind = "directional"
direction = [1, -1, -1]
[[light]]
name = "noon"
kind = "directional"
direction = [0, -1, 0]
[[mesh]]
shape = "box"
"""


@pytest.fixture
def read(tmp_path: Path) -> ReadStudy:
    def reader(text: str) -> Study:
        file = tmp_path / "study.toml"
        file.write_text(text, encoding="utf-8")
        return read_study(file, KNOWN)

    return reader


@pytest.fixture
def pair(tmp_path: Path) -> str:
    """A study's line for a scene of two cameras and two lights beside it."""
    (tmp_path / "pair.toml").write_text(TWO_OF_EACH)
    return 'scenes = ["pair.toml"]\ntechnique = [{ spec = "unshadowed" }]\n'


def specs(study: Study) -> list[str]:
    return [cell.spec.text for cell in study.cells()]


def named(blocks: list[Block]) -> list[tuple[str, str]]:
    return [(block.view.camera.name, block.view.light.name) for block in blocks]


def test_fields_missing_in_a_study_have_the_promised_defaults(read: ReadStudy) -> None:
    study = read(SCENE)
    assert [spec.technique.name for spec in study.specs] == list(KNOWN)
    assert study.map_size is None
    assert (study.view_size, study.rounds, study.phases) == (DEFAULT_SIZE, 9, 1)
    assert (study.time_limit, study.memory_limit) == (120, 8)
    assert study.coordinates == "relative"
    assert study.reference.full_text.startswith("shadow-map:")
    assert study.reference.map_size == 1024
    assert (study.views, study.lights) == (("file",), ("file",))
    assert study.notes == ()


def test_lists_are_crossed(read: ReadStudy) -> None:
    study = read(
        SCENE + '[[technique]]\nspec = "shadow-map:size=64"\nbias = ["none", "slope(max=0.05,min=0.005)"]\n'
        'filter = ["hard", "pcf(taps=5)"]\n'
    )
    assert specs(study) == [
        "shadow-map:size=64,bias=none,filter=hard",
        "shadow-map:size=64,bias=none,filter=pcf(taps=5)",
        "shadow-map:size=64,bias=slope,filter=hard",
        "shadow-map:size=64,bias=slope,filter=pcf(taps=5)",
    ]
    assert specs(read(SCENE + '[[technique]]\nspec = "shadow-map"\nsize = 64\n')) == ["shadow-map:size=64"]


def test_duplicate_specs_are_measured_once(read: ReadStudy) -> None:
    study = read(
        'scenes = ["cube-on-plane", "cube-on-plane"]\nviews = ["file", "camera"]\nlights = ["file", "light"]\n'
        'map_size = [64, 64]\n[[technique]]\nspec = "shadow-map"\n[[technique]]\nspec = "shadow-map"\nsize = [64, 32]\n'
        '[[technique]]\nspec = "shadow-map:bias=texel"\n'
    )
    assert specs(study) == ["shadow-map:size=64", "shadow-map:size=32"]
    assert named(list(study.blocks())) == [("camera", "light")]


def test_a_map_size_goes_where_there_is_a_map_and_no_size_of_its_own(read: ReadStudy) -> None:
    tables = [
        ('spec = "unshadowed"', [None]),
        ('spec = "shadow-map"', [64, 128]),
        ('spec = "shadow-map:size=256"', [256]),
        ('spec = "shadow-map:preset=webgl"', [512]),
        ('spec = "shadow-map:bias=none"\nsize = 32', [32]),
    ]
    for table, sizes in tables:
        study = read(f"{SCENE}map_size = [64, 128]\n[[technique]]\n{table}\n")
        assert [cell.spec.map_size for cell in study.cells()] == sizes, table


def test_phases_may_be_given_for_one_technique(read: ReadStudy) -> None:
    own = '[[technique]]\nspec = "shadow-map"\nphases = 3\n[[technique]]\nspec = "cascades"\n'
    none = '[[technique]]\nspec = "unshadowed"\nphases = 3\n'
    plain = '[[technique]]\nspec = "shadow-map"\n'

    def phases(text: str) -> list[tuple[str, int]]:
        return [(cell.spec.text, cell.phase) for cell in read(SCENE + text).cells()]

    each = [("shadow-map", 0), ("cascades", 0), ("shadow-map", 1), ("shadow-map", 2)]
    assert phases(own) == each
    assert phases("phases = 2\n" + own) == [*each[:3], ("cascades", 1), each[3]]
    assert phases(none) == [("unshadowed", 0)]
    for tables in (plain + own, own + plain):
        assert ("shadow-map", 3) in phases("phases = 4\n" + tables), "the larger of both"


def test_a_table_may_be_for_lights_with_a_size_only_or_for_those_without(read: ReadStudy) -> None:
    tables = '[[technique]]\nspec = "unshadowed"\n[[technique]]\nspec = "soft-volume"\nsoft = true\n'
    study = read(f'scenes = ["cube-on-plane", "post"]\n{tables}[[technique]]\nspec = "ray-traced"\nsoft = false\n')
    drawn = [{cell.spec.technique.name for cell in block.cells} for block in study.blocks()]
    assert drawn == [{"unshadowed", "ray-traced"}, {"unshadowed", "soft-volume"}]
    with pytest.raises(InputError, match="soft: found 1; allowed: true or false"):
        read(f'scenes = ["post"]\n{tables.replace("true", "1")}')


def test_a_technique_for_soft_shadows_is_in_the_default_list_where_the_light_has_a_size() -> None:
    study = study_from_options(KNOWN, ["cube-on-plane", "post"], measuring=Measuring(phases=2))
    drawn = [{cell.spec.technique.name for cell in block.cells} for block in study.blocks()]
    assert drawn == [KNOWN.keys() - {"light-samples", "soft-volume"}, KNOWN.keys()]
    named = study_from_options(KNOWN, ["cube-on-plane"], [parse_spec("light-samples", KNOWN)])
    assert [len(block.cells) for block in named.blocks()] == [1]
    assert {spec.technique.name for spec in default_specs(KNOWN.values())} == drawn[0]


def test_an_invalid_combination_is_dropped_with_a_note(read: ReadStudy) -> None:
    study = read(SCENE + '[[technique]]\nspec = "shadow-map"\nbias = ["texel", "none"]\nbias_sweep = [0.5, 2]\n')
    scaled = [f"shadow-map:bias=texel(scale={scale})" for scale in (0.5, 2.0)]
    assert [spec.text for spec in study.specs] == scaled
    (note,) = study.notes
    assert "technique 1: dropped" in note and "bias=none" in note


def test_file_is_the_first_camera_and_every_light_and_others_have_names(read: ReadStudy, pair: str) -> None:
    assert named(list(read(pair).blocks())) == [("camera", "light"), ("camera", "noon")]
    study = read(pair.replace("technique", 'views = ["low", "file"]\nlights = ["noon"]\ntechnique', 1))
    assert named(list(study.blocks())) == [("low", "noon"), ("camera", "noon")]


def test_cameras_and_lights_are_written_as_tables(read: ReadStudy, pair: str) -> None:
    study = read(
        'views = ["file", { position = [0, 1, 5], target = [0, 0, 0], fov_y = 90 }, '
        '{ name = "near", position = [0, 1, 2], target = [0, 0, 0] }]\n'
        'lights = [{ name = "lamp", kind = "point", position = [0, 3, 0], radius = 0.5 }]\n' + pair
    )
    blocks = list(study.blocks())
    assert named(blocks) == [("camera", "lamp"), ("view-2", "lamp"), ("near", "lamp")]
    assert blocks[1].view.camera.fov_y == pytest.approx(math.pi / 2)
    assert blocks[1].view.camera.near is not None
    assert blocks[0].view.light.radius == 0.5


def test_scenes_are_built_in_names_or_files_beside_the_study(read: ReadStudy, tmp_path: Path, pair: str) -> None:
    (tmp_path / "below").mkdir()
    (tmp_path / "below" / "other.toml").write_text(TWO_OF_EACH.replace("pair", "other"))
    study = read('scenes = ["pair.toml", "below/other.toml", "cube-on-plane"]\n')
    assert list(dict.fromkeys(block.view.scene.name for block in study.blocks())) == ["pair", "other", "cube-on-plane"]


ONE = '[[technique]]\nspec = "shadow-map"\n'


WRONG: list[tuple[str, list[str]]] = [
    ("scenes = [", ["not TOML"]),
    ("", ["scenes"]),
    ("scenes = [1]\n", ["scenes 1", "found 1", "text"]),
    ('[[mesh]]\nshape = "box"\n', ["found a scene file", "a study file, or `shadowbench run`"]),
    (SCENE + "size = 3\n", ["unknown field 'size'", "map_size"]),
    (SCENE + "map_size = [512, 1.5]\n", ["map_size", "1.5"]),
    (SCENE + "map_size = 65537\n", ["map_size", "65537"]),
    (SCENE + "rounds = -1\n", ["rounds", "-1"]),
    (SCENE + "time_limit = nan\n", ["time_limit", "nan"]),
    (SCENE + 'reference = "no-map"\n', ["reference", "no-map", "shadow-map"]),
    (SCENE + "views = [{ position = [0, 1, 5] }]\n", ["views 1", "target"]),
    (SCENE + 'lights = [{ kind = "moon" }]\n', ["lights 1", "kind", "'moon'", "directional"]),
    (SCENE + "technique = []\n", ["technique"]),
    (SCENE + "[[technique]]\nsize = 64\n", ["technique 1", "spec"]),
    (SCENE + ONE + "taps = 3\n", ["technique 1", "'taps'", "filter"]),
    (SCENE + ONE + ONE + "size = [64, 0]\n", ["technique 2", "size", "0"]),
    (SCENE + ONE + 'bias = ["texel", "velvet"]\n', ["technique 1", "'velvet'", "slope"]),
    (SCENE + ONE + "bias = []\n", ["technique 1", "bias"]),
    (SCENE + ONE + "bias_sweep = [-1]\n", ["technique 1", "bias_sweep", "-1"]),
    (SCENE + '[[technique]]\nspec = "unshadowed"\nbias_sweep = [2]\n', ["technique 1", "bias_sweep", "unshadowed"]),
    (SCENE + "rounds = 99999999999999999999\n", ["rounds", "64 bits"]),
]


def test_a_wrong_field_and_a_study_beyond_its_limits_are_one_line(read: ReadStudy) -> None:
    for text, words in WRONG:
        with pytest.raises(InputError) as error:
            next(read(text).blocks())
        line = str(error.value)
        assert line.isprintable() and len(line) < 1000, text
        assert [word for word in words if word not in line] == [], text


def test_unknown_cameras_and_lights_and_two_of_one_name_are_refused(read: ReadStudy, pair: str, tmp_path: Path) -> None:
    (tmp_path / "twin.toml").write_text(TWO_OF_EACH)
    other = '{ name = "low", position = [0, 1, 5], target = [0, 0, 0] }'
    for text, line in (
        ('views = ["dusk"]\n' + pair, "views of pair: found 'dusk'; allowed: camera, low"),
        ('lights = ["dusk"]\n' + pair, "lights of pair: found 'dusk'; allowed: light, noon"),
        ('scenes = ["pair.toml", "twin.toml"]\n', r"two scenes .*'pair'.*pair\.toml.*twin\.toml"),
        (f'views = ["low", {other}]\n' + pair, "views of pair: two are called 'low'"),
    ):
        with pytest.raises(InputError, match=line):
            list(read(text).blocks())


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
    assert (asked.scenes, asked.rounds, asked.map_size, asked.view_size) == (("lamp-by-wall",), 0, (32,), (16, 16))
    assert (asked.lights, asked.views) == (("lamp",), ("file",))
    assert phases(study_from_options(KNOWN, study=file, measuring=Measuring(phases=3))) == {0, 1, 2}, (
        "also of what has a number of its own"
    )


def test_specs_have_the_phases_of_the_study_and_keep_their_place_in_its_sweeps(file: str) -> None:
    asked = study_from_options(KNOWN, specs=[SPEC], study=file)
    assert (asked.specs, phases(asked)) == ((SPEC,), {0, 1})
    assert asked.sweeps == study_from_options(KNOWN, study=file).sweeps


def test_specs_alone_are_measured_with_their_own_sizes() -> None:
    assert specs(study_from_options(KNOWN, specs=[SPEC, SMALL])) == ["shadow-map", "shadow-map:size=64"]
    sized = study_from_options(KNOWN, specs=[SPEC, SMALL], map_size=[32, 128])
    assert {cell.spec.map_size for cell in sized.cells()} == {32, 64, 128}


@pytest.mark.slow
def test_the_default_errs_less_with_each_larger_map(shadowbench: Callable[..., Any], tmp_path: Path) -> None:
    command = ("run", "-s", "default", "-t", "shadow-map", "--phases", "8", "--rounds", "0", "--json", "-o", tmp_path)
    tables = json.loads(shadowbench(*command).out)
    assert len(tables) == 3
    for rows in tables.values():
        errors = {row["map_size"]: 1 - row["iou"] for row in rows}
        falling = [errors[size] for size in (512, 1024, 2048, 4096)]
        assert falling == sorted(set(falling), reverse=True)
        assert {row["phases"] for row in rows} == {8}
