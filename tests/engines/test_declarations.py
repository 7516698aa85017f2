"""What each engine declares, and its files."""

import re

import pytest

from shadowbench.engines.environment import locked_version
from shadowbench.plugin.engine import Engine, EngineParams
from shadowbench.plugin.registry import engines
from shadowbench.plugin.spec import parse_spec

KNOWN = engines()


@pytest.fixture(params=KNOWN)
def declared(request: pytest.FixtureRequest) -> type[Engine]:
    return KNOWN[request.param]


def test_ten_engines_are_declared() -> None:
    assert len(KNOWN) >= 10


def test_an_adapter_is_short(declared: type[Engine]) -> None:
    (file,) = (file for file in declared.folder().iterdir() if file.stem == "draw")
    assert len(file.read_text(encoding="utf-8").splitlines()) <= 80


def test_defaults_are_what_ships_and_each_preset_has_a_source(declared: type[Engine]) -> None:
    assert issubclass(declared.Params, EngineParams)
    assert declared.presets["shipped"] == ""
    assert declared.presets.keys() == declared.sources.keys()
    for preset in declared.presets:
        assert parse_spec(f"{declared.name}:preset={preset}", KNOWN).technique is declared


def test_a_lock_file_has_versions_and_hashes_and_no_address(declared: type[Engine]) -> None:
    names = {"web": "package-lock.json", "python": "requirements.txt"}
    text = (declared.folder() / names[declared.host]).read_text(encoding="utf-8")
    assert not re.search(r"://|find-links|index-url", text)
    assert re.search(r"sha512-|sha256:", text)
    assert re.fullmatch(r"[\w.]+", locked_version(declared))
    if declared.host == "python":
        requirements = re.split(r"\n(?=\w)", re.sub(r"(?m)^#.*\n", "", text))
        assert all("==" in one and "--hash=sha256:" in one for one in requirements if one.strip())
