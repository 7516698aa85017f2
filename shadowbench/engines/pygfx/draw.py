# pygfx: https://docs.pygfx.org/stable/_autosummary/objects/pygfx.objects.LightShadow.html
import math

import numpy as np
import pygfx

renderer = scene = None


def open(width, height):
    global renderer
    target = pygfx.Texture(dim=2, size=(width, height, 1), format="rgba8unorm")
    renderer = pygfx.WgpuRenderer(target, pixel_ratio=1, ppaa="none")
    return pygfx.__version__, renderer.device.adapter.info["device"]


def load(model, view):
    global scene
    scene = pygfx.Scene().add(pygfx.load_gltf(str(model), quiet=True).scene)
    for node in list(scene.iter()):
        if isinstance(node, pygfx.Light | pygfx.Camera):
            node.parent.remove(node)
        elif isinstance(node, pygfx.Mesh):
            node.cast_shadow = node.receive_shadow = True


def draw(camera, light, box, params, shadows, exposure):
    planes, height, aspect = (camera["near"], camera["far"]), camera["height"], camera["aspect"]
    if height:
        eye = pygfx.OrthographicCamera(aspect * height, height, depth_range=planes)
    else:
        mean = np.tan(np.radians(camera["fov_y"]) / 2) * (1 + aspect) / 2  # of width and height, which its angle is of
        eye = pygfx.PerspectiveCamera(2 * np.degrees(np.arctan(mean)), aspect, depth_range=planes)
    eye.local.position = camera["position"]
    eye.local.reference_up = camera["up"]
    eye.look_at(camera["target"])
    kind = {"directional": pygfx.DirectionalLight, "spot": pygfx.SpotLight, "point": pygfx.PointLight}[light["kind"]]
    lamp = kind(intensity=np.pi * exposure, cast_shadow=shadows)
    lens = lamp.shadow.camera
    lamp.local.position = light["position"] or box["position"]
    if light["kind"] == "directional":
        lamp.target.local.position = box["target"]
        lens.local.reference_up = box["up"]
        lens.width, lens.height, lens.depth_range = box["width"], box["height"], (0, box["depth"])
    else:
        lens.depth_range = box["near"], box["far"]
    if light["kind"] == "spot":
        lamp.target.local.position = np.add(light["position"], light["direction"])
        lamp.angle = math.radians(light["cone"] / 2)
        lens.fov = 180 / math.pi * 2 * lamp.angle  # another one has pygfx set the depth range too
    lamp.shadow.bias, lamp.shadow.cull_mode = params["bias"], params["cull"]
    scene.add(lamp)
    renderer.render(scene, eye)
    scene.remove(lamp)
    return renderer.snapshot()
