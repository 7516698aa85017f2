"""Probes: small drawings, truths and scores, whose numbers `probes.json` holds with the versions that they belong to.

`python -m tests.probes` records them anew, after a version in `shadowbench/versions.py` was raised, a shader changed or
a probe was added. Equal versions and shaders with other numbers are refused: rows with the same key would differ.
Remove the file first if a probe itself was changed.
"""

import hashlib
import json
import math
import sys
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from shadowbench import versions
from shadowbench.errors import Unsupported
from shadowbench.measure.gl_drawer import GLDrawer
from shadowbench.measure.keys import sources_of
from shadowbench.measure.scoring import mask_record, prepare_truth
from shadowbench.measure.session import CellRequest, Session
from shadowbench.measure.worker import Worker
from shadowbench.plugin.registry import techniques
from shadowbench.scenes.library import builtin_names, load_scene
from shadowbench.scenes.model import view_of
from shadowbench.scores.masks import quantise
from shadowbench.studies.study import read_study
from shadowbench.truths.trace import Truth, trace

FILE = Path(__file__).with_name("probes.json")
BASELINE = Path(__file__).parents[1] / "results" / "baseline" / "study.toml"
KINDS = ("draw", "trace", "score")
# A sun, one with a size, an eye in shadow, a point, a spot.
SCENES = ("cube-on-plane", "fence", "inside-volume", "lamp-by-wall", "spot-lamp")
MAP_SIZE, DRAWN, TRACED, SCORED = 64, 64, 48, 128  # pixels along a side

# What numbers of another processor may differ by; those of the recording one are compared to the bit. Between Mesa and
# Embree with and without fused multiply-add a quarter of an image differs by 0.12 pixels at most, a fact by 2e-7.
PIXELS, SHARE = 0.5, 1e-5

Probe = dict[str, Any]
Record = dict[str, Any]


def record(kinds: Sequence[str] = KINDS) -> Record:
    """The probes of some kinds, and what they depend on."""
    makers = {"draw": _draw, "trace": _trace, "score": _score}
    with Worker() as worker:
        identity = {**versions.of_rows(), **GLDrawer(worker).device_identity}
        return {"identity": identity, **{kind: dict(makers[kind](worker)) for kind in kinds}}


def complaint(kind: str, recorded: Record, found: Record) -> str:
    """What is wrong with the recorded probes of a kind, after the version to raise if one must be; empty if nothing."""
    was, now = recorded[kind], found[kind]
    others = {name: value for name, value in found["identity"].items() if name not in KINDS}
    exact = all(recorded["identity"][name] == value for name, value in others.items())
    same_version = recorded["identity"][kind] == found["identity"][kind]
    changed = [name for name in was.keys() & now.keys() if not _equal(was[name], now[name], exact)]
    silent = [name for name in changed if same_version and was[name].get("shaders") == now[name].get("shaders")]
    if silent:
        return (
            f"{kind.upper()}: {len(silent)} of {len(now)} probes have other numbers, such as {min(silent)!r}. "
            "If this is meant, raise it in shadowbench/versions.py, then python -m tests.probes"
        )
    stale = changed or was.keys() != now.keys() or not same_version
    stale = stale or any(was[name].get("shaders") != now[name].get("shaders") for name in now)
    return f"probes of {kind} are out of date: python -m tests.probes" if stale else ""


def _equal(was: Probe, now: Probe, exact: bool) -> bool:
    if exact:
        return was["exact"] == now["exact"]
    near = all(abs(one - other) <= PIXELS for one, other in zip(was["pixels"], now["pixels"], strict=True))
    return (
        near
        and was["numbers"].keys() == now["numbers"].keys()
        and all(
            value == now["numbers"][name]
            or (None not in (value, now["numbers"][name]) and math.isclose(value, now["numbers"][name], rel_tol=SHARE))
            for name, value in was["numbers"].items()
        )
    )


