"""Shadow volumes: side walls and caps extruded away from the light, counted along the camera's rays."""

from dataclasses import replace
from typing import Literal

import numpy as np

from shadowbench.geometry.topology import Singles, casters_of
from shadowbench.gl.device import Device
from shadowbench.gl.gbuffer import view_projection
from shadowbench.gl.library import moderngl
from shadowbench.gl.program import Comparison, Sampling, State, Stencil
from shadowbench.gl.targets import StencilTarget
from shadowbench.maps.reduction import MinMaxReduction
from shadowbench.plugin.base import Entry, Frame, Stage, Technique, TechniqueParams, param
from shadowbench.scenes.model import Light, View
from shadowbench.scenes.vectors import Floats, perpendicular_basis, unit
from shadowbench.techniques.volumes import Batch, Count, Extrusion, VolumeParams, VolumePart, Volumes, batches_of

# The stencil stores the number of caster layers between receiver and light modulo 256: increments and decrements wrap,
# so their order and the number of walls along the camera's ray do not matter. If no light ray crosses 256 layers, 0
# therefore means lit. With z-pass it is the receiver's number minus the eye's, both below 256, and 0 only if equal.
MOST_LAYERS = 2**StencilTarget.bits - 2

_ADDING = Stencil(front=("keep", "keep", "increment"), back=("keep", "keep", "decrement"))
_SUBTRACTING = Stencil(front=_ADDING.back, back=_ADDING.front)
_ROUNDING = 1e-6  # of the largest coordinate: exceeds the float32 rounding of a silhouette


