"""What is sent to Dask workers."""

from shadowbench.cluster.parcel import pack, unpack
from shadowbench.extremes.axes import AXES
from shadowbench.extremes.sweep import LineJob
from shadowbench.techniques.registry import techniques
from shadowbench.techniques.spec import parse_spec


def test_an_axis_s_job_is_picklable() -> None:
    specs = (parse_spec("shadow-map:bias=slope", techniques()),)
    for axis in AXES.values():
        job = LineJob(axis, axis.lights[0], axis.swept(True), specs)
        again = unpack(*pack(job), techniques())
        assert (again.axis.name, again.values, again.specs) == (axis.name, job.values, specs)
