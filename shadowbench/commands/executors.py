"""What draws for a command: a worker process here, or the workers of a Dask cluster."""

from collections.abc import Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from shadowbench.errors import InputError

if TYPE_CHECKING:
    from shadowbench.measure.bench import Reporter
    from shadowbench.measure.executor import Executor, Limits
    from shadowbench.studies.study import Study


@contextmanager
def drawing(
    dask: str | None,
    renderer: str | None,
    plugins: Sequence[Path],
    limits: "Limits | None",
    reporter: "Reporter",
    time_on: str | None = None,
) -> "Iterator[Executor]":
    """The executor of a command that needs one; time_on: name of the only worker that it uses, so that it can time."""
    from shadowbench.measure.worker import Worker

    if dask is None:
        check_without_dask({"--renderer": renderer, "--time-on": time_on})
        with Worker(plugins, limits) as worker:
            yield worker
        return
    from shadowbench.cluster.cluster import Cluster
    from shadowbench.cluster.connect import Connection
    from shadowbench.cluster.executor import DaskExecutor
    from shadowbench.cluster.timing import EACH, HERE, timers

    if time_on in (EACH, HERE):
        raise InputError(f"--time-on {time_on}: allowed: one worker, by its address or machine")
    with ExitStack() as stack:
        cluster = stack.enter_context(
            Cluster(stack.enter_context(Connection(dask)), reporter, plugins, limits, renderer)
        )
        if time_on is None:
            yield DaskExecutor(cluster, cluster.renderers()[0])
        else:
            (executor,) = timers(time_on, cluster, plugins, stack).values()
            yield executor


def check_without_dask(given: Mapping[str, object]) -> None:
    """Raises InputError if an option is given that has a meaning with --dask only."""
    named = [name for name, value in given.items() if value]
    if named:
        raise InputError(f"{named[0]}: is for --dask, which is not given")


@dataclass(frozen=True, eq=False)
class Places:
    """Where a study is measured: see `studies.measure.measure`."""

    study: "Study"
    executor: "Executor"
    others: "Sequence[Executor]" = ()
    timers: "Mapping[str, Executor] | None" = None


@contextmanager
def places(
    study: "Study",
    dask: str,
    reporter: "Reporter",
    plugins: Sequence[Path],
    renderer: str | None,
    any_renderer: bool,
    time_on: str | None,
    rounds: int | None,
) -> Iterator[Places]:
    """Where a study is measured with --dask; rounds: those asked for by an option. Raises InputError."""
    if time_on is None and rounds:
        raise InputError(
            f"--rounds {rounds} with --dask: times belong to one machine; allowed: --rounds 0, or --time-on here, each "
            "or a worker"
        )
    if time_on is not None and study.rounds == 0:
        raise InputError(f"--time-on {time_on}: found 0 rounds; allowed: 1 or more")
    from shadowbench.cluster.cluster import Cluster
    from shadowbench.cluster.connect import Connection
    from shadowbench.cluster.executor import DaskExecutor
    from shadowbench.cluster.timing import timers

    if time_on is None and study.rounds:
        reporter.note("nothing is timed: --time-on says on which machine")
        study = study.with_(rounds=0)
    with ExitStack() as stack:
        connection = stack.enter_context(Connection(dask))
        cluster = stack.enter_context(Cluster(connection, reporter, plugins, study.limits, renderer, any_renderer))
        executor, *others = [DaskExecutor(cluster, one) for one in cluster.renderers()]
        taken = timers(time_on, cluster, plugins, stack) if time_on else {}
        yield Places(study, executor, others, taken)