class ShadowVolume(Technique):
    """Shadow volumes, counted along each of the camera's rays (Crow 1977; stencil: Heidmann 1991).

    Volumes are counted in front of the receiver, without caps, and end beyond the visible region (Lloyd et al. 2004).
    With `z-fail`, parts whose volume the eye may be in are counted behind it (Bilodeau and Songy 1999, Carmack 2000),
    to infinity (Everitt and Kilgard 2002); `z-pass` does not, which is wrong if the eye is inside a volume, or a
    caster between the eye and the near plane. Cut-outs that are drawn whole are counted behind it in both.
    Silhouettes are found on the CPU, by compiled code.
    Closed parts extrude the triangles that face the light. Open parts extrude all triangles, oriented towards the
    light, with signed edge weights, and are as exact. With the stencil counter, a view whose light rays may cross 255
    layers or more is counted in a colour target instead; the row's facts say so. Exact except for single pixels;
    `compare=depth` has more of them and is faster. Its 24 bits suffice because the near plane is moved to the nearest
    visible surface. The time grows with the screen area of the walls.
    """

    name = "shadow-volume"
    catalogue = Entry(
        picture_scene="inside-volume",
        grid={"compare": ("position", "depth")},
        exact=True,
    )

    class Params(VolumeParams):
        count: Count = param("z-fail", "counts in front of the receiver, or behind it where the eye may be in a volume")
        faces: Extrusion = param("silhouette", "extrudes every triangle that faces the light, or silhouette edges only")
        counter: Literal["stencil", "color"] = param("stencil", "8-bit wrapping stencil, or a blended float target")
        compare: Literal["position", "depth"] = param(
            "position",
            "orders wall and receiver by the receiver's position, or by a 24-bit depth buffer, which is faster",
        )
        cull: bool = param(True, "skips parts that cannot shadow a visible receiver")

    params: Params

    @classmethod
    def unsupported(cls, params: TechniqueParams, view: View, device: Device) -> str | None:
        assert isinstance(params, cls.Params)
        return params.unsupported_casters(view)

    @classmethod
    def extra_work(cls, params: TechniqueParams) -> str | None:
        assert isinstance(params, cls.Params)
        by_depth = params.compare == "depth"
        return "also draws the surfaces' depth, which is more work; on a GPU it may be faster" if by_depth else None

    @classmethod
    def draws_on_cpu(cls, params: TechniqueParams) -> bool:
        return True  # the silhouettes

    def build(self, stage: Stage) -> None:
        params = self.params
        self.casters = casters_of(stage.scene)
        self.volumes = Volumes(stage, self.casters, params.faces, params)
        # No ray crosses more layers than there are triangles.
        many = len(self.volumes.faces) > MOST_LAYERS
        stencil = params.counter == "stencil"
        self.bound = LayerBound(stage.scene.geometry.vertices[self.volumes.faces]) if stencil and many else None
        if params.compare == "depth":
            self.distances = MinMaxReduction(stage, stage.size, "values")
            self.depth_program = stage.program("casters.vert", "depth.frag")
            self.surfaces = stage.surfaces(self.depth_program)
        self.visibility = stage.texture()
        self.stenciled = stage.stencil_target(self.visibility)
        self.resolve_program = stage.program("fullscreen.vert", "shadow-volume/resolve.frag")
        self.fullscreen = stage.fullscreen(self.resolve_program)
        self.stage = stage
        if not stencil:
            self._build_counter()

    def _build_counter(self) -> None:
        """Build what counts in a colour target."""
        stage = self.stage
        self.counts = stage.texture()
        self.counting = stage.target(self.counts, depth=self.stenciled.depth)
        self.resolve_counts = stage.program("fullscreen.vert", "shadow-volume/resolve.frag", defines={"COLOR": 1})
        self.fullscreen_counts = stage.fullscreen(self.resolve_counts)
        self.visibility_target = stage.target(self.visibility)

    def draw(self, frame: Frame) -> moderngl.Texture:
        with frame.timed("extrude", changes="light"):
            _, w = frame.light.homogeneous
            count_both_facings = bool(w) and self.casters.may_contain(frame.light.position)
            self.volumes.extrude(frame, count_both_facings)
        self.layers = None
        if self.bound is not None:
            with frame.timed("layers", changes="light"):
                self.layers = self.bound(frame.light, self.volumes.silhouette())
        self.in_color = self.params.counter == "color" or (self.layers or 0) > MOST_LAYERS
        with frame.timed("clear", changes="view"):
            self.stenciled.target.clear(1.0, depth=1.0)
            if self.in_color:
                if not hasattr(self, "counts"):
                    self._build_counter()
                self.counting.clear(depth=1.0)  # shares the depth buffer
            else:
                self.stenciled.clear_stencil()
        view = frame.view
        if self.params.compare == "depth":
            with frame.timed("near", changes="view"):
                view = self._with_tight_near(frame)
            with frame.timed("depth", changes="view"):
                self.depth_program.set(world_to_clip=view_projection(view))
                self.surfaces.draw(self.stenciled.target, state=State(depth_test="<", color_write=False))
        with frame.timed("volumes", changes="view"):
            boxes, cut_out = self.volumes.boxes, self.volumes.cut_out
            self.batches = batches_of(frame.view, boxes, cut_out, self.params.count, self.params.cull)
            self.volumes.set_camera(frame, view_projection(view), self.batches)
            for batch in self.batches:
                self._count("wall", batch, frame)
                if batch.behind:
                    self._count("cap", batch, frame)
        with frame.timed("resolve", changes="view"):
            self._resolve(frame)
        return self.visibility

    def _with_tight_near(self, frame: Frame) -> View:
        """The view with its near plane just in front of the nearest visible surface.

        Depth steps grow with far² / near; with near at far/10⁴, 24 bits are too coarse.
        """
        lowest, _ = self.distances({"values": (frame.surface.depth, Sampling())})
        near, far = frame.view.near_far
        return replace(frame.view, camera=replace(frame.camera, near=max(near, 0.999 * far * float(lowest[0]))))

    def _count(self, part: VolumePart, batch: Batch, frame: Frame) -> None:
        """Count the walls or caps behind the receivers, or the walls in front of them."""
        # The camera's ray enters a volume through a counter-clockwise cap, and leaves it through a counter-clockwise
        # wall a → b → infinity.
        front_adds = 1 if batch.behind and part == "wall" else -1
        # The receiver is the nearest surface, so that every cap is at or behind it and needs no depth test, but those
        # with holes, for which count.frag has one. Caps in front of the near plane are clipped.
        by_depth = part == "wall" and self.params.compare == "depth"
        compare: Comparison = "" if not by_depth else ">=" if batch.behind else "<"
        state = State(compare, depth_write=False, depth_clamp=True, clip_distances=1 if part == "cap" else 0)
        for sign in (1, -1):
            adds = sign * front_adds
            if self.in_color:
                target, counted = self.counting, replace(state, blend="add")
            else:
                stencil = _ADDING if adds > 0 else _SUBTRACTING
                target, counted = self.stenciled.target, replace(state, color_write=False, stencil=stencil)
            self.volumes.draw(part, batch, sign, adds, target, frame.surface.inputs, counted)

    def _resolve(self, frame: Frame) -> None:
        if self.in_color:
            self.resolve_counts.set(light=frame.light_uniform)
            textures = frame.surface.inputs | {"counts": (self.counts, Sampling())}
            self.fullscreen_counts.draw(self.visibility_target, textures)
        else:
            self.resolve_program.set(light=frame.light_uniform)
            state = State(stencil=Stencil(test="!="))
            self.fullscreen.draw(self.stenciled.target, frame.surface.inputs, state)

    def facts(self) -> dict[str, float]:
        facts = {
            "closed_parts": float(len(self.casters.closed.boxes)),
            "open_parts": float(len(self.casters.open.boxes)),
            "culled_parts": float(len(self.volumes.boxes) - sum(batch.parts.sum() for batch in self.batches)),
            "counted_in_color": float(self.in_color),
        }
        return facts if self.layers is None else facts | {"layers_at_most": self.layers}


