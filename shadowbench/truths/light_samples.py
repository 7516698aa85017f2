"""Points on a light, one stratified set for each receiver, and the shadow rays towards them.

Each replication of each receiver draws one of TABLES scrambled Sobol sets (Matoušek 1998) and shifts it by random bits,
so that replications are unbiased and errors of neighbouring pixels independent. With the shift alone, straight edges
would interfere with the set's structure: errors would have heavier tails than their replications show.

Suns and spheres are sampled uniformly in their cone of directions. A rectangle is sampled uniformly in its solid angle
(Ureña, Fajardo, King 2013, "An area-preserving parametrization for spherical rectangles"), or, if it is small as seen
from the receiver, in its area with the weight cos/d². A disc is the part of its bounding square, so sampled, that lies
inside it.
"""

from functools import cache

import numba
import numpy as np
from numpy.typing import NDArray

from shadowbench.compiled import compiled
from shadowbench.scenes.model import Light
from shadowbench.scenes.vectors import Floats, perpendicular_basis, unit

Single = NDArray[np.float32]

MOST_SAMPLES = 1 << 12  # of a replication
TABLES = 64
LONGEST_OFFSET = 100.0  # δ; a ray starts δ above the receiver unless light grazes it
_CONE_OF_SUN, _CONE_OF_SPHERE, _RECTANGLE, _DISC = range(4)
_SMALL = 0.05  # half diagonal of a rectangle over its distance, below which it is sampled by area
_INFINITE = 1e30


class LightSampler:
    """Sampler of the points of a light that has a size, in local coordinates."""

    def __init__(self, light: Light) -> None:
        kinds = {"directional": _CONE_OF_SUN, "disc": _DISC, "rectangle": _RECTANGLE}
        self._kind = kinds.get(light.kind, _CONE_OF_SPHERE)
        half_width, half_height = light.size[0] / 2, light.size[1] / 2
        if light.kind == "disc":
            half_width = half_height = light.radius
        center = np.array(light.homogeneous[0])
        right, up, back = perpendicular_basis(-unit(light.direction), light.up)
        # The axes of the rectangle point to where the light shines from: z along its normal.
        self._light = np.array([center, right, up, -back, [half_width, half_height, light.radius]])

    def rays(
        self,
        points: Floats,
        normals: Floats,
        scrambles: NDArray[np.uint32],
        samples: int,
        delta: float,
        along_normal: bool = False,
    ) -> tuple[Single, Single, Single, Single, Single]:
        """Rays to `samples` points of the light, best a power of 2, from each receiver, in each replication.

        points, normals: (3, R); scrambles: (3, R, replications). Rays start at the height `delta` above the receiver,
        along the ray or `along_normal`, and end as far before a disc or rectangle. Returns origins and directions
        (3, M), reach, weight, 0 for points below the receiver's plane, and N·ω, each (M,), by receiver first.
        """
        count = scrambles.shape[1] * scrambles.shape[2] * samples
        origins, directions = np.empty((3, count), np.float32), np.empty((3, count), np.float32)
        reach, weight, cosine = (np.empty(count, np.float32) for _ in range(3))
        arrays = (origins, directions, reach, weight, cosine)
        given = (points, normals, scrambles, _tables(), samples, delta, 1.0 if along_normal else 0.0)
        _fill_rays(self._kind, self._light, *given, *arrays)
        return arrays


def scrambles_of(receivers: NDArray[np.intp], replications: int, purpose: int) -> NDArray[np.uint32]:
    """(3, R, replications) two digital shifts and a table, by receiver, replication and purpose, a number, alone."""
    use = np.uint64(purpose << 8) + np.arange(replications, dtype=np.uint64)
    index = _mixed(receivers.astype(np.uint64))[:, np.newaxis] + use
    shifts, table = _mixed(index), _mixed(~index) % np.uint64(TABLES)
    return np.stack([shifts >> np.uint64(32), shifts & np.uint64(0xFFFFFFFF), table]).astype(np.uint32)


