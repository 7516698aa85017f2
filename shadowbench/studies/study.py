"""Studies: what is crossed with what, and the blocks of cells that come of it."""

import itertools
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

from shadowbench.errors import InputError
from shadowbench.measure.cells import Block, Cell, Conditions
from shadowbench.measure.references import name_of
from shadowbench.measure.rows import StudyFacts
from shadowbench.scenes.library import load_scene
from shadowbench.scenes.model import Camera, Coordinates, Light, Scene, view_of
from shadowbench.scenes.views import Named, named
from shadowbench.techniques.spec import Spec


@dataclass(frozen=True)
class BiasSweep:
    """A spec whose bias a study multiplies, and what that makes of it: a factor and a spec each, by rising factor."""

    home: Spec
    swept: tuple[tuple[float, Spec], ...]


@dataclass(frozen=True, eq=False)
class Study:
    """A study with everything resolved but the scenes, which are loaded one at a time.

    own_phases: of the specs that have others than the study's `phases`.
    """

    scenes: tuple[str, ...]
    specs: tuple[Spec, ...]
    reference: Spec
    map_sizes: tuple[int, ...] = ()
    view_size: int = 512
    rounds: int = 9
    phases: int = 1
    own_phases: Mapping[Spec, int] = field(default_factory=dict)
    coordinates: Coordinates = "relative"
    time_limit: float = 120.0
    memory_limit: float = 8.0
    views: tuple[str | Camera, ...] = ("file",)
    lights: tuple[str | Light, ...] = ("file",)
    assets: Path | None = None
    up: str | None = None
    about: str = ""
    sweeps: tuple[BiasSweep, ...] = ()
    notes: tuple[str, ...] = field(default=())

    def conditions(self, time_again: bool = False) -> Conditions:
        """What its cells are measured under."""
        return Conditions(self.coordinates, self.rounds, self.reference, time_again)

    @property
    def facts(self) -> StudyFacts:
        """What `run.json` says of it."""
        return {
            "scenes": list(self.scenes),
            "specs": [spec.text for spec in self.specs],
            "reference": name_of(self.reference),
            "view_size": self.view_size,
            "rounds": self.rounds,
            "phases": self.phases,
            "coordinates": self.coordinates,
        }

    def cells(self) -> tuple[Cell, ...]:
        """The cells of one view, phase by phase: phases of techniques that have a grid, one cell of the others."""
        cells = [
            Cell(one, phase)
            for spec in self.specs
            for one in sized([spec], self.map_sizes)
            for phase in range(self.own_phases.get(spec, self.phases) if spec.technique.phased else 1)
        ]
        return tuple(sorted(dict.fromkeys(cells), key=lambda cell: cell.phase))

    def blocks(self) -> Iterator[Block]:
        """All blocks, scene by scene; raises InputError for a scene that cannot be read."""
        files: dict[str, str] = {}
        for reference in dict.fromkeys(self.scenes):
            scene = load_scene(reference, self.assets, self.up)
            first = files.setdefault(scene.name, reference)
            if first != reference:
                raise InputError(f"two scenes are called {scene.name!r}: {first} and {reference}; names must differ")
            for camera, light in itertools.product(self.cameras(scene), self.lights_of(scene)):
                yield Block(view_of(scene, camera, light, self.view_size), self.cells())

    def cameras(self, scene: Scene) -> list[Camera]:
        """The study's cameras in a scene; "file" is the first that its file has."""
        return _chosen(self.views, scene.cameras, scene.cameras[:1], f"views of {scene.name}")

    def lights_of(self, scene: Scene) -> list[Light]:
        """The study's lights in a scene; "file" is all that its file has."""
        return _chosen(self.lights, scene.lights, scene.lights, f"lights of {scene.name}")


def _chosen(
    entries: Sequence[str | Named], known: Sequence[Named], of_file: Sequence[Named], where: str
) -> list[Named]:
    """What entries name, each once: "file" stands for `of_file`, another word for one of `known`."""
    found: list[Named] = []
    for entry in entries:
        if not isinstance(entry, str):
            found.append(entry)
        else:
            found.extend(of_file if entry == "file" else [named(known, entry, where)])
    found = list(dict.fromkeys(found))
    names = [thing.name for thing in found]
    for name in names:
        if names.count(name) > 1:
            raise InputError(f"{where}: two are called {name!r}; names must differ")
    return found


def scenes_of(blocks: Sequence[Block]) -> list[Scene]:
    """The scenes of blocks, each once."""
    return list(dict.fromkeys(block.scene for block in blocks))


def sized(specs: Sequence[Spec], sizes: Sequence[int]) -> tuple[Spec, ...]:
    """The specs at each map size, where a technique has one and its spec does not name it; each only once."""
    grown = [
        spec.with_(size=size) if size is not None else spec
        for spec in specs
        for size in (sizes if sizes and spec.has_size and "size" not in spec.named else [None])
    ]
    return tuple(dict.fromkeys(grown))
