"""Axes of cut-outs: the size of leaves, and the number of cards that they are cut out of."""

from functools import partial

from shadowbench.extremes.model import TEXEL, Axis, Setting, ground, light_at, mesh, view_of_meshes
from shadowbench.scenes.foliage import LEAF
from shadowbench.scenes.model import LightKind

_CROWN = 1.5  # diameter, in metres
_COVER = 5.5  # area of all cards over that of the crown's cross-section


def _crown(size: float, count: int, kind: LightKind) -> Setting:
    """A crown of cards of a size in metres, above the ground."""
    crown = mesh("foliage", _CROWN, (-0.3, 1.0, 0.1), count=count, size=size / _CROWN)
    return Setting((view_of_meshes([ground(), crown], light_at(kind, 65.0)),))


@partial(
    Axis,
    name="leaf-size",
    about="leaves cut out of cards get smaller than a shadow-map texel: light no longer comes through between them",
    unit="texels of 5.9 mm",
    values=(30.0, 20.0, 10.0, 5.0, 3.0, 2.0, 1.0),
    default=20.0,
    quick=(20.0, 5.0, 1.0),
    invariant="between small leaves light comes through as between large ones",
)
def leaf_size(texels: float, kind: LightKind) -> Setting:
    """A crown of leaves of a length; their number grows so that they cover the same area."""
    size = texels * TEXEL / LEAF
    return _crown(size, max(1, round(_COVER * _CROWN**2 / size**2)), kind)


@partial(
    Axis,
    name="cards",
    about="more and more cards overlap in one crown: a shadow ray meets many before one that is opaque there",
    unit="cards",
    values=(10, 30, 100, 300, 1000, 10_000),
    default=100,
    quick=(10, 100, 1000),
    invariant="a ray passes every card that is clear where it meets it",
)
def cards(count: float, kind: LightKind) -> Setting:
    """A crown of cards of one size."""
    return _crown(0.3, int(count), kind)
