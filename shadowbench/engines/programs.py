"""Programs in which engines draw, and the environments that they run in.

An environment is a folder below the cache folder, installed from an engine's lock file by `install`. In it runs a
page in headless Chromium, or a Python of the engine's own: a host. A host takes one call at a time, with a header in
JSON and bytes behind it, and gives an answer of the same form. What the engine prints goes to a log. A program that
dies, or does not answer in time, is ended with all its children.
"""

import hashlib
import json
import os
import queue
import re
import secrets
import shutil
import signal
import subprocess
import sys
import tempfile
from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from contextlib import suppress
from functools import partial
from pathlib import Path
from threading import Thread
from typing import IO, TYPE_CHECKING, Any

import psutil

from shadowbench.errors import InputError, ShadowbenchError, quoted
from shadowbench.files import cache_folder, make_folder
from shadowbench.measure.worker import CellFailed
from shadowbench.plugin.engine import Engine

if TYPE_CHECKING:
    from http.server import ThreadingHTTPServer

HERE = Path(__file__).parent
Answer = tuple[dict[str, Any], bytes]

_LOCKS = {"web": "package-lock.json", "python": "requirements.txt"}
_MESA = {  # variables that name files of drivers, and Mesa's files below /etc and the folders of shared data
    ("VK_DRIVER_FILES", "VK_ICD_FILENAMES"): "vulkan/icd.d/lvp_icd*.json",
    ("__EGL_VENDOR_LIBRARY_FILENAMES",): "glvnd/egl_vendor.d/*mesa*.json",
}
_BROWSERS = ("chromium", "chromium-browser", "google-chrome")
# Through ANGLE and EGL to Mesa, whose software renderer has 8 sub-pixel bits; Chromium's own has 4. No display needed.
_CHROMIUM = (
    "--headless=new", "--use-gl=angle", "--use-angle=gl-egl", "--ignore-gpu-blocklist", "--no-sandbox",
    "--disable-dev-shm-usage", "--no-first-run", "--disable-extensions", "--disable-background-networking",
    "--enable-logging=stderr", "--remote-debugging-pipe",
)  # fmt: skip
# Its end of the pipe for debugging is file 3; Chromium ends when this process does, however that ends.
_WITH_PIPE = ("sh", "-c", 'exec "$@" 3<&0 4>/dev/null', "sh")


def environment(engine: type[Engine]) -> Path:
    """Folder of an engine's environment; it may not exist."""
    return cache_folder("engines") / f"{engine.name}-{hashlib.sha256(_lock(engine).encode()).hexdigest()[:12]}"


def _lock(engine: type[Engine]) -> str:
    """Text of an engine's lock file."""
    return (engine.folder() / _LOCKS[engine.host]).read_text(encoding="utf-8")


def locked_version(engine: type[Engine]) -> str:
    """Version of the engine's package in its lock file."""
    if engine.host == "web":
        return str(json.loads(_lock(engine))["packages"][""]["dependencies"][engine.package])
    line = re.search(rf"^{re.escape(engine.package)}==(\S+)", _lock(engine), re.MULTILINE)
    assert line is not None
    return line[1]


def what_lacks(engine: type[Engine]) -> str | None:
    """In one line what an engine lacks to draw here, and the command that helps; None if nothing."""
    if missing := needed_programs(engine):
        return f"{' and '.join(missing)} not found: apt-get install {' '.join(missing.values())}"
    if not _installed(engine):
        return f"not installed: shadowbench engines install {engine.name}"
    return None


def needed_programs(engine: type[Engine]) -> dict[str, str]:
    """Programs that an engine needs to draw and that are not here, and the package of Debian that has each."""
    missing = {}
    if engine.host == "web" and _browser() is None:
        missing["chromium"] = "chromium"
    if engine.display and shutil.which("Xvfb") is None:
        missing["Xvfb"] = "xvfb"
    if engine.vulkan and "VK_DRIVER_FILES" not in software_renderer():
        missing["Mesa's software driver of Vulkan"] = "mesa-vulkan-drivers"
    return missing


