"""The axes of `stress`: parameters that it drives to extreme values."""

from shadowbench.extremes import casters, cutouts, lights, views
from shadowbench.extremes.model import Axis

AXES: dict[str, Axis] = {
    axis.name: axis
    for axis in (
        *(lights.elevation, lights.through_up, lights.far_near),
        *(views.distance, views.distance_absolute, views.scale, views.depth_format, views.map_size, views.view_size),
        *(casters.thickness, casters.gap, lights.lamp_distance, lights.light_size, views.volume_wall),
        *(casters.defects, casters.overlap, casters.layers, casters.triangles, cutouts.leaf_size, cutouts.cards),
        *(casters.smoothness, views.camera_step, views.light_step),
    )
}
"""All axes by name, in the order of tables."""
