"""Poses of glTF files: against an independent evaluation, known values, and laws."""

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from shadowbench.scenes.file_contents import Chosen
from shadowbench.scenes.gltf import read_gltf
from shadowbench.scenes.library import load_scene
from shadowbench.scenes.triangles import Triangles, transformed
from tests.scenes.conftest import refused
from tests.scenes.pose_reference import Reference
from tests.scenes.rigs import RIGS, Rig, tube, turn

Floats = NDArray[np.float64]
UP = [[0.0, 0.0, 0.0], [0.2, 0.0, 0.0], [0.2, 1.0, 0.0], [0.2, 2.0, 0.0], [0.0, 2.0, 0.0], [0.0, 1.0, 0.0]]
STRIP = [[0, 1, 2], [0, 2, 5], [5, 2, 3], [5, 3, 4]]
BELOW, ABOVE = [0, 0, 0, 0], [1, 0, 0, 0]
ALL = [1, 0, 0, 0]


def corners(path: Path, chosen: Chosen) -> list[Floats]:
    """(F, 3, 3) corners of each mesh in the world."""
    found = []
    for mesh, matrix in read_gltf(path, path.name, chosen).instances:
        moved = transformed(Triangles(mesh.vertices, mesh.faces), matrix)
        found.append(moved.vertices[moved.faces])
    return found


def test_vertices_are_those_of_an_evaluation_by_hand(tmp_path: Path) -> None:
    for name in RIGS:
        for time in (0.0, 0.5, 0.8, 1.9, 7.0):
            rig, clip = RIGS[name](), int(name == "sheared")
            found = corners(rig.write(tmp_path / "rig.glb"), Chosen(time, str(clip + 1)))
            expected = Reference(rig, clip, time).corners()
            assert len(found) == len(expected)
            everything = np.concatenate([np.reshape(part, (-1, 3)) for part in expected])
            diagonal = np.linalg.norm(np.ptp(everything, axis=0))
            for mine, theirs in zip(found, expected, strict=True):
                assert min(np.abs(mine - theirs).max(), np.abs(mine - theirs[:, ::-1]).max()) < 1e-12 * diagonal


def bar(degrees: float, inverse: bool = True) -> Rig:
    """A strip of two squares whose upper half hangs on a joint at half its height, turned about z."""
    rig = Rig()
    joints = [BELOW if y < 1 else ABOVE for _, y, _ in UP]
    mesh = rig.mesh(UP, STRIP, **rig.influences(joints, [ALL] * 6))
    rig.json["nodes"] = [{"mesh": mesh, "skin": 0, "children": [1]}, {"children": [2]}]
    rig.json["nodes"].append({"translation": [0, 1, 0], "rotation": turn([0, 0, 1], degrees).tolist()})
    bind = np.tile(np.eye(4), (2, 1, 1))
    bind[1, 1, 3] = -1
    rig.skin([1, 2], bind if inverse else None)
    return rig


def moving(times: Any, values: Any, kind: str, path: str = "translation") -> Rig:
    rig = Rig()
    rig.json["nodes"] = [{"mesh": rig.mesh(*tube())}]
    rig.clip((0, path, times, values), kind=kind)
    return rig


def place(path: Path, time: float) -> Floats:
    (instance,) = read_gltf(path, path.name, Chosen(time)).instances
    return instance[1]


def test_known_values_between_two_keys(tmp_path: Path) -> None:
    for kind, rows, half in (
        ("STEP", [[0, 0, 0], [8, 0, 0]], 0.0),
        ("LINEAR", [[0, 0, 0], [8, 0, 0]], 4.0),
        # h = t³ − 2t² + t is 1/8 at the middle, times 2 s of duration and the tangent 4; its mirror image is 0.
        ("CUBICSPLINE", [[0] * 3, [0] * 3, [4, 0, 0], [0] * 3, [8, 0, 0], [0] * 3], 5.0),
        ("CUBICSPLINE", [[0] * 3, [0] * 3, [4, 0, 0], [4, 0, 0], [8, 0, 0], [0] * 3], 4.0),
        ("CUBICSPLINE", [[9] * 3, [0] * 3, [0, 0, 0], [0, 0, 0], [8, 0, 0], [9] * 3], 4.0),
    ):
        path = moving([1.0, 3.0], rows, kind).write(tmp_path / "a.glb")
        assert [place(path, time)[0, 3] for time in (0.0, 1.0, 2.0, 3.0, 99.0)] == pytest.approx([0, 0, half, 8, 8])


