"""Compare soft truths with Mitsuba 3, an independent ray tracer.

It needs `python -m pip install mitsuba` and an LLVM library, which $DRJIT_LIBLLVM_PATH may name.

For pixels in the penumbrae of four views, one with each kind of light, Mitsuba finds the receiver, samples the light in
its own way, and tests visibility in its own acceleration structure. Visibility is compared as in Mitsuba's own test of
renderings: z is the difference over both standard errors (variances of at least 1e-4 of a sample), at the level
1 − .99^(1/pixels); 99.75% of the pixels must pass, and the mean signed difference must lie within 3 of its standard
errors. Exit code 1 if a view fails.
"""

import math
import sys
from dataclasses import replace
from typing import Any

import drjit as dr
import mitsuba as mi
import numpy as np
from scipy.stats import norm

from shadowbench.scenes.model import Light, View
from shadowbench.scenes.opening import chosen_view
from shadowbench.scenes.vectors import perpendicular_basis, unit
from shadowbench.truths.trace import trace

mi.set_variant("llvm_ad_rgb")

SIZE, PIXELS = 256, 2048
BATCHES, SAMPLES = 32, 256
FAR = 1e5  # local distance of the sphere that stands for a sun
LIFT = 2e-6  # local height of a shadow ray's origin; Mitsuba's own, 1e-4 of the scene, moves shadows visibly
LEAST_VARIANCE, PASSING = 1e-4, 0.9975


def views() -> list[View]:
    """A sun, a bulb, a rectangle and a disc."""
    cube, room, table = (chosen_view(name, SIZE) for name in ("cube-on-plane", "room-with-lamp", "lamp-over-table"))
    down = (0.1, -1.0, 0.05)
    return [
        replace(cube, light=replace(cube.light, radius=math.radians(4.0))),
        replace(room, light=replace(room.light, radius=0.1)),
        replace(
            room, light=Light("panel", "rectangle", down, room.light.position, size=(0.6, 0.3), up=(1.0, 0.0, 0.0))
        ),
        replace(table, light=Light("disc", "disc", down, table.light.position, radius=0.2)),
    ]


def mitsuba_scenes(view: View) -> tuple[Any, Any]:
    """The triangles of a view in local coordinates, and its light as an emitting shape, which must not hide them."""
    geometry = view.scene.geometry
    mesh = mi.Mesh("scene", len(geometry.vertices), len(geometry.faces))
    parameters = mi.traverse(mesh)
    parameters["vertex_positions"] = geometry.vertices.astype(np.float32).ravel()
    parameters["faces"] = geometry.faces.astype(np.uint32).ravel()
    parameters.update()
    light = {**shape_of(view.light), "emitter": {"type": "area"}}
    return mi.load_dict({"type": "scene", "mesh": mesh}), mi.load_dict({"type": "scene", "light": light})


def shape_of(light: Light) -> dict[str, Any]:
    """The shape of a light in Mitsuba's terms."""
    if light.kind == "directional":
        center = FAR * -unit(light.direction)
        return {"type": "sphere", "center": center.tolist(), "radius": FAR * math.sin(light.radius)}
    if light.kind in ("point", "spot"):
        return {"type": "sphere", "center": list(light.position), "radius": light.radius}
    # Mitsuba's discs and rectangles lie in xy, within ±1, and shine along +z.
    right, up, back = perpendicular_basis(-unit(light.direction), light.up)
    half = (light.radius, light.radius) if light.kind == "disc" else (light.size[0] / 2, light.size[1] / 2)
    matrix = np.eye(4)
    matrix[:3, :3] = np.stack([right * half[0], -up * half[1], -back], axis=1)
    matrix[:3, 3] = light.position
    return {"type": "disk" if light.kind == "disc" else "rectangle", "to_world": mi.ScalarTransform4f(matrix)}


def visibility(view: View, pixels: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """(P,) visibility of the light at the centres of some pixels, and its variance of a sample."""
    (scene, light), camera = mitsuba_scenes(view), view.camera
    right, up, back = camera.basis()
    row, column = np.divmod(pixels, view.size.width)
    x, y = column + 0.5 - view.size.width / 2, view.size.height / 2 - row - 0.5
    toward = view.pixel * (x[:, None] * right + y[:, None] * up) - back
    toward /= np.linalg.norm(toward, axis=1, keepdims=True)
    count = len(pixels) * SAMPLES
    index = dr.arange(mi.UInt32, count) // SAMPLES
    direction = dr.gather(mi.Vector3f, mi.Vector3f(toward.T.astype(np.float32)), index)
    hit = scene.ray_intersect(mi.Ray3f(mi.Point3f(*camera.position), direction))
    normal = dr.mulsign(hit.n, -dr.dot(hit.n, direction))
    origin = hit.p + LIFT * normal
    totals = np.zeros((BATCHES, 2, len(pixels)))
    for batch in range(BATCHES):
        sampler = mi.load_dict({"type": "independent"})
        sampler.seed(batch, count)
        sample, _ = light.sample_emitter_direction(hit, sampler.next_2d(), test_visibility=False)
        used = (sample.pdf > 0) & (dr.dot(normal, sample.d) > 0)
        weight = dr.select(used, 1 / sample.pdf, 0)
        seen = ~scene.ray_test(mi.Ray3f(origin, sample.d, sample.dist, 0.0, []), used)
        for part, value in enumerate((weight, dr.select(seen, weight, 0))):
            totals[batch, part] = np.array(value, dtype=np.float64).reshape(-1, SAMPLES).sum(axis=1)
    weights, lit = totals.sum(axis=0)
    share = lit / weights
    residual = (totals[:, 1] - share * totals[:, 0]) / totals[:, 0].mean(axis=0)
    return share, residual.var(axis=0, ddof=1) * SAMPLES


def compare(view: View) -> bool:
    """Whether both agree on a view; prints the figures."""
    truth = trace(view, pixel_samples=1)
    soft = truth.receivers & ~truth.undecided & (truth.visibility > 0.02) & (truth.visibility < 0.98)
    pixels = np.random.default_rng(0).permutation(np.flatnonzero(soft))[:PIXELS]
    placed, _ = view.placed()
    theirs, variance = visibility(placed, pixels)
    squared = np.maximum(variance, LEAST_VARIANCE) / (BATCHES * SAMPLES) + truth.standard_error.ravel()[pixels] ** 2
    difference = truth.visibility.ravel()[pixels] - theirs
    critical = norm.isf((1 - 0.99 ** (1 / len(pixels))) / 2)
    passing = float((np.abs(difference) <= critical * np.sqrt(squared)).mean())
    mean, error = float(difference.mean()), float(np.sqrt(squared.sum()) / len(pixels))
    agrees = passing >= PASSING and abs(mean) <= 3 * error
    print(
        f"{view.scene.name:16} {view.light.kind:12} {len(pixels)} pixels, z beyond {critical:.2f} in "
        f"{1 - passing:.2%}, mean difference {mean:+.5f} ± {error:.5f}: {'agrees' if agrees else 'DIFFERS'}"
    )
    return agrees


if __name__ == "__main__":
    agree = [compare(view) for view in views()]  # all of them, whatever the first says
    sys.exit(not all(agree))
