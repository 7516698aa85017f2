"""Measures cells with the current sources of a folder, each time in a fork of this process.

`python forked.py SOURCES` holds the libraries and nothing of ours, so that what is imported for one run is gone before
the next. It reads a request a line, [scenes, specs, phases, study, folder], and answers [exit code, what was printed].
"""

import gc
import importlib
import json
import os
import sys
import tempfile
import traceback
from pathlib import Path
from typing import Any

# With what they import, these are imported once; ours are forgotten again.
WARM = ("shadowbench.studies.measure", "shadowbench.measure.session", "scipy.ndimage", "skimage.metrics", "pandas")


def measured(scenes: list[str], specs: list[str], phases: int, study: str, folder: str) -> None:
    """Like `run`, but with the session in this process."""
    from shadowbench.measure.campaign import Campaign
    from shadowbench.measure.failures import Limits
    from shadowbench.measure.gl_drawer import GLDrawer
    from shadowbench.measure.session import Session
    from shadowbench.options import Measuring
    from shadowbench.studies.measure import Place, measure, study_from_options
    from shadowbench.techniques.registry import techniques
    from shadowbench.techniques.spec import parse_spec

    class Here:
        """A worker that lets exceptions of techniques end the run."""

        limits = Limits()

        def __init__(self) -> None:
            self.session = Session()
            self.info = self.session.info()

        def call(self, method: Any, *arguments: Any, **options: Any) -> Any:
            return method(self.session, *arguments, **options)

        def stop(self) -> None:
            pass

    class Silent:
        """The reporter."""

        def note(self, line: str) -> None:
            pass

        def stage(self, name: str, total: int | None) -> None:
            pass

        def step(self, what: str) -> None:
            pass

    known = techniques()
    chosen = [parse_spec(text, known) for text in specs]
    asked = study_from_options(known, scenes, chosen, study=study, measuring=Measuring(phases=phases))
    measure(asked, Path(folder), [Place(lambda at: Campaign(at, GLDrawer(Here()), Silent()))])


def main(sources: str) -> None:
    sys.dont_write_bytecode = True  # of a changed module, which a later run would take for the unchanged one
    sys.path.insert(0, sources)
    os.chdir(sources)
    for name in WARM:
        importlib.import_module(name)
    for name in [name for name in sys.modules if name.partition(".")[0] == "shadowbench"]:
        del sys.modules[name]
    gc.freeze()  # forks need not look through all this for garbage
    for line in sys.stdin:
        with tempfile.TemporaryFile() as printed:
            child = os.fork()
            if child == 0:
                for stream in (1, 2):
                    os.dup2(printed.fileno(), stream)
                code = 1
                try:
                    measured(*json.loads(line))
                    code = 0
                except BaseException:  # also what a plug-in or a signal raises: the fork never returns to the loop
                    traceback.print_exc()
                finally:
                    sys.stderr.flush()
                    os._exit(code)
            _, status = os.waitpid(child, 0)
            printed.seek(0)
            answer = os.waitstatus_to_exitcode(status), printed.read().decode(errors="replace")
            print(json.dumps(answer), flush=True)


if __name__ == "__main__":
    main(sys.argv[1])
