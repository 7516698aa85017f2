"""Mistakes planted in the sampling of lights: each must fail the check that is named beside it."""

import importlib.util
import math
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest

from shadowbench.scenes.model import Floats, Light, Mesh, View, perpendicular_basis, unit, vec3
from shadowbench.truths import light_samples, soft
from shadowbench.truths import trace as tracing
from shadowbench.truths.rays import ViewRays
from shadowbench.truths.trace import OFFSET, STANDARD_ERROR

from .test_soft_closed_forms import TOWARD, cap_beyond, check, clipped, edge_normals, ground, half_plane, solid_angle
from .test_soft_errors import neighbours, receivers_of

CENTER = np.array([-2.0, 7.0, 0.5])  # of the lamps
SUN_RADIUS = math.radians(25)
SCRAMBLES = 16
COMPILED = "\n_fast = "  # where the compiled part of `light_samples` begins

Shape = Callable[..., Mesh]
Looking = Callable[..., View]
Rays = Callable[[View], tuple[Floats, Floats]]


class Checks:
    """Facts about a straight edge before each kind of light, as the truth of the modules under test has them."""

    def __init__(self, estimator: type[soft.Estimator], shape: Shape, looking: Looking, pixel_rays: Rays) -> None:
        self._estimator, self._shape, self._looking, self._pixel_rays = estimator, shape, looking, pixel_rays

    def _view(self, light: Light, extra: tuple[Mesh, ...] = ()) -> View:
        target = (2.6, 0.0, 0.3)
        return self._looking(
            [*half_plane(self._shape, 20.0, 1.0), *extra], light, 48, (5.6, 4.0, 1.3), target, fov=75.0
        )

    def _check(self, light: Light, share: Callable[[Floats, Floats], Floats]) -> None:
        """Visibility is `share` of points and normals of the planes through them and the edge."""
        view = self._view(light)
        truth = tracing.trace(view, pixel_samples=1)
        shown, points = ground(view, truth, self._pixel_rays)
        shown &= (np.abs(points[:, 2]) < 5) & (points[:, 0] > -1) & (points[:, 0] < 8)
        check(truth, shown, share(points, edge_normals(points, 1.0)))

    def sun(self) -> None:
        light = Light("sun", "directional", vec3(-unit(TOWARD)), radius=SUN_RADIUS)
        self._check(light, lambda _, normals: 1 - cap_beyond(np.arcsin(normals @ unit(TOWARD)), SUN_RADIUS))

    def sphere(self) -> None:
        def share(points: Floats, normals: Floats) -> Floats:
            away = CENTER - points
            distance = np.linalg.norm(away, axis=1)
            angles = np.arcsin((normals * away).sum(axis=1) / distance)
            radii = np.arcsin(1.5 / distance)
            return np.array([1 - float(cap_beyond(*each)) for each in zip(angles, radii, strict=True)])

        self._check(Light("bulb", "point", position=vec3(CENTER), radius=1.5), share)

    def _panel(self, light: Light, corners: Floats) -> None:
        right, up, _ = perpendicular_basis(-unit(light.direction), light.up)
        outline = CENTER + corners @ np.stack([right, up])

        def share(points: Floats, normals: Floats) -> Floats:
            seen = outline - points[:, None, :]
            return solid_angle(clipped(seen, normals)) / solid_angle(seen)

        self._check(light, share)

    def rectangle(self) -> None:
        light = Light("window", "rectangle", (0.5, -1.0, -0.1), vec3(CENTER), size=(4.0, 1.5), up=(0.0, 0.3, 1.0))
        self._panel(light, np.array([[-2.0, -0.75], [2.0, -0.75], [2.0, 0.75], [-2.0, 0.75]]))

    def disc(self) -> None:
        turns = np.arange(256) / 256 * 2 * math.pi
        light = Light("disc", "disc", (0.5, -1.0, -0.1), vec3(CENTER), radius=2.0)
        self._panel(light, 2.0 * np.stack([np.cos(turns), np.sin(turns)], axis=1))

    def half_set(self) -> None:
        """Of a sun that is half below the horizon, the half above it counts."""
        light = Light("sun", "directional", (1.0, -math.tan(math.radians(5.0)), 0.0), radius=math.radians(20.0))
        view = self._looking([self._shape("box", [8.0, 1.0, 8.0], (0.0, -0.5, 0.0))], light, 32)
        truth = tracing.trace(view, pixel_samples=1)
        assert truth.receivers.any()
        assert (truth.visibility[truth.receivers] == 1).all()

    def behind(self) -> None:
        """What stands behind a lamp casts no shadow."""
        light = Light("disc", "disc", (0.0, -1.0, 0.0), (0.0, 2.0, 0.0), radius=0.5)
        view = self._looking([self._shape("plane", 8.0), self._shape("plane", 1.5, (0.0, 2.5, 0.0))], light, 32)
        truth = tracing.trace(view, pixel_samples=1)
        ground_shown = truth.receivers & (truth.triangle < 2)
        assert ground_shown.any()
        assert (truth.visibility[ground_shown] == 1).all()

    def irradiance(self) -> None:
        """Weighted by N·ω, the part of the sun that is high above the horizon counts for more."""
        light = Light("sun", "directional", vec3(-unit(TOWARD)), radius=SUN_RADIUS)
        view = self._view(light)
        truth = tracing.trace(view, pixel_samples=1)
        shown, points = ground(view, truth, self._pixel_rays)
        shown &= (truth.visibility.ravel() > 0.4) & (truth.visibility.ravel() < 0.6)
        pixel = np.flatnonzero(shown)[0]
        below, turn = np.meshgrid((np.arange(300) + 0.5) / 300, (np.arange(300) + 0.5) / 300 * 2 * math.pi)
        cosine = 1 - below * (1 - math.cos(SUN_RADIUS))
        sine = np.sqrt(1 - cosine**2)
        local = np.stack([sine * np.cos(turn), sine * np.sin(turn), cosine], axis=-1).reshape(-1, 3)
        toward = local @ perpendicular_basis(unit(TOWARD), (0.0, 1.0, 0.0))
        seen = toward @ edge_normals(points[pixel : pixel + 1], 1.0)[0] > 0
        expected = toward[seen, 1].sum() / toward[:, 1].sum()
        assert truth.irradiance.ravel()[pixel] == pytest.approx(expected, abs=4 * STANDARD_ERROR)
        assert abs(truth.visibility.ravel()[pixel] - expected) > 8 * STANDARD_ERROR

    def errors(self) -> None:
        """Errors are as their replications say, and independent between neighbours."""
        view = self._view(Light("sun", "directional", vec3(-unit(TOWARD)), radius=SUN_RADIUS))
        light = view.placed()[0].light
        rays, receivers = receivers_of(view)
        pilot = self._sums(rays, light, 98).sums(receivers, 64, 1, 0).visibility
        chosen = receivers.select((pilot > 0.05) & (pilot < 0.95) & (receivers.rays // view.size % 4 == 0))
        best = self._sums(rays, light, 99).sums(chosen, 4096, 8, 0).visibility
        found = [self._sums(rays, light, seed).sums(chosen, 64, 8, 0) for seed in range(SCRAMBLES)]
        wrong = np.array([sums.visibility - best for sums in found])
        z = wrong / np.maximum([sums.spread for sums in found], 1 / 512)
        assert 1.0 < z.var() < 1.7
        assert abs(neighbours(wrong, chosen.rays, view.size)) < 0.1

    def _sums(self, rays: ViewRays, light: Light, seed: int) -> soft.Estimator:
        return self._estimator(rays, light, OFFSET, seed)


FAULTS = {
    "one scramble for all pixels": (
        "errors",
        "light_samples",
        "_mixed(receivers.astype(np.uint64))",
        "_mixed(0 * receivers.astype(np.uint64))",
    ),
    "no replication": (
        "errors",
        "light_samples",
        "+ np.arange(replications, dtype=np.uint64)",
        "+ 0 * np.arange(replications, dtype=np.uint64)",
    ),
    "standard deviation for standard error": ("errors", "soft", "(count * (count - 1))", "(count - 1)"),
    "radius for diameter": ("sun", "light_samples", "2.0 * np.sin(radius / 2) ** 2", "2.0 * np.sin(radius / 4) ** 2"),
    "a flat disc for a cone": ("sun", "light_samples", "versine * (2.0 - below)", "versine * 2.0"),
    "corners of a square for a disc": (
        "sun",
        "light_samples",
        "angle = (np.pi / 4) * (b if wide else a) / radius",
        "angle = 0.2 * (b if wide else a) / radius",
    ),
    "penumbra not widened": ("sun", "soft", "DILATION = 2", "DILATION = 0"),
    "points below the horizon count": ("half_set", "light_samples", "share[i] if facing > 0.0 else 0.0", "share[i]"),
    "cosine forgotten": ("irradiance", "soft", "weight * cosine, seen * cosine", "weight, seen"),
    "tangent for sine": (
        "sphere",
        "light_samples",
        "radius * radius / squared, 1.0",
        "radius * radius / (squared + radius * radius), 1.0",
    ),
    "width for height": (
        "rectangle",
        "light_samples",
        "light.size[0] / 2, light.size[1] / 2",
        "light.size[1] / 2, light.size[0] / 2",
    ),
    "uniform in area": (
        "rectangle",
        "light_samples",
        "_SMALL = 0.05",
        "_SMALL = 50.0",
        "(far / distance[i]) ** 3",
        "1.0",
    ),
    "a square for a disc": ("disc", "light_samples", "<= radius * radius else 0.0", "<= 2 * radius * radius else 0.0"),
    "rays beyond the light": ("behind", "light_samples", "max(distance[i] - along, 0.0) if", "1e30 if"),
}


@pytest.fixture
def planted(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Iterator[Callable[..., type[soft.Estimator]]]:
    """Copies of both modules, one of them with edits, in place of those that `trace` uses."""
    names = ("light_samples", "soft")

    def plant(where: str = "", *edits: str) -> type[soft.Estimator]:
        loaded: dict[str, ModuleType] = {}
        for name, original in zip(names, (light_samples, soft), strict=True):
            source = text = Path(str(original.__file__)).read_text(encoding="utf-8")
            if name == where:
                for before, after in zip(edits[::2], edits[1::2], strict=True):
                    assert text.count(before) == 1, f"{before!r} occurs {text.count(before)} times"
                    text = text.replace(before, after)
            file = tmp_path / f"{name}.py"
            file.write_text(text.replace("shadowbench.truths.light_samples", "planted_light_samples"), encoding="utf-8")
            spec = importlib.util.spec_from_file_location(f"planted_{name}", file)
            assert spec is not None
            assert spec.loader is not None
            loaded[name] = importlib.util.module_from_spec(spec)
            monkeypatch.setitem(sys.modules, f"planted_{name}", loaded[name])
            spec.loader.exec_module(loaded[name])
            if name == "light_samples" and text.endswith(source[source.index(COMPILED) :]):
                loaded[name].__dict__["_fill_rays"] = light_samples._fill_rays  # compiling takes 3 s
        monkeypatch.setattr(soft, "soft_shadows", loaded["soft"].soft_shadows)
        estimator: type[soft.Estimator] = loaded["soft"].Estimator
        return estimator

    return plant


@pytest.mark.slow
def test_without_a_fault_all_checks_pass(
    planted: Callable[..., type[soft.Estimator]], shape: Shape, looking: Looking, pixel_rays: Rays
) -> None:
    checks = Checks(planted(), shape, looking, pixel_rays)
    for name in {fault[0] for fault in FAULTS.values()}:
        getattr(checks, name)()


@pytest.mark.slow
@pytest.mark.parametrize("fault", FAULTS.values(), ids=FAULTS)
def test_a_planted_fault_fails_its_check(
    fault: tuple[str, ...],
    planted: Callable[..., type[soft.Estimator]],
    shape: Shape,
    looking: Looking,
    pixel_rays: Rays,
) -> None:
    name, where, *edits = fault
    checks = Checks(planted(where, *edits), shape, looking, pixel_rays)
    with pytest.raises(AssertionError):
        getattr(checks, name)()
