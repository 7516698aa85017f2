"""Mutation testing of the modules that compute numbers: plants one small fault at a time and runs their tests.

A mutant is a module with one number multiplied or divided by 1.1 (± 1 for an integer that is compared, or where only
an integer is valid) or one comparison operator changed. It is killed if a test fails or hangs. A survivor needs a
reason in tools/mutants.toml; the command exits with 1 if one has none, with 2 if the tests fail without any fault.
"""

import argparse
import ast
import gc
import importlib
import importlib.util
import multiprocessing
import os
import random
import re
import signal
import sys
import tempfile
import time
import tomllib
from collections import Counter, deque
from collections.abc import Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from importlib.abc import Loader, MetaPathFinder
from multiprocessing.connection import Connection, wait
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parent.parent
REASONS = ROOT / "tools" / "mutants.toml"
FITS = ["tests/maps/test_window.py", "tests/geometry/test_light_view.py", "tests/maps/test_fits.py"]
# Tests of each module; only tests that run in one process, since a worker process would import the unchanged module.
TESTS = {
    "shadowbench/maps/fits.py": FITS,
    "shadowbench/geometry/lights.py": FITS,
    "shadowbench/geometry/convex.py": FITS,
    "shadowbench/scores/*.py": ["tests/scores"],
    "shadowbench/results/baseline.py": ["tests/results/test_baseline.py"],
    "shadowbench/studies/t*s.py": ["tests/studies/test_tables.py", "tests/studies/test_times.py"],
}
# Modules imported once before children are forked, for the third-party packages that they import.
WARM = ("shadowbench.commands", "tests.conftest", "hypothesis.extra.numpy", "scipy.optimize", "skimage.metrics")
FLIPPED = {"<": ["<=", ">="], "<=": ["<", ">"], ">": [">=", "<="], ">=": [">", "<"], "==": ["!="], "!=": ["=="]}
NUMBER = re.compile(rb"[\d._]+(e[+-]?\d+)?")
NO_INTEGER = re.compile(r"^E +\w*(Error|Exception)\b.*(integer|'int'|'float')", re.MULTILINE)


@dataclass(frozen=True)
class Mutant:
    """A module's source with at most one change; instead: the mutant to try if an integer is required."""

    module: str
    line: int
    function: str
    before: str
    after: str
    source: str = ""
    instead: "Mutant | None" = None

    @property
    def key(self) -> tuple[str, str, str, str]:
        """Key of a mutant in mutants.toml; without the line number, which any edit changes."""
        return self.module, self.function, self.before, self.after

    def __str__(self) -> str:
        return f"{self.module}:{self.line} {self.function}\n  - {self.before}\n  + {self.after}"


UNCHANGED = Mutant("", 0, "", "", "")


def mutants_of(module: str) -> list[Mutant]:
    """All mutants of a module, in the order of its syntax tree."""
    source = (ROOT / module).read_bytes()
    starts = [0, *(match.end() for match in re.finditer(rb"\n", source))]

    def change(begin: int, end: int, new: str, function: str, instead: Mutant | None = None) -> Mutant:
        changed = source[:begin] + new.encode() + source[end:]
        row = sum(start <= begin for start in starts) - 1
        before, after = (text.split(b"\n")[row].decode().strip() for text in (source, changed))
        return Mutant(module, row + 1, function or "(module)", before, after, changed.decode(), instead)

    def find(node: Any, function: str, compared: bool = False) -> Iterator[Mutant]:
        if isinstance(node, ast.Constant) and type(node.value) in (int, float):
            begin, end = starts[node.lineno - 1] + node.col_offset, starts[node.end_lineno - 1] + node.end_col_offset
            if NUMBER.fullmatch(source[begin:end]):  # positions in f-strings are wrong before Python 3.12
                for new, integer in perturbed(node.value, compared):
                    yield change(begin, end, new, function, (integer and change(begin, end, integer, function)) or None)
        elif isinstance(node, ast.Compare):
            for left, right in zip([node.left, *node.comparators], node.comparators, strict=False):
                begin = starts[left.end_lineno - 1] + left.end_col_offset
                end = starts[right.lineno - 1] + right.col_offset
                operator = re.search(rb"[<>=!]=|[<>]", source[begin:end])
                for new in FLIPPED[operator[0].decode()] if operator else ():
                    yield change(begin + operator.start(), begin + operator.end(), new, function)
        for child in ast.iter_child_nodes(node):
            named = isinstance(child, ast.FunctionDef | ast.ClassDef)
            inner = f"{function}.{child.name}".lstrip(".") if named else function
            yield from find(child, inner, isinstance(node, ast.Compare))

    return list(find(ast.parse(source), ""))


