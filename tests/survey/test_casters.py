"""Silhouettes and closed parts of casters, as trimesh and shadow volumes have them."""

from pathlib import Path

import numpy as np
import pytest
import trimesh

import shadowbench
from shadowbench.geometry import topology
from shadowbench.scenes.model import Light, Mesh
from shadowbench.scenes.opening import chosen_view
from shadowbench.survey.casters import casters_of
from tests.survey.conftest import DOWN, SUN, ball, box, looking, plate, reasons


def turned(mesh: Mesh) -> Mesh:
    return Mesh("turned", mesh.vertices, mesh.faces[:, ::-1].copy())


@pytest.mark.parametrize(
    ("meshes", "light", "triangles", "closed", "silhouette", "edges"),
    [
        ([box(1.0, (0.0, 0.0, 0.0))], SUN, 12, 12, 6, 18),
        ([box(1.0, (0.0, 0.0, 0.0))], DOWN, 12, 12, 4, 18),
        ([turned(box(1.0, (0.0, 0.0, 0.0)))], SUN, 12, 0, 6, 18),
        ([plate(1.0)], SUN, 2, 0, 4, 5),
        ([plate(9.0), box(1.0, (0.0, 0.5, 0.0))], SUN, 14, 12, 10, 23),
        ([plate(1.0, casts=False)], SUN, 0, 0, 0, 0),
    ],
    ids=["box", "box and sun along an edge", "box inside out", "plate", "box on ground", "nothing"],
)
def test_outlines_and_closed_parts(meshes, light, triangles, closed, silhouette, edges) -> None:
    casters = casters_of(looking(meshes, light))
    assert (casters.triangles, casters.closed, casters.silhouette, casters.edges) == (
        triangles,
        closed,
        silhouette,
        edges,
    )


def test_the_explanation_counts_open_and_inward_wound_casters() -> None:
    mesh, inwards = box(1.0, (0.0, 0.5, 0.0)), turned(box(1.0, (2.0, 0.5, 0.0)))

    def reason(*meshes: Mesh) -> str:
        return reasons(looking(meshes, SUN))["closed casters"]

    signs = "which shadow volumes count with signed weights"
    both = "2 are in open parts, 12 in closed parts not wound outwards"
    assert reason(plate(9.0), mesh, inwards) == f"triangles; {both}, {signs}"
    assert reason(plate(9.0), mesh) == f"triangles; 2 are in open parts, {signs}"
    assert reason(plate(9.0, casts=False), inwards) == f"triangles; 12 are in closed parts not wound outwards, {signs}"
    assert reason(plate(9.0, casts=False), mesh).startswith("triangles, all in closed parts")


def test_a_ball_has_the_outlines_that_lie_between_triangles_turned_to_the_light_and_away(light: Light) -> None:
    mesh = ball(4)
    view = looking([mesh], light)
    made = trimesh.Trimesh(mesh.vertices, mesh.faces, process=False)
    source, w = light.homogeneous
    seen = ((np.array(source) - w * made.triangles_center) * made.face_normals).sum(axis=1) > 0
    between = seen[made.face_adjacency]
    assert casters_of(view).silhouette == np.count_nonzero(between[:, 0] != between[:, 1])


@pytest.mark.parametrize("name", ["leaves", "stairs", "walker"])
def test_meshes_that_volumes_treat_as_closed_are_closed(name: str) -> None:
    view, _ = chosen_view(name, 64).placed()
    casters, of_volumes = casters_of(view), topology.casters_of(view.scene)
    assert casters.triangles == len(of_volumes.closed.faces) + len(of_volumes.open.faces)
    assert casters.closed == len(of_volumes.closed.faces)


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
    casters = casters_of(chosen_view(str(scene), 32).placed()[0])
    assert casters.open == 12 and casters.closed == 12 and casters.walls > casters.silhouette
    (cell,) = shadowbench.run(str(scene), "shadow-volume", view_size=32, rounds=0).to_dict("records")
    assert cell["work_primitives"] == 2 * casters.walls + 1
