"""Decompression of a glTF's bufferViews: EXT_meshopt_compression and KHR_meshopt_compression, one stream format.

In this process, unlike Draco: the decoder writes as many elements as it is asked for, whatever the stream says, and
what it is asked for is checked against the stream's size and its bufferView's before (`gltf_storage`).
"""

from shadowbench.errors import InputError
from shadowbench.scenes.gltf_accessors import Data
from shadowbench.scenes.gltf_storage import BufferView
from shadowbench.strict import short


def decompressed(data: Data) -> Data:
    """The same with each compressed bufferView in a buffer of its own. Raises InputError for an invalid stream."""
    views, buffers = list(data.layout.bufferViews), list(data.buffers)
    for k, view in enumerate(views):
        if view.compressed is not None:
            views[k] = view.model_copy(update={"buffer": len(buffers), "byteOffset": 0, "compressed": None})
            buffers.append(_decoded(view, data, f"{data.where}: bufferViews {k + 1}"))
    return Data(data.layout.model_copy(update={"bufferViews": views}), buffers, data.where)


def _decoded(view: BufferView, data: Data, where: str) -> bytes:
    import meshopt  # not on all platforms

    packed = view.compressed
    assert packed is not None
    if not packed.count:
        return b""
    stream = data.buffers[packed.buffer][packed.byteOffset : packed.end]
    try:
        rows = meshopt.decode_gltf_buffer(stream, packed.count, packed.byteStride, packed.mode, packed.filter)
    except ValueError as error:
        raise InputError(f"{where}: cannot be decompressed: {short(error)}") from error
    return bytes(rows)
