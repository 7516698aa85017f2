"""The data sent over the pipe to the worker process."""

from typing import Any

import numpy as np

from shadowbench.measure.worker import Pipe
from shadowbench.scenes.opening import chosen_view


class Wire:
    """A connection to itself, with the data sent but not yet received."""

    def __init__(self) -> None:
        self.sent: list[bytes] = []

    def send_bytes(self, data: memoryview) -> None:
        self.sent.append(bytes(data))

    def recv_bytes(self) -> bytes:
        return self.sent.pop(0)

    def recv_bytes_into(self, buffer: bytearray) -> None:
        buffer[:] = self.sent.pop(0)


def test_a_scene_is_sent_once_until_another_is_sent() -> None:
    wire: Any = Wire()
    here, there = Pipe(wire), Pipe(wire)
    first, second = (chosen_view(name, 16) for name in ("cube-on-plane", "stairs"))
    sizes = []
    for view in (first, first, second, first):
        before = sum(map(len, wire.sent))
        here.send(("a call", view))
        sizes.append(sum(map(len, wire.sent)) - before)
    assert sizes[1] < 1000 < min(sizes[0], sizes[2], sizes[3])
    scenes = [there.receive()[1].scene for _ in sizes]
    assert scenes[0] is scenes[1] and len(set(scenes)) == 3
    for scene, view in zip(scenes, (first, first, second, first), strict=True):
        assert scene.name == view.scene.name
        assert np.array_equal(scene.geometry.vertices, view.scene.geometry.vertices)
