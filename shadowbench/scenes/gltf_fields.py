"""What tables of a glTF's JSON are made of: numbers, and indices into its lists, which are checked."""

from typing import Annotated, Any

from pydantic import AfterValidator, AliasPath, BaseModel, ConfigDict, Field, ValidationInfo

LISTS = {"lights": AliasPath("extensions", "KHR_lights_punctual", "lights")}
"""Lists of extensions."""

Count = Annotated[int, Field(ge=0, le=2**53, strict=True)]
Number = Annotated[float, Field(strict=True)]
Three = Annotated[list[Number], Field(min_length=3, max_length=3)]


def index_into(part: str) -> AfterValidator:
    """Checks an index into a list of the file's top level."""

    def check(index: int, info: ValidationInfo) -> int:
        document: dict[str, Any] = info.context or {}
        parts = LISTS[part].search_dict_for_path(document) if part in LISTS else document.get(part)
        count = len(parts) if isinstance(parts, list | dict) else 0
        if index >= count:
            raise ValueError(f"found {index}; allowed: {f'0 to {count - 1}' if count else 'none, as there are none'}")
        return index

    return AfterValidator(check)


AccessorIndex = Annotated[Count, index_into("accessors")]
NodeIndex = Annotated[Count, index_into("nodes")]
ViewIndex = Annotated[Count, index_into("bufferViews")]


class JsonObject(BaseModel):
    """A table whose unknown fields are ignored."""

    model_config = ConfigDict(extra="ignore", frozen=True, allow_inf_nan=False)
