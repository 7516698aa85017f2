"""The stress axes: parameters that `stress` drives to extreme values."""

from shadowbench.extremes.axes.casters import GAP, LAYERS, OVERLAP, THICKNESS, TRIANGLES
from shadowbench.extremes.axes.lights import ELEVATION, FAR_NEAR, LAMP_DISTANCE, LIGHT_SIZE, UP
from shadowbench.extremes.axes.meshes import MESH
from shadowbench.extremes.axes.model import Axis, Setting, Value, value_label
from shadowbench.extremes.axes.motion import CAMERA_STEP, LIGHT_STEP, VOLUME_WALL
from shadowbench.extremes.axes.places import DISTANCE, DISTANCE_ABSOLUTE, SCALE
from shadowbench.extremes.axes.sizes import DEPTH_FORMAT, MAP_TEXELS, VIEW_PIXELS

AXES: dict[str, Axis] = {
    axis.name: axis
    for axis in (
        ELEVATION,
        UP,
        FAR_NEAR,
        DISTANCE,
        DISTANCE_ABSOLUTE,
        SCALE,
        DEPTH_FORMAT,
        MAP_TEXELS,
        VIEW_PIXELS,
        THICKNESS,
        GAP,
        LAMP_DISTANCE,
        LIGHT_SIZE,
        VOLUME_WALL,
        MESH,
        OVERLAP,
        LAYERS,
        TRIANGLES,
        CAMERA_STEP,
        LIGHT_STEP,
    )
}
"""All axes by name, in the order of tables."""

__all__ = ["AXES", "Axis", "Setting", "Value", "value_label"]
