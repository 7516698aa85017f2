"""Builds the sdist and, from it, the wheel; tries the wheel in an empty environment and copies both to dist/.

python tools/wheel.py [-o DIR]: a failed build, installation or test run stops it, and nothing is copied.
"""

import argparse
import os
import shlex
import shutil
import subprocess
import sys
import tempfile
import venv
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
TRIED = [
    shlex.split(line)
    for line in (
        "shadowbench --version",
        "shadowbench list scenes",
        "shadowbench list devices",
        "shadowbench run stairs -t shadow-map --map-size 512 --view-size 64 --rounds 0",
        "python -c 'import shadowbench; print(shadowbench.__file__)'",
    )
]


def main() -> int:
    """Build, try, copy; 1 for a command that failed."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("-o", "--output", metavar="DIR", type=Path, default=ROOT / "dist", help="[dist]")
    output = parser.parse_args().output
    with tempfile.TemporaryDirectory() as scratch:
        try:
            built = build(Path(scratch) / "dist")
            try_install(Path(scratch) / "venv", built[0])
        except subprocess.CalledProcessError as error:
            print(f"failed, with exit code {error.returncode}: {shown(error.cmd)}", file=sys.stderr)
            return 1
        output.mkdir(parents=True, exist_ok=True)
        copied = [Path(shutil.copy2(file, output)) for file in built]
    for file in copied:
        print(f"{file}: {file.stat().st_size / 1e6:.1f} MB")
    return 0


def build(folder: Path) -> tuple[Path, Path]:
    """The wheel, and the sdist that it was built from."""
    call(Path(sys.executable), "-m", "build", "--quiet", "--outdir", folder, ROOT)
    (wheel,), (sdist,) = folder.glob("*.whl"), folder.glob("*.tar.gz")
    return wheel, sdist


def try_install(environment: Path, *what: str | Path) -> Path:
    """Install `what`, with the versions of constraints.txt, into a new environment and run TRIED from an empty folder.

    Returns the folder of the environment's commands. Raises CalledProcessError for one that fails.
    """
    venv.create(environment, with_pip=True)
    commands = environment / ("Scripts" if sys.platform == "win32" else "bin")
    constraints = ROOT / "constraints.txt"
    call(
        commands / "python", "-m", "pip", "install", "--quiet", "--disable-pip-version-check", "-c", constraints, *what
    )
    with tempfile.TemporaryDirectory() as elsewhere:
        for name, *words in TRIED:
            call(commands / name, *words, cwd=Path(elsewhere))
    return commands


def call(program: Path, *words: str | Path, cwd: Path | None = None) -> None:
    """Print a command and run it without PYTHONPATH, which would lead it back to the sources."""
    print(f"$ {shown([program, *words])}", flush=True)
    environment = {name: value for name, value in os.environ.items() if name != "PYTHONPATH"}
    subprocess.run([program, *words], check=True, cwd=cwd, env=environment)


def shown(command: list[str | Path]) -> str:
    """A command with its program's name alone."""
    program, *words = command
    return shlex.join([Path(program).name, *map(str, words)])


if __name__ == "__main__":
    sys.exit(main())
