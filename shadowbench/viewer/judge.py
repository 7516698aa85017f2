"""The truth and the scores of what is shown, as far as the process beside the window has answered."""

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from shadowbench.gl.device import Device
from shadowbench.viewer.panes import TruthTextures
from shadowbench.viewer.state import ViewerState
from shadowbench.viewer.truth_messages import Scored, Traced
from shadowbench.viewer.truth_task import TruthTask


@dataclass(frozen=True, eq=False)
class Scores:
    """Scores of specs by their text, of a state whose `viewed` is given."""

    viewed: tuple[object, ...] = ()
    by_spec: Mapping[str, Mapping[str, float | None]] = field(default_factory=dict)


class Judge:
    """Asks for truth and scores, and keeps the answers to the last question."""

    def __init__(self, device: Device, task: TruthTask) -> None:
        self.device, self.task = device, task
        self.scores = Scores()
        self._viewed: tuple[object, ...] = ()  # of the last question
        self._number = 0
        self._traced: Traced | None = None
        self._textures: TruthTextures | None = None

    def ask(self, state: ViewerState, masks: Mapping[str, NDArray[np.float32]]) -> None:
        """Ask for the truth of what is shown, and for the scores of masks by their specs' text."""
        if state.viewed != self._viewed:
            self._traced, self._viewed = None, state.viewed
        self._number = self.task.ask(state.view(), masks)

    def receive(self) -> str:
        """Take what was answered about the last view; why something failed, empty if nothing did."""
        failure = ""
        for answer in self.task.answers():
            if answer.number != self._number:
                continue
            if isinstance(answer, Traced):
                self._traced = answer
            elif isinstance(answer, Scored):
                kept = self.scores.by_spec if self.scores.viewed == self._viewed else {}
                self.scores = Scores(self._viewed, {**kept, answer.spec: answer.scores})
            else:
                failure = answer.reason
        return failure

    def has_traced(self, state: ViewerState) -> bool:
        """Whether there is a truth, perhaps a coarse one, of a state."""
        return self._traced is not None and self._viewed == state.viewed

    @property
    def is_coarse(self) -> bool:
        """Whether the last truth will be followed by a finer one."""
        return self._traced is not None and not self._traced.final

    def textures(self, state: ViewerState, size: int) -> TruthTextures | None:
        """The truth of a state at a size; None if it is not traced yet."""
        if not self.has_traced(state) or self._traced is None:
            return None
        held = self._textures
        if held is None or held.traced is not self._traced or held.size != size:
            self.release()
            self._textures = TruthTextures.of(self.device, self._traced, size)
        return self._textures

    def release(self) -> None:
        """Free the textures."""
        if self._textures is not None:
            self._textures.release()
            self._textures = None
