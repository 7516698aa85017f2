"""What a filter stores in a map besides depth: the texture, its blur and its mip levels."""

from collections.abc import Mapping, Sequence

import numpy as np

from shadowbench.gl.program import Sampling, Texture, Wrap
from shadowbench.gl.targets import Kind
from shadowbench.maps.filters import Contents, Kernel
from shadowbench.plugin.params import TechniqueParams
from shadowbench.plugin.stage import Stage
from shadowbench.scenes.vectors import Floats


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
        self._contents, self._kind, self.layers = contents, kind, layers
        self.texture = stage.map_texture((size, size), kind, layers, contents.components, contents.dtype)
        self.far = _far_contents(stage, params, contents, layers, includes)
        blurred = 2 * _taps(contents.blur) if contents.blur > 1 else 0
        self.reads = layers * size**2 * (blurred + (1 if contents.mips else 0))
        self._passes = _BlurPasses(stage, self, _taps(contents.blur), size) if contents.blur > 1 else None

    def prepare(self, texels: Sequence[float] = ()) -> None:
        """Blur the layers and compute their mip levels.

        texels: width of each layer's texels, if they differ; the blur has the width in the scene that it has in the
        layer of the finest ones.
        """
        if self._passes is not None:
            shares = min(texels) / np.array(texels) if texels else np.ones(self.layers)
            blur, kernel = self._contents.blur, self._contents.kernel
            self._passes([kernel_weights(kernel, share * blur, _taps(blur)) for share in shares])
        if self._contents.mips:
            self.texture.build_mipmaps()

    def sampler(self, wrap: Wrap) -> dict[str, tuple[Texture, Sampling]]:
        """The sampler `map_contents` of filter.glsl."""
        sampling = Sampling(
            linear=self._contents.linear,
            wrap="edge" if self._kind == "cube" else wrap,
            border=self.far,
            mips=self._contents.mips,
        )
        return {"map_contents": (self.texture, sampling)}


class _BlurPasses:
    """A separable blur of every layer, through a scratch texture that has the rows beyond a layer's edges too."""

    def __init__(self, stage: Stage, contents: MapContents, taps: int, size: int) -> None:
        texture, self._far, self._layers = contents.texture, contents.far, contents.layers
        scratch = stage.map_texture(
            (size, size + taps - 1), "array", self._layers, texture.components, contents._contents.dtype
        )
        defines, map = {"TAPS": taps, "SIZE": size}, contents._kind
        self._rows, self._columns = (
            stage.fullscreen(
                stage.program("fullscreen.vert", "blur.frag", defines=defines, includes={"blur": blur, "map": map})
            )
            for blur in ("rows", "columns")
        )
        self._scratch, self._texture = scratch, texture
        self._to_scratch = [stage.target(scratch, layer=layer) for layer in range(self._layers)]
        self._back = [stage.target(texture, layer=layer) for layer in range(self._layers)]
        cube = contents._kind == "cube"
        self._sampling = Sampling(linear=True) if cube else Sampling(wrap="border", border=self._far)

    def __call__(self, weights: Sequence[Floats]) -> None:
        # Rows of all layers before the columns of any, as a cube's faces read their neighbours.
        for drawable, targets, source, sampling in (
            (self._rows, self._to_scratch, self._texture, self._sampling),
            (self._columns, self._back, self._scratch, Sampling()),
        ):
            for layer, target in enumerate(targets):
                drawable.program.set(weights=weights[layer], layer=layer)
                drawable.draw(target, {"source": (source, sampling)})


def _taps(width: int) -> int:
    """Texels that a kernel of a width touches: an odd number."""
    return width | 1


def kernel_weights(kernel: Kernel, width: float, taps: int) -> Floats:
    """(taps,) weights of the texels of a kernel of a width in texels, at most `taps`; their sum is 1.

    A Gaussian has a standard deviation of a quarter of its width.
    """
    width = min(max(width, 1.0), taps)
    at = np.abs(np.arange(taps) - taps // 2)
    inside = np.clip((width + 1) / 2 - at, 0.0, 1.0)  # a box covers its outermost texels in part
    weights: Floats = inside * np.exp(-8 * (at / width) ** 2) if kernel == "gaussian" else inside
    return weights / float(weights.sum())


def _far_contents(
    stage: Stage, params: TechniqueParams, contents: Contents, layers: int, includes: Mapping[str, str]
) -> tuple[float, float, float, float]:
    """Contents of the far plane; components that are not stored are 0."""
    defines = {"LAYERS": layers}
    program = stage.program("fullscreen.vert", "contents-far.frag", params=params, defines=defines, includes=includes)
    texture = stage.texture((1, 1), contents.components)
    stage.fullscreen(program).draw(stage.target(texture))
    found = np.zeros(4, dtype=np.float32)
    found[: contents.components] = np.frombuffer(texture.read(), dtype=np.float32)
    x, y, z, w = found.tolist()
    return x, y, z, w
