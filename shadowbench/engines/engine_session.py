"""A running engine: its program, the scene that it holds, and masks made from its pictures.

Pictures that cannot be of the scene are refused. A probe, of known places and brightness, shows before all else whether
frame, encoding and shading are what they should be.
"""

import math
import subprocess
import tempfile
from collections.abc import Iterator, Mapping, Sequence
from contextlib import ExitStack
from dataclasses import replace
from functools import lru_cache
from pathlib import Path
from typing import Any, cast

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import binary_dilation, maximum_filter, minimum_filter

from shadowbench.engines.programs import start_host
from shadowbench.masks.export import describe, describe_camera, describe_light, glb_of, light_box, nearest_depth
from shadowbench.masks.inputs import DARKEST, decode_srgb
from shadowbench.measure.pictures import Rendering
from shadowbench.measure.worker import CellFailed
from shadowbench.options import ViewSize
from shadowbench.plugin.base import Phase
from shadowbench.plugin.engine import Engine, EngineParams
from shadowbench.scenes.model import WIDEST_CONE, Camera, Light, Mesh, Scene, View
from shadowbench.scenes.opening import chosen_view
from shadowbench.scores.masks import quantise
from shadowbench.truths.cache import PIXEL_SAMPLES, cached_truth
from shadowbench.truths.trace import Truth

Request = Mapping[str, Any]
Luminance = NDArray[np.float64]
Levels = Sequence[Luminance]
"""Linear luminance of a picture at exposures that grow by BRIGHTER, (H, W) each, row 0 at the top."""

BRIGHTER = 16.0
"""Ratio of two exposures: of 255 levels of sRGB, a pixel at 1/64 of full light has 34 in one, 137 in the other."""
_FULL = 0.98  # luminance from which a pixel may be cut off
_TOLERATED = 2e-3  # share of pixels that may be lighter with shadows
_ODD = 0.02  # share of pixels that may be shaded otherwise than they or those beside them are
_STEP = 0.01  # of N·L, which 8 bits round
_GRAZING = 0.1  # N·L below which rounding may turn a surface away
_ALIKE = 0.1  # relative difference from N·L up to which shading is Lambert's

TURNS = {"upper right": -60.0, "upper left": 0.0, "lower left": 15.52, "lower right": 50.0}
"""Degrees by which the probe's squares are turned to the right. No reflection or turn of the picture is like it."""
_SUN = 60.0  # degrees from the camera's axis to the left, so that N·L is 1, 0.5 and 0.25, and one square is not lit
_PLACES = {"upper left": (-1, 1), "upper right": (1, 1), "lower left": (-1, -1), "lower right": (1, -1)}
_UNLIT = 0.002  # of the brightest, that the unlit square may have
_TOLERANCE = 0.03  # of the ratio of luminances, of which 8 bits take 0.01 at N·L = 1/4
_FACES = np.array([[0, 1, 2], [0, 2, 3]], np.int32)

_BRIGHTEST, _TOO_DARK, _CUT_OFF = 0.9, 0.5, 0.97  # luminance of the brightest surface: wanted, and where it is no good
_ROUNDING = 1e-5  # of floats, when a phase moves the light; a level of 8 bits is 30 times as much
_TRIES = 12  # pictures that may be drawn to find the exposure
_MOST_LEVELS, _TOO_DARK_SHARE = 4, 0.01  # exposures, and the share of surfaces that may be too dark in the brightest

_TRIAL_SCENES = {"directional": "cube-on-plane", "spot": "spot-lamp", "point": "room-with-lamp"}
_TRIAL_MAP = 1024
_LEAST_SHADOW = 0.5  # share of the true shadow