def test_half_a_turn_goes_the_way_of_the_specification(tmp_path: Path) -> None:
    path = moving([0.0, 1.0], [[0, 0, 0, 1], [0, 0, 1, 0]], "LINEAR", "rotation").write(tmp_path / "a.glb")
    assert place(path, 0.5)[:3, 0] == pytest.approx([0, 1, 0])  # 90° counter-clockwise about z
    assert place(path, 1 / 6)[:3, 0] == pytest.approx([math.cos(math.pi / 6), 0.5, 0])


quaternions = st.lists(st.floats(-1, 1), min_size=4, max_size=4).filter(lambda q: sum(x * x for x in q) > 0.01)


@settings(suppress_health_check=[HealthCheck.function_scoped_fixture], max_examples=25)
@given(st.sampled_from(["morphed_skin", "eight_joints", "two_skins"]), quaternions, st.floats(0, 2))
def test_moving_all_joints_and_nodes_moves_the_posed_mesh(
    tmp_path: Path, name: str, turned: list[float], time: float
) -> None:
    from scipy.spatial.transform import Rotation

    rig = RIGS[name]()
    still = corners(rig.write(tmp_path / "a.glb"), Chosen(time))
    number = len(rig.json["nodes"])
    rig.json["nodes"].append({"children": [0], "rotation": turned, "translation": [3, -2, 1]})
    rig.json["scenes"] = [{"nodes": [number]}]
    moved = corners(rig.write(tmp_path / "b.glb"), Chosen(time))
    for before, after in zip(still, moved, strict=True):
        expected = Rotation.from_quat(turned).apply(before.reshape(-1, 3)).reshape(before.shape) + np.array([3, -2, 1])
        assert after == pytest.approx(expected, abs=1e-11)


def test_a_mirrored_skin_still_faces_outwards(tmp_path: Path) -> None:
    def signed_volume(x: float) -> float:
        rig, box = bar(0), np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]], np.float64)
        faces = [[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]]
        rig.json["nodes"][0]["mesh"] = rig.mesh(box, faces, **rig.influences([BELOW] * 4, [ALL] * 4))
        rig.json["nodes"][1]["scale"] = [x, 1, 1]
        (mesh,) = corners(rig.write(tmp_path / "a.glb"), Chosen())
        return float(np.linalg.det(mesh).sum() / 6)

    assert signed_volume(1) == signed_volume(-1) == pytest.approx(1 / 6)


def test_weights_are_divided_by_their_sum_with_a_note(tmp_path: Path) -> None:
    for factor, noted in ((1.0, False), (1.002, False), (0.5, True)):
        rig = bar(90)
        weights = np.array([ALL] * 6) * factor
        weights[3] = 0.0 if noted else weights[3]
        rig.json["meshes"][0]["primitives"][0]["attributes"] |= {"WEIGHTS_0": rig.accessor(weights)}
        contents = read_gltf(rig.write(tmp_path / "a.glb"), "a.glb")
        assert contents.notes == ["a.glb: weights of joints of 6 vertices divided by their sum, which is not 1"] * noted
        assert corners(tmp_path / "a.glb", Chosen())[0] == pytest.approx(
            corners(bar(90).write(tmp_path / "b.glb"), Chosen())[0]
        )


def test_joints_outside_the_scene_move_a_skin(tmp_path: Path) -> None:
    rig = bar(90)
    rig.json["nodes"][0].pop("children")
    (mesh,) = corners(rig.write(tmp_path / "a.glb"), Chosen())
    assert mesh == pytest.approx(corners(bar(90).write(tmp_path / "b.glb"), Chosen())[0])


def test_the_clip_and_its_time_are_a_note(tmp_path: Path) -> None:
    path = RIGS["sheared"]().write(tmp_path / "a.glb")
    posed = "from 0 to 2 s: posed at"
    for chosen, note in {
        Chosen(): f"clip 'other', 1 of 2, {posed} 0 s; clip and time choose another",
        Chosen(3, "walk"): f"clip 'walk', 2 of 2, {posed} 3 s (held at its end); clip and time choose another",
        Chosen(None, "2"): f"clip 'walk', 2 of 2, {posed} 0 s; clip and time choose another",
        Chosen(None, "none"): "none of 2 clip(s) taken: nodes stand as in the file",
    }.items():
        assert read_gltf(path, "a.glb", chosen).notes == [f"a.glb: {note}"]
    assert corners(path, Chosen(1, "walk"))[0].tolist() != corners(path, Chosen(1, "other"))[0].tolist()


