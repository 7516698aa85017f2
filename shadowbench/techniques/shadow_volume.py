"""Shadow volumes: walls and caps extruded by the light, counted along the camera's rays."""

from dataclasses import replace
from typing import Literal, Self

import moderngl
import numpy as np
from pydantic import model_validator

from shadowbench.geometry.topology import casters_of
from shadowbench.gl.matrices import view_projection
from shadowbench.gl.program import Comparison, Sampling, State, Stencil
from shadowbench.gl.targets import StencilTarget
from shadowbench.scenes.model import Floats, View
from shadowbench.techniques.base import Frame, Stage, Technique, TechniqueParams, param
from shadowbench.techniques.culling import visible_region
from shadowbench.techniques.layers import LayerBound
from shadowbench.techniques.reduction import MinMaxReduction
from shadowbench.techniques.volumes import ArrayVolumes, Extrusion, RenderPass, ShaderVolumes, VolumePart, Volumes

# What the stencil holds is, modulo 256, the number of layers between receiver and light: increments and decrements
# wrap, so that they add up modulo 256 in any order, however many walls the camera's ray crosses. A receiver's layers
# are some of those on its light ray, so that 0 means none as long as no light ray crosses 256. Counted from the eye it
# is the receiver's number less the eye's, two numbers under 256, and 0 only where they are equal.
MOST_LAYERS = 2**StencilTarget.bits - 2

_AT_EYE = 1e-6  # of the far plane

_ADDING = Stencil(front=("keep", "keep", "increment"), back=("keep", "keep", "decrement"))
_SUBTRACTING = Stencil(front=_ADDING.back, back=_ADDING.front)


