"""What is sent to Dask workers."""

from shadowbench.extremes.axes import AXES
from shadowbench.measure.dask_tasks import Setup, Station, pack
from shadowbench.measure.drawer import Limits
from shadowbench.measure.keys import view_key
from shadowbench.plugin.registry import techniques
from shadowbench.plugin.spec import parse_spec
from shadowbench.studies.stress import block_at, points_of


def test_the_blocks_of_an_axis_arrive_as_they_were() -> None:
    here = Station(Setup((), Limits()))
    for axis in AXES.values():
        sent = block_at([parse_spec("shadow-map:bias=slope", techniques())], points_of([axis], quick=True)[0])
        (again,) = here.unpack(pack(sent))
        parts = [(block.cells, block.place, block.coordinates, block.step) for block in (sent, again)]
        assert parts[0] == parts[1]
        before, after = ([view_key(view) for view in (block.view, *block.later)] for block in (sent, again))
        assert before == after
    here.folder.cleanup()
