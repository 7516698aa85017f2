"""Where times are taken: in this process's own worker process, or on workers of a cluster one after the other."""

from collections.abc import Mapping, Sequence
from contextlib import ExitStack
from pathlib import Path

from shadowbench.cluster.cluster import Cluster
from shadowbench.cluster.executor import DaskExecutor
from shadowbench.cluster.workers import WorkerFacts
from shadowbench.errors import InputError
from shadowbench.measure.executor import Executor
from shadowbench.measure.worker import Worker

HERE = "here"
EACH = "each"


def timers(place: str, cluster: Cluster, plugins: Sequence[Path], stack: ExitStack) -> Mapping[str, Executor]:
    """Executors that take times, by the name of their machine; stack: closes them.

    place: `here`, `each` for one worker on every machine, or a worker by its address or the name of its machine. Raises
    InputError for an unknown worker, and for a renderer here that is not measured.
    """
    if place == HERE or (place == EACH and cluster.connection.local):
        worker = stack.enter_context(Worker(plugins, cluster.setup.limits))
        if worker.info.renderer not in cluster.renderers():
            measured = " and ".join(cluster.renderers())
            raise InputError(f"--time-on {place}: the renderer here is {worker.info.renderer}; allowed: {measured}")
        return {HERE: worker}
    machines: dict[str, WorkerFacts] = {}
    for one in cluster.facts.values():
        machines.setdefault(one.host, one)
    if place != EACH:
        named = [one for one in cluster.facts.values() if place in (one.address, one.host)]
        if not named or cluster.connection.local:
            allowed = [HERE] if cluster.connection.local else [HERE, EACH, *machines, *cluster.facts]
            raise InputError(f"--time-on {place}: no such worker; allowed: {', '.join(allowed)}")
        machines = {place: named[0]}
    return {name: DaskExecutor(cluster, one.info.renderer, one) for name, one in machines.items() if one.info}
