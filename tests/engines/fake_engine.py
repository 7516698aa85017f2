"""An engine for tests: draws what a file says, as it should or with a fault; runs in a program of its own."""

import io
import os
import sys
import time
from pathlib import Path

import numpy as np

FOLDER = Path(__file__).parent
FAULT = (FOLDER / "fault").read_text()
CHANGES = {  # of the linear picture, with shadows or without
    "no shadows": lambda lit, picture, shadows: lit,
    "lighter": lambda lit, picture, shadows: 1.5 * lit if shadows else picture,
    "noise": lambda lit, picture, shadows: picture * (1 + 0.01 * np.random.default_rng().random(picture.shape)),
    "upside down": lambda lit, picture, shadows: picture[::-1],
    "mirrored": lambda lit, picture, shadows: picture[:, ::-1],
    "nothing": lambda lit, picture, shadows: 0 * picture,
}
last = None


def open(width, height):
    if FAULT == "prints":
        print("hello" * 1000, flush=True)
        os.write(1, b"not a message\n")
    return "1.0", "SwiftShader" if FAULT == "SwiftShader" else "a test"


def load(model, view):
    assert model.read_bytes()[:4] == b"glTF"
    with (FOLDER / "loaded").open("a") as file:
        print(view["scene"], file=file)


def draw(camera, light, box, params, shadows, exposure):
    global last
    known = f"{camera['target'][0]:.6f} {light['direction'][0]:.6f}.npz"
    scene = dict(np.load(io.BytesIO((FOLDER / known).read_bytes())))
    if FAULT == "dies" and not scene["probe"]:
        print("out of memory", file=sys.stderr, flush=True)
        os._exit(3)
    if FAULT == "hangs" and not scene["probe"]:
        time.sleep(600)
    if FAULT == "raises":
        raise ValueError("no such filter")
    lit = exposure * scene["cosine"]
    linear = lit * scene["visibility"] if shadows else lit
    if FAULT in CHANGES:
        linear = CHANGES[FAULT](lit, linear, shadows)
    if FAULT == "late":
        linear, last = (linear if last is None else last), linear
    clipped = np.clip(linear, 0, 1)
    encoded = np.where(clipped <= 0.0031308, clipped * 12.92, 1.055 * clipped ** (1 / 2.4) - 0.055)
    if FAULT == "gamma":
        encoded = clipped ** (1 / 1.5)
    picture = np.repeat(np.round(encoded * 255).astype(np.uint8)[..., None], 3, axis=-1)
    if FAULT == "NaN":
        return np.full(picture.shape, np.nan, np.float32)
    return picture[:-1] if FAULT == "size" else np.ascontiguousarray(picture)
