"""The truth and the scores of what is shown, from a process beside the window, for which drawing never waits.

The process sends the truth that `score` compares with, then the scores.
"""

import multiprocessing
import os
import queue
import threading
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from shadowbench.errors import message
from shadowbench.measure.plugin_output import forward_output
from shadowbench.measure.points import Points
from shadowbench.measure.scoring import prepare_truth, truth_record
from shadowbench.measure.worker import Pipe, connected, die_with, sigint_blocked, spawn
from shadowbench.scenes.opening import chosen_view
from shadowbench.scores.comparison import Comparison, PreparedTruth
from shadowbench.scores.metrics import score
from shadowbench.scores.motion import Motion
from shadowbench.truths.cache import cached_truth
from shadowbench.truths.trace import trace

if TYPE_CHECKING:
    from shadowbench.viewer.state import ViewerState

_NICE = 5  # by which the priority of the process is lower than the window's

Masks = Mapping[str, NDArray[np.float32]]
"""Visibility by the full text of its spec."""
Scores = Mapping[str, Mapping[str, float | None]]
"""Values of metrics by the full text of their spec."""


@dataclass(frozen=True, eq=False)
class Traced:
    """What the window shows of a truth: arrays (N, N), row 0 at the top, as those of `Truth`.

    scored: receivers that are not undecided; facets: as of `Truth`; soft: whether there is a penumbra.
    """

    visibility: NDArray[np.float32]
    scored: NDArray[np.bool_]
    facets: NDArray[np.bool_]
    soft: bool


class Judge:
    """Asks a process of its own for the truth of a state and the scores of its masks, and keeps its last answers.

    scores: of the masks that were scored last; failure: why the last question has no answer, empty if nothing failed.
    """

    def __init__(self) -> None:
        self.scores: Scores = {}
        self.failure = ""
        self._traced: Traced | None = None
        self._viewed: tuple[object, ...] = ()  # of the last question
        self._number = self._first = 0  # of the last question, and of the first one about its view
        self._scored = 0  # the question that `scores` answers
        self._start()

    def ask(self, state: "ViewerState", masks: Masks) -> None:
        """Ask for the truth of what is shown, and for the scores of masks. A process that has ended is replaced."""
        if self._ended:
            self._start()
        self._number, self.failure = self._number + 1, ""
        if state.viewed != self._viewed:
            self._traced, self._viewed, self._first = None, state.viewed, self._number
        frame = (hash(state.start), state.frame) if state.sequence else None
        self._questions.put((self._number, state.view(), masks, frame))

    @property
    def has_answers(self) -> bool:
        """Whether there are answers to `receive`."""
        return not self._ended and self._pipe.connection.poll()

    def receive(self) -> None:
        """Take what was answered about the last question, and the truth of its view."""
        try:
            while self.has_answers:
                self._take(*self._pipe.receive())
        except (EOFError, OSError):
            self.failure = f"the process that traces ended (code {self._process.wait()})"
            self.stop()

    def _take(self, number: int, answer: Traced | Scores | str) -> None:
        if isinstance(answer, Traced):
            self._traced = answer if number >= self._first else self._traced
        elif number != self._number:
            return
        elif isinstance(answer, str):
            self.failure = answer
        else:
            self.scores, self._scored = answer, number

    @property
    def is_answered(self) -> bool:
        """Whether the scores are of the masks of the last question."""
        return 0 < self._number == self._scored

    def traced(self, state: "ViewerState") -> Traced | None:
        """The truth of a state; None if it is not traced yet."""
        return self._traced if self._viewed == state.viewed else None

    def stop(self) -> None:
        """End the process."""
        self._questions.put(None)
        self._process.kill()
        self._process.wait()
        self._sender.join()
        self._pipe.connection.close()
        self._ended = True

    def _start(self) -> None:
        ours, theirs = multiprocessing.Pipe()
        with theirs, sigint_blocked():
            self._process = spawn(theirs, __name__)
        assert self._process.stdout is not None
        forward_output(self._process.stdout)
        self._pipe, self._ended = Pipe(ours), False
        self._questions: queue.SimpleQueue[object] = queue.SimpleQueue()
        self._sender: threading.Thread = threading.Thread(target=_send, args=(self._pipe, self._questions), daemon=True)
        self._sender.start()


def _send(pipe: Pipe, questions: "queue.SimpleQueue[object]") -> None:
    """Pickle and send questions, which may take long, until the process is gone."""
    with suppress(OSError):
        while (question := questions.get()) is not None:
            pipe.send(question)


def serve(handle: str, parent: str) -> None:
    """Answer questions until the pipe is closed; arguments: as of `worker.serve`. Only the latest one is answered."""
    pipe = connected(handle)
    die_with(int(parent))
    os.nice(_NICE)  # drawing goes first
    trace(chosen_view("post", 16))  # compiled loops and libraries are loaded before the first question
    viewed: tuple[object, ...] = ()
    prepared: PreparedTruth | None = None  # of the last view: other masks of it are only scored
    last = 0, 0  # the sequence and index of the frame that was scored last
    points, motions = Points(), dict[str, Motion]()
    while True:
        try:
            number, view, masks, frame = pipe.receive()
            while pipe.connection.poll():
                number, view, masks, frame = pipe.receive()
        except EOFError:
            return
        try:
            if viewed != tuple(vars(view).values()):
                truth = cached_truth(view, 1) if frame else trace(view, 1)
                scored = truth.receivers & ~truth.undecided
                pipe.send((number, Traced(truth.visibility, scored, truth.facets, truth.sampled)))
                prepared, viewed = prepare_truth(truth), tuple(vars(view).values())
            assert prepared is not None
            record = truth_record(prepared)
            scores = {spec: score(mask, prepared) | record for spec, mask in masks.items()}
            if frame:  # its sequence and its index
                if frame[1] == 0:
                    points, motions = Points(), {spec: Motion() for spec in masks}
                elif last != (frame[0], frame[1] - 1):  # out of order: of no flicker until frame 0
                    motions = {}
                last, motions = frame, {spec: motions[spec] for spec in motions.keys() & masks}
                if motions:
                    seen = points.see(truth)
                for spec, motion in motions.items():
                    motion.add(Comparison(masks[spec], prepared), seen)
                    scores[spec] |= {"flicker": motion.scores()["flicker"]}
            pipe.send((number, scores))
        except Exception as error:  # shown in the window, whatever it is
            pipe.send((number, message(error)))
