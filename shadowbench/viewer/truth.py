"""The truth of what is shown, traced and scored beside the drawing, which never waits for it.

`TruthTask` is the window's side: it starts a process, which calls `serve`. That process sends coarse truths first, then
the one that `score` compares with.
"""

import multiprocessing
import os
import queue
import subprocess
import threading
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from shadowbench.errors import message
from shadowbench.measure.plugin_output import forward_output
from shadowbench.measure.scoring import prepare_truth, truth_record
from shadowbench.measure.serve import connected, die_with
from shadowbench.measure.worker import Pipe, sigint_blocked, spawn
from shadowbench.scenes.model import View
from shadowbench.scenes.views import chosen_view
from shadowbench.scores.metrics import score
from shadowbench.scores.prepared import PreparedTruth
from shadowbench.truths.trace import Truth, trace

COARSE = (8, 4)
"""By which shares of its size a view is traced before it is traced in full."""
PATIENCE = 5  # by which its priority is lower than the window's
COARSE_ERROR = 0.05
"""Standard error of visibility in a coarse truth of a light with a size."""


@dataclass(frozen=True, eq=False)
class Request:
    """A view to trace, unless it was the last one, and masks to score, by spec.

    number: of the request, which its answers carry; of_view: equal for requests of the same view.
    """

    number: int
    of_view: int
    view: View
    masks: Mapping[str, NDArray[np.float32]]


@dataclass(frozen=True, eq=False)
class Traced:
    """What the window shows of a truth: arrays (N, N), row 0 at the top, as those of `Truth`.

    scored: receivers that are not undecided; soft: whether there is a penumbra; final: whether it is the full truth.
    """

    number: int
    visibility: NDArray[np.float32]
    scored: NDArray[np.bool_]
    blocker: NDArray[np.float32]
    soft: bool
    final: bool


@dataclass(frozen=True, eq=False)
class Scored:
    """The scores of a spec's mask in a view."""

    number: int
    spec: str
    scores: Mapping[str, float | None]


@dataclass(frozen=True, eq=False)
class Failed:
    """Why a view cannot be traced or a mask not scored."""

    number: int
    reason: str


Answer = Traced | Scored | Failed


class TruthTask:
    """A process that traces views and scores masks. Requests are pickled and sent in a thread."""

    def __init__(self) -> None:
        self._number = self._of_view = 0  # of the last request, and of its view
        self._start()

    def ask(self, view: View, masks: Mapping[str, NDArray[np.float32]], again: bool = False) -> int:
        """Ask for the truth of a view, and for the scores of masks by spec; returns the number of their answers.

        again: the view is that of the last request, whose truth is not traced again. A process that has ended is
        replaced.
        """
        if self._ended:
            self._start()
        self._number += 1
        self._of_view += not again
        self._requests.put(Request(self._number, self._of_view, view, dict(masks)))
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
            self._process: subprocess.Popen[bytes] = spawn(theirs, __name__)
        assert self._process.stdout is not None
        forward_output(self._process.stdout)
        self._ended = False
        self._pipe: Pipe = Pipe(ours)
        self._requests: queue.SimpleQueue[Request | None] = queue.SimpleQueue()
        self._sender: threading.Thread = threading.Thread(
            target=self._send, args=(self._pipe, self._requests), daemon=True
        )
        self._sender.start()

    @staticmethod
    def _send(pipe: Pipe, requests: "queue.SimpleQueue[Request | None]") -> None:
        """Send requests until the process is gone."""
        with suppress(BrokenPipeError, ConnectionResetError, OSError):
            while (request := requests.get()) is not None:
                pipe.send(request)


class TruthServer:
    """Answers requests. The truth of the last view is kept: other masks of it are only scored."""

    def __init__(self, pipe: Pipe) -> None:
        self._pipe = pipe
        self._of_view = -1
        self._prepared: PreparedTruth | None = None

    def answer(self, request: Request) -> None:
        """Answer a request, unless another one has come in the meantime: that one is about what is shown now."""
        try:
            if request.of_view != self._of_view and not self._trace(request):
                return
            assert self._prepared is not None
            for spec, mask in request.masks.items():
                scores = score(mask, self._prepared) | truth_record(self._prepared)
                self._pipe.send(Scored(request.number, spec, scores))
        except Exception as error:  # shown in the window, whatever it is
            self._pipe.send(Failed(request.number, message(error)))

    def _trace(self, request: Request) -> bool:
        """Trace a view; whether it was traced in full."""
        view, number = request.view, request.number
        for share in COARSE:
            if view.size // share >= 16:
                coarse = View(view.scene, view.camera, view.light, view.size // share)
                truth = trace(coarse, pixel_samples=1, standard_error=COARSE_ERROR)
                self._pipe.send(_shown(truth, number, final=False))
                if self._pipe.connection.poll():
                    return False
        truth = trace(view)
        self._prepared, self._of_view = prepare_truth(truth), request.of_view
        self._pipe.send(_shown(truth, number, final=True))
        return True


def _shown(truth: Truth, number: int, final: bool) -> Traced:
    scored = truth.receivers & ~truth.undecided
    return Traced(number, truth.visibility, scored, truth.blocker, truth.sampled, final)


def serve(handle: str, parent: str) -> None:
    """Answer requests until the pipe is closed; arguments: as of `measure.serve`."""
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
