"""Rows of another renderer in a run folder, beside ours."""

import hashlib
import json
import re
import shutil
from contextlib import closing
from pathlib import Path

import numpy as np

from shadowbench.engines.difference import write_difference
from shadowbench.engines.scored import Accuracy
from shadowbench.errors import InputError
from shadowbench.files import replace_file
from shadowbench.measure import scoring
from shadowbench.measure.row_store import RowStore
from shadowbench.measure.score_rows import Measurement, identity, score_row
from shadowbench.scenes.digest import view_digest
from shadowbench.scores.masks import write_mask
from shadowbench.sources import code_digest
from shadowbench.truths import cache
from shadowbench.truths.cache import cached_truth

_IDENTITY = ("scene", "view", "light", "spec", "view_size", "renderer")
_NAME = re.compile(r"[A-Za-z0-9][\w.+-]{0,79}")


def check_name(name: str) -> None:
    """InputError unless an engine may be called so: in a spec, a column and a file name."""
    if not _NAME.fullmatch(name):
        raise InputError(f"--name: found {name!r:.90}; allowed: letters, digits and . _ + -, at most 80 of them")


def append_row(accuracy: Accuracy, name: str, folder: Path) -> bool:
    """Keep an engine's score, mask, difference and truth in a run folder; False if the newest row is this one already.

    The row's technique and spec are the engine's name, its renderer `external: NAME`. A mask that changed is a row of
    its own, after the older one. InputError when the folder cannot be written or another run writes into it.
    """
    check_name(name)
    content, view, renderer = content_key(accuracy, name), accuracy.view, f"external: {name}"
    cell = identity(view, technique=name, spec=name, full_spec=name)
    named = {**cell, "renderer": renderer}
    with closing(RowStore(folder)) as store:
        same = [row for row in store.scores.values() if all(row.get(part) == named[part] for part in _IDENTITY)]
        if same and same[-1].get("content") == content:
            return False
        # What is as it was before the last change is a row again: the newest of a cell is the one that counts.
        key = content if content not in store.scores else _digest([content, same[-1]["key"]])
        _keep_pictures(accuracy, folder, key)
        measured = Measurement(accuracy.record, None, {}, {})
        extra_fields = {"assumptions": list(view.scene.notes)}
        store.append(score_row(key, cell, renderer, measured, {"content": content}, extra_fields))
        return True


def content_key(accuracy: Accuracy, name: str) -> str:
    """Hex key of everything that the row rests on: engine, view, what was handed over, sources."""
    view = accuracy.view
    parts = {
        "engine": name,
        "view": (view.scene.name, view.camera.name, view.light.name, view_digest(view)),
        "mask": accuracy.record["mask_sha256"],
        "input": accuracy.record["input"],
        "sources": code_digest(Path(scoring.__file__), Path(cache.__file__)),
    }
    return _digest(parts)


def _digest(parts: object) -> str:
    return hashlib.sha256(json.dumps(parts, sort_keys=True).encode()).hexdigest()[:24]


def _keep_pictures(accuracy: Accuracy, folder: Path, key: str) -> None:
    view, truth = accuracy.view, cached_truth(accuracy.view)
    for kind in ("masks", "differences", "truth", "pictures"):
        (folder / kind).mkdir(exist_ok=True)
    write_mask(folder / "masks" / f"{key}.png", accuracy.handed.visibility)
    write_difference(folder / "differences" / f"{key}.png", accuracy.difference())
    write_mask(folder / "truth" / f"{view.name}.png", truth.visibility)
    write_mask(folder / "truth" / f"{view.name}.undecided.png", truth.undecided.astype(np.float32))
    if accuracy.handed.picture is not None:
        with replace_file(folder / "pictures" / f"{key}.png") as beside:
            shutil.copyfile(accuracy.handed.picture, beside)
