"""The engine's half of the Python host: runs in the engine's own environment, without shadowbench.

`python python_host.py DRAW.py` reads calls from standard input and writes answers to what was standard output; what the
engine prints goes to standard error. Each is the length of a message in 8 bytes, little-endian, and the message, as
`pack` in programs.py makes it.
"""

import importlib.util
import json
import os
import sys
import tempfile
import traceback
from pathlib import Path
from typing import Any


def main(file: str) -> None:
    """Answer calls until the input ends."""
    answers = os.fdopen(os.dup(1), "wb")
    os.dup2(2, 1)
    specification = importlib.util.spec_from_file_location("draw", file)
    assert specification is not None and specification.loader is not None
    engine = importlib.util.module_from_spec(specification)
    while length := sys.stdin.buffer.read(8):
        message = sys.stdin.buffer.read(int.from_bytes(length, "little"))
        end = 4 + int.from_bytes(message[:4], "little")
        call = json.loads(message[4:end])
        try:
            if call["name"] == "open":
                specification.loader.exec_module(engine)
            answer, pixels = answer_to(engine, call["name"], call["argument"], message[end:])
        except Exception as error:
            place = traceback.extract_tb(error.__traceback__)[-1]
            answer, pixels = {"error": f"{type(error).__name__}: {error} ({place.filename}:{place.lineno})"}, b""
        text = json.dumps(answer).encode()
        answers.write((4 + len(text) + len(pixels)).to_bytes(8, "little"))
        answers.write(len(text).to_bytes(4, "little") + text + pixels)
        answers.flush()


def answer_to(engine: Any, name: str, argument: Any, data: bytes) -> tuple[dict[str, Any], bytes]:
    """Header and data of the answer to a call."""
    if name == "open":
        version, renderer = engine.open(**argument)
        return {"version": version, "renderer": renderer}, b""
    if name == "load":
        with tempfile.TemporaryDirectory() as folder:
            (model := Path(folder, "scene.glb")).write_bytes(data)
            engine.load(model, argument)
        return {}, b""
    picture = engine.draw(**argument)
    return {"shape": picture.shape, "type": str(picture.dtype)}, picture.tobytes()


if __name__ == "__main__":
    main(sys.argv[1])
