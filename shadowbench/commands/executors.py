"""Where a command measures: with a worker process here, or on the workers of a Dask cluster."""

from collections.abc import Iterator, Sequence
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

from shadowbench.commands.options import Machines, StudyMachines
from shadowbench.errors import InputError

if TYPE_CHECKING:
    from shadowbench.measure.campaign import Campaign, Reporter
    from shadowbench.measure.drawer import Limits
    from shadowbench.measure.worker import Worker

HERE = "here"


@contextmanager
def campaigns(
    folder: Path,
    machines: Machines,
    plugins: Sequence[Path],
    limits: "Limits | None",
    reporter: "Reporter",
    worker: "Worker | None" = None,
    **options: Any,
) -> "Iterator[list[Campaign]]":
    """Campaigns of a command in a folder, the last of which takes times; worker: the one here, if it has been started.

    With --dask one for each renderer, and one where times are taken. options: of the campaigns.
    """
    from shadowbench.measure.campaign import Campaign
    from shadowbench.measure.gl_drawer import GLDrawer, drawer_of
    from shadowbench.measure.worker import Worker

    with ExitStack() as stack:
        if machines.dask is None:
            here = worker or stack.enter_context(Worker(plugins, limits))
            drawer = stack.enter_context(drawer_of(here))
            yield [Campaign(folder, drawer, reporter, **options)]
            return
        from shadowbench.measure.dask_campaign import ClusterCampaign
        from shadowbench.measure.dask_cluster import Cluster

        time_on, any_renderer = (getattr(machines, name, None) for name in ("time_on", "any_renderer"))
        if time_on == HERE and not isinstance(machines, StudyMachines):
            raise InputError(f"--time-on {time_on}: allowed: one worker, by its address or machine")
        cluster = Cluster(machines.dask, reporter, plugins, limits, machines.renderer, bool(any_renderer))
        stack.enter_context(cluster)
        renderers = cluster.renderers()
        found: list[Campaign] = [ClusterCampaign(folder, cluster, reporter, one, **options) for one in renderers]
        if time_on == HERE:
            here = stack.enter_context(Worker(plugins, limits))
            if here.info.renderer not in renderers:
                measured = " and ".join(renderers)
                raise InputError(f"--time-on here: the renderer here is {here.info.renderer}; allowed: {measured}")
            found.append(Campaign(folder, GLDrawer(here), reporter, **options))
        elif time_on is not None:
            only = cluster.named(time_on)
            renderer = cluster.facts[only].info.renderer
            found.append(ClusterCampaign(folder, cluster, reporter, renderer, only, **options))
        yield found
