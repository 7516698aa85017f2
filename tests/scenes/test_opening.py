"""Cameras and lights that options place."""

import math
from collections.abc import Callable
from functools import partial
from pathlib import Path

import numpy as np
import pytest
import trimesh

import shadowbench
from shadowbench.errors import InputError
from shadowbench.options import SceneOptions, ViewOptions
from shadowbench.plugin.registry import techniques
from shadowbench.scenes import opening
from shadowbench.scenes.model import view_digest
from shadowbench.scenes.opening import SIDES, chosen_view
from shadowbench.scenes.vectors import unit
from shadowbench.studies.study import read_study, study_from_options
from shadowbench.truths.embree import tracer_of

opened = partial(opening.opened, tracer_of=tracer_of)

MINE = """
[[camera]]
name = "front"
position = [3, 2, 4]
target = [0, 0, 0]
[[camera]]
name = "low"
position = [3, 0.5, 4]
target = [0, 0, 0]
[[light]]
kind = "point"
position = [0, 3, 0]
[[mesh]]
shape = "box"
"""


@pytest.fixture
def box(tmp_path: Path) -> Path:
    path = tmp_path / "box.obj"
    trimesh.creation.box(bounds=[(4, 1, -2.5), (6, 5, -1.5)]).export(path)
    return path


@pytest.fixture
def room(tmp_path: Path) -> Callable[..., Path]:
    """A room of 6 × 3 × 4 m with thick walls, and a table that is no floor in its middle."""

    def made(scale: float = 1.0, *, window: bool = False) -> Path:
        walls = [((-3, -0.2, -2), (3, 0, 2)), ((-3, 3, -2), (3, 3.2, 2)), ((-3, 0, -2.2), (3, 3, -2))]
        walls += [((-3.2, 0, -2), (-3, 3, 2)), ((3, 0, -2), (3.2, 3, 2)), ((-0.5, 0, -0.5), (0.5, 0.7, 0.5))]
        walls += [] if window else [((-3, 0, 2), (3, 3, 2.2))]
        parts = [trimesh.creation.box(bounds=bounds) for bounds in walls]
        path = tmp_path / f"room-{scale:g}-{window}.obj"
        trimesh.util.concatenate(parts).apply_scale(scale).export(path)
        return path

    return made


@pytest.mark.parametrize("side", SIDES)
def test_a_camera_stands_at_the_side_and_sees_all_but_the_assumed_ground(box: Path, side: str) -> None:
    scene = opened(box, SceneOptions(camera=side))
    (camera,) = scene.cameras
    assert camera.name == side and camera.target == pytest.approx((5, 3, -2))
    away = unit(np.subtract(camera.position, camera.target))
    axis = {"front": (0, 0, 1), "back": (0, 0, -1), "left": (-1, 0, 0), "right": (1, 0, 0), "top": (0, 1, 0)}[side]
    assert away @ axis > 0.9 and away[1] > 0.1
    corners = np.array([(x, y, z) for x in (4, 6) for y in (1, 5) for z in (-2.5, -1.5)]) - camera.position
    right, up, back = camera.basis() @ corners.T
    assert (np.abs([right, up]) < -back * math.tan(camera.fov_y / 2)).all()
    assert math.dist(camera.position, camera.target) < 10  # a diagonal of 4.6 m; the ground's side is 18 m
    assert f"{side} of box: camera at" in scene.notes[-1] and not any("no camera" in note for note in scene.notes)
    if side == "top":
        assert camera.basis()[1] == pytest.approx(np.array([0, 0, -1]))  # north is up, as on a map


def test_a_camera_at_a_point_looks_at_the_target_or_the_middle(box: Path) -> None:
    (middle,) = opened(box, SceneOptions(camera="-1,2.5,3")).cameras
    (aimed,) = opened(box, SceneOptions(camera="-1,2.5,3", target="0,1e-3,0")).cameras
    assert (middle.position, middle.target) == ((-1, 2.5, 3), (5, 3, -2)) and aimed.target == (0, 1e-3, 0)
    assert (middle.name, aimed.name) == ("at -1 2.5 3", "at -1 2.5 3 to 0 0.001 0")
    assert shadowbench.load(box, camera=np.array([-1, 2.5, 3]), target=(0, 1e-3, 0)).cameras == (aimed,)


def test_a_name_of_the_scenes_camera_is_meant_before_a_word(tmp_path: Path) -> None:
    (tmp_path / "mine.toml").write_text(MINE)
    front, low = opened(tmp_path / "mine.toml", SceneOptions()).cameras
    for name, camera in (("front", front), ("low", low)):
        assert opened(tmp_path / "mine.toml", SceneOptions(camera=name)).cameras == (camera,)
    (placed,) = opened(tmp_path / "mine.toml", SceneOptions(camera="back")).cameras
    assert placed.position[2] < -1
    with pytest.raises(InputError, match=r"found 'lo'; did you mean 'low'\? allowed: front, low, back, left"):
        opened(tmp_path / "mine.toml", SceneOptions(camera="lo"))


def test_an_assumed_camera_is_no_name(box: Path) -> None:
    with pytest.raises(InputError, match="found 'camera'; allowed: front, back, left, right, top, inside, or X,Y,Z"):
        opened(box, SceneOptions(camera="camera"))


