"""`submit`: the times of a device, measured into one file that others can use, or checked on arrival."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from shadowbench.commands import console, options
from shadowbench.errors import counted

if TYPE_CHECKING:
    from shadowbench.results.submission import Submission


@options.command(
    "\b\nFor example\n"
    "  shadowbench submit                      # on the machine with the GPU\n"
    "  shadowbench submit --check my-gpu.json  # where it is received"
)
def submit(
    check: Annotated[
        list[Path] | None,
        typer.Option("--check", metavar="FILE", help="Check this submission instead; repeatable."),
    ] = None,
    output: Annotated[
        Path, typer.Option("-o", "--output", metavar="DIR", help="Folder for the cells and the submission.")
    ] = Path("results/device"),
    quiet: options.Quiet = False,
) -> int:
    """Measure this GPU for others, into one file.

    Measures the study `device`: each kind of technique, map size and filter on fourteen scenes, in interleaved
    rounds. The file has the device, its driver and clock rates, the noise of its times, and of each cell its IoU
    and times; of the machine processor, cores, memory, system, and the versions of Python and of the libraries. An
    interrupted measurement resumes when the command is repeated.

    With --check, tells what speaks against a submission: times of a software renderer, noise, few rounds, cells that
    are missing or are drawn otherwise than on a software renderer. Exit code 1 if anything does.
    """
    from shadowbench.results.submission import read_submission, write_submission

    files = check or []
    if not files:
        made = _measured(output, quiet)
        files = [write_submission(made, output)]
    return max(_told(file, read_submission(file), quiet) for file in files)


def _measured(output: Path, quiet: bool) -> "Submission":
    """The submission of this machine's device. Raises InputError if the study cannot be read."""
    from shadowbench.campaigns import campaign_in
    from shadowbench.measure.clock_rates import clock_rates
    from shadowbench.measure.doctor import measure_noise
    from shadowbench.measure.worker import Worker
    from shadowbench.plugin.registry import techniques
    from shadowbench.results.submission import STUDY, Noise, submission_of
    from shadowbench.studies.run import measure
    from shadowbench.studies.study import find_study, read_study

    study = read_study(find_study(STUDY), techniques())
    with console.Reporter(quiet) as reporter, Worker((), study.limits) as worker:
        with campaign_in(output, reporter, worker=worker) as campaign:
            found = measure(study, campaign)
        noise = measure_noise(worker)
        rates = clock_rates(found.info.renderer)  # right after it was at work
    return submission_of(found.run, found.info, rates, Noise(ratio=noise.ratio, worst=noise.worst, n=noise.n))


def _told(file: Path, one: "Submission", quiet: bool) -> int:
    """Print what speaks against a submission; 1 if anything does."""
    from shadowbench.results.submission import objections

    lines = objections(one)
    for line in lines:
        console.print_error(f"{file}: {line}")
    if not quiet:
        console.print_line(f"{file}: {counted(len(one.cells), 'timed cell')} of {one.device}")
    return 1 if lines else 0
