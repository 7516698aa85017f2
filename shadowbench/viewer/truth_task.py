"""The truth of what is shown, traced and scored beside the drawing, which never waits for it."""

import multiprocessing
import queue
import subprocess
import threading
from collections.abc import Mapping
from contextlib import suppress

import numpy as np
from numpy.typing import NDArray

from shadowbench.measure.pipe import Pipe
from shadowbench.measure.plugin_output import forward_output
from shadowbench.measure.worker import sigint_blocked, spawn
from shadowbench.scenes.model import View
from shadowbench.viewer.truth_messages import Answer, Failed, Request


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
            self._process: subprocess.Popen[bytes] = spawn(theirs, "shadowbench.viewer.truth_server")
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
