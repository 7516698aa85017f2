"""Template of a new technique: a working shadow map in one file."""

import keyword
import re
from importlib.util import find_spec
from pathlib import Path
from string import Template

from shadowbench.errors import InputError
from shadowbench.files import replace_file
from shadowbench.plugin.registry import techniques
from shadowbench.scenes.scene_tables import LONGEST_NAME

_NAME = re.compile(rf"[A-Za-z][\w-]{{0,{LONGEST_NAME - 1}}}", re.ASCII)
_TEXT = Template('''\
"""Try it: shadowbench run cube-on-plane -t $name -t shadow-map --plugin $name.py.

A shadow map to start from. shadowbench.plugin.base documents the class and the inputs of its shaders.
"""

from shadowbench.maps.caster_map import CasterMap, MapLayout, map_uniforms
from shadowbench.maps.fits import FittedParams, FittedView
from shadowbench.maps.caster_map import ResolvePass
from shadowbench.plugin.base import Technique, param

RESOLVE = """
#include "map.glsl"
uniform float bias;  // the parameter; an int or a choice would be a #define, such as SIZE
out float visibility;

void main() {
    Receiver r = receiver_here();
    ShadowCoord p = shadow_coord(r, 0);
    float stored = textureLod(map_depths, p.uv, 0.0).r;
    bool shadowed = p.depth < 1.0 && p.depth - bias * p.depth_per_length > stored;
    visibility = r.facing && p.axis_distance > 0.0 && shadowed ? 0.0 : 1.0;
}
"""


class $class_name(Technique):
    """The idea in one sentence, with its source (author year).

    Where it fails.
    """

    name = "$name"
    lights = frozenset({"directional", "spot"})  # supported kinds; the third is "point"
    phased = True  # it has a texel grid, which studies shift by fractions of a texel

    class Params(FittedParams):  # has fit and size
        """Parameters of $name."""

        bias: float = param(0.02, "offset of the receiver towards the light", ge=0, metres=True)
        # One length suits one slope: acne where it is too small, peter-panning where too large. See biases.py.

    def build(self, stage):
        """Create programs, textures and targets, independent of camera and light."""
        self.fitted = FittedView(stage, self.params.fit, self.params.size, filter_radius=0.5)
        program = stage.program("casters.vert", "depth.frag")
        self.map = CasterMap(stage, program, MapLayout(self.params.size, clamp=self.params.fit.clamps))
        self.resolve = ResolvePass(stage, RESOLVE, self.params)

    def draw(self, frame):
        """Draw the timed passes. changes: what invalidates a pass, "light", "view" (camera or light) or "frame"."""
        with frame.timed("depth", changes=self.params.fit.invalidated_by):
            self.light_view = self.fitted(frame)
            self.map.draw(frame, [self.light_view])
        with frame.timed("resolve", changes="view"):
            return self.resolve(frame, self.map.textures, **map_uniforms([self.light_view]))
''')


def write_technique(name: str, folder: Path) -> Path:
    """Write the template of a technique to NAME.py. Raises InputError for a bad or taken name or an existing file."""
    class_name = "".join(part[:1].upper() + part[1:] for part in re.split("[-_]", name))
    if not _NAME.fullmatch(name) or keyword.iskeyword(class_name) or keyword.iskeyword(name):
        words = f"letters, digits, _ and -, at most {LONGEST_NAME} of them, the first a letter"
        raise InputError(f"new-technique: found {name!r:.90}; allowed: {words}, and not a Python keyword")
    if name in techniques() or (name.isidentifier() and find_spec(name) is not None):
        taken = "technique" if name in techniques() else "Python module (which the file would hide)"
        raise InputError(f"new-technique: there is a {taken} called {name!r}; allowed: another name")
    file = folder / f"{name}.py"
    if file.exists():
        raise InputError(f"{file}: is there already, and is not overwritten")
    with replace_file(file) as temporary:
        temporary.write_text(_TEXT.substitute(name=name, class_name=class_name), encoding="utf-8")
    return file
