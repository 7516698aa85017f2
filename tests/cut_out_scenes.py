"""Scenes of cut-out cards with nearest sampling, and the same made of triangles: what may go wrong, one scene each."""

import math
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from shadowbench.scenes.cutouts import WRAPS, Cutout
from shadowbench.scenes.meshes import read_meshes
from shadowbench.scenes.model import Light, Mesh
from tests.cards import CAMERA, GROUND, alpha_of, cards, made_of_triangles
from tests.scenes.rigs import Rig
from tests.scenes.test_gltf_materials import image_of

Meshes = tuple[Mesh, ...]
Pair = tuple[Meshes, Meshes]  # cut out, and made of triangles
TWO = np.array([[0, 1, 2], [0, 2, 3]], dtype=np.int32)
NOISE = np.random.default_rng(8).integers(0, 256, (7, 13), dtype=np.uint8)


def card(cutout: Cutout, middle: Any, along: Any, up: Any, places: Any, name: str = "card") -> Mesh:
    """A parallelogram; along, up: half its sides; places: (4, 2) of its corners, from the lower left one on."""
    middle, along, up = (np.asarray(each, float) for each in (middle, along, up))
    corners = middle + np.array([-1, 1, 1, -1.0])[:, None] * along + np.array([-1, -1, 1, 1.0])[:, None] * up
    return Mesh(name, corners, TWO, cutout=cutout, coordinates=np.asarray(places, np.float32)[TWO])


def box(left: float, top: float, right: float, bottom: float) -> list[list[float]]:
    """Texture coordinates of a card's corners, v downwards."""
    return [[left, bottom], [right, bottom], [right, top], [left, top]]


def pair(*meshes: Mesh, least: int = 128, ground: Mesh = GROUND) -> Pair:
    return (ground, *meshes), (ground, *(made_of_triangles(mesh, least) for mesh in meshes))


def scattered(light: Light, folder: Path) -> Pair:
    """Cards in random directions."""
    return pair(cards(40, Cutout(alpha_of("noise"), nearest=True, wrap=("mirror", "clamp"))))


def crossing(light: Light, folder: Path) -> Pair:
    """Plants, each of three cards through one axis and a level one through all."""
    leaf, found = Cutout(alpha_of("leaf"), nearest=True, wrap=("clamp", "clamp")), []
    for x, z in ((-0.8, -0.5), (0.1, 0.3), (0.9, -0.3), (-0.6, 0.9)):
        for turn in (0.2, 0.2 + math.pi / 3, 0.2 - math.pi / 3):
            across = 0.45 * np.array([math.cos(turn), 0, math.sin(turn)])
            found.append(card(leaf, (x, 0.6, z), across, (0, 0.6, 0), box(-0.1, 0, 1.1, 1)))
        found.append(card(leaf, (x, 0.7, z), (0.5, 0.1, 0), (0, 0.1, 0.5), box(0, 0, 1, 1)))
    return pair(*found)


def wraps(light: Light, folder: Path) -> Pair:
    """Each wrap in u with each in v, coordinates from −2.3 to 3.6, of a mask that is not square."""
    found = []
    for i, u in enumerate(WRAPS):
        for j, v in enumerate(WRAPS):
            at, cutout = (0.9 * i - 0.9, 0.5 + 0.2 * j, 0.9 * j - 0.9), Cutout(NOISE, nearest=True, wrap=(u, v))
            found.append(card(cutout, at, (0.4, 0.1 * i, 0), (0, 0.3, -0.3), box(-2.3, -1.7, 3.6, 2.2)))
    return pair(*found)


def transformed(light: Light, folder: Path) -> Pair:
    """A glTF file's KHR_texture_transform: scaled, one axis reversed, turned and moved."""
    scale, turn, offset = np.array([1.7, -2.4]), 0.6, np.array([0.3, -1.2])
    raw = np.array(box(-0.5, 0, 1, 1.25), np.float32)
    c, s = math.cos(turn), math.sin(turn)
    moved = raw @ np.diag(scale) @ np.array([[c, -s], [s, c]]) + offset
    extension = {"offset": offset.tolist(), "rotation": turn, "scale": scale.tolist()}
    info = {"index": 0, "extensions": {"KHR_texture_transform": extension}}
    nodes = [{"mesh": 0, "translation": [0.8 * k, 0.6, 0.25 * k]} for k in (-1, 0, 1)]
    ours = from_gltf(folder, info, {"magFilter": 9728, "wrapS": 33648, "wrapT": 10497}, raw, nodes)
    cutout, side = (
        Cutout(NOISE, nearest=True, wrap=("mirror", "repeat")),
        np.float32([[0.5, 0.1, 0.25], [-0.25, 0.5, 0]]),
    )
    return (GROUND, *ours), pair(*(card(cutout, node["translation"], *side, moved) for node in nodes))[1]


