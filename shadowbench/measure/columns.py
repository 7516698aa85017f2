"""The columns of `table.csv`: their names, in the order of the table, and what they mean."""

import re
from collections import ChainMap
from collections.abc import Mapping

from shadowbench.measure.time_rows import REDRAWN
from shadowbench.scores.metrics import METRICS, Metric
from shadowbench.scores.motion import MOTION

ROW_METRICS: Mapping[str, Metric] = ChainMap(dict(MOTION), METRICS)
"""All metrics that a row may have: those of a mask, plug-ins' among them, and those of several frames."""

IDENTITY = {
    "scene": "Scene.",
    "view": "Camera of the scene.",
    "light": "Light of the scene.",
    "phase": "Index of the sub-texel offset of the map's grid.",
    "technique": "Technique, or other engine.",
    "spec": "Technique with its parameters, as asked for, without the map size.",
    "map_size": "Texels along a side of a map, of one face or one cascade; empty without a map.",
    "view_size": "Height of the image in pixels.",
    "view_width": "Its width.",
    "renderer": "OpenGL renderer, of a software renderer with a digest of how it calculates, or `external: NAME`.",
    "status": "`ok`, `unsupported: …` or `failed: …`.",
}
TIMES = {
    "frame_ms": "Median time of a frame with every pass redrawn, in milliseconds.",
    "frame_iqr_ms": "Interquartile range of that time, in milliseconds.",
    "added_ms": "Time minus the time of `unshadowed`, in milliseconds.",
    "ratio": "Time divided by the time of the reference, timed in turn.",
    "n": "Number of timed rounds.",
    "clock": "How times are taken.",
}
COSTS = {
    "gpu_bytes": "Bytes of textures and buffers.",
    "prepare_ms": "Time of what is done once, before the first frame, in milliseconds.",
    "machine": "Digest of the machine on which the times were taken.",
    "command": "Command that measured the row.",
}
TRUTH_ERRORS = {
    "truth_error": "Standard error of a truth that has a penumbra, root mean square over receivers; a visibility of "
    "exactly 0 or 1 counts as exact.",
    "truth_error_pen": "The same over the penumbra.",
}
MORE = {
    "receivers": "Pixels whose surface faces the light, undecided ones among them.",
    "undecided": "Receivers that are not scored, as rounding decides their visibility.",
    "surface_mismatch": "Pixels in which the G-buffer shows another surface than the truth.",
    "coordinates": "`relative` to the scene's centre, or `absolute`.",
    "full_spec": "Spec with every parameter.",
    "mask_sha256": "Digest of the mask's 16-bit levels.",
    "assumptions": "What was assumed where the scene's file says nothing.",
    "key": "Digest of everything that the scores depend on.",
    "sequence": "Sequence whose frames were drawn in order; empty for a still view.",
    "frames": "Number of its frames. Metrics of one mask, work and facts are means over the frames, `gpu_bytes` is the "
    "largest; `mae_area`, times and all other columns are of the first.",
    **{name: one.help for name, one in MOTION.items()},
    "pop_frame": "Frame, from 0, to which `pop` belongs.",
    **TRUTH_ERRORS,
    "penumbra": "Pixels of the truth's penumbra.",
    "width_share": "Share of the lines across the penumbra along which `width` could be measured.",
    "width_bias": "Median log₂ of the drawn over the true width of penumbrae, above 0 where too wide.",
}
_MOVED = {"still": "every frame", "camera": "when the camera moves", "light": "when light or camera moves"}
TOTALS = {
    "wall_ms": "Wall time of a frame, in milliseconds.",
    **{f"{moved}_ms": f"Time of the passes redrawn {_MOVED[moved]}, in milliseconds." for moved in REDRAWN},
}
MORE_TIMES = {
    "ratio_iqr": "Interquartile range of `ratio`.",
    "reference": "Spec against which `ratio` is taken.",
    "reference_ms": "Median time of the reference in the same rounds, in milliseconds.",
    **TOTALS,
}
SOMETIMES = {
    "engine_version": "Version of another engine.",
    "box": "What an engine's map covers: a `given` box, or its `own`.",
    "sides": "Double-sided materials of an engine: those of open meshes (`closed`), or all (`double`).",
    "commit": "Commit of the code that measured a published row.",
}
FIXED = IDENTITY | TIMES | COSTS | MORE | MORE_TIMES | SOMETIMES
"""The columns that no metric, pass or technique names, and what they mean."""


_NAMED = re.compile(r"(pass_.+_ms|work_.+|fact_.+|bias_(of|factor)|run|processor|software)")


def is_taken(name: str) -> bool:
    """Whether a column other than a metric's may have this name."""
    return name in FIXED or _NAMED.fullmatch(name) is not None
