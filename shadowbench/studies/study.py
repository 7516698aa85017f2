"""Studies: scenes, views, lights, techniques and map sizes to combine, from a file or options, and their cells."""

import itertools
import shlex
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, fields, replace
from pathlib import Path
from typing import Annotated, Any, Self

from pydantic import BeforeValidator, Field, InstanceOf, model_validator

from shadowbench.errors import InputError, alternatives
from shadowbench.files import data_folder, replace_file
from shadowbench.measure.campaign import DEFAULT_REFERENCE, Block, Cell, reference_name
from shadowbench.measure.worker import Limits
from shadowbench.options import (
    AS_STUDIED,
    DEFAULT_SIZE,
    FIRST,
    FRAMES,
    MAP_SIZE,
    PHASES,
    ROUNDS,
    Measuring,
    SceneOptions,
    ViewOptions,
    in_python,
)
from shadowbench.plugin.spec import Spec, has_size
from shadowbench.scenes.assumed import sunlit
from shadowbench.scenes.model import Camera, Coordinates, Light, Scene, View, view_of
from shadowbench.scenes.opening import Named, named, opened
from shadowbench.scenes.sequences import frames_of, motions_of
from shadowbench.strict import Strict, ViewSizeField, read_toml, validated
from shadowbench.studies.crossing import CrossedSpecs, Techniques, convert, to_list
from shadowbench.truths.embree import tracer_of

_Size = Annotated[int, Field(ge=MAP_SIZE.least, le=MAP_SIZE.most, strict=True)]
_SOME = Field(min_length=1)


def _names(value: object) -> list[Any]:
    return value.split(",") if isinstance(value, str) else to_list(value)


class SceneFields(Strict):
    """How all scenes of a study are read; each field is that of `SceneOptions`, places also as lists of numbers."""

    sun: bool = Field(False, strict=True)
    no_ground: bool = Field(False, strict=True)
    time: float | None = Field(None, ge=0.0)
    clip: str | None = None
    camera: Any = None
    target: Any = None
    lamp: Any = None
    sun_at: Any = None
    assets: Path | None = None
    up: str | None = None

    @model_validator(mode="after")
    def _valid_together(self) -> Self:
        try:
            self.scene_options()
        except InputError as error:
            raise ValueError(in_python(str(error))) from None
        return self

    def scene_options(self) -> SceneOptions:
        """The fields as options. Raises InputError."""
        return SceneOptions(**{field.name: getattr(self, field.name) for field in fields(SceneOptions)})

    def scene_facts(self) -> dict[str, Any]:
        """The fields that are set and `sun`, for `run.json`; not `assets`, which is a folder of one machine."""
        options = asdict(self.scene_options()).items()
        given = {name: value for name, value in options if value is not None and value is not False}
        given.pop("assets", None)
        return {"sun": self.sun, **given}


