"""Shadow volumes: exact except for pixels affected by the rasteriser's grid, for every extrusion and counting."""

from dataclasses import replace

import numpy as np
import pytest

from shadowbench.scenes.library import hard_names, load_scene, transform_of
from shadowbench.scenes.model import Light, Mesh, view_of
from shadowbench.scenes.scene_tables import MeshTable
from shadowbench.scenes.vectors import unit
from shadowbench.truths.trace import trace
from tests.samples import by_turns, daily

FAST = ["cube-on-plane", "spot-lamp", "room-with-lamp", "stairs"]
SILHOUETTE, TRIANGLE = "shadow-volume", "shadow-volume:faces=triangle"
DEPTH = "shadow-volume:compare=depth"
EXACT = [*hard_names(), "armadillo.obj", "bgfx_tree.obj"]  # the meshes are closed, and open


def wrong(mask: np.ndarray, truth) -> np.ndarray:
    """Decided receivers on the wrong side."""
    return truth.receivers & ~truth.undecided & ((mask < 0.5) != (truth.visibility < 0.5))


# Every way of extruding and counting


@pytest.mark.parametrize(("name", "compare"), by_turns(FAST, ["position", "depth"]))
def test_stencil_and_colour_give_the_same_bits(name, compare, studio, build, builtin) -> None:
    shot = studio.shot(builtin(name, 192))
    for faces in ("silhouette", "triangle"):
        stencil, color = (
            build(f"shadow-volume:faces={faces},counter={counter},compare={compare}", shot).draw(shot)
            for counter in ("stencil", "color")
        )
        assert 0.01 < (stencil < 0.5).mean() < 0.99
        assert np.array_equal(stencil, color)


@pytest.mark.parametrize("name", ["spot-lamp", "canopy"])
def test_counting_before_and_behind_agree_where_the_camera_is_in_the_light(name, mask, builtin) -> None:
    view = builtin(name, 192)
    assert np.array_equal(mask("shadow-volume:count=z-pass", view), mask(SILHOUETTE, view))


def test_z_pass_from_an_eye_in_shadow_is_wrong(mask, builtin, truth_of, scored) -> None:
    view, truth = builtin("inside-volume"), truth_of("inside-volume")
    assert scored(mask(SILHOUETTE, view), truth)["iou"] >= 0.9995
    assert scored(mask("shadow-volume:count=z-pass", view), truth)["iou"] < 0.5


# Against the truth


@pytest.mark.parametrize("name", FAST)
def test_small_views_are_exact(name, mask, builtin, truth_of) -> None:
    assert wrong(mask(SILHOUETTE, builtin(name)), truth_of(name)).sum() <= 1


def sun(*direction: float) -> Light:
    return Light("sun", "directional", direction)


def lamp(*position: float, kind: str = "point") -> Light:
    return Light("lamp", kind, (0.1, -1.0, 0.0), position, 2.5)


def edge_on(shape) -> list[Mesh]:
    """300 triangles over two planes, each with a wall whose plane holds the eye."""
    random = np.random.default_rng(0)
    a = random.uniform([-1.5, 0.2, -1.5], [1.5, 2.0, 1.5], (300, 3))
    along, down, aside = (
        random.uniform(*ends) for ends in ((0.05, 0.4, (300, 1)), (-0.2, 0.2, (300, 1)), (-0.2, 0.2, a.shape))
    )
    corners = np.stack([a, a + along * (a - EYE) + down * unit(ASLANT), a + aside], axis=1)
    fan = Mesh("fan", corners.reshape(-1, 3), np.arange(900, dtype=np.int32).reshape(-1, 3))
    return [shape("plane", [40.0, 1.0, 40.0]), shape("plane", [40.0, 1.0, 40.0], (0.0, 0.9, 0.0), casts=False), fan]


def book(shape) -> list[Mesh]:
    """Pages that share an edge, wound without a rule."""
    tips = [[np.cos(angle), 0.2 + np.sin(angle), z] for angle in (0.4, 1.4, 2.3) for z in (-0.5, 0.5)]
    faces = np.array([[0, 1, 3], [0, 3, 2], [1, 0, 5], [0, 4, 5], [0, 1, 7], [0, 7, 6]], dtype=np.int32)
    return [shape("plane", 6.0), Mesh("book", np.array([[0.0, 0.2, -0.5], [0.0, 0.2, 0.5], *tips]), faces)]


