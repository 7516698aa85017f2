"""A scene on the device, and the one view of it that is open."""

from dataclasses import dataclass

from shadowbench.gl.device import Device
from shadowbench.gl.gbuffer import GBuffer, GBufferPass
from shadowbench.gl.geometry import DeviceGeometry
from shadowbench.gl.picture import PicturePass
from shadowbench.measure.cells import PlacedView
from shadowbench.scenes.model import IDENTITY_PLACEMENT, Coordinates, Scene, View
from shadowbench.techniques.base import Frame, Stage, Technique


class LoadedScene:
    """A scene (file coordinates) on the device, in the coordinates that it is drawn in."""

    def __init__(self, device: Device, filed: Scene, coordinates: Coordinates) -> None:
        self.filed, self.coordinates = filed, coordinates
        self.placement = filed.placement if coordinates == "relative" else IDENTITY_PLACEMENT
        self.scene = self.placement.scene(filed)
        self.geometry = DeviceGeometry(device, self.scene.geometry)
        self.surface_pass = GBufferPass(device, self.geometry)
        self.picture_pass = PicturePass(device, self.geometry)

    def shows(self, at: PlacedView) -> bool:
        """Whether a view is of this scene, in these coordinates."""
        return at.view.scene is self.filed and at.coordinates == self.coordinates

    def placed(self, view: View) -> View:
        """A view of this scene (file coordinates, the camera's planes known), in those it is drawn in."""
        return View(self.scene, self.placement.camera(view.camera), self.placement.light(view.light), view.size)

    def release(self) -> None:
        """Free it."""
        self.picture_pass.release()
        self.surface_pass.release()
        self.geometry.release()


@dataclass(frozen=True, eq=False)
class OpenView:
    """A view whose G-buffer is drawn: as it was asked for, and as it is drawn."""

    filed: View
    loaded: LoadedScene
    view: View
    surface: GBuffer

    def shows(self, at: PlacedView) -> bool:
        """Whether a view is this one."""
        mine, asked = self.filed, at.view
        same = (mine.camera, mine.light, mine.size) == (asked.camera, asked.light, asked.size)
        return same and self.loaded.shows(at)


@dataclass(frozen=True, eq=False)
class Built:
    """A cell that can be drawn; `prepare_ms`: what building it took."""

    technique: Technique
    stage: Stage
    frame: Frame
    prepare_ms: float
