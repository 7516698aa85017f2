"""Types of a study's fields: validation and conversion from what a study file has."""

import os
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, Any

from pydantic import AfterValidator, BeforeValidator, Field, GetPydanticSchema, InstanceOf, ValidationInfo
from pydantic_core import PydanticKnownError

from shadowbench.options import MAP_SIZE
from shadowbench.scenes.library import builtin_names
from shadowbench.scenes.model import Camera, Light, Scene
from shadowbench.scenes.tables import camera_from_table, light_from_table
from shadowbench.studies.crossing import CrossedSpecs, Techniques, cross, parse_spec_at, to_list
from shadowbench.techniques.spec import Spec

MOST_NAMED = 1000
"""Most entries of a study file's lists of scenes, views, lights and technique tables."""

Table = dict[str, Any]


@dataclass(frozen=True)
class Source:
    """Context of reading a study file: its name and folder, the known techniques, and notes made on the way."""

    where: str
    folder: Path
    techniques: Techniques
    notes: list[str] = field(default_factory=list)


def _written(kind: Any) -> Any:
    """Schema of a field as written in files, for a field that holds a converted type."""
    return GetPydanticSchema(lambda _, handler: handler.generate_schema(kind))


def _entries(kind: Any) -> Any:
    """Schema of a list field as written in files."""
    return _written(Annotated[list[kind], Field(min_length=1), AfterValidator(_few)])


def _few(entries: list[Any], info: ValidationInfo) -> list[Any]:
    if info.context is not None and len(entries) > MOST_NAMED:
        sizes = {"field_type": "List", "max_length": MOST_NAMED, "actual_length": len(entries)}
        raise PydanticKnownError("too_long", sizes)
    return entries


def _scenes(entries: list[str | Scene], info: ValidationInfo) -> tuple[str | Scene, ...]:
    """Scenes by name, or by path, made relative to the study file's folder."""
    if info.context is None:
        return tuple(entries)
    folder = info.context.folder
    return tuple(_scene_reference(entry, folder) if isinstance(entry, str) else entry for entry in entries)


def _scene_reference(reference: str, folder: Path) -> str:
    # A bare word that names no file is a misspelt built-in name, which `load_scene` reports.
    bare = not Path(reference).suffix and Path(reference).name == reference and not os.path.lexists(folder / reference)
    return reference if bare or reference in builtin_names() else str(folder / reference)


def _cameras(entries: list[Any], info: ValidationInfo) -> tuple[str | Camera, ...]:
    def made(entry: Any, number: int) -> str | Camera:
        return camera_from_table(entry, f"{_source(info).where}: views {number}", f"view-{number}")

    return _made_of_tables(entries, made)


def _lights(entries: list[Any], info: ValidationInfo) -> tuple[str | Light, ...]:
    def made(entry: Any, number: int) -> str | Light:
        return light_from_table(entry, f"{_source(info).where}: lights {number}", f"light-{number}")

    return _made_of_tables(entries, made)


def _crossings(entries: list[Any], info: ValidationInfo) -> tuple[CrossedSpecs, ...]:
    def made(entry: Any, number: int) -> CrossedSpecs:
        source = _source(info)
        return cross(entry, source.techniques, f"{source.where}: technique {number}", source.notes)

    return _made_of_tables(entries, made)


def _made_of_tables(entries: list[Any], made: Callable[[Any, int], Any]) -> tuple[Any, ...]:
    """The entries, with tables converted by `made`, which also takes their number."""
    return tuple(
        made(entry, number) if isinstance(entry, dict) else entry for number, entry in enumerate(entries, start=1)
    )


def _reference(written: Any, info: ValidationInfo) -> Spec:
    if isinstance(written, Spec):
        return written
    return parse_spec_at(written, _source(info).techniques, f"{_source(info).where}: reference")


def _source(info: ValidationInfo) -> Source:
    assert isinstance(info.context, Source)  # unconverted values come from files only
    return info.context


Sizes = Annotated[
    tuple[Annotated[int, Field(ge=MAP_SIZE.least, le=MAP_SIZE.most, strict=True)], ...],
    BeforeValidator(to_list),
    Field(min_length=1),
]
Scenes = Annotated[tuple[str | Scene, ...], _entries(str | InstanceOf[Scene]), AfterValidator(_scenes)]
Cameras = Annotated[tuple[str | Camera, ...], _entries(str | Table | InstanceOf[Camera]), AfterValidator(_cameras)]
Lights = Annotated[tuple[str | Light, ...], _entries(str | Table | InstanceOf[Light]), AfterValidator(_lights)]
Crossings = Annotated[tuple[CrossedSpecs, ...], _entries(Table | InstanceOf[CrossedSpecs]), AfterValidator(_crossings)]
Reference = Annotated[Spec, _written(str | InstanceOf[Spec]), AfterValidator(_reference)]
