"""Where a command measures: with a worker process here, or on the workers of a Dask cluster."""

from collections.abc import Iterator, Sequence
from contextlib import ExitStack, contextmanager, nullcontext
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from shadowbench.commands.options import Machines, StudyMachines, TimingMachines
from shadowbench.errors import InputError

if TYPE_CHECKING:
    from shadowbench.measure.campaign import Reporter
    from shadowbench.measure.failures import Limits
    from shadowbench.measure.worker import Worker
    from shadowbench.studies.measure import Place
    from shadowbench.studies.study import Study


@contextmanager
def places(
    machines: Machines,
    plugins: Sequence[Path],
    limits: "Limits | None",
    worker: "Worker | None" = None,
    **options: Any,
) -> "Iterator[list[Place]]":
    """Where a command measures: one place, but for a study each renderer of a cluster, and where it is timed.

    worker: one that was started here; options: of the campaigns. Raises InputError.
    """
    from shadowbench.measure.campaign import Campaign
    from shadowbench.measure.gl_drawer import GLDrawer
    from shadowbench.measure.worker import Worker
    from shadowbench.studies.measure import Place

    if machines.dask is None:
        with nullcontext(worker) if worker else Worker(plugins, limits) as here:
            yield [Place(partial(Campaign, drawer=GLDrawer(here), **options))]
        return
    from shadowbench.measure.dask_campaign import ClusterCampaign, ClusterDrawer
    from shadowbench.measure.dask_cluster import Cluster

    time_on = machines.time_on if isinstance(machines, TimingMachines) else None
    several = isinstance(machines, StudyMachines)
    if time_on == "here" and not several:
        raise InputError(f"--time-on {time_on}: allowed: one worker, by its address or machine")
    setup = (plugins, limits, machines.renderer, isinstance(machines, StudyMachines) and machines.any_renderer)
    with ExitStack() as stack:
        cluster = stack.enter_context(Cluster(machines.dask, options["reporter"], *setup))
        only = cluster.named(time_on) if time_on not in (None, "here") else None
        on_dask = partial(ClusterCampaign, **options)
        if not several:
            yield [Place(partial(on_dask, drawer=ClusterDrawer(cluster, cluster.renderers()[0], only)))]
            return
        found = [
            Place(partial(on_dask, drawer=ClusterDrawer(cluster, one), time_again=False), times=False)
            for one in cluster.renderers()
        ]
        if only is not None:
            found.append(Place(partial(on_dask, drawer=ClusterDrawer(cluster, str(only.renderer), only))))
        if time_on == "here":
            here = stack.enter_context(Worker(plugins, limits))
            if here.info.renderer not in cluster.renderers():
                measured = " and ".join(cluster.renderers())
                raise InputError(f"--time-on here: the renderer here is {here.info.renderer}; allowed: {measured}")
            found.append(Place(partial(Campaign, drawer=GLDrawer(here), **options)))
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
