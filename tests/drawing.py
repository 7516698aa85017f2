"""Techniques built and drawn without a worker, and small scenes with known shadows."""

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from functools import lru_cache

import numpy as np
import pytest

from shadowbench.gl.clock import Clock
from shadowbench.gl.device import Device, moderngl
from shadowbench.gl.gbuffer import download
from shadowbench.plugin.base import Frame, Phase, Stage, Technique, surface_of
from shadowbench.plugin.base import build as build_technique
from shadowbench.plugin.registry import shader_folder, techniques
from shadowbench.plugin.spec import parse_spec
from shadowbench.scenes.model import Camera, Light, Mesh, Scene, View, view_of
from shadowbench.scenes.vectors import Vec3, unit
from shadowbench.scores import PreparedTruth, score

KNOWN = techniques()  # which searches all installed packages


def view_at(
    meshes: Sequence[Mesh] | Scene,
    light: Light,
    size: int = 64,
    eye: Vec3 = (2.3, 4.0, 3.4),
    target: Vec3 = (0.0, 0.0, 0.0),
    fov: float = 50.0,
    **planes: float | None,
) -> View:
    """A view of some meshes or of a whole scene; fov in degrees."""
    camera = Camera("camera", eye, target, math.radians(fov), **planes)
    scene = meshes if isinstance(meshes, Scene) else Scene("test", tuple(meshes), (camera,), (light,))
    return view_of(scene, camera, light, size)


@dataclass(eq=False)
class Built:
    """A technique built on a stage."""

    technique: Technique
    stage: Stage
    clock: Clock
    draw_frame: Callable[[Frame], moderngl.Texture]
    frames: int = field(default=0)

    def draw(self, shot, phase: int | Phase = 0) -> np.ndarray:
        """Visibility of a view of the same scene as float32, row 0 at the top."""
        surface = surface_of(self.technique, shot.surface)
        phase = Phase(phase) if isinstance(phase, int) else phase
        texture = self.draw_frame(Frame(shot.view, phase, self.frames, surface, self.clock))
        self.frames += 1
        self.stage.device.check(f"drawing {self.technique.name}")
        return download(texture)[..., 0].astype(np.float32)


@pytest.fixture
def build(device: Device, studio) -> Iterator[Callable[..., Built]]:
    """A spec built for a view's scene and size; released after the test."""
    stages: list[Stage] = []

    def make(spec: str, shot, known=KNOWN) -> Built:
        parsed = parse_spec(spec, known)
        stage = Stage(
            shot.view.scene, device, shot.view.size, shot.geometry, shot.placement, shader_folder(parsed.technique)
        )
        stages[:] = [*(one for one in stages if one.bytes), stage]  # without those released, which hold shader texts
        technique = parsed.technique(parsed.params)
        draw = build_technique(technique, stage)
        device.check(f"building {spec}")
        return Built(technique, stage, Clock(device), draw)

    yield make
    for stage in stages:
        stage.release()


@pytest.fixture
def mask(build, studio) -> Callable[..., np.ndarray]:
    """Visibility by a spec of one view."""

    def draw(spec: str, view: View, phase: int = 0) -> np.ndarray:
        shot = studio.shot(view)
        built = build(spec, shot)
        visibility = built.draw(shot, phase)
        built.stage.release()
        return visibility

    return draw


@pytest.fixture(scope="session")
def scored() -> Callable[..., dict[str, float | None]]:
    """All scores of a mask against a truth."""

    @lru_cache
    def prepared(truth) -> PreparedTruth:
        return PreparedTruth(truth.arrays())

    return lambda visibility, truth: score(visibility, prepared(truth))


@pytest.fixture(scope="session")
def looking() -> Callable[..., View]:
    return lambda meshes, light, size=128, *place, **options: view_at(meshes, light, size, *place, **options)


@pytest.fixture(scope="session")
def sun() -> Callable[..., Light]:
    """A directional light at an elevation and azimuth in degrees."""

    def make(elevation: float = 45.0, azimuth: float = 23.0) -> Light:
        e, a = math.radians(elevation), math.radians(azimuth)
        return Light("sun", "directional", (-math.cos(e) * math.cos(a), -math.sin(e), -math.cos(e) * math.sin(a)))

    return make


@pytest.fixture(scope="session")
def spot() -> Callable[..., Light]:
    """A spot at a place that shines at another; the cone's full angle in degrees."""

    def make(position: Vec3, target: Vec3 = (0.0, 0.0, 0.0), angle: float = 60.0) -> Light:
        direction = unit(np.subtract(target, position))
        return Light("spot", "spot", tuple(map(float, direction)), position, math.radians(angle))

    return make