def _mixed(values: NDArray[np.uint64]) -> NDArray[np.uint64]:
    """Random bits of each number (splitmix64, Steele, Lea, Flood 2014)."""
    mixed = (values + np.uint64(1)) * np.uint64(0x9E3779B97F4A7C15)
    mixed = (mixed ^ (mixed >> np.uint64(30))) * np.uint64(0xBF58476D1CE4E5B9)
    mixed = (mixed ^ (mixed >> np.uint64(27))) * np.uint64(0x94D049BB133111EB)
    return mixed ^ (mixed >> np.uint64(31))


@cache
def _tables() -> NDArray[np.uint32]:
    """(TABLES, 2, MOST_SAMPLES) Sobol points as 32-bit fractions, scrambled by random lower triangular matrices."""
    index = np.arange(MOST_SAMPLES)
    bits, directions = np.zeros((2, MOST_SAMPLES), np.uint32), np.full((2, 1), 1 << 31, np.uint32)
    for place in range(int(index[-1]).bit_length()):  # by Gray code; scipy.stats has the points, and takes 0.6 s
        bits ^= ((index ^ index >> 1) >> place & 1).astype(np.uint32) * directions
        directions = np.vstack([directions[:1] >> 1, directions[1:] ^ directions[1:] >> 1])
    tables = np.zeros((TABLES, *bits.shape), dtype=np.uint32)
    rows = _mixed(np.arange(TABLES * 2 * 32, dtype=np.uint64)).astype(np.uint32).reshape(TABLES, 2, 32, 1)
    for row in range(32):  # of the matrices, each giving a bit of the fraction, the highest first
        own = np.uint32(1 << 31 - row)
        higher = np.uint32(0xFFFFFFFF ^ (2 * int(own) - 1))
        tables |= (np.bitwise_count(bits & (rows[:, :, row] & higher | own)) & 1).astype(np.uint32) * own
    return tables


_fast = {"contract", "nsz", "reassoc"}  # keeps NaN, infinity and division; without it, no loop is vectorised


@numba.njit(inline="always")
def _fraction(bits, shift):  # type: ignore[no-untyped-def]
    """The middle of a 24-bit fraction's interval in (0, 1), after a digital shift; int32, for its quick conversion."""
    return np.float64(np.int32(np.uint32(bits ^ shift) >> np.uint32(8))) * 2.0**-24 + 2.0**-25


@numba.njit(inline="always")
def _sine(x):  # type: ignore[no-untyped-def]
    """Sine to 1e-11 without branches: the Taylor series in [−π/2, π/2]."""
    turns = np.floor(x * (1 / np.pi) + 0.5)
    y = x - turns * np.pi
    z = y * y
    series = 1 - z * (1 / 6) * (
        1 - z * (1 / 20) * (1 - z * (1 / 42) * (1 - z * (1 / 72) * (1 - z * (1 / 110) * (1 - z * (1 / 156)))))
    )
    return y * series * (1 - 2 * (turns - 2 * np.floor(turns * 0.5)))


@numba.njit(inline="always")
def _tangents(x, y, z):  # type: ignore[no-untyped-def]
    """Two unit vectors perpendicular to a unit vector and to each other (Duff et al. 2017)."""
    sign = np.copysign(1.0, z)
    a = -1.0 / (sign + z)
    b = x * y * a
    return 1.0 + sign * x * x * a, sign * b, -sign * x, b, sign + y * y * a, -y


