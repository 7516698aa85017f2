# Panda3D: https://docs.panda3d.org/1.10/python/programming/render-attributes/lighting
import gltf
import numpy as np
from panda3d import core

Z_UP = core.LMatrix4(1, 0, 0, 0, 0, 0, 1, 0, 0, -1, 0, 0, 0, 0, 0, 1)  # rows: where x, y, z of glTF go
CULL = core.CullFaceAttrib  # what the light does not see
CULLED = {"both": CULL.M_cull_none, "front": CULL.M_cull_clockwise, "back": CULL.M_cull_counter_clockwise}
KINDS = {"directional": core.DirectionalLight, "spot": core.Spotlight, "point": core.PointLight}
engine = output = picture = scene = eye = None


def open(width, height):
    global engine, output, picture, eye
    core.load_prc_file_data("", "textures-power-2 none")
    engine, pipe = core.GraphicsEngine.get_global_ptr(), core.GraphicsPipeSelection.get_global_ptr().make_default_pipe()
    made = core.WindowProperties.size(width, height), core.GraphicsPipe.BF_refuse_window
    host = engine.make_output(pipe, "host", 0, core.FrameBufferProperties.get_default(), *made)
    frame = core.FrameBufferProperties()
    frame.float_color, frame.depth_bits = True, 32
    frame.set_rgba_bits(32, 32, 32, 32)
    output = engine.make_output(pipe, "picture", 1, frame, *made, host.get_gsg(), host)
    picture = core.Texture()
    output.add_render_texture(picture, core.GraphicsOutput.RTM_copy_ram)
    output.set_clear_color((0, 0, 0, 1))
    eye = core.NodePath(core.Camera("camera"))
    output.make_display_region().set_camera(eye)
    return core.PandaSystem.get_version_string(), output.get_gsg().get_driver_renderer()


def load(model, view):
    global scene
    scene = core.NodePath(gltf.load_model(str(model)))
    scene.clear_light()
    for material in scene.find_all_materials():
        material.set_refractive_index(1)  # else a roughness of 1 reflects 4% everywhere
    scene.set_shader_auto()
    scene.set_bin("unsorted", 0)  # in this order where surfaces meet
    eye.reparent_to(scene)


def place(node, position, target, up):
    node.set_pos(Z_UP.xform_point(core.LPoint3(*position)))
    node.look_at(core.LPoint3(Z_UP.xform_point(core.LPoint3(*target))), Z_UP.xform_vec(core.LVector3(*up)))


def draw(camera, light, box, params, shadows, exposure):
    height = camera["height"] or 2 * np.tan(np.radians(camera["fov_y"]) / 2)  # at unit distance
    lens = core.OrthographicLens() if camera["height"] else core.PerspectiveLens()
    lens.set_film_size(camera["aspect"] * height, height)
    if not camera["height"]:
        lens.set_focal_length(1)
    eye.node().set_lens(lens)
    lens.set_near_far(camera["near"], camera["far"])
    place(eye, camera["position"], camera["target"], camera["up"])
    lamp = KINDS[light["kind"]]("lamp")
    node, lamp.color = scene.attach_new_node(lamp), (exposure, exposure, exposure, 1)
    lamp.set_shadow_caster(shadows, params["size"], params["size"])
    state = lamp.get_initial_state().set_attrib(core.DepthOffsetAttrib.make(params["offset"]))
    if params["cast"] != "shipped":
        state = state.set_attrib(CULL.make(CULLED[params["cast"]]), 1)
    lamp.set_initial_state(state)
    if light["kind"] == "directional":
        lamp.get_lens().set_film_size(box["width"], box["height"])
        lamp.get_lens().set_near_far(0, box["depth"])
        place(node, box["position"], box["target"], box["up"])
    else:
        lamp.get_lens().set_fov(light["cone"] or 90)
        for side in range(6 if light["kind"] == "point" else 1):
            lamp.get_lens(side).set_near_far(box["near"], box["far"])
        place(node, light["position"], np.add(light["position"], light["direction"] or (0, 0, -1)).tolist(), (0, 1, 0))
    if light["kind"] == "spot":
        lamp.exponent = 0
    scene.set_light(node)
    for _ in range(3):
        engine.render_frame()
    scene.clear_light()
    node.remove_node()
    return np.frombuffer(bytes(picture.get_ram_image_as("RGBA")), np.float32).reshape(picture.get_y_size(), -1, 4)[::-1]
