# Bevy by pybevy: https://docs.rs/bevy/0.18.0/bevy/light/struct.DirectionalLight.html
import math
import os
import tempfile
from importlib import metadata
from pathlib import Path

import numpy as np

FOLDER = tempfile.TemporaryDirectory()
os.chdir(FOLDER.name)  # below which Bevy looks for assets/, from its first import on
Path("assets").mkdir()

from pybevy import light as bl  # noqa: E402
from pybevy import prelude as bp  # noqa: E402
from pybevy._internal import render_readback  # noqa: E402
from pybevy.app import App, Startup, Update  # noqa: E402
from pybevy.camera import RenderTarget, Tonemapping  # noqa: E402
from pybevy.render import RenderPlugin  # noqa: E402
from pybevy.scene import SceneRoot  # noqa: E402
from pybevy.window import ExitCondition  # noqa: E402
from pybevy.winit import WinitPlugin  # noqa: E402

app = camera = image = side = count = pose = wanted = None
lamps = []


def open(size):
    global side, count
    side, count = size, 0
    return metadata.version("pybevy"), "Vulkan"


def load(glb, view):
    global app, count, pose
    count, pose = count + 1, view["camera"]
    lamps.clear()
    Path("assets", f"scene{count}.glb").write_bytes(glb)
    app = App()
    window = bp.WindowPlugin(primary_window=None, exit_condition=ExitCondition.DontExit)
    compiled = RenderPlugin(synchronous_pipeline_compilation=True)  # or pictures lack what is not yet
    app.add_plugins(bp.DefaultPlugins().set(window).set(compiled).disable(WinitPlugin))
    app.add_plugins(render_readback.ImageCopyPlugin())
    app.insert_resource(bl.GlobalAmbientLight(brightness=0.0))
    app.add_systems(Startup, start)
    app.add_systems(Update, change)
    app.add_systems(Update, smooth)
    app.initialize()
    app.update()
    render_readback.spawn_image_copier(app, camera.to_bits(), image, side, side)


def start(commands: bp.Commands, images: bp.ResMut[bp.Assets[bp.Image]], assets: bp.Res[bp.AssetServer]) -> None:
    global camera, image
    image = images.add(bp.Image.new_render_target(width=side, height=side))
    near, far, fov = pose["near"], pose["far"], math.radians(pose["fov_y"])
    lens = bp.PerspectiveProjection(fov=fov, near=near, far=far, aspect_ratio=1.0)
    black = bp.Camera(clear_color=bp.ClearColorConfig.Custom(bp.Color.BLACK))
    where = seen(pose["position"], pose["target"], pose["up"])
    what = bp.Camera3d(), black, RenderTarget.image(image), Tonemapping.NONE, bp.Msaa.Off
    camera = commands.spawn(*what, bp.Projection.Perspective(lens), where).id()
    commands.spawn(SceneRoot(assets.load_scene(f"scene{count}.glb#Scene0")))


def seen(position, target, up):
    return bp.Transform.from_translation(bp.Vec3(*position)).looking_at(bp.Vec3(*target), bp.Vec3(*up))


def smooth(meshes: bp.Query[bp.MeshMaterial3d], materials: bp.ResMut[bp.Assets[bp.StandardMaterial]]) -> None:
    for mesh in meshes:
        material = materials.get_mut(mesh.handle())
        if material and material.reflectance:
            material.reflectance, material.perceptual_roughness = 0.0, 0.5  # as near to Lambert's as its diffuse gets


def change(commands: bp.Commands) -> None:
    global wanted
    if not wanted:
        return
    light, box, params, shadows, exposure = wanted
    wanted = None
    while lamps:
        commands.entity(lamps.pop()).despawn()
    settings = {"shadow_depth_bias": params["bias"], "shadow_normal_bias": params["normal_bias"]}
    settings["shadows_enabled"] = shadows
    position = light["position"] or (0, 0, 0)
    up = np.eye(3)[np.argmin(np.abs(light["direction"]))]
    where = seen(position, np.add(position, light["direction"]), up)
    if light["kind"] == "spot":
        cone = math.radians(light["cone"] / 2)
        settings |= {"range": 100 * box["far"], "outer_angle": cone, "inner_angle": cone * 0.9999}
        what = (bl.SpotLight(intensity=4e4 * box["near"] ** 2 * exposure, **settings),)
    else:
        bounds = [bound * params["distance"] / 150 for bound in (10.0, 28.0, 78.0, 150.0)]
        lamp = bl.DirectionalLight(illuminance=3000.0 * exposure, **settings)
        what = lamp, bl.CascadeShadowConfig(bounds=bounds)
    lamps.append(commands.spawn(*what, where).id())
    commands.entity(camera).insert(getattr(bl.ShadowFilteringMethod, params["filter"]))


def draw(light, box, params, shadows, exposure):
    global wanted
    app.insert_resource(bl.DirectionalLightShadowMap(size=params["size"]))
    wanted = light, box, params, shadows, exposure
    last, same = None, 0
    while same < 8:  # a scene is loaded in the meantime, and a picture comes frames late
        app.update()
        frame = render_readback.try_receive_frame(app, camera.to_bits())
        if frame is not None:
            now = bytes(frame[0] if isinstance(frame, tuple) else frame)[: side * side * 4]
            same = same + 1 if now == last and np.frombuffer(now, np.uint8).reshape(-1, 4)[:, :3].any() else 0
            last = now
    return np.frombuffer(last, np.uint8).reshape(side, side, 4)
