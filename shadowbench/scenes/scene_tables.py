"""Models of a scene file's camera, light and mesh tables, with their validation."""

import math
import re
from collections.abc import Callable
from typing import Annotated, Any, Literal, Self

from pydantic import AfterValidator, BeforeValidator, Field, model_validator

from shadowbench.errors import InputError, alternatives
from shadowbench.options import LATEST
from shadowbench.scenes.model import WIDEST_CONE, Camera, Light
from shadowbench.scenes.triangles import LARGEST
from shadowbench.strict import Strict, validated

MOST_COPIES = 50_000
"""Limit on the meshes of a scene, each copy counted."""
MOST_NAMED = 1000
"""Limit on the cameras of a scene, and on its lights."""
WIDEST_SUN = 90.0
"""Angular radii of directional lights are below this, in degrees: a wider one surrounds the scene."""
NARROWEST = 0.01
"""Smallest field of view in degrees; float32 cannot resolve the pixels of a narrower one."""
LONGEST_NAME = 80
NAME = re.compile(rf"\w[\w .+-]{{0,{LONGEST_NAME - 1}}}")
"""Names are used in file names and CSV cells: no line breaks, and no initial =, +, - or @, which begins a formula."""
NAMES = f"up to {LONGEST_NAME} letters, digits, spaces, or any of _ . + -, the first a letter, a digit or _"


def _not_too_large(number: float) -> float:
    if abs(number) > LARGEST:
        raise ValueError(f"found {number:g}; allowed: at most {LARGEST:.0e} either way")
    return number


def _checked(valid: Callable[[tuple[float, ...]], bool], allowed: str) -> AfterValidator:
    """Accepts numbers that are valid together."""

    def check(numbers: tuple[float, ...]) -> tuple[float, ...]:
        if not valid(numbers):
            raise ValueError(f"found {list(numbers)}; allowed: {allowed}")
        return numbers

    return AfterValidator(check)


def _name(value: object) -> str:
    if not isinstance(value, str) or not NAME.fullmatch(value):
        raise ValueError(f"found {value!r:.60}; allowed: {NAMES}")
    return value


def name_from(text: str) -> str:
    """A name with invalid characters replaced by `-` and invalid initial ones removed.

    The result may be empty or too long.
    """
    return re.sub(r"[^\w .+-]", "-", text).lstrip(" .+-")


Number = Annotated[float, Field(strict=True), AfterValidator(_not_too_large)]
Share = Annotated[float, Field(strict=True, ge=0.0, le=1.0)]
Three = tuple[Number, Number, Number]
Direction = Annotated[Three, _checked(any, "a direction of three numbers, not three zeros")]
Scale = Annotated[
    Three,
    _checked(all, "a number or three, none of them 0"),
    BeforeValidator(lambda value: value if isinstance(value, list | tuple) else [value] * 3),
]
Size = Annotated[
    tuple[Number, Number],
    _checked(lambda size: min(size) > 0.0 or not any(size), "a width and a height above 0, or both 0 for a hard light"),
]
Color = tuple[Share, Share, Share]  # linear red, green, blue
Name = Annotated[str, BeforeValidator(_name)]
Flag = Annotated[bool, Field(strict=True)]
Text = Annotated[str, Field(min_length=1, strict=True)]


class _Camera(Strict):
    name: Name | None = None
    position: Three
    target: Three
    kind: Literal["perspective", "orthographic"] = "perspective"
    fov_y: Number = Field(36.0, ge=NARROWEST, lt=180.0)  # degrees
    height: Number | None = Field(None, gt=0.0)  # metres
    up: Direction = (0.0, 1.0, 0.0)
    near: Number | None = Field(None, gt=0.0)
    far: Number | None = Field(None, gt=0.0)

    @model_validator(mode="after")
    def _sees_something(self) -> Self:
        if self.position == self.target:
            raise ValueError(f"position and target are both {list(self.position)}; they must differ")
        own, other = ("fov_y", "height") if self.kind == "perspective" else ("height", "fov_y")
        if other in self.model_fields_set or getattr(self, own) is None:
            raise ValueError(f"a camera of kind {self.kind} has {own}, not {other}")
        if self.near is not None and self.far is not None and self.near >= self.far:
            raise ValueError(f"near is {self.near:g} and far {self.far:g}; near must be less")
        return self


