"""The images of a run folder: masks and pictures of cells by their key, truths by their view's name."""

from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from shadowbench.errors import InputError
from shadowbench.files import replace_file
from shadowbench.measure.rendering import Rendering
from shadowbench.scenes.model import View
from shadowbench.scores.masks import mask_sha256, read_mask, write_mask
from shadowbench.truths.trace import Truth


class Pictures:
    """Writes `masks/`, `pictures/` and `truth/` of a folder."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder

    def write_cell(self, key: str, drawn: Rendering) -> None:
        """What a cell drew."""
        write_mask(self._made("masks") / f"{key}.png", drawn.visibility)
        write_picture(self._made("pictures") / f"{key}.png", drawn.picture)

    def write_truth(self, view: View, truth: Truth) -> None:
        """Where they differ: a scene that is as it was again measures nothing, but another text's truth is there."""
        folder = self._made("truth")
        for name, mask in ((view.name, truth.visibility), (f"{view.name}.undecided", truth.undecided.astype(float))):
            if not _shows(folder / f"{name}.png", mask):
                write_mask(folder / f"{name}.png", mask)

    def write_shading(self, view: View, lit: NDArray[np.uint8], ambient: NDArray[np.uint8]) -> None:
        """The view without and with shadow everywhere, from which a mask's picture is blended."""
        folder = self._made("truth")
        write_picture(folder / f"{view.name}.lit.png", lit)
        write_picture(folder / f"{view.name}.ambient.png", ambient)

    def _made(self, name: str) -> Path:
        folder = self.folder / name
        folder.mkdir(exist_ok=True)
        return folder


def write_picture(file: Path, picture: NDArray[np.uint8]) -> None:
    """A (H, W, 3) sRGB or (H, W) grey image as a PNG."""
    with replace_file(file) as beside:
        Image.fromarray(picture).save(beside, format="PNG", compress_level=1)


def _shows(file: Path, mask: NDArray[np.floating]) -> bool:
    try:
        return mask_sha256(read_mask(file)) == mask_sha256(mask)
    except InputError:  # absent, or no mask
        return False