def test_a_scene_file_poses_each_of_its_meshes(tmp_path: Path) -> None:
    RIGS["sheared"]().write(tmp_path / "a.glb")
    table = '[[mesh]]\nfile = "a.glb"\n'
    (tmp_path / "a.toml").write_text(table + 'time = 0.75\nclip = "walk"\n' + table + "time = 1.5\n" + table)
    scene = load_scene(tmp_path / "a.toml")
    for mesh, chosen in zip(scene.meshes, (Chosen(0.75, "walk"), Chosen(1.5), Chosen()), strict=True):
        assert mesh.vertices[mesh.faces] == pytest.approx(corners(tmp_path / "a.glb", chosen)[0], abs=1e-12)
    for line in ("time = -1", 'clip = "run"', 'time = "now"'):
        (tmp_path / "b.toml").write_text(table + line)
        refused(tmp_path / "b.toml", "[[mesh]] 1", line.split()[0])
    (tmp_path / "c.toml").write_text('[[mesh]]\nshape = "box"\ntime = 1')
    refused(tmp_path / "c.toml", "time and clip are for a file")


def test_what_has_no_clips_says_so(tmp_path: Path) -> None:
    path = bar(0).write(tmp_path / "a.glb")
    assert any(note == "a.glb: time: no clip to pose" for note in load_scene(path, chosen=Chosen(1.0)).notes)
    refused(path, "a.glb: clip: found 'walk'", "none", chosen=Chosen(None, "walk"))
    refused(RIGS["sheared"]().write(tmp_path / "b.glb"), "did you mean 'walk'", "1 to 2", chosen=Chosen(None, "walks"))
    for source in ("cube-on-plane", tmp_path / "a.obj"):
        refused(source, "--time, --clip", "no glTF", chosen=Chosen(1.0))


Place = tuple[str | int, ...]
ATTRIBUTES: Place = ("meshes", 0, "primitives", 0, "attributes")
JOINTS, WEIGHTS = (*ATTRIBUTES, "JOINTS_0"), (*ATTRIBUTES, "WEIGHTS_0")
TARGETS: Place = ("meshes", 0, "primitives", 0, "targets")
CHANNEL: Place = ("animations", 0, "channels", 0)
SAMPLER: Place = ("animations", 0, "samplers", 0)


def test_an_invalid_rig_is_one_line(tmp_path: Path) -> None:
    """Numbers in lists become an accessor."""
    for name, place, value, words in (
        ("quantised", ("nodes", 0, "skin"), 1, ["nodes 1.skin: found 1; allowed: 0 to 0"]),
        ("quantised", ("skins", 0, "joints", 0), 99, ["skins 1.joints 1: found 99; allowed: 0 to 4"]),
        ("quantised", ("skins", 0, "joints"), [2, 3], ["has joint 3; its skin has 2"]),
        ("quantised", ("skins", 0, "inverseBindMatrices"), np.eye(4)[None], ["4 joints, and 1 inverse"]),
        ("quantised", JOINTS, 2, ["VEC4 of unsigned integers"]),
        ("quantised", WEIGHTS, [[1, 0, 0, 0]], ["WEIGHTS_0 has 1 elements; allowed: 54"]),
        ("quantised", ATTRIBUTES, {"POSITION": 2, "JOINTS_0": 0}, ["JOINTS_0 without WEIGHTS_0"]),
        ("quantised", (*CHANNEL, "sampler"), 4, ["animations 1: channels 1: found sampler 4 of 4"]),
        ("quantised", (*SAMPLER, "input"), [0, np.nan, 1, 1], ["times that increase"]),
        ("quantised", (*SAMPLER, "interpolation"), "CUBICSPLINE", ["needed are 3"]),
        ("morphing", (*TARGETS, 0, "POSITION"), [[1, 1, 1]], ["POSITION has 1 elements; allowed: 54"]),
    ):
        rig = RIGS[name]()
        part: Any = rig.json
        for key in place[:-1]:
            part = part[key]
        data = isinstance(value, np.ndarray) or (isinstance(value, list) and value and "joints" not in place)
        part[place[-1]] = rig.accessor(value) if data else value
        refused(rig.write(tmp_path / "rig.glb"), "rig.glb", *words, chosen=Chosen(0.1))