def perturbed(value: float, compared: bool) -> Iterator[tuple[str, str]]:
    """A number changed up and down, as source; each with the integer to try if one is required, or "" for none."""
    whole = isinstance(value, int)
    for scaled, step in ((value * 1.1, 1), (value / 1.1, -1)):
        integer = value + step if abs(value) < 10 else round(scaled)
        if whole and (compared or not value):  # a change by 10% would not affect comparisons of integers
            yield f"({integer})" if integer < 0 else f"{integer}", ""
        else:
            scaled = scaled or 0.1 * step
            yield f"({scaled:.6g})" if scaled < 0 else repr(float(f"{scaled:.6g}")), f"{integer}" if whole else ""


class MutantImporter(MetaPathFinder, Loader):
    """Import hook that loads a mutant in place of its module."""

    def __init__(self, mutant: Mutant) -> None:
        self.name, self.file = mutant.module.removesuffix(".py").replace("/", "."), str(ROOT / mutant.module)
        self.source = mutant.source

    def find_spec(self, fullname: str, path: Any, target: Any = None) -> Any:  # noqa: D102
        own = fullname == self.name
        return importlib.util.spec_from_file_location(fullname, self.file, loader=self) if own else None

    def exec_module(self, module: Any) -> None:  # noqa: D102
        exec(compile(self.source, self.file, "exec"), module.__dict__)


@dataclass
class Outcome:
    """Result of a pytest run: exit code, None for a hang or crash; the first failure; seconds by test."""

    code: int | None = None
    failed: str = ""
    report: str = ""
    seconds: Counter[str] = field(default_factory=Counter)


@dataclass(eq=False)  # pytest hashes plug-ins if tests lie in several folders
class Watch:
    """Pytest plug-in that runs the test most likely to fail first, and records the outcome."""

    order: dict[str, tuple[float, ...]]
    outcome: Outcome = field(default_factory=Outcome)

    def pytest_collection_modifyitems(self, items: list[Any]) -> None:  # noqa: D102
        items.sort(key=lambda item: self.order.get(item.nodeid, ()))

    def pytest_runtest_logreport(self, report: Any) -> None:  # noqa: D102
        self.outcome.seconds[report.nodeid] += report.duration
        if report.failed and not self.outcome.failed:
            self.outcome.failed, self.outcome.report = report.nodeid, str(report.longrepr)


def run_tests(end: Connection, tests: Sequence[str], mutant: Mutant, order: dict[str, tuple[float, ...]]) -> None:
    """Run pytest on a mutant, in a child process."""
    os.setsid()  # processes started by tests are killed with it
    null = os.open(os.devnull, os.O_RDWR)
    for stream in (0, 1, 2) if mutant.source else (0,):
        os.dup2(null, stream)
    import pytest
    from hypothesis import HealthCheck, Phase, settings

    # The same examples for every mutant, no deadlines, and no shrinking of examples.
    quick = {"phases": [Phase.explicit, Phase.generate], "suppress_health_check": list(HealthCheck)}
    settings.register_profile("mutate", deadline=None, derandomize=True, database=None, **quick)
    settings.load_profile("mutate")
    if mutant.source:
        sys.meta_path.insert(0, MutantImporter(mutant))
    watch, folder = Watch(order), f"--basetemp={tempfile.gettempdir()}/{os.getpid()}"
    options = ["-x", "-q", "-p", "no:cacheprovider", "-m", "not slow", "--timeout=60", folder]
    options.append("--assert=plain")  # rewriting is slower, and would import the unchanged module
    watch.outcome.code = int(pytest.main([*options, *tests], plugins=[watch]))
    end.send(watch.outcome)
    os._exit(0)


def outcomes(
    mutants: Sequence[Mutant], tests: Sequence[str], jobs: int, seconds: Counter[str]
) -> Iterator[tuple[Mutant, Outcome]]:
    """Every mutant with its outcome, in order of completion; seconds: duration of each test without a fault."""
    fork, limit = multiprocessing.get_context("fork"), 60 + 4 * seconds.total() if seconds else 600
    kills: Counter[tuple[str, str]] = Counter()
    waiting, running = deque(mutants), {}
    try:
        while waiting or running:
            while waiting and len(running) < jobs:
                mutant = waiting.popleft()
                order = {test: (-kills[mutant.function, test], -kills["", test], seconds[test]) for test in seconds}
                pipe, end = fork.Pipe(duplex=False)
                process = fork.Process(target=run_tests, args=(end, tests, mutant, order))
                process.start()
                end.close()
                running[pipe] = mutant, process, time.monotonic() + limit
            ready = wait(list(running), timeout=1.0)
            for pipe in [pipe for pipe in running if pipe in ready or time.monotonic() > running[pipe][2]]:
                try:
                    outcome = pipe.recv() if pipe in ready else Outcome()
                except EOFError:  # it crashed
                    outcome = Outcome()
                mutant, process, _ = running.pop(pipe)
                end_group(process)
                refused = NO_INTEGER.search(outcome.report) or (not outcome.failed and outcome.code != 0)
                if mutant.instead and refused:
                    waiting.appendleft(mutant.instead)
                else:
                    kills.update([(mutant.function, outcome.failed), ("", outcome.failed)])
                    yield mutant, outcome
    finally:
        for _, process, _ in running.values():
            end_group(process)


