"""Environments of engines: one folder each under the cache folder, installed from a lock file when asked for."""

import hashlib
import json
import os
import re
import shutil
import subprocess
import sys
import tempfile
from functools import cache
from pathlib import Path

import platformdirs

from shadowbench.errors import InputError, ShadowbenchError, quoted
from shadowbench.files import make_folder
from shadowbench.plugin.engine import Engine

_LOCKS = {"web": ("package.json", "package-lock.json"), "python": ("requirements.txt",)}
_MESA = {  # variables that name files of drivers, and Mesa's files below /etc and the folders of shared data
    ("VK_DRIVER_FILES", "VK_ICD_FILENAMES"): "vulkan/icd.d/lvp_icd*.json",
    ("__EGL_VENDOR_LIBRARY_FILENAMES",): "glvnd/egl_vendor.d/*mesa*.json",
}
_PINNED = re.compile(r"[\w.\[\]-]+==[\w.+!-]+(\s*;[^#]+?)?(\s+--hash=sha256:[0-9a-f]{64})+")
_BROWSERS = ("chromium", "chromium-browser", "google-chrome")


def environment(engine: type[Engine]) -> Path:
    """Folder of an engine's environment, in $SHADOWBENCH_ENGINES or the platform's cache folder; it may not exist."""
    chosen = os.environ.get("SHADOWBENCH_ENGINES")
    folder = Path(chosen) if chosen else Path(platformdirs.user_cache_dir("shadowbench")) / "engines"
    return folder / f"{engine.name}-{_digest(engine)}"


@cache
def _digest(engine: type[Engine]) -> str:
    return hashlib.sha256(b"".join(file.read_bytes() for file in _locks(engine))).hexdigest()[:12]


def locked_version(engine: type[Engine]) -> str:
    """Version of the engine's package in its lock file."""
    text = _locks(engine)[0].read_text(encoding="utf-8")
    if engine.host == "web":
        return str(json.loads(text)["dependencies"][engine.package])
    found = re.search(rf"^{re.escape(engine.package)}==(\S+)", text, re.MULTILINE)
    assert found is not None
    return found[1]


def python_of(engine: type[Engine]) -> Path:
    """Python of an engine's environment."""
    return environment(engine) / "bin" / "python"


def browser() -> str:
    """Path of Chromium. Raises InputError if it is not here."""
    if path := _chromium():
        return path
    raise InputError("chromium not found: apt-get install chromium")


def _chromium() -> str | None:
    return next(filter(None, map(shutil.which, _BROWSERS)), None)


def browser_version() -> str:
    """What Chromium says of its version."""
    told = subprocess.run([browser(), "--version"], capture_output=True, text=True, check=False)
    return told.stdout.strip()


def needed_programs(engine: type[Engine]) -> dict[str, str]:
    """Programs that an engine needs to draw and that are not here, and the package of Debian that has each."""
    missing = {}
    if engine.host == "web" and _chromium() is None:
        missing["chromium"] = "chromium"
    if engine.display and shutil.which("Xvfb") is None:
        missing["Xvfb"] = "xvfb"
    if engine.vulkan and "VK_DRIVER_FILES" not in software_renderer():
        missing["Mesa's software driver of Vulkan"] = "mesa-vulkan-drivers"
    return missing


def software_renderer() -> dict[str, str]:
    """Variables that have OpenGL and Vulkan drawn by Mesa's software renderer, also where there is a GPU.

    Engines then differ by what they draw alone. Files of Mesa that are not where the loaders of Vulkan and EGL look for
    them are left out: of Vulkan the engine then lacks them, of EGL the renderer that draws is in the rows.
    """
    places = os.environ.get("XDG_DATA_DIRS") or "/usr/local/share:/usr/share"
    folders = [Path(place) for place in ("/etc", *places.split(":"))]
    found = {"LIBGL_ALWAYS_SOFTWARE": "1"}
    for names, pattern in _MESA.items():
        if files := sorted(str(file) for folder in folders for file in folder.glob(pattern)):
            found |= dict.fromkeys(names, files[0])
    return found


