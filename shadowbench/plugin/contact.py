"""Contact shadows on top of any technique: a march through the view's depth, and as engines ship it."""

from collections.abc import Callable
from typing import TYPE_CHECKING, Literal

from shadowbench.gl.device import moderngl
from shadowbench.gl.gbuffer import view_projection, world_to_depth
from shadowbench.gl.program import Sampling
from shadowbench.plugin.params import Component, param

if TYPE_CHECKING:
    from shadowbench.plugin.base import Frame, Technique
    from shadowbench.plugin.stage import Stage


class Contact(Component):
    """Base class of contact shadows. A shader defines `float contact_shadow(Receiver r)`, the share of light taken."""

    @property
    def reads(self) -> int:
        """The most texels of the G-buffer that it reads per pixel."""
        return 0


class NoContact(Contact):
    """The technique alone."""

    name = "none"
    unwritten = True


class ScreenSpace(Contact):
    """A march from the receiver towards the light through what the view shows; what hides a point of the ray darkens.

    A point is hidden if it lies behind the surface that the view shows in its pixel, by less than a thickness, which a
    view does not tell. Hence false shadows behind what is thinner, and light behind what is thicker, outside the view
    or hidden in it. `depth=plane` compares with the plane of the pixel's triangle too, so that no plane shadows itself;
    `nearest` with the pixel's depth alone, a stair that does on slopes; `both` with that and the bilinear depth
    (Stachowiak 2023, in Bevy). `bend` turns rays towards the normal: fully for N·L below 0.25, not at all above 0.45
    (bevyengine/bevy #25355). Towards a light with a size the ray ends at its centre: penumbrae get a hard edge.
    """

    name = "screen-space"
    shader = "contact/screen-space.glsl"
    # google/filament: LightManager.h, stepCount 8, maxShadowDistance 0.3; surface_shadowing.fs,
    # screenSpaceContactShadow: twice the tolerance is two steps along the view, to first order; faded towards the edge.
    # bevyengine/bevy 0.19: contact_shadows.rs; pbr_functions.wgsl, raymarch.wgsl.
    # mrdoob/three.js: SSSNode.js, maxDistance, thickness, quality 0.5. Left out here: a second noise, steps after 128.
    # Bend Studio 2023, bend_sss_gpu.h: 60 samples, SurfaceThickness 0.005 to both sides of its middle, ShadowContrast
    # 4. Left out here: the mean of four samples, the last eight that fade, and the near end that does.
    presets = {
        "filament": "steps=8,length=0.3,thickness=0.075,share=0,reach=0,stride=0,depth=nearest,first=0.5,jitter=1,"
        "border=0.08333",
        "bevy": "steps=16,length=0.3,thickness=0.1,share=0,reach=0,stride=0,depth=both,first=0,jitter=1,soft=0.5",
        "three": "steps=128,length=0.1,thickness=0.01,share=0,reach=0,stride=2,depth=nearest,first=0,jitter=1",
        "bend-studio": "steps=60,length=0,reach=60,share=0.01,depth=both,soft=0.125",
    }
    steps: int = param(32, "points of the ray, at most", ge=1, le=1024)
    length: float = param(0.3, "length of the ray", ge=0, metres=True)
    reach: float = param(32.0, "length of the ray on the screen, in pixels, where that is more", ge=0, le=4096)
    stride: float = param(1.0, "pixels between points, at least", ge=0, le=64)
    thickness: float = param(0.0, "thickness of surfaces along the view", ge=0, metres=True)
    share: float = param(0.005, "thickness added to it, as a share of the distance from the eye", ge=0, le=1)
    depth: Literal["plane", "nearest", "both"] = param("plane", "what points are compared with")
    first: float = param(1.0, "first point, in steps from the receiver", ge=0, le=2)
    jitter: float = param(0.0, "interleaved gradient noise (Jimenez 2014) added to that, in steps", ge=0, le=1)
    bend: float = param(0.0, "largest turn of the ray towards the normal, in degrees", ge=0, le=90)
    soft: float = param(0.0, "part of the thickness, at its far end, over which shadows fade", ge=0, le=1)
    border: float = param(0.0, "border over which shadows fade, as a share of the view", ge=0, le=0.5)

    @property
    def reads(self) -> int:
        return self.steps * (1 if self.depth == "nearest" else 2)


class ContactPass:
    """Darkens what a technique draws. draw: of the technique."""

    def __init__(self, stage: "Stage", technique: "Technique", draw: "Callable[[Frame], moderngl.Texture]") -> None:
        self._draw = draw
        self._program = stage.program("fullscreen.vert", "contact.frag", params=technique.params)
        self._texture = stage.texture()
        self._target = stage.target(self._texture)
        self._triangle = stage.fullscreen(self._program)

    def __call__(self, frame: "Frame") -> moderngl.Texture:
        """Visibility with contact shadows."""
        depth = frame.surface.depth
        more = {"drawn": (self._draw(frame), Sampling()), "surface_between": (depth, Sampling(linear=True))}
        with frame.timed("contact", changes="view"):
            self._program.set(
                light=frame.light_uniform,
                world_to_clip=view_projection(frame.view),
                world_to_depth=world_to_depth(frame.camera),
                eye=frame.camera.eye,
                view_far=frame.view.near_far[1],
            )
            self._triangle.draw(self._target, {**frame.surface.inputs, **more})
        return self._texture
