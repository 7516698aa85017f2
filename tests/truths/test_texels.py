"""Cut-outs with nearest sampling are exactly the triangles that their opaque texels cover."""

from pathlib import Path

import pytest

from shadowbench.scenes.model import Light, Mesh, Scene, view_of
from shadowbench.truths.trace import trace
from tests.cards import CAMERA
from tests.cut_out_scenes import SCENES


@pytest.mark.parametrize("size", [128, pytest.param(640, marks=pytest.mark.slow)])
@pytest.mark.parametrize("name", SCENES)
def test_no_decided_pixel_differs_from_exact_triangles(name: str, size: int, light: Light, tmp_path: Path) -> None:
    def traced(meshes: tuple[Mesh, ...]):
        return trace(view_of(Scene(name, meshes, (CAMERA,), (light,)), CAMERA, light, size), pixel_samples=1)

    meshes, triangles = SCENES[name](light, tmp_path)
    cut, exact = traced(meshes), traced(triangles)
    decided, ground = ~(cut.undecided | exact.undecided), len(meshes[0].faces)
    on_cards, shadow = cut.triangle >= ground, cut.receivers & (cut.visibility == 0)
    assert (on_cards & decided).sum() > 0.02 * size**2
    assert (shadow & decided).sum() > 0.005 * size**2
    assert (on_cards != (exact.triangle >= ground))[decided].sum() == 0
    assert (cut.receivers != exact.receivers)[decided].sum() == 0
    assert (cut.visibility != exact.visibility)[decided].sum() == 0
