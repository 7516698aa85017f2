"""Fuzzing: python -m tests.fuzz --count 10000 --meshes 1000. Every file must give a result or one clear line."""

import argparse
import hashlib
import random
import sys
import time
from collections import Counter, defaultdict
from multiprocessing.pool import ThreadPool
from pathlib import Path

from .cases import Case
from .command import commanded
from .corrupt import FORMATS, corrupted
from .generate import generated
from .pool import verdicts
from .verdict import Verdict


def main() -> int:
    parser = argparse.ArgumentParser(prog="python -m tests.fuzz", description=__doc__)
    parser.add_argument("--count", type=int, default=10_000, help="scene, study and parameter files, in all [10000]")
    parser.add_argument("--meshes", type=int, default=1_000, help="mesh files of each format [1000]")
    parser.add_argument("--commands", type=int, default=150, help="of them, by way of the command line too [150]")
    parser.add_argument("--jobs", type=int, default=2, help="processes [2]")
    parser.add_argument("--seed", type=int, default=0, help="another number, other files [0]")
    parser.add_argument(
        "--keep", type=Path, default=Path("results/fuzz"), help="folder of failing files [results/fuzz]"
    )
    options = parser.parse_args()
    start = time.monotonic()
    meshes = range(options.seed, options.seed + options.meshes)
    cases = [*generated(options.count, options.seed), *(corrupted(kind, k) for kind in FORMATS for k in meshes)]
    print(f"{len(cases)} files made in {time.monotonic() - start:.0f} s", flush=True)
    counts: dict[str, Counter[str]] = defaultdict(Counter)

    def count(row: str, case: Case, verdict: Verdict) -> None:
        counts[row][verdict.kind] += 1
        if verdict.kind == "failure":
            print(f"failure: {row}: {verdict.line}\n  kept in {kept(case, options.keep)}", flush=True)

    small: list[Case] = []
    slowest = 0.0
    for number, (case, verdict, took) in enumerate(verdicts(cases, options.jobs), 1):
        count(case.kind, case, verdict)
        slowest = max(slowest, took)
        if verdict.small and verdict.kind != "failure":
            small.append(case)
        if number % 1000 == 0:
            print(f"{number} of {len(cases)} after {time.monotonic() - start:.0f} s", flush=True)
    chosen = random.Random(options.seed).sample(small, min(options.commands, len(small)))
    with ThreadPool(options.jobs) as pool:
        for case, verdict in zip(chosen, pool.imap(commanded, chosen), strict=True):
            count("command", case, verdict)
    print(f"{'kind':8} {'files':>6} {'results':>8} {'refusals':>9} {'failures':>9}")
    for kind, found in counts.items():
        print(f"{kind:8} {found.total():6} {found['result']:8} {found['refusal']:9} {found['failure']:9}")
    failures = sum(found["failure"] for found in counts.values())
    print(f"{failures} failures; the slowest file took {slowest:.1f} s, all {time.monotonic() - start:.0f} s")
    return 1 if failures else 0


def kept(case: Case, folder: Path) -> Path:
    """Folder in which a failing case is kept, named by its content."""
    name = hashlib.sha256(repr((case.files, case.text)).encode("utf-8", "replace")).hexdigest()[:12]
    place = folder / f"{case.kind}-{name}"
    if not place.exists():
        case.write(place)
        (place / "spec.txt").write_text(case.text, encoding="utf-8", errors="backslashreplace")
    return place


if __name__ == "__main__":
    sys.exit(main())
