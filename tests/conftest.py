"""What all tests share: larger scenes, and a truth cache of their own."""

import os
from collections.abc import Iterator
from pathlib import Path

import pytest


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
