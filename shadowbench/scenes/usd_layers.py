"""The files that a USD file is composed of: all of them in its own folder."""

import re
from pathlib import Path
from typing import Any

from shadowbench.errors import InputError
from shadowbench.files import file_below

MOST_LAYERS = 1000
"""Limit on the files that a USD file is composed of."""


def check_layers(path: str) -> None:
    """Raises InputError for a file that a USD file refers to and that is missing, or outside its folder.

    Before the stage is composed, as that reads whatever file it is told to.
    """
    from pxr import Ar

    folder = Path(path).parent.resolve()
    waiting, seen = [path], set[str]()
    while waiting:
        name = waiting.pop()
        if name in seen:
            continue
        seen.add(name)
        if len(seen) > MOST_LAYERS:
            raise InputError(f"refers to more than {MOST_LAYERS} files")
        layer: Any = _opened(name, folder)
        for asset in filter(None, layer.GetCompositionAssetDependencies()):
            target = layer.ComputeAbsolutePath(asset)
            outer = Ar.SplitPackageRelativePathOuter(target)[0] if Ar.IsPackageRelativePath(target) else target
            file_below(outer, folder, f"asset {asset!r:.60}", "its folder")
            waiting.append(target)


def _opened(name: str, folder: Path) -> Any:
    from pxr import Sdf, Tf

    reason = ""
    try:
        layer = Sdf.Layer.FindOrOpen(name)
    except (Tf.ErrorException, UnicodeDecodeError) as error:  # the first of many lines, with places in USD's source
        layer, reasons = None, re.findall(r" : '(.+?)'?$", str(error), re.MULTILINE)
        reason = "".join(f": {each}" for each in reasons).replace(f"{folder}/", "")
    if layer is None:
        raise InputError(f"{Path(name).name!r:.60} is not USD{reason}")
    return layer
