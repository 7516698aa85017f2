"""One view drawn once with one technique, as `render` shows it."""

from shadowbench.errors import InputError, ShadowbenchError
from shadowbench.measure.drawn import Drawn
from shadowbench.measure.session import CellRequest, Unsupported
from shadowbench.measure.worker import CellFailed, Worker
from shadowbench.scenes.model import View
from shadowbench.techniques.spec import Spec, format_spec


def render(view: View, spec: Spec, worker: Worker, *, name: str, with_map: bool = False, tint: bool = False) -> Drawn:
    """Visibility and picture of a view with a technique's shadows, and its map where asked for and there is one.

    name: what errors call the spec; tint: colour the picture by what the technique did where. Raises InputError for a
    map beyond the device, and for a technique that has no answer for the view; ShadowbenchError where it fails.
    """
    largest = worker.call("info").max_map_size
    if (spec.map_size or 0) > largest:
        raise InputError(f"map size {spec.map_size}: this device allows 1 to {largest}")
    try:
        worker.call("load", view.scene)
        worker.call("open", view.camera, view.light, view.size)
        drawn: Drawn = worker.call("draw", CellRequest(format_spec(spec, full=True)), with_map, tint)
    except Unsupported as reason:
        raise InputError(f"{name} does not go with {view.scene.name}: {reason}") from None
    except CellFailed as reason:
        raise ShadowbenchError(f"{name} on {view.scene.name} failed: {reason}") from None
    return drawn
