"""An engine for tests: draws what a file says, as it should or with a fault; runs in a program of its own."""

import io
import os
import sys
import time
from pathlib import Path

import numpy as np

FOLDER = Path(__file__).parent
FAULT = (FOLDER / "fault").read_text()
last = None


def open(size):
    if FAULT == "prints":
        print("hello" * 1000, flush=True)
        os.write(1, b"not a message\n")
    return "1.0", "SwiftShader" if FAULT == "SwiftShader" else "a test"


def load(glb, view):
    global scene
    assert glb[:4] == b"glTF"
    scene = dict(np.load(io.BytesIO((FOLDER / f"{view['scene']}.npz").read_bytes())))


def draw(light, box, params, shadows, exposure):
    global last
    probing = len(scene["cosine"]) and scene["probe"]
    if FAULT == "dies" and not probing:
        print("out of memory", file=sys.stderr, flush=True)
        os._exit(3)
    if FAULT == "hangs" and not probing:
        time.sleep(600)
    if FAULT == "raises":
        raise ValueError("no such filter")
    linear = exposure * scene["cosine"] * (scene["visibility"] if shadows else 1)
    if FAULT == "no shadows":
        linear = exposure * scene["cosine"]
    if FAULT == "lighter" and shadows:
        linear = exposure * scene["cosine"] * 1.5
    if FAULT == "noise":
        linear = linear * (1 + 0.01 * np.random.default_rng().random(linear.shape))
    if FAULT == "upside down":
        linear = linear[::-1]
    if FAULT == "mirrored":
        linear = linear[:, ::-1]
    if FAULT == "nothing":
        linear = np.zeros_like(linear)
    if FAULT == "late":
        linear, last = (linear if last is None else last), linear
    if FAULT == "gamma 2.2":
        encoded = np.clip(linear, 0, 1) ** (1 / 1.5)
    else:
        clipped = np.clip(linear, 0, 1)
        encoded = np.where(clipped <= 0.0031308, clipped * 12.92, 1.055 * clipped ** (1 / 2.4) - 0.055)
    picture = np.repeat(np.round(encoded * 255).astype(np.uint8)[..., None], 3, axis=-1)
    if FAULT == "NaN":
        return np.full(picture.shape, np.nan, np.float32)
    return picture[:-1] if FAULT == "size" else np.ascontiguousarray(picture)
