"""A technique in one file: shadowbench run cube-on-plane -t sphere-proxies --plugin examples/sphere_proxies.py."""

import numpy as np

from shadowbench.gl.program import Sampling
from shadowbench.plugin.base import Technique, TechniqueParams, param

RESOLVE = """
#include "receiver.glsl"
uniform sampler2D spheres;  // a texel each: centre, radius
uniform float scale;
out float visibility;

void main() {
    Receiver r = receiver_here();
    visibility = 1.0;
    if (!r.facing) return;
    for (int i = 0; i < textureSize(spheres, 0).x; ++i) {
        vec4 sphere = texelFetch(spheres, ivec2(i, 0), 0);
        vec3 to_centre = sphere.xyz - r.position;
        float ahead = dot(to_centre, r.to_light);
        float miss = length(to_centre - ahead * r.to_light);
        if (ahead > 0.0 && miss < scale * sphere.w) visibility = 0.0;
    }
}
"""


class SphereProxies(Technique):
    """Shadow rays against a sphere in place of each closed caster, centred in its bounding box.

    Cheap, but right for balls only; elsewhere a sphere also shadows its own caster.
    """

    name = "sphere-proxies"

    class Params(TechniqueParams):
        """Parameters of sphere-proxies."""

        scale: float = param(0.8, "radius, in halves of the diagonal of a caster's bounding box", gt=0, le=2)

    @classmethod
    def unsupported(cls, params, view, device):
        closed = any(mesh.casts and mesh.closed for mesh in view.scene.meshes)
        return None if closed else "no caster is closed"

    def build(self, stage):
        casters = [mesh.vertices for mesh in stage.scene.meshes if mesh.casts and mesh.closed]
        low = np.array([vertices.min(axis=0) for vertices in casters])
        high = np.array([vertices.max(axis=0) for vertices in casters])
        spheres = np.column_stack([(low + high) / 2, np.linalg.norm(high - low, axis=1) / 2])
        self.spheres = stage.texture((len(spheres), 1), 4)
        self.spheres.write(spheres.astype(np.float32).tobytes())
        self.program = stage.program("fullscreen.vert", RESOLVE, params=self.params)
        self.fullscreen = stage.fullscreen(self.program)
        self.visibility = stage.texture()
        self.target = stage.target(self.visibility)

    def draw(self, frame):
        with frame.timed("resolve", changes="view"):
            self.program.set(light=frame.light_uniform)
            self.fullscreen.draw(self.target, frame.surface.inputs | {"spheres": (self.spheres, Sampling())})
        return self.visibility