@numba.njit(error_model="numpy", fastmath=_fast)
def _cone(ax, ay, az, versine, us, vs, shift_u, shift_v, x, y, z):  # type: ignore[no-untyped-def]
    """Directions uniform in a cone around (ax, ay, az) whose half angle has the cosine 1 − `versine`."""
    # The square is mapped to the disc (Shirley, Chiu 1997), and the disc's area to the cone's solid angle.
    sx, sy, sz, tx, ty, tz = _tangents(ax, ay, az)
    for i in range(len(x)):
        a = 2.0 * _fraction(us[i], shift_u) - 1.0
        b = 2.0 * _fraction(vs[i], shift_v) - 1.0
        wide = abs(a) > abs(b)
        radius = a if wide else b
        angle = (np.pi / 4) * (b if wide else a) / radius
        q = angle * angle
        cosine = 1 - q * (1 / 2) * (1 - q * (1 / 12) * (1 - q * (1 / 30) * (1 - q * (1 / 56) * (1 - q * (1 / 90)))))
        sine = angle * (1 - q * (1 / 6) * (1 - q * (1 / 20) * (1 - q * (1 / 42) * (1 - q * (1 / 72)))))
        below = radius * radius * versine
        across = radius * np.sqrt(versine * (2.0 - below))
        s, t, ahead = across * (cosine if wide else sine), across * (sine if wide else cosine), 1.0 - below
        x[i] = s * sx + t * tx + ahead * ax
        y[i] = s * sy + t * ty + ahead * ay
        z[i] = s * sz + t * tz + ahead * az


@numba.njit(error_model="numpy", fastmath=_fast)
def _solid_angle(x0, x1, y0, y1, z, us, vs, shift_u, shift_v, x, y):  # type: ignore[no-untyped-def]
    """Points uniform in the solid angle of a rectangle in the plane z < 0, as seen from the origin (Ureña et al.)."""
    b0, b1 = -y0 / np.sqrt(z * z + y0 * y0), y1 / np.sqrt(z * z + y1 * y1)
    c0, c1 = x1 / np.sqrt(z * z + x1 * x1), -x0 / np.sqrt(z * z + x0 * x0)
    k = 2 * np.pi - np.arccos(-b1 * c1) - np.arccos(-c1 * b0)
    angle = np.arccos(-b0 * c0) + np.arccos(-c0 * b1) - k
    for i in range(len(x)):
        au = _fraction(us[i], shift_u) * angle + k
        fu = (_sine(au + np.pi / 2) * b0 - b1) / _sine(au)
        cu = np.copysign(1.0, fu) / np.sqrt(fu * fu + b0 * b0)
        qx = -cu * z / np.sqrt(max(1.0 - cu * cu, 1e-30))
        qx = min(max(qx, x0), x1)
        d = qx * qx + z * z
        h0, h1 = y0 / np.sqrt(d + y0 * y0), y1 / np.sqrt(d + y1 * y1)
        h = h0 + _fraction(vs[i], shift_v) * (h1 - h0)
        qy = h * np.sqrt(d / max(1.0 - h * h, 1e-30))
        x[i], y[i] = qx, min(max(qy, y0), y1)


@numba.njit(error_model="numpy", fastmath=_fast)
def _area(x0, x1, y0, y1, us, vs, shift_u, shift_v, x, y):  # type: ignore[no-untyped-def]
    """Points uniform in the area of a rectangle."""
    for i in range(len(x)):
        x[i] = x0 + _fraction(us[i], shift_u) * (x1 - x0)
        y[i] = y0 + _fraction(vs[i], shift_v) * (y1 - y0)


@numba.njit(error_model="numpy", fastmath=_fast)
def _to_world(rx, ry, rz, ux, uy, uz, ax, ay, az, plane, x, y, z, distance):  # type: ignore[no-untyped-def]
    """Points in the rectangle's axes, relative to the receiver, to unit vectors and distances."""
    for i in range(len(x)):
        qx, qy = x[i], y[i]
        d = np.sqrt(qx * qx + qy * qy + plane * plane)
        x[i] = (qx * rx + qy * ux + plane * ax) / d
        y[i] = (qx * ry + qy * uy + plane * ay) / d
        z[i] = (qx * rz + qy * uz + plane * az) / d
        distance[i] = d


