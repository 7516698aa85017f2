"""Programs in which engines draw: a page in headless Chromium, or Python in an environment of the engine's own.

A host takes one call at a time, with a header in JSON and bytes behind it, and gives an answer of the same form. What
the engine prints goes to a log. A program that dies, or does not answer in time, is ended with all its children.
"""

import json
import os
import queue
import secrets
import signal
import subprocess
import tempfile
from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from contextlib import suppress
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from threading import Thread
from typing import IO, Any

import psutil

Answer = tuple[dict[str, Any], bytes]
HERE = Path(__file__).parent
_TYPES = {".js": "text/javascript", ".mjs": "text/javascript", ".wasm": "application/wasm"}
# Through ANGLE and EGL to Mesa, whose software renderer has 8 sub-pixel bits; Chromium's own has 4. No display needed.
_CHROMIUM = (
    "--headless=new", "--use-gl=angle", "--use-angle=gl-egl", "--ignore-gpu-blocklist", "--no-sandbox",
    "--disable-dev-shm-usage", "--no-first-run", "--disable-extensions", "--disable-background-networking",
    "--enable-logging=stderr", "--remote-debugging-pipe",
)  # fmt: skip
# Its end of the pipe for debugging is file 3; Chromium ends when this process does, however that ends.
_WITH_PIPE = ("sh", "-c", 'exec "$@" 3<&0 4>/dev/null', "sh")


class HostFailed(Exception):
    """The engine reported an error, died or did not answer."""


