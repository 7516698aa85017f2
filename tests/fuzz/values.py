"""Unexpected values: paths outside the folder, absurd numbers, terminal escapes, deep nesting."""

from hypothesis import strategies as st

PATHS = [
    "part.obj", "../outside/part.obj", "../../../../../../etc/passwd", "/etc/passwd", "/dev/zero", "/dev/stdin",
    "/proc/self/mem", "out.obj", "link/part.obj", "./../inside/part.obj", "~/part.obj", "file:///etc/passwd",
    "http://127.0.0.1:9/part.obj", "C:\\part.obj", "\\\\host\\part.obj", "part.obj\0.toml", "a" * 300 + ".obj",
    "a/" * 3000 + "a.obj", "", ".", "..", "/", "part.OBJ", "part.fbx", "self.toml", "\n.obj", "\x1b[2Jpart.obj",
    "ghost.obj", "données.obj", "mesh.gltf", "random.glb", "random.ply", "random.stl", "random.off", "loop.obj",
]  # fmt: skip
WORDS = [
    *[
        "nan",
        "inf",
        "true",
        "box",
        "plane",
        "sphere",
        "directional",
        "point",
        "file",
        "𝕊",
        "\u202e",
        "é",
        "shadow-map",
        "d32f",
        "${HOME}",
        "%s%n",
        "'",
        '"',
    ],
    *("", " ", "a" * 5000, "\n", "\0", "\x1b[31m", "💥" * 90),
]
NUMBERS: list[int | float] = [
    0, -0.0, 1, -1, 2, 3, 7, 8, 17, 1000, 1024, 65536, 65537, 10_000, 99_999, 100_000, 100_001, 2**31 - 1, 2**31, 2**32,
    2**53 + 1, 2**63 - 1, -(2**63), 2**63, 10**30, 1e-320, 5e-324, 1e-18, 1e-12, 1e-6, 0.1, 0.5, 89.999, 90.0, 180.0,
    360.0, 1e6, 1e17, 1e18, 1.1e18, 1e19, 1e38, 1e154, 1.7e308, float("inf"), float("-inf"), float("nan"),
]  # fmt: skip

number = st.sampled_from(NUMBERS) | st.integers(-9, 99) | st.floats(-99, 99) | st.integers() | st.floats()
text = st.sampled_from(WORDS) | st.sampled_from(PATHS) | st.text(max_size=20)
scalar = number | text | st.booleans() | st.dates() | st.datetimes() | st.times()
value = st.recursive(
    scalar,
    lambda inner: st.lists(inner, max_size=4) | st.dictionaries(st.text(max_size=6), inner, max_size=3),
    max_leaves=6,
)
huge = st.builds(lambda part, count: [part] * count, scalar, st.sampled_from([10, 300, 3000]))
replacement = value | huge
three = st.lists(number, min_size=3, max_size=3)
