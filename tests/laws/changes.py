"""The laws: changes of a view that must not change its shadows, and why.

Each takes a view in file coordinates and random numbers, and gives the changed view. The camera's planes go along: they
are the camera's, though a view takes them from the scene. A docstring's first line is the law as the table has it, and
the rest the reason.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from inspect import cleandoc

import numpy as np

from shadowbench.scenes.model import Floats, Mesh, Scene, View, perpendicular_basis, unit, vec3

from .scenes import CONVEX, GRID, SHAPES, Caster, on_grid

Random = np.random.Generator
Change = Callable[[View, Random], View]


@dataclass(frozen=True)
class Law:
    """A change by name; `says` and `why` are its docstring."""

    name: str
    change: Change

    @property
    def says(self) -> str:
        return self._lines[0]

    @property
    def why(self) -> str:
        return " ".join(line.strip() for line in self._lines[1:] if line.strip())

    @property
    def _lines(self) -> list[str]:
        return cleandoc(self.change.__doc__ or "").splitlines()


LAWS: dict[str, Law] = {}


def law(name: str) -> Callable[[Change], Change]:
    def register(change: Change) -> Change:
        LAWS[name] = Law(name, change)
        return change

    return register


def mapped(view: View, matrix: Floats, move: Floats | float = 0.0) -> View:
    """The whole view by x → M x + move, M a rotation times a scale."""
    scale = float(np.cbrt(np.linalg.det(matrix)))

    def points(places: Floats) -> Floats:
        return places @ matrix.T + move

    def turned(direction: Floats) -> Floats:
        return direction @ matrix.T

    near, far = view.near_far
    camera = replace(
        view.camera,
        position=vec3(points(np.array(view.camera.position))),
        target=vec3(points(np.array(view.camera.target))),
        up=vec3(turned(np.array(view.camera.up))),
        near=near * scale,
        far=far * scale,
    )
    light = replace(view.light, direction=vec3(turned(np.array(view.light.direction))))
    if light.kind != "directional":
        light = replace(light, position=vec3(points(np.array(light.position))))
    meshes = [replace(mesh, vertices=points(mesh.vertices)) for mesh in view.scene.meshes]
    return replace(with_meshes(view, meshes), camera=camera, light=light)


def with_meshes(view: View, meshes: list[Mesh]) -> View:
    scene = view.scene
    return replace(view, scene=Scene(scene.name, tuple(meshes), scene.cameras, scene.lights))


def with_faces(mesh: Mesh, faces: np.ndarray, vertices: Floats | None = None) -> Mesh:
    vertices = mesh.vertices if vertices is None else vertices
    return replace(mesh, vertices=vertices, faces=np.ascontiguousarray(faces, dtype=np.int32))


def about_y(degrees: float) -> Floats:
    """(3, 3); a quarter turn is exact."""
    cosine, sine = np.cos(np.radians(degrees)), np.sin(np.radians(degrees))
    if degrees % 90 == 0:
        cosine, sine = np.round(cosine), np.round(sine)
    return np.array([[cosine, 0.0, sine], [0.0, 1.0, 0.0], [-sine, 0.0, cosine]])


@law("moved")
def moved(view: View, random: Random) -> View:
    """All is moved by up to 1000 km, by multiples of 2⁻²⁰ m.

    Nothing is rounded, and the placement takes the move out again: the local scene has the same bits.
    """
    return mapped(view, np.eye(3), random.integers(-(2**40), 2**40, 3) * GRID)


@law("scaled by a power of two")
def scaled_exactly(view: View, random: Random) -> View:
    """All is scaled by 2⁻³⁰ to 2³⁰.

    Nothing is rounded, and the placement takes the scale out again: the local scene has the same bits.
    """
    return mapped(view, np.eye(3) * 2.0 ** random.integers(-30, 31))


@law("scaled and moved")
def scaled_and_moved(view: View, random: Random) -> View:
    """All is scaled by 10⁻³ to 10³ and moved by up to 10 km.

    A similarity keeps which rays meet what. The local scene is the same but for a factor below 2 and its rounding.
    """
    return mapped(view, np.eye(3) * 10.0 ** random.uniform(-3, 3), random.uniform(-1e4, 1e4, 3))


@law("a quarter turn about y")
def quarter_turned(view: View, random: Random) -> View:
    """All is turned by 90°, 180° or 270° about y.

    A rotation keeps which rays meet what. A basis made from the light and the y axis turns along, and so does a box
    along the world's axes.
    """
    return mapped(view, about_y(90.0 * random.integers(1, 4)))


@law("a turn about y")
def turned_about_y(view: View, random: Random) -> View:
    """All is turned by any angle about y.

    A rotation keeps which rays meet what. A basis made from the light and the y axis turns along; a box along the
    world's axes does not.
    """
    return mapped(view, about_y(random.uniform(1, 359)))


@law("any turn")
def turned(view: View, random: Random) -> View:
    """All is turned about any axis, the camera's up with it.

    A rotation keeps which rays meet what. A map whose up is the world's y lies otherwise on its scene afterwards.
    """
    basis = perpendicular_basis(unit(random.normal(size=3)), random.normal(size=3))
    return mapped(view, basis)


@law("triangles split")
def split(view: View, random: Random) -> View:
    """Each triangle becomes four, at the middles of its edges.

    The same points are covered; on the grid of these scenes the middles are exact.
    """

    def quartered(mesh: Mesh) -> Mesh:
        a, b, c = (mesh.vertices[mesh.faces[:, k]] for k in range(3))
        ab, bc, ca = (a + b) / 2, (b + c) / 2, (c + a) / 2
        corners = np.concatenate(
            [np.stack(four, axis=1) for four in [(a, ab, ca), (ab, b, bc), (ca, bc, c), (ab, bc, ca)]]
        )
        return with_faces(mesh, np.arange(3 * len(corners)).reshape(-1, 3), corners.reshape(-1, 3))

    return with_meshes(view, [quartered(mesh) for mesh in view.scene.meshes])


@law("another order")
def reordered(view: View, random: Random) -> View:
    """Meshes, triangles, and the corner that each begins with, in another order.

    Which surface is the nearest is a minimum, and a count of layers a sum: neither has an order.
    """
    shuffled = [
        with_faces(mesh, np.roll(random.permutation(mesh.faces), random.integers(3), axis=1))
        for mesh in view.scene.meshes
    ]
    return with_meshes(view, [shuffled[k] for k in random.permutation(len(shuffled))])


@law("another winding")
def rewound(view: View, random: Random) -> View:
    """The triangles of each mesh, or of some, run the other way round.

    A receiver's normal is turned to the camera, and a caster has no side.
    """
    flipped = random.random(len(view.scene.meshes)) < 0.7
    flipped[random.integers(len(flipped))] = True
    meshes = zip(view.scene.meshes, flipped, strict=True)
    return with_meshes(view, [with_faces(mesh, mesh.faces[:, ::-1]) if flip else mesh for mesh, flip in meshes])


@law("casters twice")
def doubled(view: View, random: Random) -> View:
    """Each mesh is there twice.

    The same points are covered.
    """
    return with_meshes(view, [*view.scene.meshes, *view.scene.meshes])


@law("a caster off all ways to the light")
def beside(view: View, random: Random) -> View:
    """One more caster, beyond all of the scene as seen from the light, or behind a lamp.

    A plane parts it from scene, camera and lamp, and so from every segment from a receiver to the light and from the
    camera to a receiver.
    """
    light, points = view.light, np.vstack([mesh.vertices for mesh in view.scene.meshes])
    held = np.vstack([points, view.camera.position])
    if light.kind == "directional":
        away = unit(light.direction)
    else:
        held = np.vstack([held, light.position])
        away = unit(np.array(light.position) - points.mean(axis=0))
    along = held @ away
    box = Caster("box", vec3(random.uniform(0.3, 2.0, 3)), 0.0, (0.0, 0.0, 0.0)).mesh
    reach = float((box.vertices @ -away).max()) + random.uniform(0.01, 2.0)
    middle = points.mean(axis=0)
    across = random.uniform(-1.0, 1.0, 3)
    across -= (across @ away) * away
    at = middle + (along.max() - middle @ away + reach) * away + across
    more = replace(box, vertices=on_grid(box.vertices + at), receives=False)
    return with_meshes(view, [*view.scene.meshes, more])


@law("a caster in a caster")
def nested(view: View, random: Random) -> View:
    """Each convex closed caster holds a smaller one.

    Whatever meets the inner one meets the outer one before.
    """
    convex = [mesh for mesh in view.scene.meshes if mesh.name in CONVEX]
    inner = [
        replace(mesh, receives=False, vertices=on_grid(mesh.vertices / 2 + mesh.vertices.mean(axis=0) / 2))
        for mesh in convex
    ]
    return with_meshes(view, [*view.scene.meshes, *inner])


@law("another caster")
def added(view: View, random: Random) -> View:
    """One more caster anywhere: where the same triangle is seen, no pixel turns from shadow to light.

    A ray that is stopped stays so.
    """
    kind = str(random.choice(sorted(SHAPES)))
    place = random.uniform([-1.2, 0.6, -1.2], [1.2, 2.0, 1.2])
    more = Caster(kind, vec3(random.uniform(0.3, 1.2, 3)), 0.0, vec3(place)).mesh
    return with_meshes(view, [*view.scene.meshes, replace(more, receives=False)])


@law("more PCF taps")
def more_taps(view: View, random: Random) -> View:
    """The view stays; the filter goes from 1 texel to 3², 5² and 7².

    The mean of answers that all agree is their answer, and the narrower box's are among them.
    """
    return view