class Host(ABC):
    """A program in which an engine draws; `close` ends it."""

    def __init__(self, command: Sequence[str | Path], log: Path, environment: Mapping[str, str] = {}, **options: Any):
        self._answers: queue.Queue[Answer | None] = queue.Queue()
        self.log = log
        with log.open("w") as errors:
            self.process = subprocess.Popen(
                [str(word) for word in command],
                stderr=errors,
                start_new_session=True,
                env={**os.environ, **environment},
                **options,
            )
        Thread(target=self._watch, daemon=True).start()

    @abstractmethod
    def _send(self, message: bytes) -> None:
        """Pass a call on."""

    def _watch(self) -> None:
        """Report the end of the process as an answer."""
        self.process.wait()
        self._answers.put(None)

    def call(self, name: str, argument: Any, data: bytes = b"", limit: float = 120.0) -> Answer:
        """The engine's answer and its bytes. Raises HostFailed; the host is to be closed then."""
        self._send(pack({"name": name, "argument": argument}, data))
        try:
            answer = self._answers.get(timeout=limit)
        except queue.Empty:
            raise HostFailed(f"no answer to {name!r} within {limit:g} s") from None
        if answer is None:
            raise HostFailed(f"it ended with exit code {self.process.returncode}: {self._last_words()}")
        if "error" in answer[0]:
            raise HostFailed(str(answer[0]["error"]))
        return answer

    @property
    def ended(self) -> bool:
        """Whether the program has ended, even if nobody has been told yet."""
        with suppress(psutil.NoSuchProcess):
            return bool(psutil.Process(self.process.pid).status() == psutil.STATUS_ZOMBIE)
        return True

    @property
    def memory(self) -> int:
        """Resident memory of the largest of its processes, in bytes."""
        found = 0
        with suppress(psutil.NoSuchProcess):
            program = psutil.Process(self.process.pid)
            for one in (program, *program.children(recursive=True)):
                found = max(found, one.memory_info().rss)
        return found

    def _last_words(self) -> str:
        lines = self.log.read_text(encoding="utf-8", errors="replace").split("\n")
        return next((line.strip() for line in reversed(lines) if line.strip()), "it printed nothing")[:300]

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

    def __init__(self, python: Path, draw: Path, log: Path, environment: Mapping[str, str]) -> None:
        pipes = {"stdin": subprocess.PIPE, "stdout": subprocess.PIPE}
        super().__init__([python, "-I", HERE / "python_host.py", draw], log, environment, **pipes)
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
    nothing there: the page's address, which only this user can read, is a secret, and gives the cookie that all else
    needs. imports: the page's import map, as addresses below `packages/`, the engine's folder of npm packages; scripts:
    files there, loaded as classic scripts.
    """

    def __init__(
        self,
        browser: str,
        draw: Path,
        packages: Path,
        imports: Mapping[str, str],
        scripts: Sequence[str],
        log: Path,
        environment: Mapping[str, str],
    ) -> None:
        self._calls: queue.Queue[bytes] = queue.Queue()
        self._profile = tempfile.TemporaryDirectory(prefix="shadowbench-", ignore_cleanup_errors=True)
        self.secret = secrets.token_urlsafe()
        files = {"/draw.js": draw, "/web_host.js": HERE / "web_host.js"}
        self._server = _server(self, _page(imports, scripts), files, packages)
        Thread(target=self._server.serve_forever, daemon=True).start()
        self.address = f"http://127.0.0.1:{self._server.server_port}/"
        start = Path(self._profile.name, "start.html")  # a command is for everybody to read
        start.write_text(f'<meta http-equiv="refresh" content="0;url={self.address}{self.secret}">', encoding="utf-8")
        command = [*_WITH_PIPE, browser, *_CHROMIUM, f"--user-data-dir={self._profile.name}", start.as_uri()]
        pipes = {"stdin": subprocess.PIPE, "stdout": subprocess.DEVNULL}
        super().__init__(command, log, environment, **pipes)

    def _send(self, message: bytes) -> None:
        self._calls.put(message)

    def close(self) -> None:
        """End the browser and the server."""
        super().close()
        self._server.shutdown()
        self._server.server_close()
        self._profile.cleanup()


def _page(imports: Mapping[str, str], scripts: Sequence[str]) -> bytes:
    table = json.dumps({"imports": {name: f"/packages/{path}" for name, path in imports.items()}})
    classic = "".join(f'<script src="/packages/{path}"></script>' for path in scripts)
    module = '<script type="module" src="/web_host.js"></script>'
    return f'<!doctype html><meta charset="utf-8"><script type="importmap">{table}</script>{classic}{module}'.encode()


def _server(host: WebHost, page: bytes, files: Mapping[str, Path], packages: Path) -> ThreadingHTTPServer:
    """A server of the page, its modules, the engine's packages, the next call, and for answers."""
    cookie = f"secret={host.secret}"

    class Handler(BaseHTTPRequestHandler):
        protocol_version = "HTTP/1.1"

        def log_message(self, *_: Any) -> None:
            """Nothing: the browser's own log has what fails."""

        def _reply(self, body: bytes, kind: str = "application/octet-stream", status: int = 200) -> None:
            self.send_response(status)
            self.send_header("Content-Type", kind)
            self.send_header("Content-Length", str(len(body)))
            if kind == "text/html":
                self.send_header("Set-Cookie", f"{cookie}; HttpOnly; SameSite=Strict")
            self.end_headers()
            self.wfile.write(body)

        def do_GET(self) -> None:
            if self.path == f"/{host.secret}":
                self._reply(page, "text/html")
            elif self.headers["Cookie"] != cookie:
                self._reply(b"", status=403)
            elif self.path == "/call":
                self._reply(host._calls.get())
            else:
                inside = (packages / self.path.removeprefix("/packages/")).resolve()
                file = files.get(self.path, inside if inside.is_relative_to(packages.resolve()) else None)
                if file is None or not file.is_file():
                    self._reply(b"", status=404)
                else:
                    self._reply(file.read_bytes(), _TYPES.get(file.suffix, "application/octet-stream"))

        def do_POST(self) -> None:
            if self.headers["Cookie"] != cookie:
                self.close_connection = True  # its body is not read
                self._reply(b"", status=403)
                return
            host._answers.put(unpack(self.rfile.read(int(self.headers["Content-Length"]))))
            self._reply(b"")

    class Server(ThreadingHTTPServer):
        daemon_threads = True

        def handle_error(self, *_: Any) -> None:
            """Nothing: a browser that is ended resets its connections."""

    return Server(("127.0.0.1", 0), Handler)
