"""What `make demo` runs: the study `demo`, a scene at a time; after each, its verdict, and report.html so far.

python benchmarks/demo.py [-o DIR]: the run folder, by default results/demo. Stopped, it goes on where it was.
"""

import argparse
from pathlib import Path

from shadowbench.commands.console import Reporter
from shadowbench.measure.gl_drawer import campaign_in
from shadowbench.measure.worker import Worker
from shadowbench.plugin.registry import techniques
from shadowbench.reports.report import write_report
from shadowbench.reports.texts import verdict
from shadowbench.results.law import law_on_record
from shadowbench.results.summary import summaries
from shadowbench.studies.run import measure
from shadowbench.studies.study import find_study, read_study

REPORT = Path("report.html")


def main() -> None:
    """Measure, print and write."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("-o", "--output", metavar="DIR", type=Path, default=Path("results/demo"))
    folder = parser.parse_args().output
    with Worker() as worker, Reporter(False) as reporter:
        study, law = read_study(find_study("demo"), techniques()), law_on_record()
        for count in range(1, len(study.scenes) + 1):
            progress = f"{count} of {len(study.scenes)} scenes"
            notes = (progress,) if count < len(study.scenes) else ()
            part = study.with_(scenes=study.scenes[:count], notes=notes)
            with campaign_in(folder, reporter, worker=worker) as campaign:
                run = measure(part, campaign).run.last
            shown = summaries(run, law)
            write_report([(run, shown)], [], REPORT, "html")
            for line in verdict(shown[-1]):
                print(f"{shown[-1].title}: {line}")
            print(f"{REPORT}: {progress}", flush=True)


if __name__ == "__main__":
    main()
