"""Programs of engines: what other users of the computer can have of them."""

import http.client
import socket
import struct
import time
from collections.abc import Iterator
from pathlib import Path

import pytest

from shadowbench.engines.hosts import WebHost


@pytest.fixture
def host(tmp_path: Path) -> Iterator[WebHost]:
    """A page that no browser has asked for yet."""
    browser, draw, packages = tmp_path / "browser", tmp_path / "draw.js", tmp_path / "packages"
    browser.write_text("#!/bin/sh\nexec sleep 600\n")
    browser.chmod(0o755)
    draw.write_text("// draws")
    packages.mkdir()
    (packages / "engine.js").write_text("// an engine")
    host = WebHost(str(browser), draw, packages, {}, (), tmp_path / "log", {})
    yield host
    host.close()


def asked(host: WebHost, path: str, method: str = "GET", **headers: str) -> tuple[int, str | None, bytes]:
    """Status, cookie and body of an answer."""
    connection = http.client.HTTPConnection(host.address.split("/")[2], timeout=10)
    connection.request(method, path, body=b"forged" if method == "POST" else None, headers=headers)
    answer = connection.getresponse()
    found = answer.status, answer.getheader("Set-Cookie"), answer.read()
    connection.close()
    return found


def test_nothing_is_given_or_taken_without_the_secret(host: WebHost) -> None:
    host._send(b"a call")
    for path in ("/", "/call", "/draw.js", "/packages/engine.js", f"/{host.secret[:-1]}"):
        assert asked(host, path) == (403, None, b"")
    assert asked(host, "/answer", "POST")[0] == 403
    assert host._answers.empty()
    assert not any(host.secret in word for word in map(str, host.process.args))  # type: ignore[arg-type]


def test_the_page_has_what_is_its_own_and_no_more(host: WebHost, tmp_path: Path) -> None:
    (tmp_path / "packages-secret").write_text("not of the engine")
    status, cookie, page = asked(host, f"/{host.secret}")
    assert status == 200 and b"/web_host.js" in page and cookie is not None
    of_page = {"Cookie": cookie.split(";")[0]}
    host._send(b"a call")
    assert asked(host, "/call", **of_page)[2] == b"a call"
    assert asked(host, "/packages/engine.js", **of_page)[2] == b"// an engine"
    for path in ("/packages/../packages-secret", "/packages//etc/passwd", "/../draw.js", "/etc/passwd"):
        assert asked(host, path, **of_page)[0] == 404


def test_a_browser_that_is_ended_prints_nothing(host: WebHost, capfd: pytest.CaptureFixture[str]) -> None:
    place, _, port = host.address.split("/")[2].partition(":")
    with socket.create_connection((place, int(port))) as connection:
        connection.sendall(b"GET /call")
        time.sleep(0.2)
        connection.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, struct.pack("ii", 1, 0))  # closed by a reset
    time.sleep(0.2)
    assert capfd.readouterr() == ("", "")
