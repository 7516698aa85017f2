"""Tables of what moves in a glTF: skins and animations."""

from typing import Annotated, Literal, Self

from pydantic import Field, model_validator

from shadowbench.scenes.gltf_fields import AccessorIndex, Count, JsonObject, NodeIndex

MOST_MORPHED = 300_000_000
"""Limit on the displacements of vertices by morph targets, which may share their accessors: ten seconds."""


class Skin(JsonObject):
    """Nodes that are joints, and an accessor of the matrices from a mesh to each of them; None: identities."""

    joints: Annotated[list[NodeIndex], Field(min_length=1)]
    inverseBindMatrices: AccessorIndex | None = None


class Sampler(JsonObject):
    """Accessors of the times of keys, in seconds, and of their values."""

    input: AccessorIndex
    output: AccessorIndex
    interpolation: Literal["LINEAR", "STEP", "CUBICSPLINE"] = "LINEAR"


class _Target(JsonObject):
    """What of a node is set; path: translation, rotation, scale, weights, or what an extension defines."""

    node: NodeIndex | None = None
    path: str


class Channel(JsonObject):
    """Index of the sampler that sets a target."""

    sampler: Count
    target: _Target


class Animation(JsonObject):
    """A clip."""

    name: str | None = None
    channels: list[Channel]
    samplers: list[Sampler]

    @model_validator(mode="after")
    def _samplers_exist(self) -> Self:
        for k, channel in enumerate(self.channels, 1):
            if channel.sampler >= len(self.samplers):
                raise ValueError(f"channels {k}: found sampler {channel.sampler} of {len(self.samplers)}, from 0")
        return self
