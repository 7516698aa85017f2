"""Sequences: what moves, how far from frame to frame, and what stays the same."""

import math
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

from shadowbench.errors import InputError
from shadowbench.options import SceneOptions
from shadowbench.scenes.library import load_scene
from shadowbench.scenes.model import View, view_of
from shadowbench.scenes.opening import opened
from shadowbench.scenes.sequences import BUILT_IN, frames_of, motions_of

SIZE = 512


def view(name: str, size: int = SIZE) -> View:
    scene = load_scene(name)
    return view_of(scene, scene.cameras[0], scene.lights[0], size)


def pixel_of(view: View, point: np.ndarray) -> np.ndarray:
    """Column and row of a point, from the image's middle."""
    right, up, back = view.camera.basis() @ np.subtract(point, view.camera.position)
    half = view.camera.half_height(-back)
    return np.array([right, -up]) / half * view.size.height / 2


def at_target(view: View, up: float = 0.0) -> np.ndarray:
    """A point in the plane of the target, `up` of the way from there to the image's upper edge."""
    camera = view.camera
    distance = math.dist(camera.position, camera.target)
    return np.add(camera.target, up * camera.half_height(distance) * camera.basis()[1])


@pytest.mark.parametrize("name", ["stairs", "spot-lamp"])
@pytest.mark.parametrize("built_in", BUILT_IN)
def test_frame_0_is_the_view_and_fewer_frames_are_the_beginning_of_more(name: str, built_in: str) -> None:
    """Cameras may get other planes: those of a longer sequence hold more of the scene."""
    before = view("walker" if built_in == "walker" else name)
    long, short = (frames_of(before, BUILT_IN[built_in], count) for count in (6, 3))
    planeless = [
        [(replace(one.camera, near=None, far=None), one.light, one.scene.geometry.digest()) for one in frames]
        for frames in (long, short)
    ]
    assert planeless[0][:3] == planeless[1]
    assert len({(one.camera.near, one.camera.far) for one in long}) == 1, "planes are the same in all frames"
    assert all(one != other for one, other in pairwise(planeless[0])), "something moves"
    if before.light.kind != "directional" or built_in != "carried-lamp":  # a sun gives way to a lamp
        assert (long[0].light, long[0].scene) == (before.light, before.scene)
        assert (long[0].camera.position, long[0].camera.fov_y) == (before.camera.position, before.camera.fov_y)


def test_still_geometry_is_one_scene_and_its_planes_hold_it_in_every_frame() -> None:
    before = view("stairs")
    for name in ("dolly", "pan", "zoom", "orbit", "slow-sun", "quick-sun", "carried-lamp"):
        frames = frames_of(before, BUILT_IN[name])
        assert {id(one.scene) for one in frames} == {id(before.scene)}
        for one in frames:
            nearest, farthest = one.camera.depths_of(one.scene.geometry.bounds, 1.0)
            assert one.near_far[0] <= max(nearest, 1e-4 * farthest) and one.near_far[1] >= farthest
    assert frames_of(before, BUILT_IN["slow-sun"])[5].camera is before.camera


@pytest.mark.parametrize("size", [128, 512])
def test_the_image_moves_by_the_pixels_that_are_promised(size: int) -> None:
    before = view("stairs", size)

    def moved(name: str, point: np.ndarray) -> np.ndarray:
        first, second = frames_of(before, BUILT_IN[name], 2)
        return pixel_of(second, point) - pixel_of(first, point)

    assert moved("pan", at_target(before)) == pytest.approx([-0.5, 0.3], abs=0.01)
    assert moved("zoom", at_target(before, 1.0)) == pytest.approx([0.0, -1.0], abs=0.02)
    assert moved("dolly", at_target(before, 1.0)) == pytest.approx([0.0, -0.5], abs=0.01)
    assert moved("orbit", at_target(before)) == pytest.approx([0.0, 0.0], abs=1e-9)
    half_way = np.mean([before.camera.position, before.camera.target], axis=0)
    assert np.linalg.norm(moved("orbit", half_way)) == pytest.approx(0.5, rel=0.01)


@pytest.mark.parametrize(("name", "degrees"), [("slow-sun", 0.02), ("quick-sun", 0.5)])
@pytest.mark.parametrize("scene", ["stairs", "spot-lamp"])
def test_the_light_is_seen_to_move_by_the_angle_that_is_promised(scene: str, name: str, degrees: float) -> None:
    before = view(scene)

    def seen(view: View) -> np.ndarray:
        position, w = view.light.homogeneous
        away = np.subtract(position, np.multiply(w, view.camera.target))
        return away / np.linalg.norm(away)

    frames = frames_of(before, BUILT_IN[name], 3)
    angles = [math.degrees(math.acos(seen(one) @ seen(other))) for one, other in pairwise(frames)]
    assert angles == pytest.approx([degrees] * 2, rel=1e-3)
    assert seen(frames[0])[1] == pytest.approx(seen(frames[2])[1]), "it keeps its elevation"