class ShadowVolume(Technique):
    """Volumes behind the casters, counted along each of the camera's rays (Crow 1977; stencil: Heidmann 1991).

    `z-fail` counts behind the receiver (Bilodeau and Songy 1999, Carmack 2000), to infinity (Everitt and Kilgard 2002).
    Closed parts extrude facing triangles; open ones sum the signed edges of all triangles, turned to the light, and are
    as exact. A row that asks for the stencil is counted in colour where a light ray may cross 255 layers or more: its
    facts say so. `z-pass` is wrong where the eye is in a volume or a caster between it and the near plane. Otherwise
    exact but for single pixels; `compare=depth` leaves more of them and is faster. Its 24 bits suffice because the near
    plane is pulled to the nearest visible surface. The time grows with the screen that the walls cover.
    """

    name = "shadow-volume"
    picture_scene = "inside-volume"
    grid = {"compare": ("position", "depth")}
    exact = True

    class Params(TechniqueParams):
        """Parameters of shadow-volume."""

        count: Literal["z-pass", "z-fail"] = param("z-fail", "count in front of the receiver, or behind it")
        faces: Extrusion = param("silhouette", "what is extruded: every facing triangle, or edges of the outline alone")
        counter: Literal["stencil", "color"] = param("stencil", "8 bits that wrap, or a float target that is blended")
        compare: Literal["position", "depth"] = param(
            "position",
            "what says whether a wall is behind a receiver: its position, or 24 bits of depth, which is faster",
        )
        build: Literal["geometry", "cpu"] = param("geometry", "extruded by a geometry shader, or by NumPy")
        cull: bool = param(True, "leaves out parts whose volumes reach nothing in the picture, of build=geometry")

        @model_validator(mode="after")
        def _has_a_reference(self) -> Self:
            if self.build == "cpu" and self.faces != "triangle":
                raise ValueError(f"build=cpu extrudes single triangles; faces is {self.faces}, allowed: triangle")
            return self

    params: Params

    @classmethod
    def extra_work(cls, params: TechniqueParams) -> str | None:
        assert isinstance(params, cls.Params)
        by_depth = params.compare == "depth"
        return "draws the surfaces' depth besides: faster on a GPU, but more work" if by_depth else None

    def build(self, stage: Stage) -> None:
        params = self.params
        self.casters = casters_of(stage.scene)
        self.volumes: Volumes = (
            ShaderVolumes(stage, self.casters, params.faces, params)
            if params.build == "geometry"
            else ArrayVolumes(stage, self.casters, params)
        )
        # No ray crosses more layers than there are triangles.
        triangles = len(self.casters.closed.faces) + len(self.casters.open.faces)
        many = triangles > MOST_LAYERS
        stencil = params.counter == "stencil"
        self.bound = LayerBound(stage, self.casters) if stencil and many else None
        if params.compare == "depth":
            self.distances = MinMaxReduction(stage, stage.size, "values")
            self.depth_program = stage.program("casters.vert", "depth.frag")
            self.surfaces = stage.surfaces(self.depth_program)
        self.visibility = stage.texture()
        self.stenciled = stage.stencil_target(self.visibility)
        self.resolve_program = stage.program("fullscreen.vert", "shadow-volume/resolve.frag")
        self.fullscreen = stage.fullscreen(self.resolve_program)
        if many or not stencil:
            self.counts = stage.texture()
            self.counting = stage.target(self.counts, depth=self.stenciled.depth)
            self.resolve_counts = stage.program("fullscreen.vert", "shadow-volume/resolve.frag", defines={"COLOR": 1})
            self.fullscreen_counts = stage.fullscreen(self.resolve_counts)
            self.shown = stage.target(self.visibility)

    def draw(self, frame: Frame) -> moderngl.Texture:
        with frame.timed("extrude", changes="light"):  # by a geometry shader: only which triangles are
            _, w = frame.light.homogeneous
            count_both_facings = bool(w) and self.casters.may_contain(frame.light.position)
            self.volumes.extrude(frame, count_both_facings)
        self.layers = None
        if self.bound is not None:
            with frame.timed("layers", changes="light"):
                self.layers = self.bound(frame, count_both_facings)
        self.in_color = self.params.counter == "color" or (self.layers or 0) > MOST_LAYERS
        with frame.timed("clear", changes="view"):
            self.stenciled.target.clear(1.0, depth=1.0)
            if self.in_color:
                self.counting.clear(depth=1.0)  # the same depth
            else:
                self.stenciled.clear_stencil()
        view = frame.view
        if self.params.compare == "depth":
            with frame.timed("near", changes="view"):
                view = self._pulled(frame)
            with frame.timed("depth", changes="view"):
                self.depth_program.set(world_to_clip=view_projection(view))
                self.surfaces.draw(self.stenciled.target, state=State(depth_test="<", color_write=False))
        with frame.timed("volumes", changes="view"):
            planes = self._counted_in(frame.view) if self.params.cull else np.empty((0, 4))
            self.volumes.set_camera(frame, view_projection(view), planes)
            self._count("wall", frame)
            if self.params.count == "z-fail":
                self._count("cap", frame)
        with frame.timed("resolve", changes="view"):
            self._resolve(frame)
        return self.visibility

    def _counted_in(self, view: View) -> Floats:
        """The planes of where a volume changes a count: at what is seen, and by z-pass from the eye on."""
        if self.params.count == "z-fail":
            return visible_region(view)
        return visible_region(replace(view, camera=replace(view.camera, near=_AT_EYE * view.near_far[1])))

    def _pulled(self, frame: Frame) -> View:
        """The view with its near plane at the nearest visible surface, but for the rounding of depths.

        Depth steps grow with far² / near, and behind a near plane of far/10⁴ they are too wide for 24 bits.
        """
        lowest, _ = self.distances({"values": (frame.surface.depth, Sampling())})
        near, far = frame.view.near_far
        return replace(frame.view, camera=replace(frame.camera, near=max(near, 0.999 * far * float(lowest[0]))))

    def _count(self, part: VolumePart, frame: Frame) -> None:
        """Add up what a part of the volumes contributes behind the receivers, or in front of them."""
        behind = self.params.count == "z-fail"
        # A cap seen counter-clockwise is entered by the camera's ray; a wall a → b → infinity seen so is left.
        front_adds = 1 if behind and part == "wall" else -1
        # The receiver is the nearest of all surfaces, so that every cap is at it or behind: nothing is left to compare.
        # Caps before the near plane, which the camera does not see, are clipped.
        by_depth = part == "wall" and self.params.compare == "depth"
        compare: Comparison = "" if not by_depth else ">=" if behind else "<"
        state = State(compare, depth_write=False, depth_clamp=True, clip_distances=1 if part == "cap" else 0)
        if self.in_color:
            render_pass = RenderPass(self.counting, frame.surface.inputs, replace(state, blend="add"))
            self.volumes.draw(part, 0, front_adds, render_pass)
            return
        for sign in (1, -1):
            stencil = _ADDING if sign * front_adds > 0 else _SUBTRACTING
            counted = replace(state, color_write=False, stencil=stencil)
            self.volumes.draw(part, sign, front_adds, RenderPass(self.stenciled.target, frame.surface.inputs, counted))

    def _resolve(self, frame: Frame) -> None:
        if self.in_color:
            self.resolve_counts.set(light=frame.light_uniform)
            self.fullscreen_counts.draw(self.shown, frame.surface.inputs | {"counts": (self.counts, Sampling())})
        else:
            self.resolve_program.set(light=frame.light_uniform)
            state = State(stencil=Stencil(test="!="))
            self.fullscreen.draw(self.stenciled.target, frame.surface.inputs, state)

    def facts(self) -> dict[str, float]:
        facts = {
            "closed_parts": float(len(self.casters.closed.boxes)),
            "open_parts": float(len(self.casters.open.boxes)),
            "culled_parts": float(self.volumes.culled),
            "counted_in_color": float(self.in_color),
        }
        return facts if self.layers is None else facts | {"layers_at_most": self.layers}