def test_a_lamp_or_a_sun_takes_the_place_of_all_lights(tmp_path: Path, box: Path) -> None:
    (tmp_path / "mine.toml").write_text(MINE)
    (lamp,) = opened(tmp_path / "mine.toml", SceneOptions(lamp="1,2,-3")).lights
    assert (lamp.name, lamp.kind, lamp.position) == ("lamp 1 2 -3", "point", (1, 2, -3))
    lit = opened(box, SceneOptions(sun_at="0,30", sun=True))
    assert not any("no light" in note for note in lit.notes) and lit.lights[0].soft


@pytest.mark.parametrize(
    ("angles", "toward"), [("0,45", (0, 1, -1)), ("90,45", (1, 1, 0)), ("-90,45", (-1, 1, 0)), ("180,90", (0, 1, 0))]
)
def test_azimuths_are_those_of_a_compass_with_north_at_minus_z(
    box: Path, angles: str, toward: tuple[float, float, float]
) -> None:
    (sun,) = opened(box, SceneOptions(sun_at=angles)).lights
    assert -np.array(sun.direction) == pytest.approx(unit(toward), abs=1e-12)


@pytest.mark.parametrize(
    ("options", "told"),
    [
        ({"camera": "1,2"}, "--camera: found '1,2'; allowed: three numbers X,Y,Z"),
        ({"camera": "1,2,nan"}, "--camera: found '1,2,nan'"),
        ({"camera": (1, "b", 2)}, "camera: found 'b'"),
        ({"lamp": "1,2,inf"}, "--lamp: found '1,2,inf'"),
        ({"lamp": "1,2,3", "sun_at": "0,30"}, "--lamp and --sun-at; allowed: one"),
        ({"camera": "front", "target": "1,2,3"}, "--target 1,2,3: is for --camera X,Y,Z"),
        ({"camera": "1,2,3", "target": "1;2"}, "--target: found '1;2'"),
        ({"sun_at": "30"}, "--sun-at: found '30'; allowed: AZIMUTH,ELEVATION"),
        ({"sun_at": "30,0"}, "above 0 up to 90"),
        ({"sun_at": "400,20"}, "of up to 360"),
    ],
)
def test_what_cannot_be_a_place_is_told_before_a_scene_is_read(options: dict[str, str], told: str) -> None:
    with pytest.raises(InputError) as error:
        SceneOptions(**options)
    assert told in str(error.value)


def test_a_study_places_as_its_options_do(box: Path, tmp_path: Path) -> None:
    file = tmp_path / "study.toml"
    text = 'scenes = ["box.obj"]\nview_size = 16\ntechnique = [{ spec = "unshadowed" }]\n'
    file.write_text(text + "camera = [1, 2, 3]\ntarget = [0, 0, 0]\nsun_at = [90, 30]\n")
    study = read_study(file, techniques())
    view = chosen_view(box, 16, ViewOptions(camera="1,2,3", target="0,0,0", sun_at="90,30"))
    (block,) = study.blocks()
    assert view_digest(block.view) == view_digest(view)
    assert (study.facts["camera"], study.facts["sun_at"]) == ("1.0,2.0,3.0", "90.0,30.0")
    other = study_from_options(techniques(), study=str(file), view=ViewOptions(camera="front", lamp="9,9,9"))
    (block,) = other.blocks()
    assert (block.view.camera.name, block.view.light.name) == ("front", "lamp 9 9 9")
    for line, told in (("lamp = [1, 2]", "lamp: found '1.0,2.0'"), ('sun_at = ["a"]', "sun_at: found 'a'")):
        file.write_text(text + line + "\n")
        with pytest.raises(InputError, match=rf"study\.toml: (.*: )?{told}"):
            read_study(file, techniques())


def test_inside_a_room_the_camera_stands_at_eye_height_and_a_lamp_is_assumed(room: Callable[..., Path]) -> None:
    scene = opened(room(), SceneOptions(camera="inside"))
    (camera,), (lamp,) = scene.cameras, scene.lights
    x, y, z = camera.position
    assert camera.name == "inside" and y == pytest.approx(1.6, abs=1e-3)  # above the floor, not the table
    assert -3 < x < 3 and -2 < z < 2 and camera.target[1] < y
    assert abs(camera.target[0] - x) > 2 * abs(camera.target[2] - z)  # along the longer side
    assert lamp.kind == "point" and 1.6 < lamp.position[1] < 3
    assert "1.6 m above the floor" in scene.notes[-2] and "assumed a lamp" in scene.notes[-1]
    assert not any("assumed a sun" in note for note in scene.notes)


def test_a_sun_that_comes_in_and_lights_that_are_asked_for_stay(room: Callable[..., Path], tmp_path: Path) -> None:
    sunny = opened(room(window=True), SceneOptions(camera="inside"))
    assert sunny.lights[0].kind == "directional" and any("assumed a sun" in note for note in sunny.notes)
    (lamp,) = opened(room(), SceneOptions(camera="inside", lamp="0,2,0")).lights
    assert lamp.name == "lamp 0 2 0"


def test_without_free_space_inside_is_refused(tmp_path: Path) -> None:
    (tmp_path / "flat.toml").write_text('[[mesh]]\nshape = "plane"\n')
    with pytest.raises(InputError, match="--camera inside: flat encloses no free space; allowed: a side, or X,Y,Z"):
        opened(tmp_path / "flat.toml", SceneOptions(camera="inside"))
