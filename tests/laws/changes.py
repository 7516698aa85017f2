"""The laws: changes of a view that must not change its shadows, and why.

Each takes a view in file coordinates and a random generator, and returns the changed view, with the camera's near and
far planes transformed too. A docstring's first line is the law, the rest its reason.
"""

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from shadowbench.scenes.model import Mesh, Scene, View
from shadowbench.scenes.vectors import Floats, perpendicular_basis, unit, vec3

from .scenes import CONVEX, GRID, SHAPES, Caster, on_grid

Random = np.random.Generator
Change = Callable[[View, Random], View]
LAWS: dict[str, Change] = {}


def law(name: str) -> Callable[[Change], Change]:
    def register(change: Change) -> Change:
        LAWS[name] = change
        return change

    return register


def mapped(view: View, matrix: Floats, move: Floats | float = 0.0) -> View:
    """The view transformed by x → M x + move, where M is a rotation times a scale."""
    near, far = np.multiply(view.near_far, np.linalg.norm(matrix[0])).tolist()
    camera = replace(
        view.camera,
        position=vec3(matrix @ view.camera.position + move),
        target=vec3(matrix @ view.camera.target + move),
        up=vec3(matrix @ view.camera.up),
        near=near,
        far=far,
    )
    light = replace(view.light, direction=vec3(matrix @ view.light.direction))
    if light.kind != "directional":
        light = replace(light, position=vec3(matrix @ light.position + move))
    meshes = [replace(mesh, vertices=mesh.vertices @ matrix.T + move) for mesh in view.scene.meshes]
    return replace(with_meshes(view, meshes), camera=camera, light=light)


def with_meshes(view: View, meshes: list[Mesh]) -> View:
    scene = view.scene
    return replace(view, scene=Scene(scene.name, tuple(meshes), scene.cameras, scene.lights))


def with_faces(mesh: Mesh, faces: np.ndarray) -> Mesh:
    return replace(mesh, faces=np.ascontiguousarray(faces, dtype=np.int32))


@law("translation")
def moved(view: View, random: Random) -> View:
    """The scene is translated by up to 1000 km, in multiples of 2⁻²⁰ m.

    Nothing is rounded, and local coordinates are relative to the scene's centre: the local scene has the same bits.
    """
    return mapped(view, np.eye(3), random.integers(-(2**40), 2**40, 3) * GRID)


@law("scaling by a power of two")
def scaled_exactly(view: View, random: Random) -> View:
    """The scene is scaled by a power of two from 2⁻³⁰ to 2³⁰.

    Nothing is rounded, and local coordinates are normalised in scale: the local scene has the same bits.
    """
    return mapped(view, np.eye(3) * 2.0 ** random.integers(-30, 31))


@law("rotation about y")
def turned_about_y(view: View, random: Random) -> View:
    """The scene is rotated by any angle about y.

    A rotation preserves intersections. A light-space basis built from the y axis rotates with the scene; an
    axis-aligned bounding box does not.
    """
    turn = np.radians(random.uniform(1, 359))
    cosine, sine = np.cos(turn), np.sin(turn)
    return mapped(view, np.array([[cosine, 0.0, sine], [0.0, 1.0, 0.0], [-sine, 0.0, cosine]]))


@law("any rotation")
def turned(view: View, random: Random) -> View:
    """The scene is rotated about any axis, together with the camera's up direction.

    A rotation preserves intersections. A map whose up direction is the world's y is rolled relative to the scene.
    """
    basis = perpendicular_basis(unit(random.normal(size=3)), random.normal(size=3))
    return mapped(view, basis)


@law("subdivided triangles")
def split(view: View, random: Random) -> View:
    """Each triangle is subdivided into four at the midpoints of its edges.

    The same points are covered; vertices lie on a grid on which the midpoints are exact.
    """

    def quartered(mesh: Mesh) -> Mesh:
        a, b, c = (mesh.vertices[mesh.faces[:, k]] for k in range(3))
        ab, bc, ca = (a + b) / 2, (b + c) / 2, (c + a) / 2
        corners = np.concatenate(
            [np.stack(four, axis=1) for four in [(a, ab, ca), (ab, b, bc), (ca, bc, c), (ab, bc, ca)]]
        )
        separate = replace(mesh, vertices=corners.reshape(-1, 3))
        return with_faces(separate, np.arange(3 * len(corners)).reshape(-1, 3))

    return with_meshes(view, [quartered(mesh) for mesh in view.scene.meshes])