class LayerBound:
    """Bounds the layers by the silhouette edges that a half-plane through the light crosses.

    On a curve between two light rays, the number of layers changes only at silhouette edges, at each by its weight. The
    curves are half-planes of parallel rays, which come from where there are no casters, or for a light with a position
    half-planes bounded by a line through it, on which they come from the ray that meets the fewest triangles' boxes.
    """

    def __init__(self, triangles: Floats) -> None:
        """Triangles: (F, 3, 3) corners of the casters."""
        low, high = (triangles.min(axis=1), triangles.max(axis=1)) if len(triangles) else np.zeros((2, 0, 3))
        self._low: Floats = low.T
        self._high: Floats = high.T

    def __call__(self, light: Light, edges: Singles) -> float:
        """Upper bound on the layers along any ray of the light.

        edges: (N, 6) edges a → b of the silhouette with the casters to their left as seen from the light, each as often
        as its weight.
        """
        a, b = edges[:, :3].astype(np.float64), edges[:, 3:].astype(np.float64)
        rounding = _ROUNDING * float(max(np.abs(edges).max(initial=0.0), np.abs(light.position).max()))
        if light.kind == "directional":
            basis = perpendicular_basis(-unit(light.direction), (0.0, 1.0, 0.0))
            start, end = a @ basis[0], b @ basis[0]
            rising = end >= start - rounding
            return float(_most_at_once(start[rising] - rounding, end[rising] + rounding))
        axis, sign, crossed = self._emptiest(np.array(light.position), rounding)
        return crossed + _most_around(a - light.position, b - light.position, axis, sign, rounding)

    def _emptiest(self, point: Floats, rounding: float) -> tuple[int, int, int]:
        """Of the six rays from a point along the axes, the one that meets the fewest boxes: axis, sign and number."""
        above, below = self._low <= point[:, None] + rounding, self._high >= point[:, None] - rounding
        met = {}
        for axis in range(3):
            i, j = (axis + 1) % 3, (axis + 2) % 3
            beside = above[i] & below[i] & above[j] & below[j]
            met[axis, 1], met[axis, -1] = int((beside & below[axis]).sum()), int((beside & above[axis]).sum())
        (axis, sign), fewest = min(met.items(), key=lambda item: item[1])
        return axis, sign, fewest


def _most_around(a: Floats, b: Floats, axis: int, sign: int, rounding: float) -> int:
    """Number of edges a → b, counter-clockwise about an axis through the origin, that a half-plane crosses at most.

    An edge within `rounding` of the axis counts for every half-plane, and so does one of either direction that is as
    narrow, where it is.
    """
    i, j = (axis + 1) % 3, (axis + 2) % 3
    p, q = a[:, [i, j]], b[:, [i, j]]
    along = q - p
    steps = np.clip(-(p * along).sum(axis=1) / np.maximum((along**2).sum(axis=1), np.finfo(float).tiny), 0.0, 1.0)
    distance = np.hypot(*(p + steps[:, None] * along).T)
    near = distance <= 4 * rounding
    p, q, distance = p[~near], q[~near], distance[~near]
    start = np.arctan2(p[:, 1], p[:, 0])
    turn = (np.arctan2(q[:, 1], q[:, 0]) - start + np.pi) % (2 * np.pi) - np.pi
    slack = 2 * rounding / distance
    counted = sign * turn >= -slack
    start, turn, slack = start[counted], turn[counted], slack[counted]
    first = np.minimum(start, start + turn) - slack
    last = first + np.abs(turn) + 2 * slack
    turns = 2 * np.pi * np.array([[-1], [0], [1]])  # an interval may extend beyond −π or π
    return int(near.sum()) + _most_at_once((first + turns).ravel(), (last + turns).ravel())


def _most_at_once(first: Floats, last: Floats) -> int:
    """Largest number of intervals that share a point."""
    order = np.argsort(np.concatenate([first, last]), kind="stable")  # where one ends as another begins, both count
    return int(np.cumsum(np.where(order < len(first), 1, -1)).max(initial=0))
