"""A pool of processes that run cases; if one dies or hangs, its case is reported and it is replaced."""

import multiprocessing
import resource
import time
from collections.abc import Callable, Iterable, Iterator
from multiprocessing.connection import Connection, wait
from typing import Any

import psutil

from .cases import Case
from .verdict import Verdict, Watch, judged

LONGEST = 30.0
"""Seconds of processor time for one case, of its process and that one's children."""
PATIENCE = 120.0
"""Seconds in all: other programs may want the same cores."""
MOST_MEMORY = 4 << 30
"""Bytes of address space, of which the libraries alone take a part."""


Judge = Callable[[Case, Watch], Verdict]


def work(pipe: Connection, judge: Judge) -> None:
    """Main loop of a worker process: receives cases, sends verdicts."""
    resource.setrlimit(resource.RLIMIT_AS, (MOST_MEMORY, MOST_MEMORY))
    watch = Watch()
    warm = Case("scene", "a.toml", {"a.toml": b'[[mesh]]\nshape = "box"\n'})
    judge(warm, watch)  # imports read files of their own
    pipe.send(None)
    while (case := pipe.recv()) is not None:
        pipe.send(judge(case, watch))


class Worker:
    """One process and the case that it has."""

    def __init__(self, judge: Judge) -> None:
        context = multiprocessing.get_context("spawn")
        self.pipe, theirs = context.Pipe()
        self.process = context.Process(target=work, args=(theirs, judge), daemon=True)
        self.process.start()
        theirs.close()
        self.pipe.recv()
        self.case: Case | None = None
        self.since = self.spent = 0.0

    def give(self, case: Case) -> None:
        self.case, self.since, self.spent = case, time.monotonic(), self.processor()
        self.pipe.send(case)

    def processor(self) -> float:
        """CPU seconds so far, including those of ended children."""
        try:
            times = psutil.Process(self.process.pid).cpu_times()
        except psutil.NoSuchProcess:
            return 0.0
        return float(times.user + times.system + times.children_user + times.children_system)

    def hangs(self, longest: float) -> bool:
        """Whether the case exceeded its time limit."""
        return self.processor() - self.spent > longest or time.monotonic() - self.since > PATIENCE

    def stop(self) -> None:
        self.process.kill()
        self.process.join()
        self.pipe.close()


def verdicts(
    cases: Iterable[Case], jobs: int, judge: Judge = judged, longest: float = LONGEST
) -> Iterator[tuple[Case, Verdict, float]]:
    """Generate each case with its verdict and CPU seconds, in order of completion."""
    waiting = iter(cases)
    workers = [Worker(judge) for _ in range(jobs)]
    try:
        idle: list[Worker] = list(workers)
        busy: dict[Any, Worker] = {}
        while True:
            while idle and (case := next(waiting, None)) is not None:
                worker = idle.pop()
                worker.give(case)
                busy[worker.pipe] = worker
            if not busy:
                return
            ready = wait(list(busy), timeout=0.5)
            for pipe, worker in list(busy.items()):
                if pipe not in ready and not worker.hangs(longest):
                    continue
                took = worker.processor() - worker.spent
                del busy[pipe]
                verdict = _answer(worker) if pipe in ready else Verdict("failure", f"hung: more than {longest:.0f} s")
                assert worker.case is not None
                yield worker.case, verdict, took
                if not worker.process.is_alive() or pipe not in ready:
                    worker.stop()
                    workers.remove(worker)
                    worker = Worker(judge)
                    workers.append(worker)
                idle.append(worker)
    finally:
        for worker in workers:
            worker.stop()


def _answer(worker: Worker) -> Verdict:
    try:
        verdict: Verdict = worker.pipe.recv()
    except EOFError:
        worker.process.join(5)
        return Verdict("failure", f"the process died with code {worker.process.exitcode}")
    return verdict
