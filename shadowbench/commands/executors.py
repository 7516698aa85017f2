"""Where a command measures: with a worker process here, or on the workers of a Dask cluster."""

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
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

    Opener = Callable[[Path], Campaign]


def _here(worker: "Worker", **options: Any) -> "Opener":
    from shadowbench.measure.campaign import Campaign
    from shadowbench.measure.gl_drawer import GLDrawer

    return partial(Campaign, drawer=GLDrawer(worker), **options)


@contextmanager
def opening(machines: Machines, plugins: Sequence[Path], limits: "Limits | None", **options: Any) -> "Iterator[Opener]":
    """What opens the campaign of a command in a folder; options: of the campaign."""
    if machines.dask is None:
        from shadowbench.measure.worker import Worker

        with Worker(plugins, limits) as worker:
            yield _here(worker, **options)
        return
    from shadowbench.measure.dask_campaign import ClusterCampaign, ClusterDrawer
    from shadowbench.measure.dask_cluster import Cluster

    time_on = machines.time_on if isinstance(machines, TimingMachines) else None
    if time_on == "here":
        raise InputError(f"--time-on {time_on}: allowed: one worker, by its address or machine")
    with Cluster(machines.dask, options["reporter"], plugins, limits, machines.renderer) as cluster:
        one = cluster.named(time_on) if time_on is not None else None
        yield partial(ClusterCampaign, drawer=ClusterDrawer(cluster, cluster.renderers()[0], one), **options)


@contextmanager
def places(
    study: "Study", machines: StudyMachines, worker: "Worker | None", plugins: Sequence[Path], **options: Any
) -> "Iterator[list[Place]]":
    """Where a study is measured; worker: the one here, without --dask; options: of the campaigns."""
    from shadowbench.measure.worker import Worker
    from shadowbench.studies.measure import Place

    if machines.dask is None:
        assert worker is not None
        yield [Place(_here(worker, **options))]
        return
    from shadowbench.measure.dask_campaign import ClusterCampaign, ClusterDrawer
    from shadowbench.measure.dask_cluster import Cluster

    setup = (plugins, study.limits, machines.renderer, machines.any_renderer)
    with Cluster(machines.dask, options["reporter"], *setup) as cluster:
        found = [
            Place(
                partial(ClusterCampaign, drawer=ClusterDrawer(cluster, one), **options | {"time_again": False}), False
            )
            for one in cluster.renderers()
        ]
        if machines.time_on == "here":
            with Worker(plugins, study.limits) as here:
                if here.info.renderer not in cluster.renderers():
                    measured = " and ".join(cluster.renderers())
                    raise InputError(f"--time-on here: the renderer here is {here.info.renderer}; allowed: {measured}")
                yield [*found, Place(_here(here, **options))]
            return
        if machines.time_on is not None:
            one = cluster.named(machines.time_on)
            drawer = ClusterDrawer(cluster, str(one.renderer), one)
            found.append(Place(partial(ClusterCampaign, drawer=drawer, **options)))
        yield found


def timed_on(study: "Study", machines: TimingMachines, rounds: int | None, reporter: "Reporter") -> "Study":
    """The study as it is measured: with --dask it is only timed where --time-on says. rounds: as given by an option.

    Raises InputError.
    """
    if machines.dask is None:
        return study
    if machines.time_on is None and rounds:
        raise InputError(
            f"--rounds {rounds} with --dask: times belong to one machine; allowed: --rounds 0, or --time-on here or a "
            "worker"
        )
    if machines.time_on is not None and study.rounds == 0:
        raise InputError(f"--time-on {machines.time_on}: found 0 rounds; allowed: 1 or more")
    if machines.time_on is None and study.rounds:
        reporter.note("nothing is timed: --time-on says on which machine")
        return study.with_(rounds=0)
    return study
