"""Seams of cube maps: shadow edges are no worse there than elsewhere; tests/faults plants wrong ones.

Everything is measured where the map has it: in texels of the face that a pixel's receiver lies on.
"""

from dataclasses import dataclass

import numpy as np
import pytest
from scipy.spatial import cKDTree

from shadowbench.scenes.model import Camera, Light, Scene, view_of
from shadowbench.scenes.vectors import unit
from shadowbench.truths.trace import Truth, trace

SIZE = 256


@dataclass(frozen=True)
class EdgePixels:
    """The decided pixels of a view within two texels of a true shadow edge, and which of them lie at a seam."""

    decided: np.ndarray  # (H, W)
    dark: np.ndarray  # of the decided, by the truth
    edge: np.ndarray
    seam: np.ndarray

    def count(self, mask: np.ndarray) -> np.ndarray:
        """[[pixels, wrong pixels] at seams, the same elsewhere]."""
        wrong = (mask[self.decided] < 0.5) != self.dark
        parts = [self.edge & self.seam, self.edge & ~self.seam]
        return np.array([[part.sum(), (part & wrong).sum()] for part in parts])


def edge_pixels(shot, truth: Truth) -> EdgePixels:
    """A true edge passes between two neighbouring decided pixels of one triangle that differ.

    A seam lies where the two largest components of the direction from the light are equal. Near is within two texels.
    """
    away = shot.position[..., :3] - np.asarray(shot.view.light.position)
    decided, dark = truth.receivers & ~truth.undecided, truth.visibility < 0.5
    found = []
    for a, b in ((np.s_[:-1], np.s_[1:]), (np.s_[:, :-1], np.s_[:, 1:])):
        crossed = decided[a] & decided[b] & (shot.triangle[a] == shot.triangle[b]) & (dark[a] != dark[b])
        found.append(((away[a] + away[b]) / 2)[crossed])
    edges, pixels = (u / np.linalg.norm(u, axis=1, keepdims=True) for u in (np.concatenate(found), away[decided]))
    edges = edges[cKDTree(edges).query(pixels)[1]]
    axis = np.eye(3)[np.argmax(np.abs(pixels), axis=1)] * np.sign(pixels)
    on_face, edge_on_face = (u / np.maximum((u * axis).sum(axis=1, keepdims=True), 1e-9) for u in (pixels, edges))
    texels = SIZE / 2
    to_edge = np.abs(on_face - edge_on_face).max(axis=1) * texels
    to_seam = (1 - np.sort(np.abs(on_face), axis=1)[:, 1]) * texels
    return EdgePixels(decided, dark[decided], to_edge <= 2, to_seam <= 2)


def test_the_hardware_s_filter_reads_across_seams(builtin, studio, build, device) -> None:
    """Switched off, the mask changes within half a texel of a seam, and nowhere else."""
    shot = studio.shot(builtin("lamp-by-wall", 384))
    one = build("cube-map:size=32", shot)
    across = one.draw(shot)
    device.context.disable_direct(0x884F)
    try:
        clamped = one.draw(shot)
    finally:
        device.context.enable_direct(0x884F)
    away = np.sort(np.abs(shot.position[..., :3] - np.asarray(shot.view.light.position)), axis=-1)
    to_seam = (1 - away[..., 1] / away[..., 2]) * 16
    changed = np.abs(across - clamped) > 1e-3
    assert changed.sum() > 100 and to_seam[changed].max() < 0.51


@pytest.mark.slow
def test_shadow_edges_are_no_worse_at_seams(shape, studio, mask) -> None:
    """Over lamps amid 160 boxes and spheres in a room."""
    random = np.random.default_rng(5)
    meshes = [shape("box", 4.0, casts=False)]
    for number in range(160):
        scale = random.uniform(0.06, 0.2, 3 if number % 2 else 1)
        place = random.uniform(0.6, 1.6) * unit(random.normal(size=3))
        meshes.append(shape("box" if number % 2 else "sphere", scale, place))
    scene, counts = Scene("seams", tuple(meshes), (), ()), np.zeros((2, 2))
    for _ in range(16):
        eye = random.choice([-1.0, 1.0], 3) * [1.8, 1.6, 1.4]
        camera = Camera("corner", tuple(eye), tuple(-0.3 * eye), 1.5)
        light = Light("lamp", "point", position=tuple(random.uniform(-0.25, 0.25, 3)))
        view = view_of(scene, camera, light, 320)
        pixels = edge_pixels(studio.shot(view), trace(view, pixel_samples=1))
        counts += pixels.count(mask(f"cube-map:size={SIZE}", view))
    (seam, wrong_at_seam), (other, wrong_elsewhere) = counts
    assert min(seam, other) >= 2000
    assert wrong_at_seam / seam <= min(1.5 * wrong_elsewhere / other, 0.05)  # found: 0.0424, elsewhere 0.0441