@law("reordered triangles")
def reordered(view: View, random: Random) -> View:
    """Meshes, triangles, and the first corner of each triangle, in another order.

    The nearest surface is a minimum and a layer count a sum; neither depends on the order.
    """
    shuffled = [
        with_faces(mesh, np.roll(random.permutation(mesh.faces), random.integers(3), axis=1))
        for mesh in view.scene.meshes
    ]
    return with_meshes(view, [shuffled[k] for k in random.permutation(len(shuffled))])


@law("reversed winding")
def rewound(view: View, random: Random) -> View:
    """The winding of all or some meshes is reversed.

    Normals of receivers are oriented towards the camera, and casters are two-sided.
    """
    flipped = random.random(len(view.scene.meshes)) < 0.7
    flipped[random.integers(len(flipped))] = True
    meshes = zip(view.scene.meshes, flipped, strict=True)
    return with_meshes(view, [with_faces(mesh, mesh.faces[:, ::-1]) if flip else mesh for mesh, flip in meshes])


@law("a caster off all light rays")
def beside(view: View, random: Random) -> View:
    """A caster is added beyond the whole scene as seen from a sun, or behind a point or spot light.

    A plane separates it from the scene, the camera and the light, and so from every shadow ray and camera ray.
    """
    light, points = view.light, np.vstack([mesh.vertices for mesh in view.scene.meshes])
    fixed = np.vstack([points, view.camera.position])
    if light.kind == "directional":
        away = unit(light.direction)
    else:
        fixed = np.vstack([fixed, light.position])
        away = unit(np.array(light.position) - points.mean(axis=0))
    along = fixed @ away
    box = Caster("box", vec3(random.uniform(0.3, 2.0, 3)), 0.0, (0.0, 0.0, 0.0)).mesh
    reach = float((box.vertices @ -away).max()) + random.uniform(0.01, 2.0)
    middle = points.mean(axis=0)
    across = random.uniform(-1.0, 1.0, 3)
    across -= (across @ away) * away
    at = middle + (along.max() - middle @ away + reach) * away + across
    more = replace(box, vertices=on_grid(box.vertices + at), receives=False)
    return with_meshes(view, [*view.scene.meshes, more])


@law("a caster inside a caster")
def nested(view: View, random: Random) -> View:
    """A smaller caster is added inside each convex closed caster.

    Every ray that meets the inner caster meets the outer one first.
    """
    convex = [mesh for mesh in view.scene.meshes if mesh.name in CONVEX]
    inner = [
        replace(mesh, receives=False, vertices=on_grid(mesh.vertices / 2 + mesh.vertices.mean(axis=0) / 2))
        for mesh in convex
    ]
    return with_meshes(view, [*view.scene.meshes, *inner])


@law("an additional caster")
def added(view: View, random: Random) -> View:
    """A caster is added anywhere: no pixel that still shows the same triangle changes from shadow to light.

    A blocked ray stays blocked.
    """
    kind = str(random.choice(sorted(SHAPES)))
    place = random.uniform([-1.2, 0.6, -1.2], [1.2, 2.0, 1.2])
    more = Caster(kind, vec3(random.uniform(0.3, 1.2, 3)), 0.0, vec3(place)).mesh
    return with_meshes(view, [*view.scene.meshes, replace(more, receives=False)])


@law("a vanishing light")
def nearly_hard(view: View, random: Random) -> View:
    """The light, which has no size, gets a radius of a millionth of its distance.

    Its penumbrae are narrower than the rasteriser's subpixel grid.
    """
    light = view.light
    distance = 1.0 if light.kind == "directional" else float(np.linalg.norm(light.position))
    return replace(view, light=replace(light, radius=1e-6 * distance))