class EngineSession:
    """A program in which an engine draws pictures of a size, and the scene that it holds; `close` ends it.

    Raises CellFailed if it cannot start, or draws a probe wrongly.
    """

    def __init__(self, engine: type[Engine], size: ViewSize) -> None:
        self.engine, self.size = engine, size
        self._stack = ExitStack()
        self._lit: tuple[View, str, Levels] | None = None  # of the last view, and the sides of its materials
        try:
            log = Path(self._stack.enter_context(tempfile.TemporaryDirectory(prefix="shadowbench-"))) / "log"
            self.host = start_host(engine, log, {"DISPLAY": self._display()} if engine.display else {})
            self._stack.callback(self.host.close)
            about, _ = self._call("open", size._asdict())
            self.version, self.renderer = str(about["version"]), str(about["renderer"])
            if "SwiftShader" in self.renderer:
                raise CellFailed(
                    "drew with SwiftShader, whose 4 sub-pixel bits are not the 8 that undecided pixels assume"
                )
            probe, params = probe_view(size), cast(EngineParams, engine.Params())
            self._load(probe, params)
            check_probe(probe, self._lit_picture(self._request(probe, params, Phase(), nearest_depth(probe))))
        except BaseException:  # such as KeyboardInterrupt: no program may be left
            self.close()
            raise

    def close(self) -> None:
        """End the program."""
        self._stack.close()

    def draw(self, views: Sequence[View], params: EngineParams, phase: Phase) -> Iterator[Rendering]:
        """Masks of a view, or of a sequence's frames in order. Raises CellFailed; the session is to be closed then."""
        nearest = nearest_depth(*views)  # of all frames, as the planes of their cameras are
        about = {"version": self.version, "renderer": self.renderer}
        about |= {"box": self.engine.box, "phase": "box" if self.engine.phased else "none"}
        for index, view in enumerate(views):
            request = self._request(view, params, phase, nearest)
            if self._lit is None or self._lit[0] is not view or self._lit[1] != params.sides:
                if index == 0 or view.scene is not views[index - 1].scene:
                    self._load(view, params)
                truth = cached_truth(view, 1 if index else PIXEL_SAMPLES)
                self._lit = view, params.sides, self._lit_levels(view, params, nearest, truth)
            lit = self._lit[2]
            exposures = [BRIGHTER**level for level in range(len(lit))]
            shadowed = [self._picture(request, shadows=True, times=times) for times in exposures]
            again = self._picture(request, shadows=False)
            if np.abs(again - lit[0]).max() > _ROUNDING:
                raise CellFailed("drew two different pictures without shadows")
            mask, measurable = visibility(lit, shadowed)
            picture = encode_srgb(shadowed[0])
            yield Rendering(mask, picture, None, None, {}, {}, engine=about, measurable=measurable)

    def shadows_drawn(self) -> dict[str, float]:
        """Share of the true shadow that the engine has in shadow, by kind of light. Raises CellFailed for less than ½.

        A light or a map size that does not reach the engine leaves no shadow.
        """
        given = {"size": _TRIAL_MAP} if "size" in self.engine.Params.model_fields else {}
        params = cast(EngineParams, self.engine.Params(**given))
        shares: dict[str, float] = {}
        for light in sorted(self.engine.lights):
            view = chosen_view(_TRIAL_SCENES[light], self.size)
            truth, rendering = cached_truth(view), next(self.draw((view,), params, Phase()))
            shadow = truth.receivers & ~truth.undecided & (truth.visibility < 0.5)
            shares[light] = float((rendering.visibility[shadow] < 0.5).mean())
            if shares[light] < _LEAST_SHADOW:
                missing = f"{shares[light]:.0%} of the shadow of {view.scene.name}"
                reach = "do the light and the map's size reach the engine?"
                raise CellFailed(f"drew {missing}, under a {light} light: {reach}")
        return shares

    def _lit_levels(self, view: View, params: EngineParams, nearest: float, truth: Truth) -> Levels:
        """Pictures of a view without shadows, as many as its darkest surfaces need, at least two."""
        request = self._request(view, params, Phase(), nearest)
        levels = [self._lit_picture(request)]
        facing = _facing(truth)
        most_dark = _TOO_DARK_SHARE * np.count_nonzero(facing)
        while len(levels) < _MOST_LEVELS:
            if len(levels) > 1 and np.count_nonzero(levels[-1][facing] < DARKEST) <= most_dark:
                break
            levels.append(self._picture(request, shadows=False, times=BRIGHTER ** len(levels)))
        check_lit(levels, truth, view.light.hard_kind == "directional")
        return levels

    def _load(self, view: View, params: EngineParams) -> None:
        """Have the program hold the scene of a view, in place of the former one."""
        plain = plain_view(view)
        self._call("load", describe(plain, plain.scene.name), glb_of(plain, sides=params.sides))

    def _lit_picture(self, request: Request) -> Luminance:
        """Find the exposure at which the brightest surface is bright but not cut off, and draw that."""
        self._exposure = _BRIGHTEST
        for _ in range(_TRIES):
            picture = self._picture(request, shadows=False)
            brightest = float(np.quantile(picture, 0.999))
            if brightest > 0 and _TOO_DARK <= brightest < _CUT_OFF:
                return picture
            self._exposure *= 0.25 if brightest >= _CUT_OFF else min(_BRIGHTEST / max(brightest, 1e-3), 100)
        raise CellFailed("drew no picture without shadows that is neither black nor white")

    def _request(self, view: View, params: EngineParams, phase: Phase, nearest: float) -> Request:
        """What the pictures of a frame have in common; nearest: as of `describe_camera`."""
        size, view = self.engine.map_size(params), plain_view(view)
        return {
            "camera": describe_camera(view, nearest),
            "light": describe_light(view.light),
            "box": light_box(view, size, phase.shift if self.engine.phased else (0.0, 0.0)),
            "params": params.model_dump(mode="json", exclude={"sides"}),
        }

    def _picture(self, request: Request, *, shadows: bool, times: float = 1.0) -> Luminance:
        """A picture, at a multiple of the view's exposure."""
        about, data = self._call("draw", {**request, "shadows": shadows, "exposure": times * self._exposure})
        picture: NDArray[Any] = np.frombuffer(data, about["type"]).reshape(about["shape"])
        return luminance(picture, self.engine, self.size)

    def _call(self, name: str, argument: Any, data: bytes = b"") -> tuple[dict[str, Any], bytes]:
        return self.host.call(name, argument, data, self.engine.seconds)

    def _display(self) -> str:
        """Name of a virtual display of its own."""
        command = ["Xvfb", "-displayfd", "1", "-screen", "0", "4096x4096x24", "-nolisten", "tcp", "-terminate"]
        server = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL)
        self._stack.enter_context(server)
        self._stack.callback(server.kill)
        assert server.stdout is not None
        return f":{server.stdout.readline().decode().strip()}"


