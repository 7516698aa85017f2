"""What is sent to Dask workers."""

from shadowbench.extremes.axes import AXES
from shadowbench.measure.dask_tasks import Setup, pack, station
from shadowbench.measure.failures import Limits
from shadowbench.measure.keys import view_key
from shadowbench.plugin.registry import techniques
from shadowbench.plugin.spec import parse_spec
from shadowbench.studies.stress import block_at, points_of


def test_the_blocks_of_an_axis_arrive_as_they_were() -> None:
    specs = [parse_spec("shadow-map:bias=slope", techniques())]
    for axis in AXES.values():
        sent = block_at(specs, points_of([axis], quick=True)[0])
        with station(Setup("", (), Limits())) as here:
            again = here.unpack(pack(sent))
        parts = [(block.cells, block.place, block.coordinates, block.step) for block in (sent, again)]
        assert parts[0] == parts[1]
        assert list(map(view_key, again.views)) == list(map(view_key, sent.views))
