"""Soft shadows as the mean of hard shadows from points of the light (Haeberli and Akeley 1990)."""

import math
from collections.abc import Iterator
from dataclasses import replace
from typing import Annotated, Any

import numpy as np
from pydantic import BeforeValidator, InstanceOf

from shadowbench.errors import InputError, alternatives
from shadowbench.gl.device import Device, moderngl
from shadowbench.gl.program import Sampling, State
from shadowbench.maps.caster_map import ResolvePass
from shadowbench.plugin.base import Entry, Frame, Stage, Technique, TechniqueParams, build, param
from shadowbench.plugin.params import Call
from shadowbench.plugin.registry import own_techniques
from shadowbench.plugin.spec import Spec, spec_of
from shadowbench.scenes.model import WIDEST_CONE, Light, View
from shadowbench.scenes.vectors import Floats, Vec3, perpendicular_basis, unit, vec3
from shadowbench.techniques.shadow_volume import ShadowVolume

_GOLDEN = (math.sqrt(5) - 1) / 2
_NEAREST = 10.0  # distance of receivers from a spot, in its radii, from which on all of its points light the whole cone


def _inner_spec(value: Any) -> Any:
    """The spec of a technique's name or call in a spec. Raises ValueError with the allowed names."""
    if isinstance(value, Spec):
        return value
    call = value if isinstance(value, Call) else Call(f"{value!s:.60}")
    known = {one.name: one for one in own_techniques() if one is not LightSamples}
    try:
        if call.name not in known:
            raise InputError(f"unknown technique {call.name!r}{alternatives(call.name, sorted(known))}")
        if any(key is None for key, _ in call.arguments):
            raise InputError(f"{call.name}: found a value without a name; allowed: {call.name}(key=value,…)")
        spec = spec_of(known[call.name], call.arguments, call.name)
        if any(component.remembers for component in spec.components):
            raise InputError(f"{call.name} is drawn several times a frame; allowed: one that remembers no frames")
        return spec
    except InputError as error:
        raise ValueError(str(error)) from None


class LightSamples(Technique):
    """A hard technique averaged over points of the light, which are the same for all pixels: soft shadows in the limit.

    Each point is weighted as each receiver sees it, so that more of them approach the truth as far as the technique
    does. Few make bands, as many as there are points. The technique is drawn once for each: the slow end for maps.
    """

    name = "light-samples"
    catalogue = Entry(
        picture_scene="post",
        soft_only=True,
        exact=True,  # with the technique that it averages by default
        never_recommended="draws its technique once for each point of the light: a yardstick, not a real-time "
        "technique",
    )

    class Params(TechniqueParams):
        of: Annotated[InstanceOf[Spec], BeforeValidator(_inner_spec)] = param(
            Spec(ShadowVolume, ShadowVolume.Params()),
            "the technique that draws the hard shadows",
            values="a technique, such as shadow-map(size=2048)",
        )
        n: int = param(16, "points of the light; 1 is its centre", ge=1, le=4096)

    params: Params

    @classmethod
    def unsupported(cls, params: Params, view: View, device: Device) -> str | None:
        hard = replace(view, light=hard_light(view.light, view.light.position))
        return params.of.drawn_here.declines(params.of.params, hard, device)

    @classmethod
    def lifts(cls, params: Params) -> bool:
        return params.of.technique.lifts(params.of.params)

    @classmethod
    def draws_on_cpu(cls, params: Params) -> bool:
        return params.of.technique.draws_on_cpu(params.of.params)

    def build(self, stage: Stage) -> None:
        spec = self.params.of
        self.technique = spec.drawn_here(spec.params)
        self.draw_technique = build(self.technique, stage)
        self.sums = stage.texture(components=2)
        self.target = stage.target(self.sums)
        self.add = stage.fullscreen(stage.program("fullscreen.vert", "light-samples/add.frag"))
        self.resolve = ResolvePass(stage, "light-samples/resolve.frag")

    def draw(self, frame: Frame) -> moderngl.Texture:
        self.work: dict[str, float] = {}
        if self.params.n == 1 or not frame.light.soft:
            return self._draw_point(frame, hard_light(frame.light, frame.light.position))
        self.target.clear()
        for point, normal in light_points(frame.light, self.params.n):
            visibility = self._draw_point(frame, point)
            with frame.timed("add", changes="view"):
                xyz, w = point.homogeneous
                self.add.program.set(light=(*xyz, w), light_normal=normal)
                inputs = {**frame.surface.inputs, "visibility": (visibility, Sampling())}
                self.add.draw(self.target, inputs, State(blend="add"))
        with frame.timed("average", changes="view"):
            return self.resolve(frame, {"sums": (self.sums, Sampling())})

    def facts(self) -> dict[str, float]:
        return self.technique.facts() | self.work

    def _draw_point(self, frame: Frame, light: Light) -> moderngl.Texture:
        """Visibility of a point of the light."""
        visibility = self.draw_technique(replace(frame, view=replace(frame.view, light=light)))
        contact = self.technique.params.contact.reads * math.prod(visibility.size)
        for name, count in (*self.technique.facts().items(), ("reads", contact)):
            if name in ("reads", "rays") and count:
                self.work[name] = self.work.get(name, 0.0) + count
        return visibility


def light_points(light: Light, count: int) -> Iterator[tuple[Light, Vec3]]:
    """Points uniform in a sun's cone or on a sphere's, disc's or rectangle's surface, by a lattice of golden ratios.

    Each is a light without a size, and the unit normal of the light's surface there.
    """
    right, up, back = perpendicular_basis(-unit(light.direction), light.up)
    center = np.array(light.position)
    for index in range(count):
        u, v = (index + 0.5) / count, (index * _GOLDEN + 0.5) % 1.0
        if light.kind == "rectangle":
            width, height = light.size
            point = center + right * width * (u - 0.5) + up * height * (v - 0.5)
            yield hard_light(light, vec3(point)), vec3(-back)
            continue
        around = right * math.cos(2 * math.pi * v) + up * math.sin(2 * math.pi * v)
        if light.kind == "directional":
            direction = _on_sphere(around, back, 1.0 - u * 2.0 * math.sin(light.radius / 2) ** 2)
            yield replace(light, direction=vec3(-direction), radius=0.0), vec3(-back)
        elif light.kind == "disc":
            point = center + around * light.radius * math.sqrt(u)
            yield hard_light(light, vec3(point)), vec3(-back)
        else:
            normal = _on_sphere(around, back, 1.0 - 2.0 * u)
            yield hard_light(light, vec3(center + normal * light.radius)), vec3(normal)


def _on_sphere(around: Floats, back: Floats, cosine: float) -> Floats:
    """Unit vector at an angle from `back`; around: unit vector perpendicular to it."""
    return around * math.sqrt(max(1.0 - cosine * cosine, 0.0)) + back * cosine


def hard_light(light: Light, position: Vec3) -> Light:
    """The light without a size at a position. A spot's cone is widened, to light what its centre's lights."""
    widened = light.angle + 2 * math.asin(1 / _NEAREST) if position != light.position else light.angle
    angle = min(widened, math.radians(WIDEST_CONE)) if light.kind == "spot" else light.angle
    return replace(light, position=position, radius=0.0, size=(0.0, 0.0), angle=angle)