@lru_cache(maxsize=1)  # a scene's geometry is made once
def plain_view(view: View) -> View:
    """A view as engines know it: of a disc or rectangle the spot in its place, and no two meshes of one name."""
    light, meshes = view.light, view.scene.meshes
    if light.kind != light.hard_kind:
        light = replace(light, kind=light.hard_kind, angle=math.radians(WIDEST_CONE))
    if len({mesh.name for mesh in meshes}) < len(meshes):  # by which some engines find what casts and receives
        meshes = tuple(replace(mesh, name=f"mesh {index}") for index, mesh in enumerate(meshes))
    if light is view.light and meshes is view.scene.meshes:
        return view
    return replace(view, scene=replace(view.scene, meshes=meshes), light=light)


def luminance(picture: NDArray[np.uint8 | np.float32], engine: type[Engine], size: ViewSize) -> Luminance:
    """(H, W) linear luminance of an engine's picture. Raises CellFailed for other shapes, NaN, and infinity."""
    if picture.shape[:2] != size.shape or picture.ndim != 3 or picture.shape[2] not in (3, 4):
        found, allowed = (" × ".join(map(str, shape)) for shape in (picture.shape, size.shape))
        raise CellFailed(f"drew {found}; allowed: {allowed} × 3 or 4")
    values = picture[..., :3] / (255.0 if picture.dtype == np.uint8 else 1.0)
    if not np.isfinite(values).all():
        raise CellFailed("drew values that are not finite")
    linear = decode_srgb(values) if engine.encoding == "srgb" else values.astype(np.float64)
    return np.asarray(linear.mean(axis=-1))  # all surfaces and lights are white


def visibility(lit: Levels, shadowed: Levels) -> tuple[NDArray[np.float32], NDArray[np.bool_]]:
    """(H, W) visibility, the shadowed picture's share of the lit one, and (H, W) bool, where it can be measured.

    Taken at the brightest exposure at which a pixel is not cut off. Raises CellFailed for shadows that lighten.
    """
    full, part = lit[0], shadowed[0]
    for brighter, darkened in zip(lit[1:], shadowed[1:], strict=True):
        usable = brighter < _FULL
        full, part = np.where(usable, brighter, full), np.where(usable, darkened, part)
    lighter = (part > full + 2 / 255 + 0.02 * full).mean()
    if lighter > _TOLERATED:
        raise CellFailed(f"drew {lighter:.1%} of the pixels lighter with shadows than without")
    measurable = full >= DARKEST
    share = np.divide(part, full, out=np.ones_like(full), where=measurable)
    return quantise(np.clip(share, 0, 1)), measurable