class Study(SceneFields):
    """Scenes × views × lights × specs × map sizes × phases to measure, and the settings of the measurement.

    The fields are those of a study file. scenes: built-in names, paths, or loaded scenes. map_size: for specs that name
    no size; None for each technique's own. technique: crossed specs. phases: subtexel offsets of the map's grid to
    measure, for `technique` entries without their own number. sequence: names of some that the scenes have, or `all`
    built-in ones, none for still views; frames: how many of each, None for all. views, lights: "file" for the first
    camera and all lights of a scene, else by name. time_limit: seconds per cell; memory_limit: GiB. notes: lines to
    show to the user.
    """

    about: str = ""
    scenes: Annotated[tuple[str | InstanceOf[Scene], ...], _SOME]
    map_size: Annotated[tuple[_Size, ...], BeforeValidator(to_list), _SOME] | None = None
    view_size: ViewSizeField = DEFAULT_SIZE
    rounds: int = Field(9, ge=ROUNDS.least, le=ROUNDS.most, strict=True)
    phases: int = Field(1, ge=PHASES.least, le=PHASES.most, strict=True)
    sequence: Annotated[tuple[str, ...], BeforeValidator(_names)] = ()
    frames: int | None = Field(None, ge=FRAMES.least, le=FRAMES.most, strict=True)
    coordinates: Coordinates = "relative"
    reference: InstanceOf[Spec] = DEFAULT_REFERENCE
    time_limit: float = Field(120.0, gt=0, le=86_400)
    memory_limit: float = Field(8.0, gt=0, le=4096)
    views: Annotated[tuple[str | InstanceOf[Camera], ...], _SOME] = ("file",)
    lights: Annotated[tuple[str | InstanceOf[Light], ...], _SOME] = ("file",)
    technique: Annotated[tuple[InstanceOf[CrossedSpecs], ...], _SOME]
    notes: tuple[str, ...] = ()

    @model_validator(mode="after")
    def _of_a_sequence(self) -> Self:
        if self.frames is not None and not self.sequence:
            raise ValueError(f"frames {self.frames}: is for a sequence, which is not given")
        return self

    @property
    def specs(self) -> tuple[Spec, ...]:
        """All specs, before map sizes are applied."""
        return tuple(spec for crossed in self.technique for spec in crossed.specs)

    @property
    def sweeps(self) -> tuple[tuple[Spec, float, Spec], ...]:
        """All bias sweeps, as those of `CrossedSpecs`."""
        return tuple(sweep for crossed in self.technique for sweep in crossed.sweeps)

    @property
    def bias_sweeps(self) -> dict[str, tuple[str, float]]:
        """By spec, the spec whose bias was multiplied, and the factor: 1 where a spec is in several sweeps."""
        own_last = sorted(self.sweeps, key=lambda sweep: sweep[1] == 1)
        return {spec.sizeless_text: (home.sizeless_text, factor) for home, factor, spec in own_last}

    @staticmethod
    def of(scenes: Sequence[str | Scene], specs: Sequence[Spec], **others: Any) -> "Study":
        """A study of the given scenes and specs; others: further fields by name. Raises InputError."""
        return validated(Study, {"scenes": list(scenes), "technique": [CrossedSpecs(tuple(specs))], **others}, "study")

    def with_(self, **changes: Any) -> "Study":
        """A copy with some fields replaced, validated again. Raises InputError."""
        return validated(Study, {name: getattr(self, name) for name in type(self).model_fields} | changes, "study")

    def phases_of_specs(self) -> Mapping[Spec, int]:
        """Number of phases of each spec; the larger one for a spec that is named twice."""
        counts: dict[Spec, int] = {}
        for crossed in self.technique:
            for spec in crossed.specs:
                counts[spec] = max(crossed.phases or self.phases, counts.get(spec, 1))
        return counts

    @property
    def limits(self) -> Limits:
        """Limits of each call to the worker."""
        return Limits(self.time_limit, int(self.memory_limit * 2**30))

    @property
    def facts(self) -> dict[str, Any]:
        """The study's entry in `run.json`."""
        return {
            "scenes": [scene if isinstance(scene, str) else scene.name for scene in self.scenes],
            "specs": [spec.text for spec in self.specs],
            "reference": reference_name(self.reference),
            "view_size": self.view_size.written,
            "rounds": self.rounds,
            "phases": self.phases,
            "coordinates": self.coordinates,
            **({"sequence": list(self.sequence)} if self.sequence else {}),
            **self.scene_facts(),
        }

    def cells(self, soft: bool = True) -> tuple[Cell, ...]:
        """Cells of one view, phase by phase; techniques without a texel grid have a single phase.

        soft: whether the light has a size.
        """
        phases = self.phases_of_specs()
        cells = [
            Cell(sized, phase)
            for crossed in self.technique
            if crossed.soft in (None, soft)
            for spec in crossed.specs
            for sized in ([spec.with_(size=size) for size in self.map_size or ()] if _takes_a_size(spec) else [])
            or [spec]
            for phase in range(phases[spec] if spec.technique.phased else 1)
        ]
        return tuple(sorted(dict.fromkeys(cells), key=lambda cell: cell.phase))

    def blocks(self) -> Iterator[Block]:
        """All blocks, scene by scene. Raises InputError for a scene that cannot be read."""
        files: dict[str, str | Scene] = {}
        for source in dict.fromkeys(self.scenes):
            scene = opened(source, self.scene_options(), tracer_of)
            first = files.setdefault(scene.name, source)
            if first != source:
                both = " and ".join(entry if isinstance(entry, str) else "a loaded scene" for entry in (first, source))
                raise InputError(f"two scenes are called {scene.name!r}: {both}; names must differ")
            cameras = _chosen(self.views, scene.cameras, scene.cameras[:1], f"views of {scene.name}")
            for camera, light in itertools.product(cameras, self.lights_of(scene)):
                view = view_of(scene, camera, light, self.view_size)
                if not self.sequence:
                    yield self.block(view)
                for motion in motions_of(scene, self.sequence):
                    yield self.block(*frames_of(view, motion, self.frames), sequence=motion.name)

    def block(self, *views: View, sequence: str | None = None) -> Block:
        """The block of a view, or of the frames of a sequence, with all cells."""
        cells, place = self.cells(views[0].light.soft), {"sequence": sequence, "frames": len(views)}
        return Block(views, cells, self.coordinates, self.rounds, self.reference, place if sequence else {})

    def lights_of(self, scene: Scene) -> list[Light]:
        """Lights of the study in a scene; "file" stands for all of the scene's."""
        lights = _chosen(self.lights, scene.lights, scene.lights, f"lights of {scene.name}")
        return [sunlit(light) for light in lights] if self.sun else lights


