"""What a filter stores in a map besides depth: the texture, its blur and its mip levels."""

from collections.abc import Mapping, Sequence

import numpy as np

from shadowbench.gl.library import moderngl
from shadowbench.gl.program import Drawable, Sampling, Texture, Wrap
from shadowbench.gl.targets import Color, Kind
from shadowbench.maps.filters import Contents, Kernel
from shadowbench.plugin.params import TechniqueParams
from shadowbench.plugin.stage import Stage
from shadowbench.scenes.vectors import Floats

BlurPass = tuple[Drawable, list[moderngl.Framebuffer], Color, Sampling]
"""A drawable, its target for each layer, and the texture that it reads."""


class MapContents:
    """A filter's contents of a map of one or more layers; its shader's `filter_contents` writes them with the depth.

    texture: the contents, of the map's kind; far: (4,) contents where no caster is, which also surround the map; reads:
    texels read by the blur, and by the first mip level.
    """

    def __init__(
        self,
        stage: Stage,
        params: TechniqueParams,
        contents: Contents,
        size: int,
        kind: Kind,
        layers: int,
        includes: Mapping[str, str],
    ) -> None:
        self._contents, self.kind, self._layers = contents, kind, layers
        self._taps = contents.blur | 1  # texels that the kernel touches: an odd number
        stored = contents.components, contents.dtype, contents.mips
        self.texture = stage.map_texture((size, size), kind, layers, *stored)
        program = stage.program(
            "fullscreen.vert", "contents-far.frag", params=params, defines={"LAYERS": layers}, includes=includes
        )
        far = stage.texture((1, 1), contents.components)
        stage.fullscreen(program).draw(stage.target(far))
        values = np.frombuffer(far.read(), dtype=np.float32)
        x, y, z, w = np.pad(values, (0, 4 - contents.components)).tolist()
        self.far = x, y, z, w
        blurred = contents.blur > 1
        self.reads = layers * size**2 * (2 * self._taps * blurred + contents.mips)
        self._passes = self._blur_passes(stage, size) if blurred else ()

    def _blur_passes(self, stage: Stage, size: int) -> tuple[BlurPass, BlurPass]:
        """A separable blur, through a scratch texture that has the rows beyond a layer's edges too."""
        layers, height = range(self._layers), size + self._taps - 1
        scratch = stage.map_texture(
            (size, height), "array", self._layers, self.texture.components, self._contents.dtype
        )
        rows, columns = (
            stage.program(
                "fullscreen.vert",
                "blur.frag",
                defines={"TAPS": self._taps, "SIZE": size},
                includes={"blur": blur, "map": self.kind},
            )
            for blur in ("rows", "columns")
        )
        around = Sampling(linear=True) if self.kind == "cube" else Sampling(wrap="border", border=self.far)
        to_scratch, back = ([stage.target(one, layer=layer) for layer in layers] for one in (scratch, self.texture))
        return (
            (stage.fullscreen(rows), to_scratch, self.texture, around),
            (stage.fullscreen(columns), back, scratch, Sampling()),
        )

    def prepare(self, texels: Sequence[float] = ()) -> None:
        """Blur the layers and compute their mip levels.

        texels: width of each layer's texels, if they differ; the blur has the width in the scene that it has in the
        layer of the finest ones.
        """
        shares = min(texels) / np.array(texels) if texels else np.ones(self._layers)
        blur, kernel = self._contents.blur, self._contents.kernel
        weights = [kernel_weights(kernel, share * blur, self._taps) for share in shares]
        # Rows of all layers before the columns of any, as a cube's faces read their neighbours.
        for drawable, targets, source, sampling in self._passes:
            for layer, target in enumerate(targets):
                drawable.program.set(weights=weights[layer], layer=layer)
                drawable.draw(target, {"source": (source, sampling)})
        if self._contents.mips:
            self.texture.build_mipmaps()

    def sampler(self, wrap: Wrap) -> dict[str, tuple[Texture, Sampling]]:
        """The sampler `map_contents` of filter.glsl."""
        sampling = Sampling(
            linear=self._contents.linear,
            wrap="edge" if self.kind == "cube" else wrap,
            border=self.far,
            mips=self._contents.mips,
        )
        return {"map_contents": (self.texture, sampling)}


def kernel_weights(kernel: Kernel, width: float, taps: int) -> Floats:
    """(taps,) weights of the texels of a kernel of a width in texels, at most `taps`; their sum is 1.

    A Gaussian has a standard deviation of a quarter of its width.
    """
    width = min(max(width, 1.0), taps)
    at = np.abs(np.arange(taps) - taps // 2)
    inside = np.clip((width + 1) / 2 - at, 0.0, 1.0)  # a box covers its outermost texels in part
    weights: Floats = inside * np.exp(-8 * (at / width) ** 2) if kernel == "gaussian" else inside
    return weights / float(weights.sum())
