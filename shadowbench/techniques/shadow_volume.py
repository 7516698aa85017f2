"""Shadow volumes: side walls and caps extruded away from the light, counted along the camera's rays."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from shadowbench.geometry.convex import Slice, box_planes, corners, view_planes
from shadowbench.geometry.lights import LightSpace, LightView
from shadowbench.geometry.topology import Casters, Indices, Singles, casters_of
from shadowbench.gl.device import Device, moderngl
from shadowbench.gl.gbuffer import view_projection
from shadowbench.gl.program import Comparison, Drawable, Sampling, State, Stencil
from shadowbench.gl.targets import StencilTarget
from shadowbench.maps.culling import box_corners, kept_ranges, may_shadow, visible_region
from shadowbench.maps.fits import MinMaxReduction
from shadowbench.plugin.base import Entry, Frame, Stage, Technique, TechniqueParams, param
from shadowbench.scenes.model import Light, View
from shadowbench.scenes.triangles import bounds_of
from shadowbench.scenes.vectors import Floats, perpendicular_basis, unit

Count = Literal["z-pass", "z-fail"]
Extrusion = Literal["triangle", "silhouette"]
VolumePart = Literal["wall", "cap"]

_SIGNS = 1, -1
_WALL_CORNERS = 6  # vertices of a wall in wall.vert
_AT_EYE = 1e-6  # near plane as a share of far, for a frustum that begins at the eye
_MARGIN = 1e-3  # of the extent of eye and visible region: walls end this far outside
_SHALLOWEST = 1e-3  # sine of the least angle of the light's rays with the plane at which walls end
_BESIDE = (1e-9, 1e-10)  # of a ray to the right and above: it meets no edge between two triangles
_BEHIND = 1.01  # depth of a plane behind all receivers, as a share of far
_STEEP = 0.1  # sine of the least angle with that plane of a sun's rays that are to end there
_ON_EDGE = 1e-6  # distance of a lamp from an edge, as a share of the coordinates: rounding
_CLOSE = 1e-3  # distance of a lamp from a triangle's plane, as a share of the triangle's size


def cut_out_casters(view: View) -> str | None:
    """Why casters of a view cannot be extruded; None if all can."""
    return None if view.scene.geometry.caster_cutouts is None else "casters cut out by alpha, which volumes do not test"


@dataclass(frozen=True, eq=False)
class Batch:
    """Parts that are counted alike.

    behind: with their caps, behind the receivers, or without, in front of them; far_plane: (4,) plane at which walls
    and volumes end, zeros if at infinity; parts: (P,) bool; others: (P,) bool, parts that must not be drawn with them.
    """

    behind: bool
    far_plane: Floats
    parts: NDArray[np.bool_]
    others: NDArray[np.bool_]


def batches_of(view: View, boxes: Floats, count: Count, cull: bool) -> list[Batch]:
    """The parts that may shadow a visible receiver, in batches.

    Counting in front of the receivers needs no caps, and no walls beyond the receivers. It is wrong for a volume that
    the eye is in, or whose cap is between the eye and the near plane: with z-fail, parts that may have such a volume
    are counted behind the receivers. boxes: (P, 2, 3) bounds of the parts; cull: False keeps all parts.
    """
    xyz, w = view.light.homogeneous
    light, far = (*xyz, w), view.near_far[1]
    region = visible_region(replace(view, camera=replace(view.camera, near=_AT_EYE * far)))
    kept = may_shadow(boxes, light, region) if cull else np.ones(len(boxes), dtype=bool)
    before = may_shadow(boxes, light, _before_near(view))
    if not view.camera.converging:
        kept |= before  # a parallel ray meets their walls on its way from infinity
    behind = kept & before if count == "z-fail" else np.zeros_like(kept)
    extent = float(np.abs([*view.scene.geometry.bounds, view.camera.position]).max())
    starts = Slice(view, 0.0, far).corners[:4]  # of the camera's rays
    low, high = bounds_of(np.vstack([corners(region, extent), starts]))
    margin = _MARGIN * float((high - low).max())
    planes = box_planes(np.array([low - margin, high + margin]))
    first = _first_passed(planes, boxes, light)
    infinity = np.zeros(4)
    batches = [Batch(True, _last_plane(view), behind, ~behind)]
    for i, plane in enumerate([*planes, infinity]):
        parts = kept & ~behind & (first == i)
        batches.append(Batch(False, plane, parts, kept & ~parts))
    return [batch for batch in batches if batch.parts.any()]


def _last_plane(view: View) -> Floats:
    """(4,) plane behind all receivers that a sun's rays pass if they go as parallel rays of the camera do, or zeros.

    Walls nearly along the camera's rays would meet them anywhere on their way to infinity.
    """
    behind = view_planes(replace(view, camera=replace(view.camera, far=_BEHIND * view.near_far[1])))[5]
    xyz, w = view.light.homogeneous
    passed = not view.camera.converging and not w and behind[:3] @ xyz > _STEEP
    return behind if passed else np.zeros(4)


def _before_near(view: View) -> Floats:
    """(P, 4) planes of the region between the eye and the near plane, and of its light rays if they can be bounded."""
    near, far = view.near_far
    planes = view_planes(replace(view, camera=replace(view.camera, near=_AT_EYE * far, far=near)))
    if not view.camera.converging:
        return np.delete(planes, 4, axis=0)  # from infinity on, where the eye is: that of the depth
    points = corners(planes, float(np.abs(view.camera.position).max()) + far)
    planes = np.vstack([planes, box_planes(bounds_of(points))])
    xyz, w = view.light.homogeneous
    toward = np.array(xyz) - w * points.mean(axis=0)
    if w and ((points - xyz) @ toward >= 0).any():
        return planes
    basis = perpendicular_basis(unit(toward), (0.0, 1.0, 0.0))
    space = LightSpace(basis, w * np.array(xyz), bool(w), float("inf"))
    return np.vstack([planes, LightView(space, space.box(points), 1).planes])


def _first_passed(planes: Floats, boxes: Floats, light: tuple[float, ...]) -> NDArray[np.intp]:
    """(P,) index of the plane that is soonest behind all light rays through each box; len(planes) if there is none."""
    points = box_corners(boxes)
    away = light[3] * points - np.array(light[:3])
    length = np.linalg.norm(away, axis=2, keepdims=True)
    approach = -(away @ planes[:, :3].T) / np.maximum(length, np.finfo(float).tiny)
    distance = np.maximum(points @ planes[:, :3].T + planes[:, 3], 0.0)
    with np.errstate(divide="ignore", invalid="ignore"):
        way = np.where(approach > _SHALLOWEST, distance / approach, np.inf).max(axis=1)
    beyond = np.column_stack([way, np.full(len(boxes), np.finfo(float).max)])
    soonest: NDArray[np.intp] = beyond.argmin(axis=1)
    return soonest


class Volumes:
    """The walls and caps of all shadow volumes, by the sign of their weight.

    Each has an integer weight, and is stored that often. Walls are wound a, b, infinity, and caps as their triangles:
    seen from the light, a cap of positive weight is counter-clockwise. Parts are numbered closed ones first. boxes:
    (P, 2, 3) their bounds; faces: (F, 3) their triangles; walls: (N, 6) float32 edges a → b; wall_ends: (P,) index
    after the last vertex of each part's walls.
    """

    def __init__(self, stage: Stage, casters: Casters, faces: Extrusion, params: TechniqueParams) -> None:
        from shadowbench.geometry.facing import cap_weights, wall_weights  # Numba takes 0.4 s to import

        parts: tuple[VolumePart, ...] = ("wall", "cap")
        count = "shadow-volume/count.frag"
        self.programs = {
            part: stage.program(f"shadow-volume/{part}.vert", count, params=params, defines={part.upper(): 1})
            for part in parts
        }
        attributes = {"wall": {"a": 3, "b": 3}, "cap": {"point": 4}}
        self._uploads = {
            (part, sign): stage.stream(self.programs[part], attributes[part]) for part in parts for sign in _SIGNS
        }
        self.drawn: dict[tuple[VolumePart, int], Drawable] = {}
        self._single, self._cap_weights, self._wall_weights = faces == "triangle", cap_weights, wall_weights
        self._exact = stage.scene.geometry.vertices
        self._vertices = self._exact.astype(np.float32)
        self.boxes, self.faces, self._edges = casters.boxes, casters.faces, casters.edges
        self._face_ends, self._edge_ends = casters.face_ends, casters.edge_ends
        self._closed_faces, self._closed_edges = casters.closed_faces, casters.closed_edges

    def extrude(self, frame: Frame, count_both_facings: bool) -> None:
        """Extrude for the frame's light; count_both_facings: closed parts extrude all triangles too."""
        self._light = np.array(frame.light_uniform)
        self._both_from = 0 if count_both_facings else self._closed_faces
        for program in self.programs.values():
            program.set(light=frame.light_uniform)
        if self._single:
            start, end = self.faces.ravel(), np.roll(self.faces, -1, axis=1).ravel()
            a, b, ends = np.minimum(start, end), np.maximum(start, end), 3 * self._face_ends
            caps = self._cap_weights(self._exact, self.faces, self._light, self._both_from, self._closed_faces)
            weights = np.repeat(caps, 3) * np.where(start < end, 1, -1)
        else:
            _, a, b, _ = self._edges.T
            ends, both_from = self._edge_ends, 0 if count_both_facings else self._closed_edges
            weights = self._wall_weights(self._exact, self._edges, self._light, both_from, self._closed_edges)
        self.walls, self.wall_ends = {}, {}
        for sign in _SIGNS:
            rows = np.flatnonzero(sign * weights > 0)
            drawn = np.repeat(rows, np.abs(weights[rows]))
            self.wall_ends[sign] = _WALL_CORNERS * np.searchsorted(drawn, ends)
            self.walls[sign] = np.concatenate([self._vertices[a[drawn]], self._vertices[b[drawn]]], axis=1)
            self.drawn["wall", sign] = self._uploads["wall", sign](np.repeat(self.walls[sign], _WALL_CORNERS, axis=0))

    def set_camera(self, frame: Frame, world_to_clip: Floats, batches: Sequence[Batch]) -> None:
        """Set the frame's camera, and extrude the caps of the batches that have any."""
        for program in self.programs.values():
            program.set(world_to_clip=world_to_clip)
        if self.programs["wall"].has("eye"):
            self.programs["wall"].set(eye=frame.camera.eye)
        none = np.zeros(len(self.boxes), dtype=bool)
        capped, end = next(((each.parts, each.far_plane) for each in batches if each.behind), (none, np.zeros(4)))
        chosen = np.repeat(capped, np.diff(self._face_ends, prepend=0))
        faces = self.faces[chosen]
        both_from, closed = (int(chosen[:end].sum()) for end in (self._both_from, self._closed_faces))
        weights = self._cap_weights(self._exact, faces, self._light, both_from, closed)
        parts = np.searchsorted(self._face_ends, np.flatnonzero(chosen), side="right")
        for sign in _SIGNS:
            drawn = sign * weights > 0
            self.drawn["cap", sign] = self._uploads["cap", sign](
                self._caps(faces[drawn], parts[drawn], sign, end, frame.view)
            )

    def _caps(self, faces: Indices, parts: Indices, sign: int, end: Floats, view: View) -> Singles:
        """(N, 4) corners of near caps and of far ones, on the plane `end` or at infinity, where a sun's are a point."""
        near = self._vertices[faces.ravel()]
        points = np.column_stack([near, np.ones(len(near), dtype=np.float32)])
        if end.any():
            plane, direction = end.astype(np.float32), -self._light.astype(np.float32)
            steps = (points @ plane) / -(direction @ plane)
            return np.concatenate([points, points[::-1] + np.maximum(steps, 0.0)[::-1, np.newaxis] * direction])
        if self._light[3] == 0:
            return points
        if not view.camera.converging:
            far = self._common_end(faces, sign, view)
            return np.concatenate([points, np.column_stack([far, np.ones(len(far))])], dtype=np.float32)
        away = self._vertices[faces[:, ::-1]] - self._light[:3].astype(np.float32)
        # A triangle close to a lamp covers nearly half of all directions, and rounding would decide which half: a fan
        # around its normal covers the right one.
        one, other = away[:, 1] - away[:, 0], away[:, 2] - away[:, 0]
        normal = np.cross(one, other)
        size = np.maximum(np.abs(one), np.abs(other)).max(axis=1) * np.linalg.norm(normal, axis=1)
        close = np.abs(np.einsum("ij,ij->i", normal, away[:, 0])) < _CLOSE * size
        fan = np.empty((np.count_nonzero(close), 3, 3, 3), dtype=np.float32)
        fan[:, :, 0], fan[:, :, 1] = away[close], np.roll(away[close], -1, axis=1)
        fan[:, :, 2] = sign * normal[close, np.newaxis]
        # Of an edge with the lamp on it, whose ends are in opposite directions, rounding would decide the way between
        # them: that away from the part is the right one, and the same for both triangles.
        length = np.linalg.norm(fan[:, :, 0] - fan[:, :, 1], axis=2)
        off = np.linalg.norm(np.cross(fan[:, :, 0], fan[:, :, 1]), axis=2)
        opposite = np.einsum("fij,fij->fi", fan[:, :, 0], fan[:, :, 1]) < 0
        through = opposite & (off <= _ON_EDGE * np.abs(near).max(initial=0.0) * length)
        middle = (self._light[:3] - self.boxes[parts[close]].mean(axis=1)).astype(np.float32)
        middle = np.broadcast_to(middle[:, np.newaxis], (len(fan), 3, 3))[through]
        second = fan[through]
        second[:, 0] = middle
        fan[through, 1] = middle
        far = np.concatenate([away[~close].reshape(-1, 3), fan.reshape(-1, 3), second.reshape(-1, 3)])
        return np.concatenate([points, np.column_stack([far, np.zeros(len(far), dtype=np.float32)])])

    def _common_end(self, faces: Indices, sign: int, view: View) -> Floats:
        """(N, 3) corners of the far caps where the camera's rays are parallel: all end at one point at infinity.

        What covers it covers the image: twice two triangles if two of the faces are hit by the light's ray to there.
        """
        right, up, back = view.camera.basis()
        ahead = np.array([*_BESIDE, -1.0]) @ np.array([right, up, back])
        a, b, c = np.moveaxis(self._exact[faces] - self._light[:3], 1, 0)
        volumes = np.stack([np.cross(*pair) @ ahead for pair in ((a, b), (b, c), (c, a))])
        side = np.sign(np.einsum("ij,ij->i", a, np.cross(b, c)))
        layers = int((volumes * side > 0).all(axis=0).sum())
        square = Slice(view, *view.near_far).corners[4:][[0, 1, 3, 0, 3, 2]]  # clockwise as the camera sees it
        return np.tile(square[::sign], (layers, 1))


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
    With `z-fail`, parts whose volume the eye may be in are counted behind it (Bilodeau and Songy 1999, Carmack
    2000), to infinity (Everitt and Kilgard 2002); `z-pass` does not, which is wrong if the eye is inside a volume,
    or a caster between the eye and the near plane. An orthographic camera's eye is infinitely far: under a lamp, a
    silhouette edge in one plane with the lamp and the direction of view is counted wrongly. Silhouettes are found
    on the CPU, by compiled code: closed parts extrude the triangles that face the light, open parts all, with
    signed edge weights. With the stencil counter, a view whose light rays may cross 255 layers or more is counted
    in a colour target instead; the row's facts say so. Exact except for single pixels; `compare=depth` has more of
    them and is faster. The time grows with the screen area of the walls.
    """

    name = "shadow-volume"
    catalogue = Entry(
        picture_scene="inside-volume",
        grid={"compare": ("position", "depth")},
        exact=True,
    )

    class Params(TechniqueParams):
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
    def unsupported(cls, params: Params, view: View, device: Device) -> str | None:
        return cut_out_casters(view)

    @classmethod
    def extra_work(cls, params: Params) -> str | None:
        by_depth = params.compare == "depth"
        return "also draws the surfaces' depth, which is more work; on a GPU it may be faster" if by_depth else None

    @classmethod
    def draws_on_cpu(cls, params: Params) -> bool:
        return True  # the silhouettes

    def build(self, stage: Stage) -> None:
        params = self.params
        self.casters = casters_of(stage.scene)
        self.volumes = Volumes(stage, self.casters, params.faces, params)
        self.bounds: tuple[Floats, Floats] | None = None  # of the triangles; no ray crosses more layers than there are
        if params.counter == "stencil" and len(self.volumes.faces) > MOST_LAYERS:
            triangles = stage.scene.geometry.vertices[self.volumes.faces]
            self.bounds = triangles.min(axis=1).T, triangles.max(axis=1).T
        if params.compare == "depth":
            self.distances = MinMaxReduction(stage, stage.size, "values")
            self.depth_program = stage.program("casters.vert", "depth.frag")
            self.surfaces = stage.surfaces(self.depth_program)
        self.visibility = stage.texture()
        self.stenciled = stage.stencil_target(self.visibility)
        self.resolve_program = stage.program("fullscreen.vert", "shadow-volume/resolve.frag")
        self.fullscreen = stage.fullscreen(self.resolve_program)
        self.stage = stage
        if params.counter == "color":
            self._build_counter()

    def _build_counter(self) -> None:
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
        if self.bounds is not None:
            with frame.timed("layers", changes="light"):
                walls = self.volumes.walls
                silhouette = np.concatenate([walls[1], np.roll(walls[-1], 3, axis=1)])
                self.layers = layers_at_most(frame.light, silhouette, *self.bounds)
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
            self.batches = batches_of(frame.view, self.volumes.boxes, self.params.count, self.params.cull)
            self.volumes.set_camera(frame, view_projection(view), self.batches)
            for batch in self.batches:
                self._count("wall", batch, frame)
                if batch.behind:
                    self._count("cap", batch, frame)
        with frame.timed("resolve", changes="view"):
            self._resolve(frame)
        return self.visibility

    def _with_tight_near(self, frame: Frame) -> View:
        """The view with its near plane just in front of the nearest surface: depth steps grow with 1 / near."""
        lowest, _ = self.distances({"values": (frame.surface.depth, Sampling())})
        near, far = frame.view.near_far
        return replace(frame.view, camera=replace(frame.camera, near=max(near, 0.999 * far * float(lowest[0]))))

    def _count(self, part: VolumePart, batch: Batch, frame: Frame) -> None:
        """Count the walls or caps behind the receivers, or the walls in front of them."""
        # The camera's ray enters a volume through a counter-clockwise cap, and leaves it through a counter-clockwise
        # wall a → b → infinity.
        front_adds = 1 if batch.behind and part == "wall" else -1
        volumes, program = self.volumes, self.volumes.programs[part]
        if part == "wall":
            program.set(far_plane=tuple(batch.far_plane.tolist()))
            if program.has("counted_behind"):
                program.set(counted_behind=batch.behind)
        # The receiver is the nearest surface, so that every cap is at or behind it and needs no depth test. Caps in
        # front of the near plane are clipped.
        by_depth = part == "wall" and self.params.compare == "depth"
        compare: Comparison = "" if not by_depth else ">=" if batch.behind else "<"
        state = State(compare, depth_write=False, depth_clamp=True, clip_distances=1 if part == "cap" else 0)
        for sign in _SIGNS:
            adds = sign * front_adds
            if self.in_color:
                target, counted = self.counting, replace(state, blend="add")
            else:
                stencil = _ADDING if adds > 0 else _SUBTRACTING
                target, counted = self.stenciled.target, replace(state, color_write=False, stencil=stencil)
            program.set(front_adds=float(adds))  # of counter-clockwise faces, in colour
            ranges = kept_ranges(batch.parts, volumes.wall_ends[sign], batch.others) if part == "wall" else None
            volumes.drawn[part, sign].draw(target, frame.surface.inputs, counted, ranges)

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
            "closed_parts": float(self.casters.closed),
            "open_parts": float(len(self.casters.boxes) - self.casters.closed),
            "culled_parts": float(len(self.volumes.boxes) - sum(batch.parts.sum() for batch in self.batches)),
            "counted_in_color": float(self.in_color),
        }
        return facts if self.layers is None else facts | {"layers_at_most": self.layers}


def layers_at_most(light: Light, edges: Singles, low: Floats, high: Floats) -> int:
    """Upper bound on the layers along any ray of the light: the silhouette edges that a half-plane of rays crosses.

    On a curve between two light rays, the number of layers changes only at silhouette edges, at each by its weight. The
    curves are half-planes of parallel rays, which come from where there are no casters, or for a light with a position
    half-planes bounded by a line through it, on which they come from the ray that meets the fewest triangles' boxes.
    edges: (N, 6) a → b with the casters to their left as seen from the light, each as often as its weight; low, high:
    (3, F) bounds of the casters' triangles.
    """
    a, b = edges[:, :3].astype(np.float64), edges[:, 3:].astype(np.float64)
    rounding = _ROUNDING * float(max(np.abs(edges).max(initial=0.0), np.abs(light.position).max()))
    if light.kind == "directional":
        basis = perpendicular_basis(-unit(light.direction), (0.0, 1.0, 0.0))
        start, end = a @ basis[0], b @ basis[0]
        rising = end >= start - rounding
        return _most_at_once(start[rising] - rounding, end[rising] + rounding)
    lamp = np.array(light.position)
    above, below = low <= lamp[:, None] + rounding, high >= lamp[:, None] - rounding
    boxes_met = {}
    for axis in range(3):
        i, j = (axis + 1) % 3, (axis + 2) % 3
        beside = above[i] & below[i] & above[j] & below[j]
        boxes_met[axis, 1], boxes_met[axis, -1] = int((beside & below[axis]).sum()), int((beside & above[axis]).sum())
    axis, sign = min(boxes_met, key=lambda ray: boxes_met[ray])
    return boxes_met[axis, sign] + _most_around(a - lamp, b - lamp, axis, sign, rounding)


def _most_around(a: Floats, b: Floats, axis: int, sign: int, rounding: float) -> int:
    """Number of edges a → b, counter-clockwise about an axis through the origin, that a half-plane crosses at most."""
    i, j = (axis + 1) % 3, (axis + 2) % 3
    p, q = a[:, [i, j]], b[:, [i, j]]
    along = q - p
    steps = np.clip(-(p * along).sum(axis=1) / np.maximum((along**2).sum(axis=1), np.finfo(float).tiny), 0.0, 1.0)
    distance = np.hypot(*(p + steps[:, None] * along).T)
    near = distance <= 4 * rounding  # of the axis: they count for every half-plane
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
