"""Rows of other renderers in a run folder."""

import hashlib
import json
import re
import shutil
from contextlib import closing
from pathlib import Path

import numpy as np

from shadowbench.engines.accuracy import Accuracy
from shadowbench.errors import InputError
from shadowbench.files import replace_file
from shadowbench.measure.rows import IMAGES, RowStore, identity
from shadowbench.scores.difference import write_difference
from shadowbench.scores.masks import write_mask
from shadowbench.versions import of_scores

_IDENTITY = ("scene", "view", "light", "spec", "view_size", "renderer")
_NAME = re.compile(r"[A-Za-z0-9][\w.+-]{0,79}")


def check_name(name: str) -> None:
    """Raises InputError unless the name can be used in a spec, a column and a file name."""
    if not _NAME.fullmatch(name):
        raise InputError(f"--name: found {name!r:.90}; allowed: letters, digits and . _ + -, at most 80 of them")


def append_row(accuracy: Accuracy, name: str, folder: Path) -> bool:
    """Write an engine's score row, mask, difference and truth into a run folder; False if its newest row is the same.

    The row's technique and spec are the engine's name, its renderer is `external: NAME`. A changed mask gets a new row
    after the older one. Raises InputError if the folder cannot be written or another run writes into it.
    """
    check_name(name)
    view = accuracy.view
    cell, renderer = identity(view, technique=name, spec=name, full_spec=name), f"external: {name}"
    content = _digest(  # of everything that the row depends on
        {
            "engine": name,
            "view": (view.scene.name, view.camera.name, view.light.name, accuracy.digest),
            "mask": accuracy.record["mask_sha256"],
            "input": accuracy.record["input"],
            "versions": of_scores(),
        }
    )
    with closing(RowStore(folder)) as store:
        named = {**cell, "renderer": renderer}
        same = [row for row in store.scores.values() if all(row.get(part) == named[part] for part in _IDENTITY)]
        if same and same[-1].get("content") == content:
            return False
        # A mask that was changed back gets a new row too, since the newest row of a cell counts.
        key = content if content not in store.scores else _digest([content, same[-1]["key"]])
        _write_pictures(accuracy, folder, key)
        row = {"kind": "score", "key": key, **cell, "content": content, "renderer": renderer, "status": "ok"}
        row |= {**accuracy.record, "gpu_bytes": None, "work": {}, "facts": {}, "assumptions": list(view.scene.notes)}
        store.append(row)
        return True


def _digest(parts: object) -> str:
    return hashlib.sha256(json.dumps(parts, sort_keys=True).encode()).hexdigest()[:24]


def _write_pictures(accuracy: Accuracy, folder: Path, key: str) -> None:
    view, truth = accuracy.view, accuracy.truth
    for kind in IMAGES:
        (folder / kind).mkdir(exist_ok=True)
    write_mask(folder / "masks" / f"{key}.png", accuracy.external.visibility)
    write_difference(folder / "differences" / f"{key}.png", accuracy.difference())
    write_mask(folder / "truth" / f"{view.name}.png", truth.visibility)
    write_mask(folder / "truth" / f"{view.name}.undecided.png", truth.undecided.astype(np.float32))
    write_mask(folder / "truth" / f"{view.name}.facets.png", truth.facets.astype(np.float32))
    if accuracy.external.picture is not None:
        with replace_file(folder / "pictures" / f"{key}.png") as temporary:
            shutil.copyfile(accuracy.external.picture, temporary)
