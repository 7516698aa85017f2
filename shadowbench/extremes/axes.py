"""The axes of `stress`: parameters that it drives to extreme values."""

from shadowbench.extremes.casters import GAP, LAYERS, MESH, OVERLAP, THICKNESS, TRIANGLES
from shadowbench.extremes.lights import ELEVATION, FAR_NEAR, LAMP_DISTANCE, LIGHT_SIZE, UP
from shadowbench.extremes.model import Axis
from shadowbench.extremes.views import (
    CAMERA_STEP,
    DEPTH_FORMAT,
    DISTANCE,
    DISTANCE_ABSOLUTE,
    LIGHT_STEP,
    MAP_TEXELS,
    SCALE,
    VIEW_PIXELS,
    VOLUME_WALL,
)

AXES: dict[str, Axis] = {
    axis.name: axis
    for axis in (
        *(ELEVATION, UP, FAR_NEAR, DISTANCE, DISTANCE_ABSOLUTE, SCALE, DEPTH_FORMAT, MAP_TEXELS, VIEW_PIXELS),
        *(THICKNESS, GAP, LAMP_DISTANCE, LIGHT_SIZE, VOLUME_WALL, MESH, OVERLAP, LAYERS, TRIANGLES),
        *(CAMERA_STEP, LIGHT_STEP),
    )
}
"""All axes by name, in the order of tables."""
