# EEVEE: https://docs.blender.org/manual/en/latest/render/eevee/light_settings.html
import math
import tempfile
from pathlib import Path

import bpy
import gpu
import numpy as np
from mathutils import Matrix, Vector

Y_UP = Matrix(((1, 0, 0, 0), (0, 0, -1, 0), (0, 1, 0, 0), (0, 0, 0, 1)))  # from glTF to Blender, where z is up


def open(width, height):
    render = bpy.context.scene.render
    render.engine, render.resolution_x, render.resolution_y = "BLENDER_EEVEE", 8, 8
    bpy.ops.render.render()  # before which the renderer has no name
    return bpy.app.version_string, gpu.platform.renderer_get()


def load(model, view):
    bpy.ops.wm.read_factory_settings(use_empty=True)
    bpy.ops.import_scene.gltf(filepath=str(model))
    for item in [item for item in bpy.data.objects if item.type in ("LIGHT", "CAMERA")]:
        bpy.data.objects.remove(item)
    scene = bpy.context.scene
    scene.camera = bpy.data.objects.new("camera", bpy.data.cameras.new("camera"))
    scene.camera.data.sensor_fit = "VERTICAL"
    scene.collection.objects.link(scene.camera)
    scene.world = None
    render = scene.render
    render.engine = "BLENDER_EEVEE"
    render.resolution_x, render.resolution_y = view["image"]["width"], view["image"]["height"]
    render.filter_size, render.dither_intensity, scene.eevee.light_threshold = 0, 0, 1e-4
    render.image_settings.file_format, render.image_settings.color_depth = "OPEN_EXR", "32"


def draw(camera, light, box, params, shadows, exposure):
    scene, directional = bpy.context.scene, light["kind"] == "directional"
    eye = scene.camera.data
    scene.camera.matrix_world = Y_UP @ Matrix(camera["view"]).inverted()
    eye.type = "ORTHO" if camera["height"] else "PERSP"
    if camera["height"]:
        eye.ortho_scale = camera["height"]
    else:
        eye.angle = math.radians(camera["fov_y"])
    eye.clip_start, eye.clip_end = camera["near"], camera["far"]
    data = bpy.data.lights.new("light", "SUN" if directional else light["kind"].upper())
    data.use_shadow = scene.eevee.use_shadows = shadows
    data.energy = math.pi * exposure if directional else (2 * math.pi * box["near"]) ** 2 * exposure
    data.shadow_filter_radius, data.shadow_maximum_resolution = params["radius"], params["resolution"]
    if directional:
        data.angle = 0
    else:
        data.shadow_soft_size = 0
    if light["kind"] == "spot":
        data.spot_size, data.spot_blend = math.radians(light["cone"]), 0
    eevee = scene.eevee
    eevee.taa_render_samples, eevee.shadow_resolution_scale = params["samples"], params["scale"]
    eevee.shadow_ray_count, eevee.shadow_step_count = params["rays"], params["steps"]
    lamp = bpy.data.objects.new("light", data)
    lamp.location = Y_UP @ Vector(light["position"] or (0, 0, 0))
    lamp.rotation_euler = (Y_UP @ Vector(light["direction"] or (0, -1, 0))).to_track_quat("-Z", "Y").to_euler()
    scene.collection.objects.link(lamp)
    with tempfile.TemporaryDirectory() as folder:
        scene.render.filepath = str(Path(folder, "picture.exr"))
        bpy.ops.render.render(write_still=True)
        image = bpy.data.images.load(scene.render.filepath)
        image.colorspace_settings.name = "Non-Color"
        pixels = np.empty(image.size[0] * image.size[1] * 4, np.float32)
        image.pixels.foreach_get(pixels)
    bpy.data.lights.remove(data)
    picture = pixels.reshape(image.size[1], image.size[0], 4)[::-1]
    bpy.data.images.remove(image)
    return picture
