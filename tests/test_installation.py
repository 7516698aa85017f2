"""What pip is told to install is this project, also where its pages, help and errors name it."""

import os
import re
import subprocess
from importlib.metadata import distributions
from pathlib import Path

import pytest
from packaging.specifiers import SpecifierSet
from packaging.utils import canonicalize_name

ROOT = Path(__file__).resolve().parents[1]
FILES = [
    *(ROOT / name for name in ("README.md", "CHANGELOG.md", "CONTRIBUTING.md", "Makefile", "pyproject.toml")),
    *(
        file
        for folder in ("docs", "shadowbench", "tools", "examples")
        for file in sorted((ROOT / folder).rglob("*"))
        if file.suffix in {".md", ".py", ".sh", ".yml", ".toml", ".html", ".js"}
    ),
]


def test_nobody_is_told_to_install_another_project_of_the_same_name() -> None:
    wrong = re.compile(r"shadowbench\[\w|pip install (-\S+ )*['\"]?shadowbench(?!-gl)\b")
    assert [file for file in FILES if wrong.search(file.read_text(encoding="utf-8"))] == []


def test_every_pinned_version_takes_the_python_of_debian_12() -> None:
    """3.11.2: with a pin that asks for more, `make` fails where the pages promise that it needs nothing else."""
    pins = re.findall(r"(?m)^([\w.-]+)==(\S+)$", (ROOT / "constraints.txt").read_text(encoding="utf-8"))
    pinned = {(canonicalize_name(name), version) for name, version in pins}
    found = [each for each in distributions() if (canonicalize_name(each.name), each.version) in pinned]
    assert len(found) > 100
    asked = {each.name: each.metadata.get("Requires-Python") or "" for each in found}
    assert [name for name, pythons in asked.items() if "3.11.2" not in SpecifierSet(pythons)] == []


@pytest.mark.parametrize(("words", "folder"), [((), ".venv"), (("PYTHON=/opt/bin/python3.13",), ".venv-python3.13")])
def test_make_tests_another_python_in_an_environment_of_its_own(words: tuple[str, ...], folder: str) -> None:
    """Only if told so in its command line: a variable of this name in the environment is for other programs."""
    clean = {name: value for name, value in os.environ.items() if name not in {"MAKEFLAGS", "MAKELEVEL"}}
    environment = clean | {"PYTHON": "/usr/bin/python2"}
    command = ["make", "-n", "test", *words]
    done = subprocess.run(command, cwd=ROOT, env=environment, capture_output=True, text=True, check=True)
    told = "/opt/bin/python3.13" if words else ""
    assert f"VENV={folder} PYTHON={told} sh tools/setup.sh" in done.stdout
    assert f"\n{folder}/bin/pytest " in done.stdout
