"""The survey of a view: everything it needs of a shadow technique."""

from collections.abc import Iterator
from dataclasses import dataclass, fields, is_dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from shadowbench.errors import InputError
from shadowbench.geometry.planes import find_planes
from shadowbench.scenes.assumed import without_ground
from shadowbench.scenes.model import LightShape, Scene, View, view_of
from shadowbench.survey.casters import Casters, RelevantCasters, casters_of, relevant_casters
from shadowbench.survey.depth import BiasNeed, DepthBits, Penumbra, bias_of, bits_of, depths_of, penumbra_of
from shadowbench.survey.samples import Samples, fitted_map, sample_view
from shadowbench.survey.sizes import CascadeSizes, Texels, cascades_of, texels_of

if TYPE_CHECKING:
    import pandas as pd

PLANAR_SHARE = 0.999  # least planar share of the visible receivers for which projection suffices


@dataclass(frozen=True)
class Receivers:
    """The visible receivers, which face the light.

    pixels: their share of the view; shadowed: their share in shadow; planar: their share on planes that
    `planar-projection` finds; lost: share of the shadow on other receivers; planes: number of visible planes.
    """

    pixels: float
    shadowed: float
    planar: float
    lost: float
    planes: int

    @property
    def projection_suffices(self) -> bool:
        """Whether practically all visible receivers are on planes."""
        return self.planar >= PLANAR_SHARE


def planes_of(scene: Scene) -> NDArray[np.int64]:
    """(T,) index of each triangle's plane, of those that `planar-projection` finds by default; −1 for none."""
    geometry = scene.geometry
    of_triangle = np.full(len(geometry.faces), -1)
    for index, plane in enumerate(find_planes(geometry, geometry.receives)):
        of_triangle[plane.triangles] = index
    return of_triangle


def receivers_of(samples: Samples, of_triangle: NDArray[np.int64]) -> Receivers:
    """Statistics of the visible receivers. of_triangle: (T,) planes of the triangles, from `planes_of`."""
    plane_of = of_triangle[samples.triangle]
    planar, shadow = plane_of >= 0, np.flatnonzero(samples.shadowed)
    return Receivers(
        pixels=len(samples.pixel) / samples.side**2,
        shadowed=float(samples.shadowed.mean()),
        planar=float(planar.mean()),
        lost=float((~planar[shadow]).mean()) if len(shadow) else 0.0,
        planes=len(np.unique(plane_of[planar])),
    )


@dataclass(frozen=True)
class Needs:
    """The needs of a view; None where a need does not apply.

    light: kind of the light; receivers, casters: their statistics; texels: needed size of one map; without_ground: the
    same without the ground that was assumed; cascades: needed sizes of cascades, under a directional light; bits, bias:
    needed depth format and bias; penumbra: widths for the light's size; reach: casters that can shadow visible
    receivers; pixels: number of sampled pixels, of view_size².
    """

    light: LightShape
    receivers: Receivers
    casters: Casters
    texels: Texels
    without_ground: Texels | None
    cascades: CascadeSizes | None
    bits: DepthBits | None
    bias: BiasNeed | None
    penumbra: Penumbra | None
    reach: RelevantCasters
    pixels: int
    view_size: int

    @property
    def frame(self) -> "pd.DataFrame":
        """A line per number: `need`, such as texels.size, and its `value`."""
        import pandas as pd  # 0.3 s, and the command does without

        return pd.DataFrame(_numbers(self, ""), columns=["need", "value"])


def _numbers(needs: Any, path: str) -> Iterator[tuple[str, float]]:
    """Generate path and value of the numbers in a dataclass and in the dataclasses in it."""
    for field in fields(needs):
        value, name = getattr(needs, field.name), f"{path}{field.name}"
        if is_dataclass(value):
            yield from _numbers(value, f"{name}.")
        elif isinstance(value, bool | int | float):
            yield name, float(value)


def needs(view: View, penumbrae: bool = True) -> Needs:
    """The needs of a view from `view_of`. Raises InputError if there is no caster or no visible receiver.

    penumbrae: whether to trace the truths that `penumbra` is read from; without, it is None.
    """
    if not len(view.scene.geometry.caster_faces):
        raise InputError(f"{view.scene.name}: no mesh casts a shadow, so that `unshadowed` suffices")
    samples = sample_view(view)
    fitted = fitted_map(samples)
    depths = depths_of(fitted)
    texels = texels_of(fitted, depths)
    return Needs(
        light=view.light.kind,
        receivers=receivers_of(samples, planes_of(view.scene)),
        casters=casters_of(view.placed()[0]),
        texels=texels,
        without_ground=_without_ground(view),
        cascades=cascades_of(fitted, depths, texels),
        bits=bits_of(fitted, depths),
        bias=bias_of(fitted, depths),
        penumbra=penumbra_of(view, samples) if penumbrae else None,
        reach=relevant_casters(fitted, sure=samples.step == 1 and not view.light.soft),
        pixels=samples.side**2,
        view_size=view.size,
    )


def _without_ground(view: View) -> Texels | None:
    """The needed size without the ground that was assumed; None if there is none, or nothing else is lit and seen."""
    if view.scene.ground is None:
        return None
    bare = view_of(without_ground(view.scene), view.camera, view.light, view.size)
    try:
        fitted = fitted_map(sample_view(bare))
        return texels_of(fitted, depths_of(fitted))
    except InputError:  # no other receiver
        return None
