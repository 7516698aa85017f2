"""Drawing one view once with one technique, as `render` does."""

from shadowbench.errors import InputError, ShadowbenchError
from shadowbench.measure.cells import Cell, PlacedView
from shadowbench.measure.executor import CellFailed, Executor, Unsupported
from shadowbench.measure.rendering import Rendering
from shadowbench.measure.session import Session
from shadowbench.scenes.model import View
from shadowbench.techniques.spec import Spec


def render(
    view: View, spec: Spec, executor: Executor, *, name: str, with_map: bool = False, tint: bool = False
) -> Rendering:
    """Draw a view with a technique.

    name: the spec in error messages; with_map: return the shadow map too, if the technique has one; tint: colour the
    picture by the technique's debug colours, such as cascades. Raises InputError for a map larger than the device
    allows and for a view that the technique does not support; ShadowbenchError if it fails.
    """
    largest = executor.info.max_map_size
    if (spec.map_size or 0) > largest:
        raise InputError(f"map size {spec.map_size}: this device allows 1 to {largest}")
    try:
        return executor.call(Session.draw, PlacedView(view), Cell(spec).request, with_map=with_map, tinted=tint)
    except Unsupported as reason:
        raise InputError(f"{name} does not support {view.scene.name}: {reason}") from None
    except CellFailed as reason:
        raise ShadowbenchError(f"{name} on {view.scene.name} failed: {reason}") from None
