"""Connection between processes that sends a scene once, however many calls refer to its views."""

import io
import pickle
from collections.abc import Callable
from multiprocessing.connection import Connection
from typing import Any

from shadowbench.scenes.model import Scene


class _Pickler(pickle.Pickler):
    """Pickler that sends `stand_in(thing)` instead of a thing, unless that is None."""

    stand_in: Callable[[object], Any]

    def persistent_id(self, thing: object) -> Any:
        return self.stand_in(thing)


class _Unpickler(pickle.Unpickler):
    """Unpickler that converts a stand-in back to its thing by `restore`."""

    restore: Callable[[Any], object]

    def persistent_load(self, sent: Any) -> object:
        return self.restore(sent)


class Pipe:
    """One end of a connection. Both ends keep the last scene, which is then referred to rather than sent again."""

    def __init__(self, connection: Connection) -> None:
        self.connection = connection
        self._scene: Scene | None = None

    def send(self, thing: object) -> None:
        """Pickle and send a thing. Raises BrokenPipeError or ConnectionResetError if the other end is closed."""
        buffer = io.BytesIO()
        arrays: list[pickle.PickleBuffer] = []  # sent as they are: copying them takes as long as sending them
        pickler = _Pickler(buffer, pickle.HIGHEST_PROTOCOL, buffer_callback=arrays.append)
        pickler.stand_in = self._scene_out
        pickler.dump(thing)
        contents = [array.raw() for array in arrays]
        self.connection.send_bytes(pickle.dumps(([content.nbytes for content in contents], buffer.getvalue())))
        for content in filter(len, contents):
            self.connection.send_bytes(content)

    def receive(self) -> Any:
        """Wait for the next thing and return it. Raises EOFError if the other end is closed."""
        sizes, pickled = pickle.loads(self.connection.recv_bytes())
        contents = [bytearray(size) for size in sizes]
        for content in filter(len, contents):
            self.connection.recv_bytes_into(content)
        unpickler = _Unpickler(io.BytesIO(pickled), buffers=contents)
        unpickler.restore = self._scene_in
        return unpickler.load()

    def _scene_out(self, thing: object) -> tuple[bytes | None] | None:
        """Stand-in for a scene: its pickled bytes, or None if the other end has it. None for any other thing."""
        if not isinstance(thing, Scene):
            return None
        if thing is self._scene:
            return (None,)
        self._scene = thing
        return (pickle.dumps(thing, pickle.HIGHEST_PROTOCOL),)

    def _scene_in(self, sent: tuple[bytes | None]) -> Scene:
        (scene,) = sent
        if scene is not None:
            self._scene = pickle.loads(scene)
        assert self._scene is not None
        return self._scene
