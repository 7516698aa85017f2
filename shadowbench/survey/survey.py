"""All that a view asks of shadows, in one value."""

from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass

from shadowbench.errors import InputError
from shadowbench.scenes.model import LightKind, View
from shadowbench.survey.cascades import CascadeSizes, cascades_of
from shadowbench.survey.casters import Casters, casters_of
from shadowbench.survey.depth import BiasNeed, DepthBits, bias_of, bits_of, depths_of
from shadowbench.survey.maps import fitted_map
from shadowbench.survey.penumbra import Penumbra, penumbra_of
from shadowbench.survey.reach import Reach, reach_of
from shadowbench.survey.receivers import Receivers, planes_of, receivers_of
from shadowbench.survey.sampling import sample_view
from shadowbench.survey.texels import Texels, texels_of


@dataclass(frozen=True)
class Needs:
    """What a view asks of shadows. None: there is nothing to ask it of.

    light: its kind; receivers, casters: what they are; texels: how large one map must be; cascades: how large several,
    for a directional light; bits, bias: of the depths that it stores; penumbra: for the light's size; reach: casters
    that matter; pixels: how many were looked at, out of view_size².
    """

    light: LightKind
    receivers: Receivers
    casters: Casters
    texels: Texels
    cascades: CascadeSizes | None
    bits: DepthBits | None
    bias: BiasNeed | None
    penumbra: Penumbra | None
    reach: Reach
    pixels: int
    view_size: int


def needs(view: View) -> Needs:
    """The needs of a view that `view_of` made; raises InputError where nothing casts or no receiver is seen."""
    if not len(view.scene.geometry.caster_faces):
        raise InputError(
            f"{view.scene.name}: no mesh casts a shadow, so that nothing needs a technique but `unshadowed`"
        )
    # What takes long with many triangles runs beside the rest, one after the other: all at once took no less time.
    with ThreadPoolExecutor(1) as pool:
        planes = pool.submit(planes_of, view.scene)
        casters = pool.submit(lambda: casters_of(view.placed()[0]))
        samples = sample_view(view)
        fitted = fitted_map(samples)
        reach = pool.submit(reach_of, fitted)
        texels = texels_of(fitted)
        depths = depths_of(fitted)
        return Needs(
            light=view.light.kind,
            texels=texels,
            cascades=cascades_of(fitted, texels),
            bits=bits_of(fitted, depths),
            bias=bias_of(fitted, depths),
            penumbra=penumbra_of(samples),
            reach=reach.result(),
            receivers=receivers_of(samples, planes.result()),
            casters=casters.result(),
            pixels=(-(-view.size // samples.step)) ** 2,
            view_size=view.size,
        )