def encode_srgb(linear: Luminance) -> NDArray[np.uint8]:
    """(H, W, 3) sRGB picture of linear luminance; IEC 61966-2-1."""
    values = np.clip(linear, 0, 1)
    encoded = np.where(values <= 0.0031308, values * 12.92, 1.055 * values ** (1 / 2.4) - 0.055)
    return np.repeat(np.round(encoded * 255).astype(np.uint8)[..., np.newaxis], 3, axis=-1)


def check_lit(lit: Levels, truth: Truth, directional: bool) -> None:
    """Raises CellFailed for pictures that are black where surfaces face the light or, under a sun, not shaded by N·L.

    A picture of another frame, upside down, or with a wrong encoding is one of these. A pixel may be shaded as one
    beside it is, as rasterisers differ at edges.
    """
    least, most = minimum_filter(truth.cosine, 3), maximum_filter(truth.cosine, 3)
    inside = _facing(truth)
    if not inside.any():
        return
    facing = inside & (least > _GRAZING)
    if facing.any() and (dark := (lit[-1][facing] <= 0).mean()) > _ODD:
        raise CellFailed(f"drew {dark:.1%} of what faces the light black, without shadows")
    if directional:
        light = lit[0][inside]
        level = float(np.median(light / truth.cosine[inside]))
        odd = (light < level * ((1 - _ALIKE) * least[inside] - _STEP)) | (
            light > level * ((1 + _ALIKE) * most[inside] + _STEP)
        )
        if level <= 0 or (share := odd.mean()) > _ODD:
            shaded = "no pixel" if level <= 0 else f"{1 - share:.1%} of the pixels"
            raise CellFailed(f"shaded {shaded} by N·L: another frame or encoding")


def _facing(truth: Truth) -> NDArray[np.bool_]:
    """Where surfaces face the light and the truth is decided."""
    return truth.receivers & ~truth.undecided & (truth.cosine > _GRAZING)


def probe_view(size: ViewSize) -> View:
    """Four squares before a camera that looks along −z, of which a sun from the left lights three."""
    meshes = tuple(_square(name, *_PLACES[name], math.radians(turn)) for name, turn in TURNS.items())
    camera = Camera("eye", (0.0, 0.0, 0.0), (0.0, 0.0, -1.0), math.radians(60), near=0.1, far=10.0)
    angle = math.radians(_SUN)
    sun = Light("sun", "directional", (math.sin(angle), 0.0, -math.cos(angle)))
    return View(Scene("probe", meshes, (camera,), (sun,)), camera, sun, size)


def _square(name: str, right: int, up: int, turn: float) -> Mesh:
    """A square with its centre at a corner of another one, turned about its vertical axis."""
    corners = np.array([(-1, -1), (1, -1), (1, 1), (-1, 1)]) * 0.7
    points = [(right + x * math.cos(turn), up + y, -4 - x * math.sin(turn)) for x, y in corners]
    return Mesh(name, np.array(points, np.float64), _FACES)


def check_probe(view: View, picture: Luminance) -> None:
    """Raises CellFailed unless each square is where it should be, and as bright as its N·L says."""
    truth = cached_truth(view)
    square = truth.triangle // len(_FACES)
    # Beside squares rasterisers may differ.
    if (picture[~binary_dilation(square >= 0, iterations=2)] > 0.02).any():
        raise CellFailed("drew the probe where nothing is: is the picture upside down, or with a background?")
    levels = {name: float(np.median(picture[square == index])) for index, name in enumerate(TURNS)}
    brightest = max(levels["upper right"], 1e-6)
    cosines = {name: max(math.cos(math.radians(turn + _SUN)), 0.0) for name, turn in TURNS.items()}
    for name, cosine in cosines.items():
        if not abs(levels[name] / brightest - cosine) <= (_TOLERANCE if cosine else _UNLIT):
            drawn = ", ".join(f"{square} {level:.3f}" for square, level in levels.items())
            wanted = ", ".join(f"{cosine:.2f}" for cosine in cosines.values())
            raise CellFailed(
                f"drew the probe's squares as {drawn}, whose N·L are {wanted}: is the picture upside down, of another "
                "encoding, or with ambient light?"
            )
