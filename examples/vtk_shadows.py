"""Renders an exported view with VTK, with and without shadows, as an example of scoring another renderer.

shadowbench export stairs out/
python examples/vtk_shadows.py out/                      # needs `pip install vtk`, but not shadowbench
shadowbench score stairs --lit out/lit.png --shadowed out/shadowed.png
"""

import json
import sys
from pathlib import Path

import vtk


def main() -> None:
    """Read scene.glb and view.json from a folder, and write lit.png and shadowed.png to it."""
    folder = Path(sys.argv[1])
    description = json.loads((folder / "view.json").read_text(encoding="utf-8"))
    window, renderer = load(folder / description["model"], description)
    save(window, folder / "lit.png")
    renderer.SetPass(shadow_pass(1024))
    save(window, folder / "shadowed.png")


def load(model: Path, description: dict) -> tuple[vtk.vtkRenderWindow, vtk.vtkRenderer]:
    """The exported scene in an off-screen window; its pixels match the scored view."""
    window, renderer = vtk.vtkRenderWindow(), vtk.vtkRenderer()
    window.SetOffScreenRendering(True)
    window.SetMultiSamples(0)  # a mask is sampled at pixel centres
    if description["image"]["width"] != description["image"]["height"]:
        raise SystemExit("VTK's shadow maps are wrong in windows that are not square: export with --view-size 512")
    window.SetSize(description["image"]["width"], description["image"]["height"])
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
    camera.SetViewAngle(found["fov_y"] or 30)
    camera.SetParallelProjection(bool(found["height"]))  # orthographic
    camera.SetParallelScale((found["height"] or 1) / 2)
    camera.SetClippingRange(found["near"], found["far"])
    return window, renderer


def light_of(found: dict) -> vtk.vtkLight:
    """A directional light or a spot; VTK's shadow maps do not support point lights."""
    light = vtk.vtkLight()
    if found["kind"] == "point":
        raise SystemExit("VTK draws shadows of directional lights and spots only")
    light.SetPosition(found["position"] or (0, 0, 0))
    light.SetFocalPoint([a + b for a, b in zip(light.GetPosition(), found["direction"], strict=True)])
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


def save(window: vtk.vtkRenderWindow, file: Path) -> None:
    """Render, and write the image."""
    window.Render()
    grabbed = vtk.vtkWindowToImageFilter()
    grabbed.SetInput(window)
    grabbed.ReadFrontBufferOff()
    writer = vtk.vtkPNGWriter()
    writer.SetFileName(str(file))
    writer.SetInputConnection(grabbed.GetOutputPort())
    writer.Write()


if __name__ == "__main__":
    main()