def mirrored(light: Light, folder: Path) -> Pair:
    """A glTF file's nodes of negative and uneven scales, one in another."""
    raw = np.array(box(-0.5, -0.25, 1.5, 1.0), np.float32)
    nodes = [
        {"mesh": 0, "translation": [-0.75, 0.75, 0], "scale": [-1, 1, 1]},
        {"mesh": 0, "translation": [0.5, 0.75, 0.25], "scale": [-0.5, -1.25, -1]},
        {"scale": [1, 1, -2], "children": [3], "translation": [0, 0, 0.5]},
        {"mesh": 0, "translation": [0.25, 1.25, 0.5], "scale": [2, -0.5, 0.25]},
    ]
    ours = from_gltf(folder, {"index": 0}, {"magFilter": 9728, "wrapS": 33071, "wrapT": 33648}, raw, nodes, [0, 1, 2])
    cutout, side = (
        Cutout(NOISE, nearest=True, wrap=("clamp", "mirror")),
        np.float32([[0.5, 0.1, 0.25], [-0.25, 0.5, 0]]),
    )
    inner = np.array([1, 1, -2]), np.array([0, 0, 0.5])
    theirs = [card(cutout, node["translation"], *side * node["scale"], raw) for node in nodes[:2]]
    last = np.array(nodes[3]["translation"]) * inner[0] + inner[1]
    theirs.append(card(cutout, last, *side * nodes[3]["scale"] * inner[0], raw))
    return (GROUND, *ours), pair(*theirs)[1]


def edge_on(light: Light, folder: Path) -> Pair:
    """Cards along the camera's ray to their middle and along the light's, and turned from it by little."""
    leaf, found = Cutout(alpha_of("noise"), nearest=True), []
    lamp = -1e3 * np.array(light.direction) if light.kind == "directional" else np.array(light.position)
    for i, tilt in enumerate((0.0, 1e-4, 1e-2, 0.1)):
        for j, toward in enumerate((np.array(CAMERA.position), lamp)):
            middle = np.array([0.55 * i - 0.9, 0.7, 0.9 * j - 0.4])
            ahead = (toward - middle) / np.linalg.norm(toward - middle)
            across = np.cross(ahead, (0.3, 0.1, 1.0))
            normal = np.cross(ahead, across / np.linalg.norm(across))
            ahead = ahead * math.cos(tilt) + normal * math.sin(tilt)
            found.append(card(leaf, middle, 0.3 * ahead, 0.3 * np.cross(normal, ahead), box(-0.2, 0.1, 1.3, 0.9)))
    return pair(*found)


def levels(light: Light, folder: Path) -> Pair:
    """Alphas at the cutoff, one step below and one above; cards in the shadows of others, one close above another."""
    alpha = np.random.default_rng(6).integers(99, 102, (9, 6), dtype=np.uint8)
    cutouts = Cutout(alpha, 1.0, 100 / 255, True), Cutout(alpha, 0.8, 0.8 * 100 / 255, True)
    heights = (0.2, 0.202, 0.5, 0.9, 1.4)
    return pair(
        *(card(cutouts[k % 2], (0.1 * k - 0.2, y, 0), (0.9, 0.05 * k, 0.1), (0, 0.1, -0.9), box(0, 0, 2.5, 1.5))
          for k, y in enumerate(heights)),
        least=100,
    )  # fmt: skip


def uneven(light: Light, folder: Path) -> Pair:
    """A grid of upright cards in one mesh over hills that they stand in."""
    x, z = np.meshgrid(*[np.linspace(-2, 2, 25)] * 2, indexing="xy")
    k = np.arange(24 * 24) // 24 * 25 + np.arange(24 * 24) % 24
    faces = np.stack([k, k + 25, k + 1, k + 1, k + 25, k + 26], axis=1).reshape(-1, 3).astype(np.int32)
    hills = Mesh("hills", np.stack([x, 0.25 * np.sin(3 * x) * np.cos(2 * z), z], axis=2).reshape(-1, 3), faces)
    cutout, found = Cutout(NOISE.T, nearest=True, wrap=("repeat", "clamp")), []
    for i in range(25):
        at = (0.6 * (i % 5) - 1.2, 0.3 + 0.02 * i, 0.6 * (i // 5) - 1.2)
        side = 0.25 * np.array([math.cos(i), 0, math.sin(i)])
        found.append(card(cutout, at, side, (0, 0.4, 0), box(0.2 * i - 2, -0.2, 0.2 * i - 1, 1.2)))
    joined = Mesh(
        "grass",
        np.concatenate([one.vertices for one in found]),
        np.concatenate([TWO + 4 * i for i in range(25)]),
        cutout=cutout,
        coordinates=np.concatenate([one.coordinates for one in found if one.coordinates is not None]),
    )
    return pair(joined, ground=hills)


def from_gltf(
    folder: Path, info: Any, sampler: Any, places: np.ndarray, nodes: list[Any], roots: list[int] | None = None
) -> Meshes:
    """The meshes of a file of one cut-out card, its texture coordinates before all that the file does to them."""
    rig = Rig()
    side = np.float32([[0.5, 0.1, 0.25], [-0.25, 0.5, 0]])
    corners = np.array([-1, 1, 1, -1.0])[:, None] * side[0] + np.array([-1, -1, 1, 1.0])[:, None] * side[1]
    rig.mesh(corners, TWO, TEXCOORD_0=rig.accessor(places))
    rig.json["meshes"][0]["primitives"][0]["material"] = 0
    rgba = np.full((*NOISE.shape, 4), 200, np.uint8)
    rgba[..., 3] = NOISE
    rig.json |= {
        "scenes": [{"nodes": list(range(len(nodes))) if roots is None else roots}],
        "nodes": nodes,
        "materials": [{"alphaMode": "MASK", "pbrMetallicRoughness": {"baseColorTexture": info}, "doubleSided": True}],
        "textures": [{"source": 0, "sampler": 0}],
        "samplers": [sampler],
        "images": [image_of(rgba)],
    }
    return tuple(read_meshes(rig.write(folder / "card.glb")).meshes)


SCENES: dict[str, Callable[[Light, Path], Pair]] = {
    made.__name__: made for made in (scattered, crossing, wraps, transformed, mirrored, edge_on, levels, uneven)
}
