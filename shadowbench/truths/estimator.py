"""Estimates of how much of a light with a size is seen, by shadow rays."""

from dataclasses import dataclass

import numpy as np

from shadowbench.scenes.model import Light
from shadowbench.scenes.vectors import Floats
from shadowbench.truths.embree import over_slices
from shadowbench.truths.light_samples import LightSampler, scrambles_of
from shadowbench.truths.rays import Receivers, ViewRays

_RAYS_A_BLOCK = 1 << 16


@dataclass(frozen=True, eq=False)
class Sums:
    """Weights, weights of the points seen, and both times N·ω, summed over each replication: (R, replications)."""

    weight: Floats
    seen: Floats
    weight_cosine: Floats
    seen_cosine: Floats

    @property
    def visibility(self) -> Floats:
        """(R,) share of the light that is seen, of the part above the receiver's plane; NaN if there is none."""
        with np.errstate(invalid="ignore"):
            share: Floats = self.seen.sum(axis=1) / self.weight.sum(axis=1)
        return share

    @property
    def spread(self) -> Floats:
        """(R,) standard error of `visibility` by the replications alone, a ratio estimator (Cochran 1977, 2.11)."""
        count = self.weight.shape[1]
        residual = self.seen - self.visibility[:, np.newaxis] * self.weight
        mean = np.maximum(self.weight.mean(axis=1), np.finfo(np.float32).tiny)
        spread: Floats = np.sqrt((residual**2).sum(axis=1) / (count * (count - 1))) / mean
        return spread


class Estimator:
    """Visibility of a light from receivers by shadow rays that start δ above them; other seeds take other points."""

    def __init__(self, rays: ViewRays, light: Light, delta: float, seed: int = 0) -> None:
        self._rays, self._delta, self._seed = rays, delta, seed
        self._sampler = LightSampler(light)

    def sums(
        self, receivers: Receivers, samples: int, replications: int, purpose: int, along_normal: bool = False
    ) -> Sums:
        """Sums for each receiver. Points depend on the camera ray's index and on `purpose` alone."""
        normals = self._rays.normals(receivers.triangle)
        size = max(1, _RAYS_A_BLOCK // (samples * replications))

        def work(part: slice) -> Floats:
            scrambles = scrambles_of(receivers.rays[part], replications, self._seed << 16 | purpose)
            points, normal = np.ascontiguousarray(receivers.point[:, part]), np.ascontiguousarray(normals[:, part])
            origins, directions, reach, weight, cosine = self._sampler.rays(
                points, normal, scrambles, samples, self._delta, along_normal
            )
            seen = weight * ~self._rays.blocked(origins, directions, reach)
            values = np.stack([weight, seen, weight * cosine, seen * cosine])
            totals: Floats = values.reshape(4, -1, replications, samples).sum(axis=3, dtype=np.float64)
            return totals

        parts = list(over_slices(work, len(receivers.rays), size))
        return Sums(*np.concatenate(parts, axis=1)) if parts else Sums(*np.zeros((4, 0, replications)))
