"""A connection between processes over which a scene crosses once, however many calls are about its views."""

import io
import pickle
from collections.abc import Callable
from multiprocessing.connection import Connection
from typing import Any

from shadowbench.scenes.model import Scene


class _Pickler(pickle.Pickler):
    """Has `stands_for` say what is sent in place of a thing; None for the thing itself."""

    stands_for: Callable[[object], Any]

    def persistent_id(self, thing: object) -> Any:
        return self.stands_for(thing)


class _Unpickler(pickle.Unpickler):
    """Has `load_as` give what was sent in place of a thing."""

    load_as: Callable[[Any], object]

    def persistent_load(self, sent: Any) -> object:
        return self.load_as(sent)


class Pipe:
    """One end of a connection. The scene that was sent last is named, not sent again; both ends hold it."""

    def __init__(self, connection: Connection) -> None:
        self.connection = connection
        self._scene: Scene | None = None

    def send(self, thing: object) -> None:
        """Send what can be pickled; raises BrokenPipeError or ConnectionResetError where nobody reads."""
        buffer = io.BytesIO()
        pickler = _Pickler(buffer, pickle.HIGHEST_PROTOCOL)
        pickler.stands_for = self._sent
        pickler.dump(thing)
        self.connection.send_bytes(buffer.getbuffer())

    def receive(self) -> Any:
        """What was sent next; waits for it. Raises EOFError where nobody is left to send."""
        unpickler = _Unpickler(io.BytesIO(self.connection.recv_bytes()))
        unpickler.load_as = self._received
        return unpickler.load()

    def _sent(self, thing: object) -> tuple[bytes | None] | None:
        """Of a scene, all of it as bytes, or nothing where the other end has it."""
        if not isinstance(thing, Scene):
            return None
        if thing is self._scene:
            return (None,)
        self._scene = thing
        return (pickle.dumps(thing, pickle.HIGHEST_PROTOCOL),)

    def _received(self, sent: tuple[bytes | None]) -> Scene:
        (scene,) = sent
        if scene is not None:
            self._scene = pickle.loads(scene)
        assert self._scene is not None
        return self._scene
