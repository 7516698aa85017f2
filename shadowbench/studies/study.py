"""A study: scenes, views, lights, techniques and map sizes to cross, from a file or from options, and its cells."""

import itertools
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, ClassVar

from pydantic import Field, ValidationError

from shadowbench.data import data_folder
from shadowbench.errors import InputError, alternatives
from shadowbench.measure.cells import Block, Cell
from shadowbench.measure.references import DEFAULT_REFERENCE, reference_name
from shadowbench.measure.rows import StudyFacts
from shadowbench.measure.timing import Conditions
from shadowbench.scenes.library import load_scene
from shadowbench.scenes.model import Camera, Coordinates, Light, Scene, view_of
from shadowbench.scenes.views import Named, named
from shadowbench.strict import Strict, explain, read_toml
from shadowbench.studies.crossing import MOST_SPECS, BiasSweep, Crossed, Techniques
from shadowbench.studies.fields import Cameras, Crossings, Lights, Reference, Scenes, Sizes, Source
from shadowbench.techniques.spec import Spec, parse_spec

MOST_CELLS = 1_000_000
"""Cells of a file's study in one view, each phase counted."""


class Study(Strict):
    """Scenes × views × lights × specs × map sizes × phases to measure, and how.

    The fields are those of a study file, which `read_study` reads into it, but for `assets`, `up` and `notes`. scenes:
    built-in names, paths, or scenes that are loaded already; assets, up: as `load_scene` takes them. map_size: of every
    spec that names none; None leaves each technique its own. technique: specs, as lists were crossed. phases: positions
    of a map's texels, for every `technique` without a number of its own. views, lights: "file" stands for the first
    camera and for all lights of a scene, other words for one by name. time_limit: seconds a cell; memory_limit: GiB.
    notes: what somebody who runs it should read.
    """

    not_in_files: ClassVar[frozenset[str]] = frozenset({"assets", "up", "notes"})

    about: str = ""
    scenes: Scenes
    map_size: Sizes | None = None
    view_size: int = Field(512, ge=1, le=16384, strict=True)
    rounds: int = Field(9, ge=0, le=10_000, strict=True)
    phases: int = Field(1, ge=1, le=10_000, strict=True)
    coordinates: Coordinates = "relative"
    reference: Reference = DEFAULT_REFERENCE
    time_limit: float = Field(120.0, gt=0, le=86_400)
    memory_limit: float = Field(8.0, gt=0, le=4096)
    views: Cameras = ("file",)
    lights: Lights = ("file",)
    technique: Crossings
    assets: Path | None = None
    up: str | None = None
    notes: tuple[str, ...] = ()

    @property
    def specs(self) -> tuple[Spec, ...]:
        """All specs, without the map sizes."""
        return tuple(spec for one in self.technique for spec in one.specs)

    @property
    def sweeps(self) -> tuple[BiasSweep, ...]:
        """The specs whose bias is multiplied."""
        return tuple(sweep for one in self.technique for sweep in one.sweeps)

    @staticmethod
    def of(scenes: Sequence[str | Scene], specs: Sequence[Spec], **others: Any) -> "Study":
        """A study of some scenes and specs, `others` being fields by name; raises InputError."""
        return _valid({"scenes": list(scenes), "technique": [Crossed(tuple(specs))], **others})

    def with_(self, **changes: Any) -> "Study":
        """The same with other values, validated again; raises InputError."""
        return _valid({name: getattr(self, name) for name in type(self).model_fields} | changes)

    def with_specs(self, specs: Sequence[Spec]) -> "Study":
        """The same with other specs, in the study's own number of phases; its bias sweeps are still known."""
        return self.with_(technique=(Crossed(tuple(specs), sweeps=self.sweeps),))

    def phases_of_specs(self) -> Mapping[Spec, int]:
        """The phases of each spec; the larger number of one that is named twice."""
        found: dict[Spec, int] = {}
        for one in self.technique:
            for spec in one.specs:
                found[spec] = max(one.phases or self.phases, found.get(spec, 1))
        return found

    def conditions(self, time_again: bool = False) -> Conditions:
        """What its cells are measured under."""
        return Conditions(self.coordinates, self.rounds, self.reference, time_again)

    @property
    def facts(self) -> StudyFacts:
        """What `run.json` says of it."""
        return {
            "scenes": [scene if isinstance(scene, str) else scene.name for scene in self.scenes],
            "specs": [spec.text for spec in self.specs],
            "reference": reference_name(self.reference),
            "view_size": self.view_size,
            "rounds": self.rounds,
            "phases": self.phases,
            "coordinates": self.coordinates,
        }

    def cells(self) -> tuple[Cell, ...]:
        """The cells of one view, phase by phase: phases of techniques that have a grid, one cell of the others."""
        phases = self.phases_of_specs()
        cells = [
            Cell(one, phase)
            for spec in self.specs
            for one in sized([spec], self.map_size or ())
            for phase in range(phases[spec] if spec.technique.phased else 1)
        ]
        return tuple(sorted(dict.fromkeys(cells), key=lambda cell: cell.phase))

    def blocks(self) -> Iterator[Block]:
        """All blocks, scene by scene; raises InputError for a scene that cannot be read."""
        files: dict[str, str | Scene] = {}
        for source in dict.fromkeys(self.scenes):
            scene = source if isinstance(source, Scene) else load_scene(source, self.assets, self.up)
            first = files.setdefault(scene.name, source)
            if first != source:
                both = " and ".join(one if isinstance(one, str) else "one that is loaded" for one in (first, source))
                raise InputError(f"two scenes are called {scene.name!r}: {both}; names must differ")
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


def read_study(file: Path, techniques: Techniques, folder: Path | None = None) -> Study:
    """The study of a file, every technique at its defaults where it names none; InputError for anything wrong in it.

    Its scenes are relative to `folder`, which is the file's own unless another is given.
    """
    table = read_toml(file, str(file), f"no such study file{alternatives(file, study_names(), 'ours')}")
    if "technique" not in table:
        table["technique"] = [Crossed((parse_spec(name, techniques),)) for name in techniques]
    source = Source(str(file), folder or file.parent, techniques)
    study = _valid(table, source).with_(notes=tuple(source.notes))
    _check_size(study, str(file))
    return study


def _check_size(study: Study, where: str) -> None:
    """Raises InputError for a file that asks for more than anybody could run."""
    sizes, phases = len(study.map_size or [None]), study.phases_of_specs()
    sized = [sizes if spec.has_size and "size" not in spec.named else 1 for spec in study.specs]
    if sum(sized) > MOST_SPECS:
        raise InputError(f"{where}: {sum(sized)} specs, each map size counted; allowed are at most {MOST_SPECS}")
    cells = sum(count * phases[spec] for count, spec in zip(sized, study.specs, strict=True))
    if cells > MOST_CELLS:
        raise InputError(
            f"{where}: {cells} cells, each map size and phase of {len(study.specs)} specs counted; "
            f"allowed are at most {MOST_CELLS}"
        )


def _valid(values: dict[str, Any], source: Source | None = None) -> Study:
    try:
        return Study.model_validate(values, context=source)
    except ValidationError as error:
        raise explain(source.where if source else "study", error) from None


def find_study(name: str) -> Path:
    """A study file by path, or one of ours by name."""
    path = Path(name)
    ours = data_folder("benchmarks") / f"{name}.toml"
    return ours if not path.is_file() and ours.is_file() else path


def study_names() -> list[str]:
    """The studies that travel with the package."""
    return sorted(path.stem for path in data_folder("benchmarks").glob("*.toml"))
