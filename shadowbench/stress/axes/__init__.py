"""The axes along which `stress` walks until a technique breaks."""

from shadowbench.stress.axes.casters import GAP, OVERLAP, THICKNESS, TRIANGLES
from shadowbench.stress.axes.lights import ELEVATION, FAR_NEAR, LAMP_DISTANCE, UP
from shadowbench.stress.axes.meshes import MESH
from shadowbench.stress.axes.model import Axis, Setting, Value, shown
from shadowbench.stress.axes.motion import CAMERA_STEP, LIGHT_STEP, VOLUME_WALL
from shadowbench.stress.axes.places import DISTANCE, DISTANCE_ABSOLUTE, SCALE
from shadowbench.stress.axes.sizes import DEPTH_FORMAT, MAP_TEXELS, VIEW_PIXELS

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
        VOLUME_WALL,
        MESH,
        OVERLAP,
        TRIANGLES,
        CAMERA_STEP,
        LIGHT_STEP,
    )
}
"""All axes by name, in the order of the table."""

__all__ = ["AXES", "Axis", "Setting", "Value", "shown"]