def test_a_walker_strides_and_the_ground_stays() -> None:
    frames = frames_of(view("walker"), BUILT_IN["walker"], 25)
    plane, figure = zip(*(one.scene.meshes for one in frames), strict=True)
    assert all((one.vertices == plane[0].vertices).all() for one in plane)
    assert np.abs(figure[12].vertices - figure[0].vertices).max() > 0.1
    np.testing.assert_allclose(figure[24].vertices, figure[0].vertices, atol=1e-9)  # a stride a second


def test_what_has_no_pose_no_such_name_or_too_many_frames_is_one_line(tmp_path) -> None:
    file = tmp_path / "still.toml"
    file.write_text(KEYED)
    scene = load_scene(file)
    before = view_of(scene, scene.cameras[0], scene.lights[0], 64)
    for name, frames, words in (
        ("walker", 8, "still has no pose that changes with time"),
        ("doly", 8, "found 'doly'; did you mean"),
        ("fly-by", 6, "--frames 6: sequence fly-by allows whole numbers from 2 to 5"),
    ):
        with pytest.raises(InputError, match=words):
            frames_of(before, *motions_of(scene, [name]), frames)


def test_all_are_those_in_which_something_of_the_scene_moves() -> None:
    assert [motion.name for motion in motions_of(load_scene("walker"), ["all"])] == list(BUILT_IN)
    assert [motion.name for motion in motions_of(load_scene("stairs"), ["zoom", "all"])] == [
        "zoom", *(name for name in BUILT_IN if name not in ("zoom", "walker")),
    ]  # fmt: skip


KEYED = """
[camera]
position = [0.0, 1.0, 5.0]
target = [0.0, 0.0, 0.0]
fov_y = 40.0
[light]
kind = "directional"
direction = [0.0, -1.0, 0.0]
[[mesh]]
shape = "plane"
scale = 4.0
[[mesh]]
name = "post"
shape = "box"
translate = [1.0, 0.5, 0.0]
[[sequence]]
name = "fly-by"
frames = 5
seconds = 2.0
[[sequence.key]]
time = 1.0
camera = { position = [1.0, 1.0, 5.0] }
light = { direction = [1.0, -1.0, 0.0] }
object = { post = { translate = [0.0, 2.0, 0.0] } }
[[sequence.key]]
time = 2.0
camera = { fov_y = 20.0 }
object = { post = { rotate = [0.0, 90.0, 0.0] } }
"""


def test_keys_are_joined_linearly_and_directions_along_an_arc(tmp_path) -> None:
    file = tmp_path / "keyed.toml"
    file.write_text(KEYED)
    scene = load_scene(file)
    before = view_of(scene, scene.cameras[0], scene.lights[0], 64)
    frames = frames_of(before, *motions_of(scene, ["fly-by"]))
    assert [one.camera.position[0] for one in frames] == pytest.approx([0.0, 0.5, 1.0, 1.0, 1.0])
    assert [math.degrees(one.camera.fov_y) for one in frames] == pytest.approx([40.0, 35.0, 30.0, 25.0, 20.0])
    slopes = [math.degrees(math.atan2(one.light.direction[0], -one.light.direction[1])) for one in frames]
    assert slopes == pytest.approx([0.0, 22.5, 45.0, 45.0, 45.0])
    posts = [one.scene.meshes[1].bounds.mean(axis=0) for one in frames]
    assert [post[1] for post in posts] == pytest.approx([0.5, 1.5, 2.5, 1.5, 0.5])
    assert [post[0] for post in posts] == pytest.approx([1.0] * 5), "it turns about its own middle"
    widths = [np.ptp(one.scene.meshes[1].vertices[:, 0]) for one in frames]
    assert widths == pytest.approx([1.0, 1.0, 1.0, math.sqrt(2), 1.0])
    assert frames[0].scene is scene


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ("frames = 5", "frames = 1", "sequence.*frames.*2"),
        ("time = 2.0", "time = 1.0", "times that increase"),
        ("post = { rot", "pots = { rot", "object: found 'pots'; did you mean 'post'"),
        ('name = "fly-by"', 'name = "pan"', "'pan' is that of a sequence which every scene has"),
        ("[[sequence.key]]\ntime = 1.0", "[[sequence.key]]\ntime = 0.0", "time"),
    ],
)
def test_a_wrong_sequence_of_a_file_is_one_line(tmp_path, old: str, new: str, words: str) -> None:
    file = tmp_path / "wrong.toml"
    file.write_text(KEYED.replace(old, new))
    with pytest.raises(InputError, match=words) as error:
        load_scene(file)
    assert "\n" not in str(error.value)


def test_a_key_of_what_the_light_has_not_is_refused(tmp_path) -> None:
    file = tmp_path / "lamp.toml"
    file.write_text(KEYED)
    scene = opened(str(file), SceneOptions(lamp="1,3,1"))
    with pytest.raises(InputError, match="key of light direction"):
        frames_of(view_of(scene, scene.cameras[0], scene.lights[0], 64), *motions_of(scene, ["fly-by"]))
