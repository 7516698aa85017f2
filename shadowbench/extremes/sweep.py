"""Blocks of `stress`: one for each value of each axis under each kind of light."""

from collections.abc import Iterable, Sequence

from shadowbench.extremes.axes import Axis, Setting, Value
from shadowbench.measure.cells import Block, Cell
from shadowbench.scenes.model import LightKind
from shadowbench.techniques.base import Technique
from shadowbench.techniques.spec import Spec

Point = tuple[Axis, LightKind, Value]


def points_of(axes: Sequence[Axis], quick: bool) -> list[Point]:
    """Values of axes under each kind of light, in their order. quick: a few of each axis."""
    return [(axis, light, value) for axis in axes for light in axis.lights for value in axis.swept(quick)]


def block_at(specs: Sequence[Spec], point: Point) -> Block:
    """Block of specs at a point, without those that lack the axis's parameters or do not support the light."""
    axis, light, value = point
    setting = axis.at(value, light)
    at_point = [(spec, spec_at(spec, setting)) for spec in specs if light in spec.technique.lights]
    cells = tuple(Cell(spec, home=home) for home, spec in at_point if spec is not None)
    place = {"axis": axis.name, "axis_value": value, "axis_unit": axis.unit, "light_kind": light}
    return Block(setting.views, cells, setting.coordinates, place=place)


def spec_at(spec: Spec, setting: Setting) -> Spec | None:
    """The spec with the parameters of a setting; None if the technique lacks one of them."""
    known = type(spec.params).model_fields
    params = {name: value for name, value in setting.params.items() if name in known}
    if len(params) < len(setting.params):
        return None
    return spec.with_(**params) if params else spec


def default_specs(techniques: Iterable[type[Technique]]) -> tuple[Spec, ...]:
    """A spec of every technique at its defaults, for the lights of the axes, which have no size."""
    return tuple(Spec(technique, technique.Params()) for technique in techniques if not technique.catalogue.soft_only)
