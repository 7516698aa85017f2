"""Shadows that `engines doctor` has an engine draw: a light or a map size that does not reach it leaves none."""

from typing import cast

from shadowbench.engines.session import EngineSession
from shadowbench.measure.worker import CellFailed
from shadowbench.plugin.base import Phase
from shadowbench.plugin.engine import EngineParams
from shadowbench.scenes.opening import chosen_view
from shadowbench.truths.cache import cached_truth

_SCENES = {"directional": "cube-on-plane", "spot": "spot-lamp", "point": "room-with-lamp"}
_MAP = 1024
_LEAST = 0.5  # share of the true shadow


def shadows_drawn(session: EngineSession) -> dict[str, float]:
    """Share of the true shadow that an engine has in shadow, by kind of light. Raises CellFailed for less than half."""
    engine = session.engine
    params = cast(EngineParams, engine.Params(**({"size": _MAP} if "size" in engine.Params.model_fields else {})))
    shares: dict[str, float] = {}
    for light in sorted(engine.lights):
        view = chosen_view(_SCENES[light], session.size)
        truth, found = cached_truth(view), session.draw(view, params, Phase())
        shadow = truth.receivers & ~truth.undecided & (truth.visibility < 0.5)
        shares[light] = float((found.visibility[shadow] < 0.5).mean())
        if shares[light] < _LEAST:
            told = f"{shares[light]:.0%} of the shadow of {view.scene.name}"
            raise CellFailed(f"drew {told}, under a {light} light: do the light and the map's size reach the engine?")
    return shares