def _probe(images: Sequence[np.ndarray], numbers: Mapping[str, float | None], **others: Any) -> Probe:
    """Digest of all bits, the sums of each quarter of square images, and numbers."""
    digest = hashlib.sha256(repr(sorted((numbers | others).items())).encode())
    for image in images:
        digest.update(np.ascontiguousarray(image).tobytes())
    quarters = [image.astype(float).reshape(2, len(image) // 2, 2, -1).sum(axis=(1, 3)).ravel() for image in images]
    pixels = [round(float(value), 3) for quarter in quarters for value in quarter]
    return {"exact": digest.hexdigest()[:12], "pixels": pixels, "numbers": dict(numbers)}


def _draw(worker: Worker) -> Iterator[tuple[str, Probe]]:
    """Each cell of the baseline's study, which has every technique and component, in small; a phase for each scene."""
    known = techniques()
    study = read_study(BASELINE, known).with_(scenes=SCENES, view_size=DRAWN, map_size=(MAP_SIZE,))
    for phase, block in enumerate(study.blocks()):
        for cell in block.cells:
            request = CellRequest(cell.spec.full_text, phase * cell.spec.technique.phased)
            try:
                drawn = worker.call(Session.draw, block.view, request)
            except Unsupported:
                continue
            probe = _probe([drawn.visibility], drawn.facts | {"gpu_bytes": drawn.gpu_bytes}, **drawn.work)
            shaders = sources_of(cell.spec)[:12]
            yield f"{block.view.scene.name} {cell.spec.text}", probe | {"shaders": shaders}


def _trace(_: Worker) -> Iterator[tuple[str, Probe]]:
    """The truth of every built-in scene."""
    for name in builtin_names():
        scene = load_scene(name)
        arrays = trace(view_of(scene, scene.cameras[0], scene.lights[0], TRACED)).arrays()
        diagonal, blocker, triangle = (arrays.pop(part) for part in ("diagonal", "blocker", "triangle"))
        distance = float(blocker[np.isfinite(blocker)].mean(dtype=float))
        digest = hashlib.sha256(blocker.tobytes() + triangle.tobytes()).hexdigest()
        yield name, _probe([*arrays.values()], {"diagonal": float(diagonal), "blocker": distance}, digest=digest)


def _score(_: Worker) -> Iterator[tuple[str, Probe]]:
    """All that is scored of a disc's shadow, hard and soft, by masks that are wrong in several ways."""
    masks = {
        "moved": np.roll(_soft(1.0), 2, axis=1),
        "wide": _soft(1.4, 0.55),
        "speckled": np.where(np.arange(SCORED**2).reshape(SCORED, SCORED) % 11 == 0, 1 - _hard(), _hard()),
        "lit": np.ones((SCORED, SCORED)),
    }
    for name, visibility in {"hard": _hard(), "soft": _soft(1.0)}.items():
        truth = _disc_truth(visibility)
        for mask, values in masks.items():
            found = mask_record(quantise(values), truth, prepare_truth(truth))
            fields = {field: value for field, value in found.items() if field not in ("metrics", "mask_sha256")}
            yield f"{mask} {name}", _probe([], found["metrics"] | fields)


def _distance() -> np.ndarray:
    """Signed distances in pixels from the edge of a disc, negative inside."""
    y, x = np.mgrid[:SCORED, :SCORED]
    return np.hypot(x - 0.47 * SCORED, y - 0.53 * SCORED) - 0.28 * SCORED


def _hard() -> np.ndarray:
    return (_distance() >= 0).astype(float)


def _soft(width: float, middle: float = 0.5) -> np.ndarray:
    """Visibility with a penumbra that widens towards the top."""
    return np.clip(_distance() / (width * np.linspace(6, 2, SCORED)[:, np.newaxis] ** 2) + middle, 0, 1)


def _disc_truth(visibility: np.ndarray) -> Truth:
    """A truth by formulas alone, on the plane of a scene."""
    distance, scene, rows = _distance(), load_scene("cube-on-plane"), np.mgrid[:SCORED, :SCORED][0]
    sampled = (visibility > 0) & (visibility < 1)
    cosine = (0.5 + rows / (3 * SCORED)).astype(np.float32)
    return Truth(
        visibility=visibility.astype(np.float32),
        standard_error=np.where(sampled, np.float32(0.003), np.float32(0)),
        irradiance=visibility.astype(np.float32),
        receivers=rows >= 3,
        undecided=np.hypot(distance, rows - 20) < 3,
        area=(visibility if sampled.any() else np.clip(distance + 0.5, 0, 1)).astype(np.float32),
        blocker=np.where(visibility < 1, 0.003 * (1 + rows), np.inf).astype(np.float32),
        triangle=np.zeros(distance.shape, np.int32),
        cosine=cosine,
        diagonal=10.0,
        view=view_of(scene, scene.cameras[0], scene.lights[0], SCORED),
        shading_cosine=cosine,
        facet_shadow=None if sampled.any() else np.abs(distance + 4) < 3,
    )


def main() -> int:
    """Record all probes; refuses other numbers of an unchanged version."""
    found = record()
    if FILE.exists():
        recorded = json.loads(FILE.read_text(encoding="utf-8"))
        raised = [text for kind in KINDS if (text := complaint(kind, recorded, found)).startswith(kind.upper())]
        if raised:
            print(*raised, sep="\n")
            return 1
    lines = [f'"identity": {json.dumps(found["identity"])}']
    for kind in KINDS:
        probes = ",\n".join(f" {json.dumps(name)}: {json.dumps(probe)}" for name, probe in found[kind].items())
        lines.append(f'"{kind}": {{\n{probes}\n}}')
    FILE.write_text("{\n" + ",\n".join(lines) + "\n}\n", encoding="utf-8")
    return 0


if __name__ == "__main__":
    sys.exit(main())
