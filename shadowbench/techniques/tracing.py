"""Shadow rays traced on the GPU: a tree of the casters in textures, walked by a full-screen pass (`tree.glsl`).

Buffer textures would do as well; 2-D textures hold more on some drivers, and OpenGL 4.1 has both.
"""

import numpy as np
from numpy.typing import NDArray

from shadowbench.gl.device import Device
from shadowbench.gl.geometry import TRIANGLE_DEFINES, TRIANGLE_ROW, triangle_texels
from shadowbench.gl.library import moderngl
from shadowbench.gl.program import Sampling, State
from shadowbench.scenes.model import Scene, vec3
from shadowbench.techniques.base import Frame, Stage

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
        self._textures = {
            "tree_nodes": (_texture(stage, tree.words[:, np.newaxis], "u4"), Sampling()),
            "tree_triangles": (_texture(stage, corners, "f4"), Sampling()),
        }
        self._program = stage.program("fullscreen.vert", "trace.frag", defines=TRIANGLE_DEFINES)
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