def _browser() -> str | None:
    return next(filter(None, map(shutil.which, _BROWSERS)), None)


def browser_version() -> str:
    """Version of Chromium as it prints it."""
    return subprocess.run([str(_browser()), "--version"], capture_output=True, text=True, check=False).stdout.strip()


def software_renderer() -> dict[str, str]:
    """Variables that have OpenGL and Vulkan drawn by Mesa's software renderer, also where there is a GPU.

    Engines then differ by what they draw alone. Files of Mesa that are not where the loaders of Vulkan and EGL look for
    them are left out: of Vulkan the engine then lacks them, of EGL the renderer that draws is in the rows.
    """
    places = os.environ.get("XDG_DATA_DIRS") or "/usr/local/share:/usr/share"
    folders = [Path(place) for place in ("/etc", *places.split(":"))]
    variables = {"LIBGL_ALWAYS_SOFTWARE": "1"}
    for names, pattern in _MESA.items():
        if files := sorted(str(file) for folder in folders for file in folder.glob(pattern)):
            variables |= dict.fromkeys(names, files[0])
    return variables


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
            root = json.loads(_lock(engine))["packages"][""]
            (made / "package.json").write_text(json.dumps({"private": True, **root}), encoding="utf-8")
            (made / "package-lock.json").write_text(_lock(engine), encoding="utf-8")
            _run("npm", "ci", "--ignore-scripts", "--no-audit", "--no-fund", folder=made)
        else:
            _run(_interpreter(engine), "-m", "venv", str(made), folder=made)
            lock = ("--require-hashes", "-r", str(engine.folder() / _LOCKS["python"]))
            _run(str(made / "bin" / "python"), "-m", "pip", "install", "--no-deps", *lock, folder=made)
        shutil.rmtree(folder, ignore_errors=True)  # what is there is broken
        made.rename(folder)
    return folder


def _installed(engine: type[Engine]) -> bool:
    """Whether an environment has what starts the engine: Python, which may have been removed since, or the package."""
    folder = environment(engine)
    if engine.host == "web":
        return (folder / "node_modules" / engine.package).is_dir()
    return (folder / "bin" / "python").exists()


def _interpreter(engine: type[Engine]) -> str:
    """The Python of the version that an engine's packages are built for."""
    name = f"python{engine.python}"
    pyenv = Path(os.environ.get("PYENV_ROOT", Path.home() / ".pyenv"))  # whose command on the PATH may refuse
    places = [sys.executable, shutil.which(name), *pyenv.glob(f"versions/{engine.python}.*/bin/{name}")]
    for python in [str(place) for place in places if place]:
        ask = "import sys; print(*sys.version_info[:2], sep='.')"
        answer = subprocess.run([python, "-c", ask], capture_output=True, text=True, check=False)
        if answer.stdout.strip() == engine.python:
            return python
    raise InputError(f"{name} not found; allowed: Python {engine.python}, on the PATH")


def _run(*command: str, folder: Path) -> None:
    """Run a program in a folder. Raises ShadowbenchError with its last line if it is missing or fails."""
    if shutil.which(command[0]) is None:
        raise ShadowbenchError(f"{command[0]} not found: apt-get install {command[0]}")
    variables = {name: value for name, value in os.environ.items() if name != "PYTHONPATH"}
    ended = subprocess.run(
        command, cwd=folder, env=variables, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, check=False
    )
    if ended.returncode:
        lines = [line for line in ended.stdout.splitlines() if line.strip()] or ["it printed nothing"]
        raise ShadowbenchError(f"{Path(command[0]).name} failed: {quoted(lines[-1])}")


def start_host(engine: type[Engine], log: Path, variables: Mapping[str, str]) -> "Host":
    """Start an engine's program; variables: of its environment, besides those of the software renderer."""
    variables = {**software_renderer(), **variables}
    return WebHost(engine, log, variables) if engine.host == "web" else PythonHost(engine, log, variables)


