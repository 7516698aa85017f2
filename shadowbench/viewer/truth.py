"""The truth and the scores of what is shown, from a process beside the window, for which drawing never waits.

`TruthTask` is the window's side: it starts the process, which calls `serve`. That process sends coarse truths first,
then the one that `score` compares with, then the scores. `Judge` keeps what it has answered.
"""

import multiprocessing
import os
import queue
import threading
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from shadowbench.errors import message
from shadowbench.measure.plugin_output import forward_output
from shadowbench.measure.scoring import prepare_truth, truth_record
from shadowbench.measure.worker import Pipe, connected, die_with, sigint_blocked, spawn
from shadowbench.scenes.model import View
from shadowbench.scenes.opening import chosen_view
from shadowbench.scores.metrics import score
from shadowbench.scores.prepared import PreparedTruth
from shadowbench.truths.trace import Truth, trace
from shadowbench.viewer.state import ViewerState

COARSE = (8, 4)
"""By which shares of its size a view is traced before it is traced in full."""
PATIENCE = 5  # by which its priority is lower than the window's
COARSE_ERROR = 0.05
"""Standard error of visibility in a coarse truth of a light with a size."""

Masks = Mapping[str, NDArray[np.float32]]
"""Visibility by the full text of its spec."""
Scores = Mapping[str, Mapping[str, float | None]]
"""Values of metrics by the full text of their spec."""


@dataclass(frozen=True, eq=False)
class Request:
    """A view to trace, unless it was the last one, and masks of it to score. Answers carry its number."""

    number: int
    view: View
    masks: Masks


@dataclass(frozen=True, eq=False)
class Traced:
    """What the window shows of a truth: arrays (N, N), row 0 at the top, as those of `Truth`.

    scored: receivers that are not undecided; facets: as of `Truth`; soft: whether there is a penumbra; final: whether
    it is the full truth.
    """

    number: int
    visibility: NDArray[np.float32]
    scored: NDArray[np.bool_]
    facets: NDArray[np.bool_]
    blocker: NDArray[np.float32]
    soft: bool
    final: bool


@dataclass(frozen=True, eq=False)
class Scored:
    """The scores of a request's masks."""

    number: int
    scores: Scores


@dataclass(frozen=True, eq=False)
class Failed:
    """Why a view cannot be traced or its masks not scored."""

    number: int
    reason: str


Answer = Traced | Scored | Failed


class Judge:
    """Asks a task for truth and scores, and keeps its last answers.

    scores: of the masks that were scored last; failure: why the last question has no answer, empty if nothing failed.
    """

    def __init__(self, task: "TruthTask") -> None:
        self.task = task
        self.scores: Scores = {}
        self.failure = ""
        self._viewed: tuple[object, ...] = ()  # of the last question
        self._number = self._first = 0  # of the last question, and of the first one about its view
        self._scored = 0  # the question that `scores` answers
        self._traced: Traced | None = None

    def ask(self, state: ViewerState, masks: Masks) -> None:
        """Ask for the truth of what is shown, and for the scores of masks."""
        self._number, self.failure = self.task.ask(state.view(), masks), ""
        if state.viewed != self._viewed:
            self._traced, self._viewed, self._first = None, state.viewed, self._number

    def receive(self) -> None:
        """Take what was answered about the last question, and the truth of its view."""
        for answer in self.task.answers():
            if isinstance(answer, Traced):
                self._traced = answer if answer.number >= self._first else self._traced
            elif answer.number != self._number:
                continue
            elif isinstance(answer, Scored):
                self.scores, self._scored = answer.scores, answer.number
            else:
                self.failure = answer.reason

    @property
    def is_answered(self) -> bool:
        """Whether the scores are of the masks of the last question."""
        return 0 < self._number == self._scored

    def traced(self, state: ViewerState) -> Traced | None:
        """The truth of a state, perhaps a coarse one; None if it is not traced yet."""
        return self._traced if self._viewed == state.viewed else None


class TruthTask:
    """A process that traces views and scores masks. Requests are pickled and sent in a thread."""

    def __init__(self) -> None:
        self._number = 0  # of the last request
        self._start()

    def ask(self, view: View, masks: Masks) -> int:
        """Ask for the truth of a view, and for the scores of masks of it; returns the number of their answers.

        A process that has ended is replaced.
        """
        if self._ended:
            self._start()
        self._number += 1
        self._requests.put(Request(self._number, view, masks))
        return self._number

    @property
    def has_answers(self) -> bool:
        """Whether `answers` would return some."""
        return not self._ended and self._pipe.connection.poll()

    def answers(self) -> list[Answer]:
        """What has been answered since the last call."""
        found: list[Answer] = []
        try:
            while self.has_answers:
                found.append(self._pipe.receive())
        except (EOFError, OSError):
            found.append(Failed(self._number, f"the process that traces ended (code {self._process.wait()})"))
            self.stop()
        return found

    def stop(self) -> None:
        """End the process."""
        self._requests.put(None)
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
        self._requests: queue.SimpleQueue[Request | None] = queue.SimpleQueue()
        self._sender: threading.Thread = threading.Thread(target=_send, args=(self._pipe, self._requests), daemon=True)
        self._sender.start()


def _send(pipe: Pipe, requests: "queue.SimpleQueue[Request | None]") -> None:
    """Send requests until the process is gone."""
    with suppress(OSError):
        while (request := requests.get()) is not None:
            pipe.send(request)


class TruthServer:
    """Answers requests. The truth of the last view is kept: other masks of it are only scored."""

    def __init__(self, pipe: Pipe) -> None:
        self._pipe = pipe
        self._viewed: tuple[object, ...] = ()
        self._prepared: PreparedTruth | None = None

    def answer(self, request: Request) -> None:
        """Answer a request, unless another one has come in the meantime: that one is about what is shown now."""
        try:
            viewed = tuple(vars(request.view).values())
            if viewed != self._viewed:
                truth = self._trace(request)
                if truth is None:
                    return
                self._prepared, self._viewed = prepare_truth(truth), viewed
            prepared = self._prepared
            assert prepared is not None
            scores = {spec: score(mask, prepared) | truth_record(prepared) for spec, mask in request.masks.items()}
            self._pipe.send(Scored(request.number, scores))
        except Exception as error:  # shown in the window, whatever it is
            self._pipe.send(Failed(request.number, message(error)))

    def _trace(self, request: Request) -> Truth | None:
        """The truth of a view; None if another request has come."""
        view = request.view
        for share in COARSE:
            if view.size // share >= 16:
                coarse = View(view.scene, view.camera, view.light, view.size // share)
                self._show(trace(coarse, pixel_samples=1, standard_error=COARSE_ERROR), request, final=False)
                if self._pipe.connection.poll():
                    return None
        truth = trace(view)
        self._show(truth, request, final=True)
        return truth

    def _show(self, truth: Truth, request: Request, final: bool) -> None:
        scored = truth.receivers & ~truth.undecided
        images = truth.visibility, scored, truth.facets, truth.blocker
        self._pipe.send(Traced(request.number, *images, truth.sampled, final))


def serve(handle: str, parent: str) -> None:
    """Answer requests until the pipe is closed; arguments: as of `measure.worker.serve`."""
    pipe = connected(handle)
    die_with(int(parent))
    os.nice(PATIENCE)  # drawing goes first
    trace(chosen_view("post", 16))  # compiled loops and libraries are loaded before the first request
    server = TruthServer(pipe)
    while True:
        try:
            request: Request = pipe.receive()
            while pipe.connection.poll():
                request = pipe.receive()
        except EOFError:
            return
        server.answer(request)
