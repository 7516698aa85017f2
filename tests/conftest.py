"""What all tests share: larger scenes, a truth cache of their own, and the command line."""

import os
import sys
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

import pytest

from shadowbench.cli import main


@dataclass(frozen=True)
class Answer:
    """What a command answered."""

    code: int
    out: str
    err: str


@pytest.fixture(scope="session")
def shared_scenes() -> Path:
    """Folder of larger scenes, which do not travel with the repository."""
    root = Path(__file__).resolve().parents[1]
    folder = root / os.environ.get("SHADOWBENCH_SCENES", "../shared/scenes")
    if not folder.is_dir():
        pytest.skip(f"no larger scenes in {folder}; SHADOWBENCH_SCENES names their folder")
    return folder


@pytest.fixture(scope="session", autouse=True)
def truth_cache(tmp_path_factory: pytest.TempPathFactory) -> Iterator[None]:
    """A truth cache of this session's own, unless SHADOWBENCH_CACHE names one."""
    with pytest.MonkeyPatch.context() as patch:
        if "SHADOWBENCH_CACHE" not in os.environ:
            patch.setenv("SHADOWBENCH_CACHE", str(tmp_path_factory.mktemp("truth-cache")))
        yield


@pytest.fixture
def shadowbench(monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]) -> Callable[..., Answer]:
    """Calls the command line in this process; a worker's output is caught too."""

    def call(*arguments: str | Path) -> Answer:
        monkeypatch.setattr(sys, "argv", ["shadowbench", *map(str, arguments)])
        capfd.readouterr()
        with pytest.raises(SystemExit) as stop:
            main()
        code = stop.value.code
        assert isinstance(code, int) or code is None
        return Answer(code or 0, *capfd.readouterr())

    return call


@pytest.fixture(scope="session")
def only_device() -> Device:
    """The context of this process. Tests take `device`, which sees to it that it is current."""
    return open_device()


@pytest.fixture
def device(only_device: Device) -> Iterator[Device]:
    """The GL device, without an error before the test and after it."""
    with only_device.context:
        only_device.check("whatever ran before this test")
        yield only_device
        only_device.check("this test")
