"""The page in which an engine draws: what other users of the computer can have of it."""

import http.client
import os
from collections.abc import Iterator
from pathlib import Path
from typing import ClassVar

import pytest

from shadowbench.engines.programs import WebHost, environment
from shadowbench.plugin.engine import Engine


@pytest.fixture
def host(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[WebHost]:
    """A page that no browser has asked for yet."""

    class Page(Engine):
        """Page: not drawn."""

        name, package, host = "page", "page", "web"
        files: ClassVar[Path] = tmp_path

        @classmethod
        def folder(cls) -> Path:
            return cls.files

    monkeypatch.setenv("SHADOWBENCH_CACHE", str(tmp_path / "cache"))
    monkeypatch.setenv("PATH", str(tmp_path), prepend=os.pathsep)
    (tmp_path / "chromium").write_text("#!/bin/sh\nexec sleep 600\n")
    (tmp_path / "chromium").chmod(0o755)
    (tmp_path / "package-lock.json").write_text("{}")
    (tmp_path / "draw.js").write_text("// draws")
    packages = environment(Page) / "node_modules"
    packages.mkdir(parents=True)
    (packages / "engine.js").write_text("// an engine")
    (packages.parent / "node_modules-secret").write_text("not of the engine")
    host = WebHost(Page, tmp_path / "log", {})
    yield host
    host.close()


def fetched(host: WebHost, path: str, method: str = "GET") -> tuple[int, bytes]:
    """Status and body of an answer."""
    connection = http.client.HTTPConnection(host.address.split("/")[2], timeout=10)
    connection.request(method, path, body=b"forged" if method == "POST" else None)
    answer = connection.getresponse()
    parts = answer.status, answer.read()
    connection.close()
    return parts


def test_nothing_is_given_or_taken_without_the_secret(host: WebHost) -> None:
    host._send(b"a call")
    for path in ("/", "/call", "/draw.js", "/packages/engine.js", f"/{host.secret[:-1]}/", f"/x/{host.secret}/call"):
        assert fetched(host, path)[0] == 404
    fetched(host, "/answer", "POST")
    assert host._answers.empty()
    assert not any(host.secret in word for word in map(str, host.process.args))  # type: ignore[arg-type]


def test_the_page_has_what_is_its_own_and_no_more(host: WebHost) -> None:
    place = f"/{host.secret}/"
    status, page = fetched(host, place)
    assert status == 200 and b"web_host.js" in page
    host._send(b"a call")
    assert fetched(host, f"{place}call")[1] == b"a call"
    assert fetched(host, f"{place}packages/engine.js")[1] == b"// an engine"
    for path in ("packages/../node_modules-secret", "packages//etc/passwd", "../draw.js", "/etc/passwd"):
        assert fetched(host, place + path)[0] == 404
