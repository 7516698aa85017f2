"""Masks by ratio beside what the engines' own shadow-only materials draw, in the same page with the same settings.

Babylon.js' `ShadowOnlyMaterial` is of another package; `BackgroundMaterial.shadowOnly` of its core is the same.
"""

import re
import shutil
from pathlib import Path

import numpy as np
import pytest

from shadowbench.engines.environment import install, needed_programs
from shadowbench.engines.session import EngineSession
from shadowbench.plugin.base import Phase
from shadowbench.plugin.engine import EngineParams
from shadowbench.plugin.registry import engines
from shadowbench.scenes.opening import chosen_view
from shadowbench.truths.cache import cached_truth

pytestmark = [pytest.mark.slow, pytest.mark.usefixtures("truth_cache")]

SIZE = 256
GRAZING = 0.1  # N·L below which a pixel has few levels
# Behind `draw.js`, whose `draw` is `lit` there: at an exposure below 0 a picture of shadow-only materials.
MATERIALS = {
    "three": """
      lit({ ...asked, exposure: 1 });
      scene.overrideMaterial = new THREE.ShadowMaterial({ color: "white", transparent: false });
      renderer.render(scene, camera);
      scene.overrideMaterial = null;""",
    "babylon": """
      await lit({ ...asked, exposure: 1 });
      const only = Object.assign(new BABYLON.BackgroundMaterial("", scene), { shadowOnly: true });
      scene.lights[0].getShadowGenerators().forEach((one) => (one.transparencyShadow = true)); // else it casts none
      only.primaryColor = BABYLON.Color3.White();
      only.alphaMode = BABYLON.Constants.ALPHA_DISABLE;
      const own = meshes.map((mesh) => mesh.material);
      meshes.forEach((mesh) => (mesh.material = only));
      do await new Promise(requestAnimationFrame); while (!meshes.every((mesh) => mesh.isReady(true)));
      scene.render();
      meshes.forEach((mesh, index) => (mesh.material = own[index]));""",
    "playcanvas": """
      const parts = root.findComponents("render").flatMap((part) => part.meshInstances);
      const own = parts.map((part) => part.material);
      const only = new pc.StandardMaterial();
      only.shadowCatcher = true;
      only.update();
      parts.forEach((part) => (part.material = only));
      await lit({ ...asked, exposure: 1 });
      parts.forEach((part, index) => (part.material = own[index]));""",
}
# Which channel has the shadow, or the light.
CHANNELS = {"three": (3, True), "babylon": (3, True), "playcanvas": (0, False)}


@pytest.mark.parametrize("name", MATERIALS)
def test_a_mask_by_ratio_is_what_the_engine_s_shadow_only_material_draws(name: str, tmp_path: Path) -> None:
    """Of 40,457 pixels of stairs, 0 of Babylon.js, 11 of PlayCanvas and 75 of three.js fall on the other side of ½.

    Those are at ½, as rounded: ratios are of 8 bits in sRGB, the shadow-only pictures of 8 linear bits.
    """
    declared = engines()[name]
    assert not needed_programs(declared)
    install(declared)
    shutil.copytree(declared.folder(), tmp_path / name)

    class Patched(declared):  # type: ignore[misc, valid-type]
        """Draws shadow-only materials too."""

        folder = classmethod(lambda cls: tmp_path / name)

    drawing = tmp_path / name / "draw.js"
    lit = re.sub(r"export (async )?function draw\(", r"\1function lit(", drawing.read_text())
    drawing.write_text(
        f"{lit}\nexport async function draw(asked) {{ if (asked.exposure > 0) return lit(asked); {MATERIALS[name]} }}"
    )
    view, params, (channel, inverted) = chosen_view("stairs", SIZE), Patched.Params(), CHANNELS[name]
    assert isinstance(params, EngineParams)
    session = EngineSession(Patched, SIZE)
    found = session.draw(view, params, Phase())
    asked = {**session._request(view, params, Phase()), "shadows": True, "exposure": -1}
    picture = np.frombuffer(session._call("draw", asked)[1], np.uint8).reshape(SIZE, SIZE, 4)[..., channel] / 255
    session.close()
    assert found.measurable is not None
    truth = cached_truth(view)
    inside = truth.receivers & found.measurable
    only = (1 - picture if inverted else picture)[inside]
    ratio = found.visibility[inside]
    differing = (only < 0.5) != (ratio < 0.5)
    assert (only < 0.5).mean() > 0.2
    assert np.abs(only - ratio)[truth.cosine[inside] > GRAZING].max() < 0.03
    assert (np.abs(ratio - 0.5)[differing] < 0.02).all()