EYE, ASLANT = (2.3, 4.0, 3.4), (0.3, -1.0, 0.2)
HARD_VIEWS = {  # meshes by `shape`, light, arguments of `looking`
    "an eye in a lamp's shadow, along the light": (
        lambda shape: [shape("plane", 6.0), shape("box", [1.5, 0.1, 1.5], (0.0, 1.6, 0.0))],
        lamp(0.0, 3.0, 0.0),
        {"eye": (0.0, 1.0, 0.1), "target": (0.5, 0.0, -0.2), "fov": 80},
    ),
    "and against it": (
        lambda shape: [shape("plane", 6.0), shape("box", [1.5, 0.1, 1.5], (0.0, 1.6, 0.0))],
        lamp(0.0, 3.0, 0.0),
        {"eye": (0.0, 1.0, 0.1), "target": (3.0, 1.2, 0.1), "fov": 80},
    ),
    **{
        f"a lamp {share} of the way from the eye to its near plane": (
            lambda shape: [shape("plane", 6.0), shape("box", 0.5, (0.0, 0.25, 0.0))],
            lamp(*(np.array([1.0, 2.0, 1.5]) * (1 - 0.05 * share))),
            {"eye": (1.0, 2.0, 1.5), "near": 0.2, "far": 9.0},
        )
        for share in (0.0, 0.5, 1.0)
    },
    "a caster before the near plane, half-way between eye and ground": (
        lambda shape: [shape("plane", 6.0), shape("box", 0.4, (1.15, 2.0, 1.7))],
        sun(-0.3, -1.0, -0.2),
        {"near": 3.5, "far": 9.0},
    ),
    "walls seen edge-on": (edge_on, sun(*ASLANT), {"size": 256, "eye": EYE}),
    "an edge a quarter of a degree from the light": (
        lambda shape: [shape("plane", 8.0), shape("box", [1.0, 40.0, 1.0], (0.0, 20.0, 0.0))],
        sun(0.004, -1.0, 0.007),
        {"size": 256},
    ),
    "pages of a book under a sun": (book, sun(0.4, -1.0, -0.2), {"size": 256}),
    "pages of a book under a lamp": (book, lamp(-0.8, 2.1, 0.5), {"size": 256}),
    "light along the faces of a box": (
        lambda shape: [shape("plane", 8.0), shape("box", 1.0, (0.0, 0.5, 0.0)), shape("plane", 1.0, (0.9, 0.4, 0.6))],
        sun(0.0, -0.2, 1.0),
        {"size": 64},
    ),
    "walls of no width, from a camera whose up they run along": (
        lambda shape: [
            *(shape("plane", [4.0, 1.0, 4.0], (0.0, y, 0.0), casts=False) for y in (-1.5, 1.5)),
            shape("sphere"),
        ],
        sun(0.0, -1.0, 0.0),
        {"size": 96, "eye": (0.6, -0.7, 3.5), "target": (0.0, -1.2, 0.0), "fov": 60},
    ),
    **{
        f"a {kind} {where} of a closed caster": (
            lambda shape: [
                shape("plane", 8.0),
                shape("box", 1.0, (0.0, 0.5, 0.0)),
                shape("box", (0.4, 1.6, 0.4), (1.2, 0.8, 0.3)),
            ],
            lamp(*place, kind=kind),
            {"size": 64},
        )
        for where, place, kind in (
            ("on a face", (0.2, 1.0, 0.1), "point"),
            ("a hair above a face", (0.2, 1.0 + 1e-7, 0.1), "spot"),
            ("a hair below a face", (0.2, 1.0 - 1e-7, 0.1), "point"),
            ("inside", (0.2, 1.0 - 1e-5, 0.1), "spot"),
            ("on an edge", (0.5, 1.0, 0.1), "point"),
            ("at a corner", (-0.5, 1.0, -0.5), "spot"),
        )
    },
}


@pytest.mark.parametrize("name", HARD_VIEWS)
def test_hard_views_are_exact(name, shape, looking, mask) -> None:
    meshes, light, options = HARD_VIEWS[name]
    view = looking(meshes(shape), light, **options)
    truth = trace(view, pixel_samples=1)
    assert (truth.receivers & ~truth.undecided).sum() > 100
    specs = (SILHOUETTE,) if name == "walls seen edge-on" else (SILHOUETTE, TRIANGLE)
    for spec in (*specs, *((DEPTH, "hybrid:size=64") if "closed caster" in name else ())):
        assert wrong(mask(spec, view), truth).sum() <= (1 if "eye" in name or "book" in name else 0), spec