def end_group(process: Any) -> None:
    """Kill a child and all processes that its tests left running."""
    with suppress(ProcessLookupError):
        os.killpg(process.pid, signal.SIGKILL)
    process.kill()
    process.join()


def warm_up() -> None:
    """Import third-party packages once before forking; our own are imported by the children.

    Creates no GL context, which would not survive a fork.
    """
    sys.path.insert(0, str(ROOT))
    for name in WARM:
        importlib.import_module(name)
    for name in [name for name in sys.modules if name.partition(".")[0] in ("shadowbench", "tests")]:
        del sys.modules[name]
    gc.freeze()  # keeps the children's garbage collector off these objects


def main() -> int:
    """Run the command."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("modules", nargs="*", help="parts of modules' paths; all if none")
    parser.add_argument("--jobs", type=int, default=1, help="mutants at a time")
    parser.add_argument("--sample", type=int, metavar="N", help="a fixed random sample of N mutants")
    parser.add_argument("--list", action="store_true", help="list the mutants and run nothing")
    options = parser.parse_args()
    os.chdir(ROOT)
    tests = {str(file.relative_to(ROOT)): TESTS[glob] for glob in TESTS for file in sorted(ROOT.glob(glob))}
    tests = {
        file: of for file, of in tests.items() if not options.modules or any(part in file for part in options.modules)
    }
    mutants = [mutant for module in tests for mutant in mutants_of(module)]
    if options.sample:
        mutants = random.Random(0).sample(mutants, min(options.sample, len(mutants)))
    if options.list:
        print(*mutants, f"{len(mutants)} mutants", sep="\n")
        return 0
    entries = tomllib.loads(REASONS.read_text(encoding="utf-8"))["survivor"]
    reasons = {
        (of["module"], of["function"], of["before"], after): of["why"] for of in entries for after in of["after"]
    }
    for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "LP_NUM_THREADS"):
        os.environ.setdefault(name, "1")
    began, survivors, hung = time.monotonic(), {}, 0
    with tempfile.TemporaryDirectory() as cache:  # for truths, which no mutant changes, and compiled modules
        os.environ["SHADOWBENCH_CACHE"] = tempfile.tempdir = cache
        warm_up()
        sys.dont_write_bytecode, sys.pycache_prefix = False, cache
        controls = {}
        for of in {tuple(of) for of in tests.values()}:
            ((_, control),) = outcomes([UNCHANGED], of, 1, Counter())
            if control.code != 0:
                print(f"{' '.join(of)} fails without a fault: {control.failed}\n{control.report}")
                return 2
            controls[of] = control.seconds
        for module, of in tests.items():
            mine, earlier = [mutant for mutant in mutants if mutant.module == module], len(survivors)
            for mutant, outcome in outcomes(mine, of, options.jobs, controls[tuple(of)]):
                hung += outcome.code is None
                if outcome.code == 0:
                    why = survivors[mutant] = reasons.get(mutant.key)
                    print(mutant, f"  {why or 'NO REASON in tools/mutants.toml'}", sep="\n", flush=True)
            print(f"{module}: {len(mine) - len(survivors) + earlier} of {len(mine)} killed", flush=True)
    killed = len(mutants) - len(survivors)
    print(
        f"{killed} of {len(mutants)} killed ({killed / max(len(mutants), 1):.1%}), {hung} of them by a crash or a hang"
    )
    unused = reasons.keys() - {mutant.key for mutant in survivors}
    for module, function, before, after in sorted(key for key in unused if key[0] in tests and not options.sample):
        print(f"a reason that no survivor needs: {module} {function}\n  - {before}\n  + {after}")
    print(f"{list(survivors.values()).count(None)} survivors without a reason; {time.monotonic() - began:.0f} s")
    return 0 if all(survivors.values()) else 1


if __name__ == "__main__":
    sys.exit(main())
