"""Tracing and scoring in a process of its own: coarse truths first, then the one that `score` compares with."""

import os

from shadowbench.errors import message
from shadowbench.measure.pipe import Pipe
from shadowbench.measure.scoring import prepare_truth, truth_record
from shadowbench.measure.serve import connected, die_with
from shadowbench.scenes.model import View
from shadowbench.scenes.views import chosen_view
from shadowbench.scores.metrics import score
from shadowbench.scores.prepared import PreparedTruth
from shadowbench.truths.trace import Truth, trace
from shadowbench.viewer.truth_messages import Failed, Request, Scored, Traced

COARSE = (8, 4)
"""By which shares of its size a view is traced before it is traced in full."""
PATIENCE = 5  # by which its priority is lower than the window's
COARSE_ERROR = 0.05
"""Standard error of visibility in a coarse truth of a light with a size."""


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