@numba.njit(error_model="numpy", fastmath=_fast)
def _start(  # type: ignore[no-untyped-def]
    px, py, pz, nx, ny, nz, delta, lift, x, y, z, distance, share, ox, oy, oz, dx, dy, dz, reach, weight, cosine
):
    """The rays towards the light points; `lift`: 1 to start along the normal, else 0."""
    for i in range(len(x)):
        wx, wy, wz = x[i], y[i], z[i]
        facing = nx * wx + ny * wy + nz * wz
        along = (1.0 - lift) * min(delta / max(facing, 1e-30), LONGEST_OFFSET * delta)
        used = share[i] if facing > 0.0 else 0.0
        ox[i] = px + wx * along + nx * (delta * lift)
        oy[i] = py + wy * along + ny * (delta * lift)
        oz[i] = pz + wz * along + nz * (delta * lift)
        dx[i], dy[i], dz[i] = wx, wy, wz
        reach[i] = max(distance[i] - along, 0.0) if used > 0.0 else 0.0
        weight[i] = used
        cosine[i] = facing


@compiled(error_model="numpy")
def _fill_rays(  # type: ignore[no-untyped-def]
    kind, light, points, normals, scrambles, tables, samples, delta, lift, origins, directions, reach, weight, cosine
):
    replications = scrambles.shape[2]
    cx, cy, cz = light[0]
    rx, ry, rz = light[1]
    ux, uy, uz = light[2]
    ax, ay, az = light[3]
    half_width, half_height, radius = light[4]
    x, y, z = np.empty(samples), np.empty(samples), np.empty(samples)
    distance, share = np.full(samples, _INFINITE), np.ones(samples)
    for receiver in range(scrambles.shape[1]):
        px, py, pz = points[0, receiver], points[1, receiver], points[2, receiver]
        nx, ny, nz = normals[0, receiver], normals[1, receiver], normals[2, receiver]
        vx, vy, vz = cx - px, cy - py, cz - pz
        squared = vx * vx + vy * vy + vz * vz
        far = np.sqrt(squared)
        for replication in range(replications):
            m = (receiver * replications + replication) * samples
            e = m + samples
            u, v, table = scrambles[:, receiver, replication]
            us, vs = tables[table, 0, :samples], tables[table, 1, :samples]
            if kind == _CONE_OF_SUN:
                _cone(cx, cy, cz, 2.0 * np.sin(radius / 2) ** 2, us, vs, u, v, x, y, z)
            elif kind == _CONE_OF_SPHERE:
                ratio = min(radius * radius / squared, 1.0)  # 1 inside the sphere
                wx, wy, wz = vx / far, vy / far, vz / far
                _cone(wx, wy, wz, ratio / (1.0 + np.sqrt(1.0 - ratio)), us, vs, u, v, x, y, z)
                for i in range(samples):
                    along = x[i] * vx + y[i] * vy + z[i] * vz
                    distance[i] = along - np.sqrt(max(along * along - squared + radius * radius, 0.0))
            else:
                qx, qy, qz = vx * rx + vy * ry + vz * rz, vx * ux + vy * uy + vz * uz, vx * ax + vy * ay + vz * az
                x0, x1, y0, y1 = qx - half_width, qx + half_width, qy - half_height, qy + half_height
                small = half_width * half_width + half_height * half_height < (_SMALL * _SMALL) * squared
                if small:
                    _area(x0, x1, y0, y1, us, vs, u, v, x, y)
                else:
                    _solid_angle(x0, x1, y0, y1, qz, us, vs, u, v, x, y)
                share[:] = 1.0
                if kind == _DISC:
                    for i in range(samples):
                        share[i] = 1.0 if (x[i] - qx) ** 2 + (y[i] - qy) ** 2 <= radius * radius else 0.0
                _to_world(rx, ry, rz, ux, uy, uz, ax, ay, az, qz, x, y, z, distance)
                if small:
                    for i in range(samples):  # cos/d² of the point, relative to that of the center
                        share[i] *= (far / distance[i]) ** 3
                for i in range(samples):  # to δ before the plane, so that a wall that a panel lies on does not block it
                    distance[i] -= min(delta * distance[i] / abs(qz), LONGEST_OFFSET * delta)
            _start(
                px, py, pz, nx, ny, nz, delta, lift, x, y, z, distance, share,
                origins[0, m:e], origins[1, m:e], origins[2, m:e],
                directions[0, m:e], directions[1, m:e], directions[2, m:e],
                reach[m:e], weight[m:e], cosine[m:e],
            )  # fmt: skip
