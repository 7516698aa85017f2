"""Renders an exported view with VTK, with and without shadows, as an example of scoring another renderer.

shadowbench export stairs out/
python examples/vtk_shadows.py out/                      # needs `pip install vtk`, but not shadowbench
shadowbench score stairs --lit out/lit.png --shadowed out/shadowed.png
"""

import argparse
import json
import math
from pathlib import Path

import vtk


def main() -> None:
    """Read scene.glb and view.json from a folder, and write lit.png and shadowed.png to it."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("folder", type=Path, help="folder written by `shadowbench export`")
    arguments = parser.parse_args()
    description = json.loads((arguments.folder / "view.json").read_text(encoding="utf-8"))
    window, renderer = load(arguments.folder / description["model"], description)
    save(window, description["image"], arguments.folder / "lit.png")
    renderer.SetPass(shadow_pass(1024))
    save(window, description["image"], arguments.folder / "shadowed.png")


def load(model: Path, description: dict) -> tuple[vtk.vtkRenderWindow, vtk.vtkRenderer]:
    """The exported scene in an off-screen window; its pixels match the scored view."""
    window, renderer = vtk.vtkRenderWindow(), vtk.vtkRenderer()
    window.SetOffScreenRendering(True)
    window.SetMultiSamples(0)  # a mask is sampled at pixel centres
    width, height = description["image"]["width"], description["image"]["height"]
    side = max(
        width, height
    )  # VTK's shadow maps are wrong in windows that are not square; the picture is a corner of one
    window.SetSize(side, side)
    window.AddRenderer(renderer)
    renderer.SetBackground(0, 0, 0)
    importer = vtk.vtkGLTFImporter()
    importer.SetFileName(str(model))
    importer.SetRenderWindow(window)
    importer.Update()
    renderer.RemoveAllLights()
    renderer.AutomaticLightCreationOff()
    renderer.AddLight(light_of(description["light"]))
    camera, found = renderer.GetActiveCamera(), description["camera"]
    camera.SetPosition(found["position"])
    camera.SetFocalPoint(found["target"])
    camera.SetViewUp(found["up"])
    camera.SetWindowCenter(1 - width / side, 1 - height / side)
    if found["height"]:  # orthographic
        camera.ParallelProjectionOn()
        camera.SetParallelScale(found["height"] / 2 * side / height)
    else:
        half = math.radians(found["fov_y"]) / 2
        camera.SetViewAngle(math.degrees(2 * math.atan(math.tan(half) * side / height)))
    camera.SetClippingRange(found["near"], found["far"])
    return window, renderer


def light_of(found: dict) -> vtk.vtkLight:
    """A directional light or a spot; VTK's shadow maps do not support point lights."""
    light = vtk.vtkLight()
    light.SetLightTypeToSceneLight()
    if found["kind"] == "point":
        raise SystemExit("VTK draws shadows of directional lights and spots only")
    position = found["position"] or (0, 0, 0)
    light.SetPosition(position)
    light.SetFocalPoint([a + b for a, b in zip(position, found["direction"], strict=True)])
    if found["kind"] == "spot":
        light.PositionalOn()
        light.SetConeAngle(found["cone"] / 2)
        light.SetExponent(0)
    return light


def shadow_pass(size: int) -> vtk.vtkRenderPass:
    """VTK's shadow mapping: a pass that renders a map per light, then one that uses them."""
    maps, shadows = vtk.vtkShadowMapBakerPass(), vtk.vtkShadowMapPass()
    maps.SetResolution(size)
    shadows.SetShadowMapBakerPass(maps)
    passes = vtk.vtkRenderPassCollection()
    passes.AddItem(maps)
    passes.AddItem(shadows)
    sequence = vtk.vtkSequencePass()
    sequence.SetPasses(passes)
    camera = vtk.vtkCameraPass()
    camera.SetDelegatePass(sequence)
    return camera


def save(window: vtk.vtkRenderWindow, size: dict, file: Path) -> None:
    """Render, and write the window's lower left corner of this size."""
    window.Render()
    grabbed, side = vtk.vtkWindowToImageFilter(), max(size.values())
    grabbed.SetInput(window)
    grabbed.SetViewport(0, 0, size["width"] / side, size["height"] / side)
    grabbed.ReadFrontBufferOff()
    writer = vtk.vtkPNGWriter()
    writer.SetFileName(str(file))
    writer.SetInputConnection(grabbed.GetOutputPort())
    writer.Write()


if __name__ == "__main__":
    main()
