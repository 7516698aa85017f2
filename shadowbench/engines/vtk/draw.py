# VTK's shadow maps: https://vtk.org/doc/nightly/html/classvtkShadowMapPass.html
import numpy as np
from vtkmodules import vtkRenderingOpenGL2 as gl
from vtkmodules.util.numpy_support import vtk_to_numpy
from vtkmodules.vtkCommonCore import vtkVersion
from vtkmodules.vtkIOImport import vtkGLTFImporter
from vtkmodules.vtkRenderingCore import vtkLight, vtkRenderer, vtkRenderWindow, vtkWindowToImageFilter

window = renderer = None
shown = (0, 0)  # width and height of the part of the window that is the picture


def open(width, height):
    global window, shown
    shown = width, height
    window = vtkRenderWindow()
    window.SetOffScreenRendering(True)
    window.SetMultiSamples(0)
    window.SetSize(max(shown), max(shown))  # a light's map would be drawn with another aspect ratio, and read without
    window.Render()
    lines = window.ReportCapabilities().splitlines()
    return vtkVersion.GetVTKVersion(), next(line.split(": ")[1].strip() for line in lines if "renderer string" in line)


def load(model, view):
    global renderer
    if renderer:
        window.RemoveRenderer(renderer)
    renderer = vtkRenderer()
    renderer.AutomaticLightCreationOff()
    window.AddRenderer(renderer)
    importer = vtkGLTFImporter()
    importer.SetFileName(str(model))
    importer.SetRenderWindow(window)
    importer.Update()


def draw(camera, light, params, shadows, exposure, **_):
    eye, more = renderer.GetActiveCamera(), max(shown) / shown[1]  # height of the window, in those of the picture
    eye.SetPosition(camera["position"])
    eye.SetFocalPoint(camera["target"])
    eye.SetViewUp(camera["up"])
    eye.SetWindowCenter(*(1 - np.divide(shown, max(shown))))  # the picture is its lower left corner
    eye.SetParallelProjection(bool(camera["height"]))
    if camera["height"]:
        eye.SetParallelScale(more * camera["height"] / 2)
    else:
        eye.SetViewAngle(np.degrees(2 * np.arctan(more * np.tan(np.radians(camera["fov_y"]) / 2))))
    eye.SetClippingRange(camera["near"], camera["far"])
    lamp, position = vtkLight(), light["position"] or (0, 0, 0)
    lamp.SetPosition(position)
    lamp.SetFocalPoint(np.add(position, light["direction"]))
    lamp.SetIntensity(np.pi * exposure)
    if light["kind"] == "spot":
        lamp.PositionalOn()
        lamp.SetConeAngle(light["cone"] / 2)
        lamp.SetExponent(0)
    renderer.RemoveAllLights()
    renderer.AddLight(lamp)
    maps, shadowed, passes = gl.vtkShadowMapBakerPass(), gl.vtkShadowMapPass(), gl.vtkRenderPassCollection()
    maps.SetResolution(params["size"])
    maps.SetExponentialConstant(params["exponent"])
    shadowed.SetShadowMapBakerPass(maps)
    passes.AddItem(maps)
    passes.AddItem(shadowed)
    sequence, every = gl.vtkSequencePass(), gl.vtkCameraPass()
    sequence.SetPasses(passes)
    every.SetDelegatePass(sequence)
    renderer.SetPass(every if shadows else None)
    window.Render()
    grabbed = vtkWindowToImageFilter()
    grabbed.SetInput(window)
    grabbed.Update()
    pixels = vtk_to_numpy(grabbed.GetOutput().GetPointData().GetScalars())
    pixels = pixels.reshape(*window.GetSize()[::-1], 3)[: shown[1], : shown[0]][::-1]
    return (pixels / 255).astype(np.float32) ** 2.2  # its materials' own gamma