class Host(ABC):
    """A program in which an engine draws; `close` ends it."""

    def __init__(self, command: Sequence[str | Path], log: Path, variables: Mapping[str, str], stdout: int) -> None:
        self._answers: queue.Queue[Answer | None] = queue.Queue()
        self.log = log
        with log.open("w") as errors:
            self.process = subprocess.Popen(
                [str(word) for word in command],
                stdin=subprocess.PIPE,
                stdout=stdout,
                stderr=errors,
                start_new_session=True,
                env={**os.environ, **variables},
            )
        Thread(target=self._watch, daemon=True).start()

    @abstractmethod
    def _send(self, message: bytes) -> None:
        """Pass a call on."""

    def _watch(self) -> None:
        """Report the end of the process as an answer."""
        self.process.wait()
        self._answers.put(None)

    def call(self, name: str, argument: Any, data: bytes, limit: float) -> Answer:
        """The answer and its bytes. Raises CellFailed for an error, a program that ended, or no answer in time."""
        self._send(pack({"name": name, "argument": argument}, data))
        try:
            answer = self._answers.get(timeout=limit)
        except queue.Empty:
            raise CellFailed(f"no answer to {name!r} within {limit:g} s") from None
        if answer is None:
            lines = self.log.read_text(encoding="utf-8", errors="replace").split("\n")
            last = quoted(next((line for line in reversed(lines) if line.strip()), "it printed nothing"))
            raise CellFailed(f"it ended with exit code {self.process.returncode}: {last}")
        if "error" in answer[0]:
            raise CellFailed(str(answer[0]["error"]))
        return answer

    @property
    def ended(self) -> bool:
        """Whether the program has ended, also before `_watch` has noticed."""
        with suppress(psutil.NoSuchProcess):
            return bool(psutil.Process(self.process.pid).status() == psutil.STATUS_ZOMBIE)
        return True

    @property
    def memory(self) -> int:
        """Resident memory of the largest of its processes, in bytes."""
        largest = 0
        with suppress(psutil.NoSuchProcess):
            program = psutil.Process(self.process.pid)
            for process in (program, *program.children(recursive=True)):
                largest = max(largest, process.memory_info().rss)
        return largest

    def close(self) -> None:
        """End the program and its children."""
        with suppress(ProcessLookupError):
            os.killpg(self.process.pid, signal.SIGKILL)
        self.process.wait()
        if self.process.stdin is not None:
            with suppress(BrokenPipeError):
                self.process.stdin.close()


def pack(header: Mapping[str, Any], data: bytes) -> bytes:
    """A message: the length of its header in 4 bytes, little-endian; the header in JSON; the data."""
    text = json.dumps(header).encode()
    return len(text).to_bytes(4, "little") + text + data


def unpack(message: bytes) -> Answer:
    """Header and data of a message."""
    end = 4 + int.from_bytes(message[:4], "little")
    return json.loads(message[4:end]), message[end:]


class PythonHost(Host):
    """Python of the engine's environment, which runs `python_host.py` with the engine's `draw.py`."""

    def __init__(self, engine: type[Engine], log: Path, variables: Mapping[str, str]) -> None:
        command: list[str | Path] = [
            environment(engine) / "bin" / "python",
            "-Iu",
            HERE / "python_host.py",
            engine.folder() / "draw.py",
        ]
        super().__init__(command, log, {**variables, "PYTHONPATH": ""}, subprocess.PIPE)
        self._reader = Thread(target=self._read, args=(self.process.stdout,), daemon=True)
        self._reader.start()

    def _send(self, message: bytes) -> None:
        pipe: Any = self.process.stdin
        with suppress(BrokenPipeError):  # its end is the answer
            pipe.write(len(message).to_bytes(8, "little") + message)
            pipe.flush()

    def _read(self, pipe: IO[bytes]) -> None:
        with pipe:
            while len(length := pipe.read(8)) == 8:
                self._answers.put(unpack(pipe.read(int.from_bytes(length, "little"))))

    def close(self) -> None:
        """End the program, and read the rest of what it says."""
        super().close()
        self._reader.join()


