"""Silhouette edges and closed parts, compared with trimesh and with shadow volumes."""

from pathlib import Path

import numpy as np
import pytest
import trimesh

import shadowbench
from shadowbench.geometry import topology
from shadowbench.scenes.library import builtin_names
from shadowbench.scenes.model import Light, Mesh
from shadowbench.scenes.views import chosen_view
from shadowbench.survey.casters import casters_of
from shadowbench.survey.explanations import explanations_of
from shadowbench.survey.survey import needs
from tests.survey.conftest import DOWN, box, looking, plate

SUN = Light("sun", "directional", (0.5, -1.0, -0.3))


def ball(subdivisions: int) -> Mesh:
    made = trimesh.creation.icosphere(subdivisions)
    return Mesh("ball", np.asarray(made.vertices), np.asarray(made.faces, dtype=np.int32))


def test_a_box_has_six_outlines_and_four_when_the_sun_shines_along_an_edge() -> None:
    assert casters_of(looking([box(1.0, (0.0, 0.0, 0.0))], SUN)).silhouette == 6
    assert casters_of(looking([box(1.0, (0.0, 0.0, 0.0))], DOWN)).silhouette == 4


def test_a_plate_has_four_outlines_and_is_open() -> None:
    found = casters_of(looking([plate(1.0)], SUN))
    assert (found.triangles, found.closed, found.silhouette, found.edges) == (2, 0, 4, 5)


def test_a_box_on_a_ground_is_closed_and_the_ground_is_not() -> None:
    found = casters_of(looking([plate(9.0), box(1.0, (0.0, 0.5, 0.0))], SUN))
    assert (found.triangles, found.closed) == (14, 12)


def test_a_box_turned_inside_out_is_not_closed() -> None:
    mesh = box(1.0, (0.0, 0.0, 0.0))
    turned = Mesh("turned", mesh.vertices, mesh.faces[:, ::-1].copy())
    assert casters_of(looking([turned], SUN)).closed == 0
    assert casters_of(looking([turned], SUN)).silhouette == 6


def test_the_explanation_counts_open_and_inward_wound_casters() -> None:
    mesh = box(1.0, (0.0, 0.5, 0.0))
    turned = Mesh("turned", mesh.vertices + np.array([2.0, 0.0, 0.0]), mesh.faces[:, ::-1].copy())

    def reason(*meshes: Mesh) -> str:
        return {row.need: row.reason for row in explanations_of(needs(looking(meshes, SUN)))}["closed casters"]

    signs = "which shadow volumes count with signed weights"
    assert casters_of(looking([plate(9.0), mesh, turned], SUN)).open == 2
    assert reason(plate(9.0), mesh, turned) == (
        f"triangles; 2 are in open parts, 12 in closed parts not wound outwards, {signs}"
    )
    assert reason(plate(9.0), mesh) == f"triangles; 2 are in open parts, {signs}"
    assert reason(plate(9.0, casts=False), turned) == f"triangles; 12 are in closed parts not wound outwards, {signs}"
    assert reason(plate(9.0, casts=False), mesh).startswith("triangles, all in closed parts")


def test_a_ball_has_the_outlines_that_lie_between_triangles_turned_to_the_light_and_away(light: Light) -> None:
    mesh = ball(4)
    view = looking([mesh], light)
    made = trimesh.Trimesh(mesh.vertices, mesh.faces, process=False)
    source, w = light.homogeneous
    seen = ((np.array(source) - w * made.triangles_center) * made.face_normals).sum(axis=1) > 0
    between = seen[made.face_adjacency]
    assert casters_of(view).silhouette == np.count_nonzero(between[:, 0] != between[:, 1])


@pytest.mark.parametrize("name", builtin_names())
def test_meshes_that_volumes_treat_as_closed_are_closed(name: str) -> None:
    view, _ = chosen_view(name, 64).placed()
    found = casters_of(view)
    theirs = topology.casters_of(view.scene)
    assert found.triangles == len(theirs.closed.faces) + len(theirs.open.faces)
    assert found.closed == len(theirs.closed.faces)


def test_shadow_volumes_draw_two_triangles_for_each_wall_of_closed_and_of_open_parts(tmp_path: Path) -> None:
    """The ground and a box without its lid are open, another box is closed; one triangle covers the screen."""
    scene = tmp_path / "boxes.toml"
    lidless = "v 0 0 0\nv 1 0 0\nv 1 0 1\nv 0 0 1\nv 0 1 0\nv 1 1 0\nv 1 1 1\nv 0 1 1\n"
    lidless += "f 1 2 3 4\nf 1 5 6 2\nf 2 6 7 3\nf 3 7 8 4\nf 4 8 5 1\n"
    (tmp_path / "lidless.obj").write_text(lidless)
    scene.write_text(
        '[[mesh]]\nshape = "plane"\nscale = 9.0\n[[mesh]]\nfile = "lidless.obj"\n'
        '[[mesh]]\nshape = "box"\ntranslate = [-2.0, 0.6, 0.0]\n'
    )
    found = casters_of(chosen_view(str(scene), 32).placed()[0])
    assert found.open == 12 and found.closed == 12 and found.walls > found.silhouette
    (cell,) = shadowbench.run(str(scene), "shadow-volume", view_size=32, rounds=0).to_dict("records")
    assert cell["work_primitives"] == 2 * found.walls + 1


def test_nothing_that_casts_has_no_outline() -> None:
    found = casters_of(looking([plate(1.0, casts=False)], SUN))
    assert (found.triangles, found.closed, found.silhouette, found.edges) == (0, 0, 0, 0)
