"""Models of a scene file's camera, light and mesh tables, with their validation."""

import math
import re
from typing import Annotated, Literal, Self

from pydantic import BeforeValidator, Field, ValidationError, model_validator

from shadowbench.errors import InputError, alternatives
from shadowbench.scenes.model import WIDEST_CONE, Camera, Light
from shadowbench.scenes.triangles import LARGEST
from shadowbench.scenes.vectors import Vec3, vec3
from shadowbench.strict import Strict, explain

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


def _number(value: object) -> float:
    if isinstance(value, bool) or not isinstance(value, int | float):
        raise ValueError(f"found {value!r:.60}; allowed: a number")
    if not abs(value) <= LARGEST:
        raise ValueError(f"found {value!r:.60}; allowed: a number of at most {LARGEST:.0e} either way")
    return float(value)


def _three(value: object) -> Vec3:
    if not isinstance(value, list | tuple) or len(value) != 3:
        raise ValueError(f"found {value!r:.60}; allowed: three numbers")
    return vec3([_number(part) for part in value])


def _direction(value: object) -> Vec3:
    direction = _three(value)
    if not any(direction):
        raise ValueError("found three zeros; allowed: a direction")
    return direction


def _scale(value: object) -> Vec3:
    scale = _three(value) if isinstance(value, list | tuple) else vec3([_number(value)] * 3)
    if not all(scale):
        raise ValueError(f"found {value!r:.60}; allowed: a number or three, none of them 0")
    return scale


def _size(value: object) -> tuple[float, float]:
    if not isinstance(value, list | tuple) or len(value) != 2:
        raise ValueError(f"found {value!r:.60}; allowed: two numbers, width and height")
    width, height = (_number(part) for part in value)
    if not (min(width, height) > 0.0 or width == height == 0.0):
        raise ValueError(f"found {value!r:.60}; allowed: a width and a height above 0, or both 0 for a hard light")
    return width, height


def _color(value: object) -> Vec3:
    color = _three(value)
    if not all(0.0 <= channel <= 1.0 for channel in color):
        raise ValueError(f"found {value!r:.60}; allowed: linear red, green, blue, each from 0 to 1")
    return color


def _name(value: object) -> str:
    if not isinstance(value, str) or not NAME.fullmatch(value):
        raise ValueError(f"found {value!r:.60}; allowed: {NAMES}")
    return value


def name_from(text: str) -> str:
    """A name with invalid characters replaced by `-` and invalid initial ones removed.

    The result may be empty or too long.
    """
    return re.sub(r"[^\w .+-]", "-", text).lstrip(" .+-")


Number = Annotated[float, BeforeValidator(_number)]
Three = Annotated[Vec3, BeforeValidator(_three)]
Direction = Annotated[Vec3, BeforeValidator(_direction)]
Scale = Annotated[Vec3, BeforeValidator(_scale)]
Size = Annotated[tuple[float, float], BeforeValidator(_size)]
Color = Annotated[Vec3, BeforeValidator(_color)]
Name = Annotated[str, BeforeValidator(_name)]
Flag = Annotated[bool, Field(strict=True)]


class CameraTable(Strict):
    """A `[camera]` table, in degrees and metres."""

    name: Name | None = None
    position: Three
    target: Three
    fov_y: Number = Field(36.0, ge=NARROWEST, lt=180.0)
    up: Direction = (0.0, 1.0, 0.0)
    near: Number | None = Field(None, gt=0.0)
    far: Number | None = Field(None, gt=0.0)

    @model_validator(mode="after")
    def _sees_something(self) -> Self:
        if self.position == self.target:
            raise ValueError(f"position and target are both {list(self.position)}; they must differ")
        if self.near is not None and self.far is not None and self.near >= self.far:
            raise ValueError(f"near is {self.near:g} and far {self.far:g}; near must be less")
        return self


class DirectionalTable(Strict):
    """A directional `[light]`; angular_radius in degrees."""

    name: Name | None = None
    kind: Literal["directional"]
    direction: Direction
    angular_radius: Number = Field(0.0, ge=0.0, lt=WIDEST_SUN)


