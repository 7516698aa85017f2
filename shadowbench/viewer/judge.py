"""The truth and the scores of what is shown, as far as the process beside the window has answered."""

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from shadowbench.gl.device import Device
from shadowbench.viewer.panes import TruthTextures
from shadowbench.viewer.state import ViewerState
from shadowbench.viewer.truth import Scored, Traced, TruthTask


@dataclass(frozen=True, eq=False)
class Scores:
    """Scores of specs by their text, of a state whose `viewed` is given."""

    viewed: tuple[object, ...] = ()
    by_spec: Mapping[str, Mapping[str, float | None]] = field(default_factory=dict)


class Judge:
    """Asks for truth and scores, and keeps the answers to the last question.

    failure: why the last question has no answer, empty if nothing failed.
    """

    def __init__(self, device: Device, task: TruthTask) -> None:
        self.device, self.task = device, task
        self.scores, self.failure = Scores(), ""
        self._viewed: tuple[object, ...] = ()  # of the last question
        self._masks: Mapping[str, NDArray[np.float32]] = {}
        self._number = self._first = 0  # of the last question, and of the first one about its view
        self._traced: Traced | None = None
        self._textures: TruthTextures | None = None

    def ask(self, state: ViewerState, masks: Mapping[str, NDArray[np.float32]]) -> None:
        """Ask for the truth of what is shown, and for the scores of masks by their specs' text.

        Scores of this view remain if they are of the very same masks.
        """
        again = state.viewed == self._viewed
        self._number = self.task.ask(state.view(), masks, again)
        if not again:
            self._traced, self._viewed, self._first = None, state.viewed, self._number
        elif self.known:
            pairs = self.known.items()
            same = {text: scores for text, scores in pairs if _equal(self._masks.get(text), masks.get(text))}
            self.scores = Scores(self._viewed, same)
        self._masks, self.failure = masks, ""

    def receive(self) -> str:
        """Take what was answered about the last question; why something failed, empty if nothing did."""
        failure = ""
        for answer in self.task.answers():
            if isinstance(answer, Traced):
                if answer.number >= self._first and (answer.final or not self.is_final):
                    self._traced = answer
            elif answer.number != self._number:
                continue
            elif isinstance(answer, Scored):
                self.scores = Scores(self._viewed, {**self.known, answer.spec: answer.scores})
            else:
                self.failure = failure = answer.reason
        return failure

    @property
    def waits(self) -> bool:
        """Whether the truth of the last question or a score is still to come."""
        return not (self.is_final and self._masks.keys() <= self.known.keys())

    @property
    def known(self) -> Mapping[str, Mapping[str, float | None]]:
        """The scores of the view of the last question."""
        return self.scores.by_spec if self.scores.viewed == self._viewed else {}

    @property
    def is_final(self) -> bool:
        """Whether the truth is traced in full."""
        return self._traced is not None and self._traced.final

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


def _equal(one: NDArray[np.float32] | None, other: NDArray[np.float32] | None) -> bool:
    return one is not None and other is not None and np.array_equal(one, other)
