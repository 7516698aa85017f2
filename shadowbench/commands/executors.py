"""Where a command measures: with a worker process here, or on the workers of a Dask cluster."""

from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack, contextmanager
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from shadowbench.commands.options import Machines, StudyMachines, TimingMachines
from shadowbench.errors import InputError

if TYPE_CHECKING:
    from shadowbench.measure.campaign import Campaign, Reporter
    from shadowbench.measure.failures import Limits
    from shadowbench.measure.worker import Worker
    from shadowbench.studies.measure import Place
    from shadowbench.studies.study import Study


@contextmanager
def opening(
    machines: Machines,
    plugins: Sequence[Path],
    limits: "Limits | None",
    reporter: "Reporter",
    **options: Any,
) -> "Iterator[Callable[[Path], Campaign]]":
    """What opens the campaign of a command in a folder; options: of the campaign."""
    if machines.dask is None:
        from shadowbench.measure.campaign import Campaign
        from shadowbench.measure.gl_drawer import GLDrawer
        from shadowbench.measure.worker import Worker

        with Worker(plugins, limits) as worker:
            yield partial(Campaign, drawer=GLDrawer(worker), reporter=reporter, **options)
        return
    from shadowbench.cluster.campaign import ClusterCampaign, ClusterDrawer
    from shadowbench.cluster.cluster import Cluster
    from shadowbench.cluster.connect import Connection
    from shadowbench.cluster.timing import EACH, HERE, named_worker

    time_on = machines.time_on if isinstance(machines, TimingMachines) else None
    if time_on in (EACH, HERE):
        raise InputError(f"--time-on {time_on}: allowed: one worker, by its address or machine")
    with ExitStack() as stack:
        connection = stack.enter_context(Connection(machines.dask))
        cluster = stack.enter_context(Cluster(connection, reporter, plugins, limits, machines.renderer))
        one = named_worker(time_on, cluster) if time_on is not None else None
        drawer = ClusterDrawer(cluster, cluster.renderers()[0], one)
        yield partial(ClusterCampaign, drawer=drawer, reporter=reporter, **options)


@contextmanager
def places(
    study: "Study",
    machines: StudyMachines,
    worker: "Worker | None",
    plugins: Sequence[Path],
    reporter: "Reporter",
    **options: Any,
) -> "Iterator[list[Place]]":
    """Where a study is measured; worker: the one here, without --dask; options: of the campaigns."""
    from shadowbench.measure.campaign import Campaign
    from shadowbench.measure.gl_drawer import GLDrawer
    from shadowbench.studies.measure import Place

    if worker is not None:
        yield [Place(partial(Campaign, drawer=GLDrawer(worker), reporter=reporter, **options))]
        return
    from shadowbench.cluster.campaign import ClusterCampaign, ClusterDrawer
    from shadowbench.cluster.cluster import Cluster
    from shadowbench.cluster.connect import Connection
    from shadowbench.cluster.timing import timers

    assert machines.dask is not None
    with ExitStack() as stack:
        connection = stack.enter_context(Connection(machines.dask))
        setup = (plugins, study.limits, machines.renderer, machines.any_renderer)
        cluster = stack.enter_context(Cluster(connection, reporter, *setup))
        scored = {**options, "time_again": False}
        found = [
            Place(
                partial(ClusterCampaign, drawer=ClusterDrawer(cluster, one), reporter=reporter, **scored), times=False
            )
            for one in cluster.renderers()
        ]
        if machines.time_on is not None:
            for name, timer in timers(machines.time_on, cluster, plugins, stack).items():
                opened = (
                    partial(ClusterCampaign, drawer=timer, reporter=reporter, **options)
                    if isinstance(timer, ClusterDrawer)
                    else partial(Campaign, drawer=timer, reporter=reporter, **options)
                )
                found.append(Place(opened, name))
        yield found


def timed_on(study: "Study", machines: TimingMachines, rounds: int | None, reporter: "Reporter") -> "Study":
    """The study as it is measured: with --dask it is only timed where --time-on says. rounds: as given by an option.

    Raises InputError.
    """
    if machines.dask is None:
        return study
    if machines.time_on is None and rounds:
        raise InputError(
            f"--rounds {rounds} with --dask: times belong to one machine; allowed: --rounds 0, or --time-on here, each "
            "or a worker"
        )
    if machines.time_on is not None and study.rounds == 0:
        raise InputError(f"--time-on {machines.time_on}: found 0 rounds; allowed: 1 or more")
    if machines.time_on is None and study.rounds:
        reporter.note("nothing is timed: --time-on says on which machine")
        return study.with_(rounds=0)
    return study