class WebHost(Host):
    """A page kept open in headless Chromium, which runs `web_host.js` with the engine's `draw.js`.

    It asks a server on the loopback interface for calls, and posts answers to it. Other users of the computer get
    nothing there: all addresses begin with a secret, which only this user can read.
    """

    def __init__(self, engine: type[Engine], log: Path, variables: Mapping[str, str]) -> None:
        self._calls: queue.Queue[bytes] = queue.Queue()
        self._folder = tempfile.TemporaryDirectory(prefix="shadowbench-", ignore_cleanup_errors=True)
        self.secret = secrets.token_urlsafe()
        served = Path(self._folder.name, "served")
        site = served / self.secret
        site.mkdir(parents=True)
        (site / "index.html").write_text(_page(engine), encoding="utf-8")
        (site / "draw.js").symlink_to(engine.folder() / "draw.js")
        (site / "web_host.js").symlink_to(HERE / "web_host.js")
        (site / "packages").symlink_to(environment(engine) / "node_modules")
        self._server = _server(self, served)
        Thread(target=self._server.serve_forever, daemon=True).start()
        self.address = f"http://127.0.0.1:{self._server.server_port}/{self.secret}/"
        start = Path(self._folder.name, "start.html")  # a command is for everybody to read
        start.write_text(f'<meta http-equiv="refresh" content="0;url={self.address}">', encoding="utf-8")
        profile = f"--user-data-dir={self._folder.name}/profile"
        command = [*_WITH_PIPE, str(_browser()), *_CHROMIUM, profile, start.as_uri()]
        super().__init__(command, log, variables, subprocess.DEVNULL)

    def _send(self, message: bytes) -> None:
        self._calls.put(message)

    def close(self) -> None:
        """End the browser and the server."""
        super().close()
        self._server.shutdown()
        self._server.server_close()
        self._folder.cleanup()


def _page(engine: type[Engine]) -> str:
    table = json.dumps({"imports": {name: f"./packages/{path}" for name, path in engine.imports.items()}})
    classic = "".join(f'<script src="packages/{path}"></script>' for path in engine.scripts)
    module = '<script type="module" src="web_host.js"></script>'
    return f'<!doctype html><meta charset="utf-8"><script type="importmap">{table}</script>{classic}{module}'


def _server(host: WebHost, folder: Path) -> "ThreadingHTTPServer":
    """A server of a folder's files, but not their names; of the next call; and for answers."""
    from http.server import SimpleHTTPRequestHandler, ThreadingHTTPServer  # no command but of engines waits for it

    class Handler(SimpleHTTPRequestHandler):
        protocol_version = "HTTP/1.1"

        def log_message(self, *_: Any) -> None:
            """Nothing: the browser's own log has what fails."""

        def list_directory(self, path: Any) -> None:
            self.send_error(404)

        def do_GET(self) -> None:
            if self.path == f"/{host.secret}/call":
                self._reply(host._calls.get())
            else:
                super().do_GET()

        def do_POST(self) -> None:
            body = self.rfile.read(int(self.headers["Content-Length"]))
            if self.path == f"/{host.secret}/answer":
                host._answers.put(unpack(body))
            self._reply(b"")

        def _reply(self, body: bytes) -> None:
            self.send_response(200)
            self.send_header("Content-Length", str(len(body)))
            self.end_headers()
            self.wfile.write(body)

    class Server(ThreadingHTTPServer):
        daemon_threads = True

        def handle_error(self, *_: Any) -> None:
            """Nothing: a browser that is ended resets its connections."""

    return Server(("127.0.0.1", 0), partial(Handler, directory=str(folder)))