class _Light(Strict):
    name: Name | None = None
    kind: str


class _Directional(_Light):
    direction: Direction
    angular_radius: Number = Field(0.0, ge=0.0, lt=WIDEST_SUN)  # degrees


class _Point(_Light):
    position: Three
    radius: Number = Field(0.0, ge=0.0)


class _Disc(_Point):
    direction: Direction


class _Spot(_Disc):
    angle: Number = Field(gt=0.0, le=WIDEST_CONE)  # of the full cone, degrees


class _Rectangle(_Light):
    position: Three
    direction: Direction
    up: Direction = (0.0, 1.0, 0.0)
    size: Size = (0.0, 0.0)


LIGHT_TABLES: dict[str, type[_Light]] = {
    "directional": _Directional, "spot": _Spot, "point": _Point, "disc": _Disc, "rectangle": _Rectangle,
}  # fmt: skip


class _Repeat(Strict):
    count: int = Field(ge=1, le=MOST_COPIES, strict=True)
    step: Three


class MeshTable(Strict):
    """A `[[mesh]]` table, without the parameters of its shape.

    time, clip: what is taken of a glTF, as of `Chosen`. smooth: whether a shape has smooth normals.
    mask: an image in the scene's folder that cuts the mesh out where its alpha is below `cutoff`; mask_filter: whether
    texels are mixed or the nearest is taken.
    repeat: `count` copies including the original, each translated by `step` from the previous one, in one or two
    directions.
    """

    name: Name | None = None
    file: Text | None = None
    shape: Text | None = None
    scale: Scale = (1.0, 1.0, 1.0)
    rotate: Three = (0.0, 0.0, 0.0)
    translate: Three = (0.0, 0.0, 0.0)
    repeat: Annotated[list[_Repeat], BeforeValidator(lambda v: [v] if isinstance(v, dict) else v)] = Field(
        [], max_length=2
    )
    time: Number | None = Field(None, ge=0.0, le=LATEST)
    clip: Text | None = None
    smooth: Flag = False
    mask: Text | None = None
    cutoff: Number = Field(0.5, gt=0.0, le=1.0)
    mask_filter: Literal["linear", "nearest"] = "linear"
    color: Color | None = None
    casts: Flag = True
    receives: Flag = True

    @model_validator(mode="after")
    def _one_source(self) -> Self:
        if (self.file is None) == (self.shape is None):
            raise ValueError(f"needs file or shape, {'not both' if self.file is not None else 'found neither'}")
        if self.file is None and (self.time, self.clip) != (None, None):
            raise ValueError("time and clip are for a file, which may have them")
        if self.shape is None and self.smooth:
            raise ValueError("smooth is for a shape; a file has normals of its own, or is flat")
        if self.mask is None and self.model_fields_set & {"cutoff", "mask_filter"}:
            raise ValueError("cutoff and mask_filter are for a mask")
        return self


def camera_from_table(table: object, where: str, default_name: str = "camera") -> Camera:
    """The camera of a table in a scene or study file. Raises InputError that begins with `where`."""
    row = validated(_Camera, table, where)
    values = {
        **dict(row),
        "name": row.name or default_name,
        "fov_y": math.radians(row.fov_y),
        "height": row.height or 0.0,
    }
    if values.pop("kind") == "orthographic":
        values["fov_y"] = 0.0
    return Camera(**values)


def light_from_table(table: object, where: str, default_name: str = "light") -> Light:
    """The light of a table in a scene or study file. Raises InputError that begins with `where`."""
    kind = table.get("kind") if isinstance(table, dict) else None
    if not isinstance(kind, str) or kind not in LIGHT_TABLES:
        found = "none" if kind is None else f"{kind!r:.60}"
        raise InputError(f"{where}: kind: found {found}{alternatives(kind, LIGHT_TABLES)}")
    row = validated(LIGHT_TABLES[kind], table, where)
    values: dict[str, Any] = {**dict(row), "name": row.name or default_name}
    if isinstance(row, _Directional):
        values["radius"] = math.radians(values.pop("angular_radius"))
    if isinstance(row, _Spot):
        values["angle"] = math.radians(row.angle)
    return Light(**values)
