"""Clips of a glTF at a time: which one, and what it sets.

glTF 2.0 specification, section 3.11 and appendix C, for interpolation.
"""

import bisect
import math
from collections.abc import Mapping

import numpy as np

from shadowbench.errors import InputError, NotInFile, alternatives
from shadowbench.scenes.contents import Chosen
from shadowbench.scenes.gltf_accessors import Data, as_floats, stored
from shadowbench.scenes.gltf_layout import Layout
from shadowbench.scenes.gltf_motion import Animation, Channel, Sampler
from shadowbench.scenes.gltf_storage import NUMBERS
from shadowbench.scenes.vectors import Floats

Pose = Mapping[tuple[int, str], Floats]
"""Values that replace those of a node: by its index, and translation, rotation, scale or weights."""
NO_CLIP = "none"
TYPES = {"translation": ("VEC3", 3), "rotation": ("VEC4", 4), "scale": ("VEC3", 3)}


def pose_at(data: Data, chosen: Chosen) -> tuple[Pose, list[str]]:
    """The pose of a file as chosen, and notes on the clip and on what it moves besides nodes. Raises InputError.

    Without animations, or with NO_CLIP, nodes stay as they stand. Before its first and after its last key a channel
    keeps the value of that key, as the specification demands.
    """
    layout, where = data.layout, data.where
    number = _number_of(layout, chosen.clip, where)
    if number is None:
        count = len(layout.animations)
        still = [f"{where}: none of {count} clip(s) taken: nodes stand as in the file"] if count else []
        return {}, still if chosen.time is None else [*still, f"{where}: time: no clip to pose"]
    clip = layout.animations[number]
    time = chosen.time or 0.0
    pose: dict[tuple[int, str], Floats] = {}
    samples: dict[tuple[int, str, int], tuple[Floats, float, float]] = {}  # each sampler's, which many may share
    first, last, lost = math.inf, -math.inf, 0
    for channel in clip.channels:
        kind, width = _kind_of(layout, channel)
        node = channel.target.node
        if node is None or not width:
            lost += 1
            continue
        key = channel.sampler, kind, width
        if key not in samples:
            samples[key] = _sampled(data, clip.samplers[channel.sampler], kind, width, time)
        value, start, end = samples[key]
        if channel.target.path == "rotation" and not (np.isfinite(value).all() and value.any()):
            raise InputError(
                f"{where}: animations {number + 1}: a rotation at {time:g} s is {value}; allowed: not zero"
            )
        pose[node, channel.target.path] = value
        first, last = min(first, start), max(last, end)
    notes = [_note(layout, number, time, first, last, where)]
    if lost:
        notes.append(
            f"{where}: {lost} channel(s) of the clip left out: they move no translation, rotation, scale or weights"
        )
    return pose, notes


def _number_of(layout: Layout, clip: str | None, where: str) -> int | None:
    """Index of the clip with a name or number, by default the first; None if none is asked for, or there is none."""
    names = [each.name for each in layout.animations]
    if clip is None:
        return 0 if names else None
    if clip in names:
        return names.index(clip)
    if clip == NO_CLIP:
        return None
    if clip.isdecimal() and 1 <= int(clip) <= len(names):
        return int(clip) - 1
    known = [f"{name:.60}" for name in names if name][:20]
    numbers = f"1 to {len(names)}" if names else "no others, as there are none"
    raise NotInFile(f"{where}: clip: found {clip!r:.60}{alternatives(clip, [*known, NO_CLIP])}, or {numbers}")


def _kind_of(layout: Layout, channel: Channel) -> tuple[str, int]:
    """Type of a channel's accessor, and the number of its values at a time: 0 for a channel that is left out."""
    if channel.target.node is None:
        return "", 0
    node = layout.nodes[channel.target.node]
    if channel.target.path == "weights" and node.mesh is not None:
        return "SCALAR", max((len(each.targets) for each in layout.meshes[node.mesh].primitives), default=0)
    # A matrix cannot be animated by the specification.
    return TYPES.get(channel.target.path, ("", 0)) if node.matrix is None else ("", 0)