def what_lacks(engine: type[Engine]) -> str | None:
    """In one line what an engine lacks to draw here, and the command that helps; None if nothing."""
    if missing := needed_programs(engine):
        return f"{' and '.join(missing)} not found: apt-get install {' '.join(missing.values())}"
    if not _installed(engine):
        return f"not installed: shadowbench engines install {engine.name}"
    return None


def check_lock(engine: type[Engine]) -> None:
    """Raises InputError for a lock file with addresses, options, or packages without a version and hashes."""
    file = _locks(engine)[-1]
    text = file.read_text(encoding="utf-8")
    if engine.host == "web":
        packages = {name: one for name, one in json.loads(text)["packages"].items() if name}
        bad = [name for name, one in packages.items() if "resolved" in one or not one.get("integrity")]
        allowed = "packages with `integrity` and without `resolved`"
    else:
        lines = (line.strip() for line in text.replace("\\\n", " ").splitlines())
        bad = [line for line in lines if line and line[0] != "#" and not _PINNED.fullmatch(line)]
        allowed = "NAME==VERSION with --hash=sha256:…, of each package"
    if bad:
        raise InputError(f"{file}: found {quoted(bad[0])}; allowed: {allowed}")


def install(engine: type[Engine]) -> Path:
    """Install an engine's packages, as locked, and return the folder; one that is complete is left as it is.

    Raises ShadowbenchError if a program is missing or fails.
    """
    folder = environment(engine)
    if _installed(engine):
        return folder
    make_folder(folder.parent)
    with tempfile.TemporaryDirectory(dir=folder.parent, prefix=f"{engine.name}-", ignore_cleanup_errors=True) as name:
        made = Path(name, "made")
        made.mkdir()
        if engine.host == "web":
            for file in _locks(engine):
                shutil.copy(file, made)
            _run("npm", "ci", "--ignore-scripts", "--no-audit", "--no-fund", folder=made)
        else:
            _run(_interpreter(engine), "-m", "venv", str(made), folder=made)
            options = ("--no-deps", "--require-hashes", "--disable-pip-version-check", "-r", str(_locks(engine)[0]))
            _run(str(made / "bin" / "python"), "-m", "pip", "install", *options, folder=made)
        if folder.is_dir() and not _installed(engine):
            folder.rename(Path(name, "broken"))
        if not folder.is_dir():  # else another command was faster
            made.rename(folder)
    return folder


def _installed(engine: type[Engine]) -> bool:
    """Whether an environment has what starts the engine: Python, which may have been removed since, or the package."""
    if engine.host == "web":
        return (environment(engine) / "node_modules" / engine.package).is_dir()
    return python_of(engine).exists()


def _locks(engine: type[Engine]) -> list[Path]:
    return [engine.folder() / name for name in _LOCKS[engine.host]]


def _interpreter(engine: type[Engine]) -> str:
    """The Python of the version that an engine's packages are built for."""
    name = f"python{engine.python}"
    pyenv = Path(os.environ.get("PYENV_ROOT", Path.home() / ".pyenv"))  # whose command on the PATH may refuse
    places = [sys.executable, shutil.which(name), *pyenv.glob(f"versions/{engine.python}.*/bin/{name}")]
    for python in [str(place) for place in places if place]:
        ask = "import sys; print(*sys.version_info[:2], sep='.')"
        told = subprocess.run([python, "-c", ask], capture_output=True, text=True, check=False)
        if told.stdout.strip() == engine.python:
            return python
    raise InputError(f"{name} not found; allowed: Python {engine.python}, on the PATH")


def _run(*command: str, folder: Path) -> None:
    """Run a program in a folder. Raises ShadowbenchError with its last line if it is missing or fails."""
    if shutil.which(command[0]) is None:
        raise ShadowbenchError(f"{command[0]} not found: apt-get install {command[0]}")
    environment = {name: value for name, value in os.environ.items() if name != "PYTHONPATH"}
    ended = subprocess.run(
        command, cwd=folder, env=environment, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, check=False
    )
    if ended.returncode:
        told = [line for line in ended.stdout.splitlines() if line.strip()]
        raise ShadowbenchError(f"{Path(command[0]).name} failed: {quoted(told[-1] if told else 'it printed nothing')}")
