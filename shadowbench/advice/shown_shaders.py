"""The GLSL of a spec, every include and define in it, and the values of its uniforms, as a driver is given them."""

import multiprocessing
from collections.abc import Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from shadowbench.errors import ShadowbenchError
from shadowbench.gl.device import open_device
from shadowbench.gl.geometry import DeviceGeometry
from shadowbench.gl.program import Program
from shadowbench.scenes.model import Scene
from shadowbench.techniques.base import TechniqueParams
from shadowbench.techniques.registry import shader_folder, techniques
from shadowbench.techniques.spec import parse_spec
from shadowbench.techniques.stage import Stage


@dataclass(frozen=True)
class ShaderText:
    """One stage of one program: `1-depth.frag`, its whole text, and the uniforms that parameters set in its program."""

    name: str
    text: str
    uniforms: Mapping[str, Any]


class _Recorder(Stage):
    """A stage that keeps the texts of its programs."""

    def __init__(self, *arguments: Any) -> None:
        super().__init__(*arguments)
        self.programs = 0
        self.texts: list[ShaderText] = []

    def program(
        self,
        vertex: Path | str,
        fragment: Path | str,
        geometry: Path | str | None = None,
        *,
        params: TechniqueParams | None = None,
        defines: Mapping[str, int | str] = {},
    ) -> Program:
        made = super().program(vertex, fragment, geometry, params=params, defines=defines)
        texts, uniforms = self._latest
        used = {name: value for name, value in uniforms.items() if made.has(name)}
        self.programs += 1
        stages = ((vertex, "vert"), (fragment, "frag"), (geometry, "geom"))
        given = [(source, suffix) for source, suffix in stages if source is not None]
        for (source, suffix), text in zip(given, texts, strict=True):
            stem = Path(source).stem if "\n" not in str(source) else "inline"
            self.texts.append(ShaderText(f"{self.programs}-{stem}.{suffix}", text, used))
        return made

    def _composed(self, *arguments: Any) -> Any:
        self._latest = super()._composed(*arguments)
        return self._latest


def shaders_of(spec: str, scene: Scene, size: int, plugins: Sequence[Path] = ()) -> list[ShaderText]:
    """The shaders of a spec (as text) for a view of size² pixels, composed where they are linked: a process of its own.

    scene: in file coordinates. Raises ShadowbenchError where that process ends before it answers.
    """
    # Spawned, not forked: this process never owns a GL context.
    with ProcessPoolExecutor(1, mp_context=multiprocessing.get_context("spawn")) as pool:
        try:
            return pool.submit(_composed, spec, scene, size, tuple(plugins)).result()
        except BrokenProcessPool:
            raise ShadowbenchError(f"the process that composes the shaders of {spec} died") from None


def _composed(spec: str, scene: Scene, size: int, plugins: Sequence[Path]) -> list[ShaderText]:
    device, parsed, placement = open_device(), parse_spec(spec, techniques(plugins)), scene.placement
    local = placement.scene(scene)
    geometry = DeviceGeometry(device, local.geometry)
    stage = _Recorder(local, device, (size, size), geometry, placement, shader_folder(parsed.technique))
    try:
        parsed.technique(parsed.params).build(stage)
        return stage.texts
    finally:
        stage.release()
        geometry.release()
