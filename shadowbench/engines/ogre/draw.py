# OGRE: https://ogrecave.github.io/ogre/api/latest/_shadows.html
import tempfile
from pathlib import Path

import numpy as np
import Ogre.Bites
import Ogre.Numpy
from Ogre.RTShader import SRS_SHADOW_MAPPING, ShaderGenerator

KINDS = {"directional": Ogre.Light.LT_DIRECTIONAL, "spot": Ogre.Light.LT_SPOTLIGHT, "point": Ogre.Light.LT_POINT}
FOLDER = tempfile.TemporaryDirectory()  # of scene.glb
app = target = texture = scene = eye = lamp = None


def open(width, height):
    global app, target, texture, scene, eye, lamp
    app = Ogre.Bites.ApplicationContext("shadowbench")
    app.createRoot()
    app.getRoot().setRenderSystem(app.getRoot().getRenderSystemByName("OpenGL 3+ Rendering Subsystem"))
    app.setup()
    Path(FOLDER.name, "scene.glb").touch()  # what is not there yet is not looked for later
    Ogre.ResourceGroupManager.getSingleton().addResourceLocation(FOLDER.name, "FileSystem", "scene")
    scene = app.getRoot().createSceneManager()
    ShaderGenerator.getSingleton().addSceneManager(scene)
    eye, lamp = scene.createCamera("camera"), scene.createLight()
    for each in eye, lamp:
        scene.getRootSceneNode().createChildSceneNode().attachObject(each)
    kind = Ogre.TEX_TYPE_2D, width, height, 0, Ogre.PF_FLOAT32_RGBA, Ogre.TU_RENDERTARGET
    texture = Ogre.TextureManager.getSingleton().createManual("picture", Ogre.RGN_DEFAULT, *kind)
    target = texture.getBuffer().getRenderTarget()
    target.addViewport(eye).setMaterialScheme(Ogre.MSN_SHADERGEN)
    return Ogre.__version__, app.getRoot().getRenderSystem().getCapabilities().getDeviceName()


def load(model, view):
    scene.destroyAllEntities()
    Ogre.ResourceGroupManager.getSingleton().clearResourceGroup("scene")
    Path(FOLDER.name, "scene.glb").write_bytes(model.read_bytes())
    mesh = Ogre.MeshManager.getSingleton().load("scene.glb", "scene")
    mesh.buildEdgeList()
    entity = scene.createEntity(mesh)
    for index in range(entity.getNumSubEntities()):  # in this order where surfaces meet
        entity.getSubEntity(index).setRenderQueueGroupAndPriority(Ogre.RENDER_QUEUE_MAIN, index)
    scene.getRootSceneNode().attachObject(entity)


def draw(camera, light, params, shadows, exposure, **_):
    node, near = eye.getParentSceneNode(), 0.99 * camera["nearest"]
    eye.setAspectRatio(camera["aspect"])
    node.setPosition(Ogre.Vector3(*camera["position"]))
    node.setOrientation(Ogre.Quaternion(*(Ogre.Vector3(*row[:3]) for row in camera["view"][:3])))
    eye.setNearClipDistance(near)  # volumes need all of the 24 bits
    eye.setFarClipDistance(0)  # infinite, as volumes set it
    eye.setCustomProjectionMatrix(False)
    if height := camera["height"]:
        # Beyond the volumes' ends; an infinite far plane would leave few steps of depth, as parallel rays have none.
        across, along = 2 / (height * camera["aspect"]), -2 / (10 * camera["far"] - near)
        depth = (0, 0, along, along * (10 * camera["far"] + near) / 2)
        rows = (across, 0, 0, 0), (0, 2 / height, 0, 0), depth, (0, 0, 0, 1)
        eye.setProjectionType(Ogre.PT_ORTHOGRAPHIC)
        eye.setCustomProjectionMatrix(True, Ogre.Matrix4(*np.ravel(rows).tolist()))
    else:
        eye.setProjectionType(Ogre.PT_PERSPECTIVE)
        eye.setFOVy(Ogre.Radian(Ogre.Degree(camera["fov_y"])))
    lamp.setType(KINDS[light["kind"]])
    node, cone = lamp.getParentSceneNode(), Ogre.Radian(Ogre.Degree(light["cone"] or 90))
    node.setPosition(Ogre.Vector3(*(light["position"] or (0, 0, 0))))
    node.setOrientation(Ogre.Vector3(0, 0, -1).getRotationTo(Ogre.Vector3(*(light["direction"] or (0, 0, -1)))))
    lamp.setSpotlightRange(cone * (1 - 1e-5), cone, 1)
    lamp.setDiffuseColour(exposure, exposure, exposure)
    generator, stencil = ShaderGenerator.getSingleton(), params["technique"] == "stencil"
    generator.getRenderState(Ogre.MSN_SHADERGEN).resetToBuiltinSubRenderStates()
    if shadows and not stencil:
        mapping = generator.createSubRenderState(SRS_SHADOW_MAPPING)
        mapping.setParameter("filter", params["filter"])
        generator.getRenderState(Ogre.MSN_SHADERGEN).addTemplateSubRenderState(mapping)
        scene.setShadowTextureSettings(params["size"], 1, Ogre.PF_DEPTH32F)
        scene.setShadowFarDistance(params["distance"])
        scene.setShadowCasterRenderBackFaces(params["cast"] == "back")
        scene.setShadowCameraSetup(getattr(Ogre, f"{params['camera']}ShadowCameraSetup").create())
        casters = Ogre.MaterialManager.getSingleton().getByName("Ogre/TextureShadowCaster", "OgreInternal")
        casters.getTechnique(0).getPass(0).setDepthBias(params["bias"], params["slope_bias"])
    wanted = Ogre.SHADOWTYPE_STENCIL_ADDITIVE if stencil else Ogre.SHADOWTYPE_TEXTURE_ADDITIVE_INTEGRATED
    scene.setShadowTechnique(wanted if shadows else Ogre.SHADOWTYPE_NONE)
    generator.invalidateScheme(Ogre.MSN_SHADERGEN)
    for _ in range(2):  # the map is fitted to what the last one showed
        target.update()
    picture = Ogre.Image(Ogre.PF_FLOAT32_RGBA, texture.getWidth(), texture.getHeight())
    target.copyContentsToMemory(picture.getPixelBox(), picture.getPixelBox())
    return Ogre.Numpy.view(picture.getPixelBox()).view(np.float32).copy()