@pytest.mark.parametrize("angles", [(15, 40, 25), (244, 174, 276)])
def test_a_lamp_on_a_face_or_an_edge_of_a_turned_box_is_in_its_shadow(angles, shape, looking, mask) -> None:
    """Rounding decides on which side of the face it is, and the way between the edge's ends, which are opposite."""
    turn = transform_of(MeshTable(shape="box", rotate=angles))[:3, :3]
    turned = replace(shape("box"), vertices=shape("box").vertices @ turn.T + [0.1, 1.3, 0.2])
    for place in ((0.5, 0.5, 0.1), (0.5, 0.3, -0.5)):
        view = looking([shape("plane", 8.0), turned], lamp(*(turn @ place + [0.1, 1.3, 0.2])), 64)
        truth = trace(view, pixel_samples=1)
        decided = (truth.receivers & ~truth.undecided).sum()
        for spec in (SILHOUETTE, TRIANGLE):
            assert decided > 100 and wrong(mask(spec, view), truth).sum() <= 2e-3 * decided


@pytest.mark.slow
@pytest.mark.parametrize("name", daily(EXACT, 3))
def test_every_scene_and_real_meshes_are_exact(name, shared_scenes, mask, scored) -> None:
    """But for a few pixels at edges, where rasteriser and ray see different triangles, and at grazing light."""
    scene = load_scene(shared_scenes / name if "." in name else name)
    view = view_of(scene, scene.cameras[0], scene.lights[0], 512)
    if scene.geometry.cutouts is None:
        truth = trace(view, pixel_samples=1)
        for spec, least in ((SILHOUETTE, 0.9999), (TRIANGLE, 0.9999), (DEPTH, 0.9995)):
            assert scored(mask(spec, view), truth)["iou"] >= least, spec


# Counting far


def nested(shape, count: int) -> list[Mesh]:
    """A patch of ground within so many spheres."""
    sphere = shape("sphere", subdivisions=2)
    radii = np.linspace(2.0, 4.0, count) * 2
    return [shape("plane", 1.0, casts=False), *(Mesh("shell", sphere.vertices * r, sphere.faces) for r in radii)]


@pytest.mark.parametrize(
    "light",
    [Light("sun", "directional", (0.3, -1.0, 0.2)), Light("lamp", "point", position=(3.0, 9.0, 2.0))],
    ids=["sun", "lamp"],
)
@pytest.mark.parametrize("count", [1, 255])
def test_inside_any_number_of_spheres_is_shadow(count, light, shape, looking, studio, build) -> None:
    shot = studio.shot(looking(nested(shape, count), light, 48, (0.0, 0.9, 0.9)))
    ground = (shot.triangle >= 0) & (shot.triangle < 2)
    assert ground.sum() > 200
    one = build(SILHOUETTE, shot)
    assert (one.draw(shot)[ground] == 0).all()
    facts = one.technique.facts()
    assert facts["layers_at_most"] >= count
    assert facts["counted_in_color"] == (count > 200)


def stack(shape, count: int, side: float, top: tuple[float, float, float], step: float) -> Mesh:
    """Squares one below the other."""
    square = shape("plane", side)
    vertices = [square.vertices + np.subtract(top, (0.0, step * i, 0.0)) for i in range(count)]
    faces = [square.faces + len(square.vertices) * i for i in range(count)]
    return Mesh("stack", np.concatenate(vertices), np.concatenate(faces).astype(np.int32))


LAYERS = {  # of which texels of a map, or rays from a lamp, would miss some
    "squares of 1 mm over a plane of 10 m": (
        lambda shape: [shape("plane", 10.0), stack(shape, 256, 0.001, (0.0, 0.1, 0.0), 2e-4)],
        sun(0.0, -1.0, 0.0),
    ),
    "all around a lamp, without a silhouette": (lambda shape: nested(shape, 257), lamp(0.1, 0.2, -0.1)),
    "the floor of a room without a ceiling": (
        lambda shape: [
            *(shape("box", [0.1, 4.0, 4.2], (x, 0.0, 0.0)) for x in (2.0, -2.0)),
            *(shape("box", [4.2, 4.0, 0.1], (0.0, 0.0, z)) for z in (2.0, -2.0)),
            stack(shape, 257, 6.0, (0.0, -1.0, 0.0), 1e-3),
        ],
        lamp(0.1, 1.0, 0.2),
    ),
}


@pytest.mark.parametrize("name", LAYERS)
def test_no_layers_are_missed(name, shape, studio, build, looking) -> None:
    meshes, light = LAYERS[name]
    shot = studio.shot(looking(meshes(shape), light, 32))
    one = build(SILHOUETTE, shot)
    one.draw(shot)
    facts = one.technique.facts()
    assert facts["layers_at_most"] >= 257 and facts["counted_in_color"]
