"""Where times are taken: in this process's own worker process, or on workers of a cluster one after the other."""

from collections.abc import Mapping, Sequence
from contextlib import ExitStack
from pathlib import Path

from shadowbench.cluster.campaign import ClusterDrawer
from shadowbench.cluster.cluster import Cluster
from shadowbench.cluster.workers import WorkerFacts
from shadowbench.errors import InputError
from shadowbench.measure.drawer import Drawer
from shadowbench.measure.gl_drawer import GLDrawer
from shadowbench.measure.worker import Worker

HERE = "here"
EACH = "each"


def timers(place: str, cluster: Cluster, plugins: Sequence[Path], stack: ExitStack) -> Mapping[str, Drawer]:
    """Drawers that take times, by the name of their machine; stack: closes them.

    place: `here`, `each` for one worker on every machine, or a worker by its address or the name of its machine. Raises
    InputError for an unknown worker, and for a renderer here that is not measured.
    """
    if place == HERE or (place == EACH and cluster.connection.local):
        worker = stack.enter_context(Worker(plugins, cluster.setup.limits))
        if worker.info.renderer not in cluster.renderers():
            measured = " and ".join(cluster.renderers())
            raise InputError(f"--time-on {place}: the renderer here is {worker.info.renderer}; allowed: {measured}")
        return {HERE: GLDrawer(worker)}
    machines = cluster.machines() if place == EACH else {place: named_worker(place, cluster)}
    return {name: ClusterDrawer(cluster, one.info.renderer, one) for name, one in machines.items() if one.info}


def named_worker(place: str, cluster: Cluster) -> WorkerFacts:
    """The worker with an address, or on a machine. Raises InputError."""
    named = [one for one in cluster.facts.values() if place in (one.address, one.host)]
    if not named or cluster.connection.local:
        others = [] if cluster.connection.local else [EACH, *cluster.machines(), *cluster.facts]
        raise InputError(f"--time-on {place}: no such worker; allowed: {', '.join([HERE, *others])}")
    return named[0]
