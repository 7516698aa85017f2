"""Ray tracing from the G-buffer's points, with Embree, which shares code with the truth, or in a shader."""

from typing import Literal, Self

import numpy as np
from numpy.typing import NDArray
from pydantic import model_validator

from shadowbench.gl.device import Device, moderngl
from shadowbench.gl.gbuffer import CUTOUTS, TRIANGLE_ROW, download, triangle_texels
from shadowbench.gl.program import Sampling, State, Texture
from shadowbench.plugin.base import Entry, Frame, Stage, Technique, TechniqueParams, param
from shadowbench.scenes.model import Light, Scene, View
from shadowbench.scenes.vectors import vec3
from shadowbench.truths.embree import INFINITE, RAYS_A_SLICE, Tracer, over_slices

EXTRA_WORK = "walks a tree in the shader, which counts of work do not see"
"""Why techniques that trace by `TracePass` are not ranked by counts of work."""
_PLAIN = State()
_STEPS = 4.0  # least ray offset, in float32 steps of the largest coordinate


def ray_offset(scene: Scene, share: float) -> float:
    """Height of a ray's start above its surface, a local length: a share of the scene's diagonal.

    At least the rounding of the G-buffer's float32 positions, which grows with the distance from the origin.
    """
    low, high = scene.geometry.bounds
    rounding = _STEPS * float(np.spacing(np.abs(scene.geometry.bounds).max(), dtype=np.float32))
    return max(share * float(np.linalg.norm(high - low)), rounding)


def too_large(scene: Scene, device: Device) -> str | None:
    """Why the casters' tree does not fit into textures; None if it does."""
    most = TRIANGLE_ROW * device.max_map_size // 2  # a tree has at most twice as many nodes
    count = len(scene.geometry.caster_faces)
    return f"{count} triangles; the tree's textures hold {most}" if count > most else None


class TracePass:
    """Traces a ray from each receiver to the light; built once, called each frame. offset: see `ray_offset`."""

    def __init__(self, stage: Stage, offset: float) -> None:
        from shadowbench.geometry.tree import build_tree  # Numba takes 0.4 s to import

        geometry = stage.scene.geometry
        tree = build_tree(geometry.vertices, geometry.caster_faces)
        corners = np.zeros((max(len(tree.order), 1), 3, 4), dtype=np.float32)  # a texture cannot be empty
        corners[: len(tree.order), :, :3] = geometry.vertices[geometry.caster_faces[tree.order]]
        self._textures: dict[str, tuple[Texture, Sampling]] = {}
        if (cut := geometry.caster_cutouts) is not None:
            number = np.zeros(len(tree.order), dtype=np.float32)
            number[cut.faces] = 1 + np.arange(len(cut.faces))
            corners[:, 0, 3] = number[tree.order]
            places = np.zeros((len(cut.faces), 3, 4), dtype=np.float32)
            places[:, :, :2], places[:, :, 2] = cut.places, cut.number[:, None]
            self._textures = {**stage.cutouts, "tree_cutouts": (_texture(stage, places, "f4"), Sampling())}
        self._textures |= {
            "tree_nodes": (_texture(stage, tree.words[:, np.newaxis], "u4"), Sampling()),
            "tree_triangles": (_texture(stage, corners, "f4"), Sampling()),
        }
        self._program = stage.program("fullscreen.vert", "trace.frag", defines={} if cut is None else CUTOUTS)
        self._program.set(tree_size=len(tree.words), tree_low=vec3(tree.low), tree_step=vec3(tree.step), offset=offset)
        self._triangle = stage.fullscreen(self._program)

    def __call__(self, frame: Frame, target: moderngl.Framebuffer, state: State = _PLAIN) -> None:
        """Draw visibility, 1 or 0, into a target."""
        self._program.set(light=frame.light_uniform)
        self._triangle.draw(target, {**frame.surface.inputs, **self._textures}, state)


def _texture(stage: Stage, rows: NDArray[np.generic], dtype: str) -> moderngl.Texture:
    """A texture of (N, k, 4) values: k texels side by side for each row, addressed as triangles are."""
    texels = triangle_texels(rows)
    height, width, each, components = texels.shape
    texture = stage.texture((width * each, height), components, dtype)
    texture.write(texels.tobytes())
    return texture


_STAGE = 1 << 15  # of random shifts, beyond the truth's: with the same points of the light, the errors would correlate


