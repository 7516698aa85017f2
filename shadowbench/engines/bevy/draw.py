# Bevy by pybevy: https://docs.rs/bevy/0.18.0/bevy/light/struct.DirectionalLight.html
import os
import shutil
import tempfile
from importlib import metadata

import numpy as np

FOLDER = tempfile.TemporaryDirectory()
os.chdir(FOLDER.name)  # below which Bevy looks for assets/, from its first import on
os.mkdir("assets")

import pybevy  # noqa: E402

bevy, readback = pybevy.prelude, pybevy._pybevy.render_readback
app = eye = image = lamp = size = None


def open(width, height):
    return metadata.version("pybevy"), "Vulkan"


def load(model, view):
    global app, size
    shutil.copy(model, "assets")
    plugins = bevy.DefaultPlugins().set(bevy.WindowPlugin(primary_window=None)).disable(pybevy.winit.WinitPlugin)
    compiled = pybevy.render.RenderPlugin(synchronous_pipeline_compilation=True)  # or pictures lack what is not yet
    app = bevy.App().add_plugins(plugins.set(compiled), readback.ImageCopyPlugin())
    app.insert_resource(bevy.GlobalAmbientLight(brightness=0.0)).add_systems(bevy.Update, smooth).initialize()
    size = view["image"]
    app.world(lambda world: start(world, **size))
    readback.spawn_image_copier(app, eye.to_bits(), image, *size.values())


def start(world, width, height):
    global eye, image, lamp
    world.spawn(bevy.SceneRoot(world.resource(bevy.AssetServer).load_scene("scene.glb#Scene0")))
    image = world.resource(bevy.Assets[bevy.Image]).add(bevy.Image.new_render_target(width=width, height=height))
    black = bevy.Camera(clear_color=bevy.ClearColorConfig.Custom(bevy.Color.BLACK))
    kind = bevy.Camera3d(), black, pybevy.camera.RenderTarget.image(image), bevy.Tonemapping.NONE, bevy.Msaa.Off
    eye = world.spawn(*kind, bevy.Transform()).id()
    lamp = world.spawn(bevy.Transform()).id()


def seen(position, target, up):
    return bevy.Transform.from_translation(bevy.Vec3(*position)).looking_at(bevy.Vec3(*target), bevy.Vec3(*up))


def smooth(meshes: bevy.Query[bevy.MeshMaterial3d], materials: bevy.ResMut[bevy.Assets[bevy.StandardMaterial]]) -> None:
    for mesh in meshes:
        if (material := materials.get_mut(mesh.handle())) and material.reflectance:
            material.reflectance, material.perceptual_roughness = 0.0, 0.5  # as near to Lambert's as its diffuse gets


def change(world, camera, light, box, params, shadows, exposure):
    lens = bevy.PerspectiveProjection(np.radians(camera["fov_y"]), camera["aspect"], camera["near"], camera["far"])
    pose = seen(camera["position"], camera["target"], camera["up"])
    filtered = getattr(pybevy.light.ShadowFilteringMethod, params["filter"])
    world.entity(eye).insert(bevy.Projection.Perspective(lens), pose, filtered)
    position, along, cone = light["position"] or (0, 0, 0), light["direction"], np.radians((light["cone"] or 0) / 2)
    own = {"shadows_enabled": shadows, "shadow_depth_bias": params["bias"], "shadow_normal_bias": params["normal_bias"]}
    if light["kind"] == "spot":
        cut = {"range": 100 * box["far"], "outer_angle": cone, "inner_angle": cone * 0.9999}
        what = [bevy.SpotLight(intensity=4e4 * box["near"] ** 2 * exposure, **cut, **own)]
    else:
        ends = pybevy.light.CascadeShadowConfig(bounds=[end * params["distance"] / 150 for end in (10, 28, 78, 150)])
        what = [bevy.DirectionalLight(illuminance=3000.0 * exposure, **own), ends]
    world.entity(lamp).insert(*what, seen(position, np.add(position, along), np.eye(3)[np.argmin(np.abs(along))]))
    world.insert_resource(pybevy.light.DirectionalLightShadowMap(size=params["size"]))


def draw(**request):
    app.world(lambda world: change(world, **request))
    last, same = None, 0
    while same < 8:  # a scene is loaded in the meantime, and a picture comes frames late
        app.update()
        if frame := readback.try_receive_frame(app, eye.to_bits()):
            same = same + 1 if frame == last and np.frombuffer(frame, np.uint8).reshape(-1, 4)[:, :3].any() else 0
            last = frame
    return np.frombuffer(last, np.uint8).reshape(size["height"], -1, 4)[:, : size["width"]]  # rows are padded