def _takes_a_size(spec: Spec) -> bool:
    """Whether map sizes of a study apply to a spec: it has a map, and names no size."""
    return has_size(spec.technique) and "size" not in spec.explicit


def _chosen(
    entries: Sequence[str | Named], known: Sequence[Named], of_file: Sequence[Named], where: str
) -> list[Named]:
    """The cameras or lights that entries name, without duplicates; "file" stands for `of_file`."""
    chosen: list[Named] = []
    for entry in entries:
        if not isinstance(entry, str):
            chosen.append(entry)
        else:
            chosen.extend(of_file if entry == "file" else [named(known, entry, where)])
    chosen = list(dict.fromkeys(chosen))
    names = [thing.name for thing in chosen]
    for name in names:
        if names.count(name) > 1:
            raise InputError(f"{where}: two are called {name!r}; names must differ")
    return chosen


def scenes_of(blocks: Sequence[Block]) -> list[Scene]:
    """Scenes of the blocks, without duplicates."""
    return list(dict.fromkeys(block.view.scene for block in blocks))


def read_study(file: Path, techniques: Techniques, folder: Path | None = None) -> Study:
    """Read a study file; without `technique` tables, all techniques at their defaults. Raises InputError.

    Those for soft shadows are then left out under lights without a size. folder: base of relative scene paths, by
    default the file's folder.
    """
    table = read_toml(file, str(file), f"no such study file{alternatives(file, study_names(), 'ours')}")
    if "mesh" in table and "scenes" not in table:
        raise InputError(f"{file}: found a scene file; allowed: a study file, or `shadowbench run` with it as a scene")
    notes: list[str] = []
    convert(table, str(file), folder or file.parent, techniques, notes)
    return validated(Study, table, str(file)).with_(notes=tuple(notes))


def study_from_options(
    known: Techniques,
    scenes: Sequence[str | Scene] = (),
    specs: Sequence[Spec] = (),
    *,
    study: str | None = None,
    map_size: Sequence[int] | None = None,
    measuring: Measuring = AS_STUDIED,
    view: ViewOptions = FIRST,
) -> Study:
    """A study from a file or a built-in one (`default` for None), with what is asked for in place of its own.

    known: techniques that the file may name; view: options without a value keep the study's. Specs without a study and
    map sizes are measured at their own map sizes, in one phase. Raises InputError.
    """
    base = read_study(find_study(study or "default"), known)
    changes: dict[str, Any] = {"scenes": scenes, "map_size": map_size, **asdict(measuring), **asdict(view)}
    for one, several in (("view", "views"), ("light", "lights")):
        changes[several] = tuple(filter(None, [changes.pop(one)]))
    changes = {name: value for name, value in changes.items() if value or type(value) in (int, float)}  # 0 rounds, 0 s
    if view.camera:
        changes["target"] = view.target
    if view.lamp or view.sun_at:
        changes |= {"lamp": view.lamp, "sun_at": view.sun_at}
    if specs:
        changes["technique"] = (CrossedSpecs(tuple(specs), sweeps=base.sweeps),)
        if study is None and map_size is None:
            changes = {"map_size": None, "phases": 1, **changes}
    elif measuring.phases:
        changes["technique"] = tuple(replace(crossed, phases=None) for crossed in base.technique)
    return base.with_(**changes)


def find_study(name: str) -> Path:
    """Path of a study: a file, or a built-in study by name."""
    path = Path(name)
    ours = data_folder("benchmarks") / f"{name}.toml"
    return ours if not path.is_file() and ours.is_file() else path


def study_names() -> list[str]:
    """Names of the built-in studies."""
    return sorted(path.stem for path in data_folder("benchmarks").glob("*.toml"))


def copy_study(about: Mapping[str, Any], folder: Path, baseline: Path) -> Path | None:
    """Copy the study file that a run folder's command names to `study.toml` in a baseline; the copied file.

    None if the command, in `about`, the contents of `run.json`, names none, and if the file was changed since.
    """
    words = shlex.split(about.get("command", "").replace("--study=", "--study "))
    named = [value for option, value in itertools.pairwise(words) if option in ("-s", "--study")]
    file, kept = find_study(named[-1]) if named else baseline, baseline / "study.toml"
    if not file.is_file() or file.stat().st_mtime > (folder / "run.json").stat().st_mtime or file == kept:
        return None
    with replace_file(kept) as temporary:
        temporary.write_bytes(file.read_bytes())
    return file