def _sampled(data: Data, sampler: Sampler, kind: str, width: int, time: float) -> tuple[Floats, float, float]:
    """(width,) values of a sampler at a time, and the times of its first and last key. Raises InputError.

    Reads the values at the two keys around the time alone, as many samplers may share long accessors.
    """
    where = f"{data.where}: accessors {sampler.input + 1}"
    keys = stored(data, sampler.input, "SCALAR")[:, 0]
    accessor = data.layout.accessors[sampler.output]
    cubic = sampler.interpolation == "CUBICSPLINE"
    rows = width // NUMBERS[kind]
    each = rows * (3 if cubic else 1)
    if not len(keys) or accessor.count < len(keys) * each:
        raise InputError(
            f"{data.where}: accessors {sampler.output + 1}: {accessor.count} elements; needed are {each} for each of "
            f"{len(keys)} keys, and at least one key"
        )

    def value(key: int, part: int = 1 if cubic else 0) -> Floats:
        start = key * each + part * rows
        return as_floats(stored(data, sampler.output, kind, rows=slice(start, start + rows)), accessor).ravel()

    first, last = float(keys[0]), float(keys[-1])
    if not (math.isfinite(first) and math.isfinite(last)):
        raise InputError(f"{where}: times from {first:g} to {last:g}; allowed: finite ones, or the clip none")
    before = bisect.bisect_right(keys, time, key=float) - 1
    if before < 0 or before == len(keys) - 1 or sampler.interpolation == "STEP":
        return value(max(before, 0)), first, last
    start, end = float(keys[before]), float(keys[before + 1])
    if not start <= time < end:
        raise InputError(f"{where}: found a key at {start:g} s and the next at {end:g} s; allowed: times that increase")
    share = (time - start) / (end - start)
    if cubic:
        spline = _hermite(value(before), value(before, 2), value(before + 1), value(before + 1, 0), share, end - start)
        return spline, first, last
    between = slerp if kind == "VEC4" else _lerp
    return between(value(before), value(before + 1), share), first, last


def _lerp(a: Floats, b: Floats, share: float) -> Floats:
    return (1.0 - share) * a + share * b


def slerp(a: Floats, b: Floats, share: float) -> Floats:
    """Quaternion at a share of the shorter arc from one to another.

    scipy's Slerp may take the other way round for half a turn, which is common between keys.
    """
    a, b = (each / (np.linalg.norm(each) or 1.0) for each in (a, b))
    cosine = float(a @ b)
    b = -b if cosine < 0.0 else b
    angle = math.acos(min(abs(cosine), 1.0))
    if angle < 1e-6:  # where sin(angle) rounds; off by less than angle³
        return _lerp(a, b, share)
    return (math.sin((1.0 - share) * angle) * a + math.sin(share * angle) * b) / math.sin(angle)


def _hermite(a: Floats, out: Floats, b: Floats, into: Floats, share: float, duration: float) -> Floats:
    """Cubic spline from a, with the tangent `out`, to b, with the tangent `into`."""
    t, t2, t3 = share, share * share, share**3
    rise = duration * ((t3 - 2 * t2 + t) * out + (t3 - t2) * into)
    return (2 * t3 - 3 * t2 + 1) * a + (3 * t2 - 2 * t3) * b + rise


def _note(layout: Layout, number: int, time: float, first: float, last: float, where: str) -> str:
    clip: Animation = layout.animations[number]
    name = f" {clip.name!r:.60}" if clip.name else ""
    title = f"{where}: clip{name}, {number + 1} of {len(layout.animations)}"
    if first > last:
        return f"{title}, moves nothing"
    held = " (held at its end)" if time > last else " (held at its beginning)" if time < first else ""
    return f"{title}, from {first:.4g} to {last:.4g} s: posed at {time:.6g} s{held}; clip and time choose another"
