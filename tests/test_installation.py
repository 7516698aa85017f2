"""What pip is told to install is this project, also where its pages, help and errors name it."""

import os
import re
import subprocess
import tomllib
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


def test_the_distribution_has_a_name_of_its_own() -> None:
    """Another project's is `shadowbench`; the index compares names without their hyphens."""
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    assert re.sub(r"[-_.]", "", project["name"].casefold()) != "shadowbench"
    assert set(project["scripts"]) == {"shadowbench"}
    of_its_own = [each for each in project["optional-dependencies"]["test"] if each.startswith("shadow")]
    assert [each.partition("[")[0] for each in of_its_own] == [project["name"]]


def test_nobody_is_told_to_install_another_project_of_the_same_name() -> None:
    wrong = re.compile(r"shadowbench\[\w|pip install (-\S+ )*['\"]?shadowbench\b")
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


def test_setup_prefers_a_python_for_which_all_has_wheels(tmp_path: Path) -> None:
    """Python 3.14, which may be the system's python3, has none of the window's."""
    tools, found = tmp_path / "tools", tmp_path / "bin"
    for folder in (tools, found):
        folder.mkdir()
    (tools / "setup.sh").write_bytes((ROOT / "tools" / "setup.sh").read_bytes())
    for name in ("python3", "python3.14", "python3.13"):  # all but the creation of an environment succeeds
        program = found / name
        program.write_text(f'#!/bin/sh\ncase $1 in -V) echo "{name}" ;; -m) exit 7 ;; esac\n')
        program.chmod(0o755)
    environment = {"PATH": f"{found}{os.pathsep}{os.environ['PATH']}"}
    done = subprocess.run(["sh", tools / "setup.sh"], env=environment, capture_output=True, text=True, check=False)
    assert (done.returncode, done.stdout) == (7, "Making .venv with python3.13\n"), done.stderr
