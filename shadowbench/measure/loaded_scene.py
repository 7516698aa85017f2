"""A scene uploaded to the GPU, a view of it with its G-buffer, and a technique built for that view."""

import sys
from dataclasses import dataclass

from shadowbench.gl.device import Device
from shadowbench.gl.gbuffer import GBuffer, GBufferPass
from shadowbench.gl.geometry import DeviceGeometry
from shadowbench.gl.picture import PicturePass
from shadowbench.plugin.base import Frame, Stage, Technique
from shadowbench.plugin.registry import shader_folder
from shadowbench.plugin.spec import Spec
from shadowbench.scenes.model import IDENTITY_PLACEMENT, Coordinates, Scene, View


class LoadedScene:
    """A scene on the GPU: its buffers and passes, in the coordinates in which it is drawn."""

    def __init__(self, device: Device, file_scene: Scene, coordinates: Coordinates) -> None:
        self.device, self.file_scene, self.coordinates = device, file_scene, coordinates
        self.placement = file_scene.placement if coordinates == "relative" else IDENTITY_PLACEMENT
        self.scene = self.placement.scene(file_scene)
        self.geometry = DeviceGeometry(device, self.scene.geometry)
        self.surface_pass = GBufferPass(device, self.geometry)
        self.picture_pass = PicturePass(device, self.geometry)

    def matches(self, scene: Scene, coordinates: Coordinates) -> bool:
        """Whether it is a scene in these coordinates."""
        return scene is self.file_scene and coordinates == self.coordinates

    def to_drawing_coordinates(self, view: View) -> View:
        """A view of this scene converted from file coordinates (near and far planes known) to drawing coordinates."""
        return View(self.scene, self.placement.camera(view.camera), self.placement.light(view.light), view.size)

    def build(self, spec: Spec, size: int, room: int = sys.maxsize) -> tuple[Technique, Stage]:
        """A technique built for images of size × size pixels. Raises any exception of the technique.

        room: most bytes that its textures and buffers may take. Raises Unsupported if they would take more.
        """
        folder = shader_folder(spec.technique)
        stage = Stage(self.scene, self.device, (size, size), self.geometry, self.placement, folder, room)
        technique = spec.technique(spec.params)
        try:
            technique.build(stage)
            self.device.check(f"building {spec.full_text}")
        except BaseException:
            stage.release()
            raise
        return technique, stage

    def release(self) -> None:
        """Free GPU memory."""
        self.picture_pass.release()
        self.surface_pass.release()
        self.geometry.release()


@dataclass(frozen=True, eq=False)
class OpenView:
    """A view with its G-buffer: `file_view` in file coordinates, `view` in drawing coordinates."""

    file_view: View
    loaded: LoadedScene
    view: View
    surface: GBuffer

    def matches(self, other: View, coordinates: Coordinates) -> bool:
        """Whether this is the given view."""
        own = self.file_view
        same = (own.camera, own.light, own.size) == (other.camera, other.light, other.size)
        return same and self.loaded.matches(other.scene, coordinates)


@dataclass(frozen=True, eq=False)
class BuiltCell:
    """A technique built for a view and ready to draw; prepare_ms: its build time."""

    technique: Technique
    stage: Stage
    frame: Frame
    prepare_ms: float