class SpotTable(Strict):
    """A spot `[light]`; angle: full cone angle in degrees; radius in metres."""

    name: Name | None = None
    kind: Literal["spot"]
    position: Three
    direction: Direction
    angle: Number = Field(gt=0.0, le=WIDEST_CONE)
    radius: Number = Field(0.0, ge=0.0)


class PointTable(Strict):
    """A point `[light]`; radius in metres."""

    name: Name | None = None
    kind: Literal["point"]
    position: Three
    radius: Number = Field(0.0, ge=0.0)


class DiscTable(Strict):
    """A disc `[light]`, which shines to the side of `direction`; radius in metres."""

    name: Name | None = None
    kind: Literal["disc"]
    position: Three
    direction: Direction
    radius: Number = Field(0.0, ge=0.0)


class RectangleTable(Strict):
    """A rectangle `[light]`, which shines to the side of `direction`; size: width and height in metres."""

    name: Name | None = None
    kind: Literal["rectangle"]
    position: Three
    direction: Direction
    up: Direction = (0.0, 1.0, 0.0)
    size: Size = (0.0, 0.0)


LightTable = DirectionalTable | SpotTable | PointTable | DiscTable | RectangleTable
LIGHT_TABLES: dict[str, type[LightTable]] = {
    "directional": DirectionalTable,
    "spot": SpotTable,
    "point": PointTable,
    "disc": DiscTable,
    "rectangle": RectangleTable,
}


class RepeatTable(Strict):
    """Repetition of a mesh: `count` copies including the original, each translated by `step` from the previous one."""

    count: int = Field(ge=1, le=MOST_COPIES, strict=True)
    step: Three


class MeshTable(Strict):
    """A `[[mesh]]` table, without the parameters of its shape."""

    name: Name | None = None
    file: str | None = Field(None, min_length=1, strict=True)
    shape: str | None = Field(None, min_length=1, strict=True)
    scale: Scale = (1.0, 1.0, 1.0)
    rotate: Three = (0.0, 0.0, 0.0)
    translate: Three = (0.0, 0.0, 0.0)
    repeat: Annotated[list[RepeatTable], BeforeValidator(lambda v: [v] if isinstance(v, dict) else v)] = Field(
        [], max_length=2
    )
    color: Color | None = None
    casts: Flag = True
    receives: Flag = True
    planar: Flag = False

    @model_validator(mode="after")
    def _one_source(self) -> Self:
        if (self.file is None) == (self.shape is None):
            raise ValueError(f"needs file or shape, {'not both' if self.file is not None else 'found neither'}")
        return self


def camera_from_table(table: object, where: str, default_name: str = "camera") -> Camera:
    """The camera of a table in a scene or study file. Raises InputError that begins with `where`."""
    try:
        row = CameraTable.model_validate(table)
    except ValidationError as error:
        raise explain(where, error) from error
    return Camera(
        name=row.name or default_name,
        position=row.position,
        target=row.target,
        fov_y=math.radians(row.fov_y),
        up=row.up,
        near=row.near,
        far=row.far,
    )


def light_from_table(table: object, where: str, default_name: str = "light") -> Light:
    """The light of a table in a scene or study file. Raises InputError that begins with `where`."""
    kind = table.get("kind") if isinstance(table, dict) else None
    if not isinstance(kind, str) or kind not in LIGHT_TABLES:
        found = "none" if kind is None else f"{kind!r:.60}"
        raise InputError(f"{where}: kind: found {found}{alternatives(kind, LIGHT_TABLES)}")
    try:
        row = LIGHT_TABLES[kind].model_validate(table)
    except ValidationError as error:
        raise explain(where, error) from error
    values = {field: value for field, value in row if field in Light.__dataclass_fields__}
    if isinstance(row, DirectionalTable):
        values["radius"] = math.radians(row.angular_radius)
    if isinstance(row, SpotTable):
        values["angle"] = math.radians(row.angle)
    return Light(**{**values, "name": row.name or default_name})