class RayTraced(Technique):
    """One shadow ray per pixel, on the CPU, timed with its transfers, or on the GPU: the slow end of the speed axis.

    Exact except for the G-buffer's float32 positions, which move shadows at contacts and at grazing light. With more
    samples, rays to as many points of a light that has a size: noise, which converges to soft shadows.
    """

    name = "ray-traced"
    catalogue = Entry(
        exact=True,
        never_recommended="traces a ray for every pixel, as the truth does: the slow end of the scale",
    )

    class Params(TechniqueParams):
        offset: float = param(1e-6, "height of a ray's origin above its surface, as a share of the scene", ge=0, le=1)
        samples: int = param(1, "points of the light for each pixel; 1 is its centre: hard shadows", ge=1, le=1 << 12)
        terminator: bool = param(
            False, "rays start on the smooth surface, not on its triangles: see the bias of that name"
        )
        where: Literal["cpu", "gpu"] = param("cpu", "Embree, or a tree of the casters that a shader walks")

        @model_validator(mode="after")
        def _gpu_traces_one_ray(self) -> Self:
            if self.where == "gpu" and self.samples != 1:
                raise ValueError(f"where=gpu traces one ray for each pixel; samples is {self.samples}, allowed: 1")
            return self

    params: Params

    @classmethod
    def lifts(cls, params: Params) -> bool:
        return params.terminator

    @classmethod
    def unsupported(cls, params: Params, view: View, device: Device) -> str | None:
        return too_large(view.scene, device) if params.where == "gpu" else None

    @classmethod
    def extra_work(cls, params: Params) -> str | None:
        return EXTRA_WORK if params.where == "gpu" else None

    @classmethod
    def draws_on_cpu(cls, params: Params) -> bool:
        return params.where == "cpu"

    def build(self, stage: Stage) -> None:
        self.offset = ray_offset(stage.scene, self.params.offset)
        self.visibility = stage.texture()
        if self.params.where == "gpu":
            self.target, self.trace = stage.target(self.visibility), TracePass(stage, self.offset)
        else:
            geometry = stage.scene.geometry
            self.tracer = Tracer(geometry.vertices, geometry.caster_faces, geometry.caster_cutouts)

    def draw(self, frame: Frame) -> moderngl.Texture:
        if self.params.where == "gpu":
            with frame.timed("trace", changes="view"):
                self.trace(frame, self.target)
            return self.visibility
        with frame.timed("download", changes="view"):
            position, normal = (
                download(texture).reshape(-1, 4) for texture in (frame.surface.position, frame.surface.normal)
            )
        with frame.timed("trace", changes="view"):
            size = max(1, RAYS_A_SLICE // self.params.samples)
            parts = list(over_slices(lambda part: self._trace(frame, part, position, normal), len(position), size))
            self.rays = sum(rays for _, rays in parts)
            visibility = np.concatenate([part for part, _ in parts])
        with frame.timed("upload", changes="view"):
            self.visibility.write(np.flipud(visibility.reshape(self.visibility.size[::-1])).tobytes())
        return self.visibility

    def facts(self) -> dict[str, float]:
        return {"rays": float(self.rays)} if self.params.where == "cpu" else {}

    def _trace(self, frame: Frame, part: slice, positions: np.ndarray, normals: np.ndarray) -> tuple[np.ndarray, int]:
        """Visibility of some pixels, and the number of rays traced."""
        position, normal = positions[part], normals[part]
        light, w = (np.asarray(part) for part in frame.light.homogeneous)
        to_light = light - w * position[:, :3].astype(np.float64)
        distance = np.linalg.norm(to_light, axis=1)
        to_light = to_light / np.maximum(distance, np.finfo(float).tiny)[:, None]
        cosine = np.einsum("ij,ij->i", normal[:, :3], to_light)
        receiver = np.flatnonzero((position[:, 3] * normal[:, 3] > 0.5) & (cosine > 0))
        visibility = np.ones(len(position), dtype=np.float32)
        if self.params.samples > 1 and frame.light.soft:
            pixels = receiver + part.start
            visibility[receiver] = self._seen_share(frame.light, position[receiver], normal[receiver], pixels)
            return visibility, len(receiver) * self.params.samples
        ahead = self.offset / cosine[receiver]
        origin = position[receiver, :3] + to_light[receiver] * ahead[:, None]
        reach = np.maximum(distance[receiver] - ahead, 0.0) if w else np.full(len(receiver), INFINITE)
        visibility[receiver] = ~self.tracer.occluded(origin, to_light[receiver], reach)
        return visibility, len(receiver)

    def _seen_share(self, light: Light, position: np.ndarray, normal: np.ndarray, pixels: np.ndarray) -> np.ndarray:
        """(R,) share of the light's points above the horizon that each receiver sees, 1 if none is."""
        from shadowbench.truths.light_samples import LightSampler, scrambles_of  # Numba takes 0.4 s to import

        samples, shifts = self.params.samples, scrambles_of(pixels, 1, _STAGE)
        points, normals = (np.ascontiguousarray(array[:, :3].T, dtype=np.float64) for array in (position, normal))
        origins, directions, reach, weight, _ = LightSampler(light).rays(points, normals, shifts, samples, self.offset)
        seen = weight * ~self.tracer.occluded(origins.T, directions.T, reach)
        total, visible = (array.reshape(-1, samples).sum(axis=1, dtype=np.float64) for array in (weight, seen))
        return np.where(total > 0, visible / np.maximum(total, np.finfo(float).tiny), 1.0)
