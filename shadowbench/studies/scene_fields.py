"""Fields of a study on how its scenes are read: those of `SceneOptions`."""

from dataclasses import fields
from pathlib import Path
from typing import Annotated, Self, cast

from pydantic import BeforeValidator, Field, ValidationInfo, model_validator

from shadowbench.errors import InputError
from shadowbench.measure.rows import StudyFacts
from shadowbench.options import SceneOptions, in_python, place_text
from shadowbench.strict import Strict


def _place(value: object, info: ValidationInfo) -> str | None:
    try:
        return place_text(value, str(info.field_name))
    except InputError as error:
        raise ValueError(str(error)) from None


_Place = Annotated[str | None, BeforeValidator(_place)]


class SceneFields(Strict):
    """How all scenes of a study are read; each field is that of `SceneOptions`, places also as lists of numbers."""

    sun: bool = Field(False, strict=True)
    no_ground: bool = Field(False, strict=True)
    time: float | None = Field(None, ge=0.0)
    clip: str | None = None
    camera: _Place = None
    target: _Place = None
    lamp: _Place = None
    sun_at: _Place = None
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

    def scene_facts(self) -> StudyFacts:
        """The fields that are set and `sun`, for `run.json`; not `assets`, which is a folder of one machine."""
        names = [field.name for field in fields(SceneOptions) if field.name not in ("assets", "sun")]
        given = {name: value for name in names if (value := getattr(self, name)) is not None and value is not False}
        return cast(StudyFacts, {"sun": self.sun, **given})
