"""Workflows, issue forms and the citation are valid YAML, and name, as the demo does, commands that exist."""

import re
import shlex
import tomllib
from pathlib import Path

import pytest
import typer
import yaml

from shadowbench import __version__
from shadowbench.commands import app
from shadowbench.plugin.registry import techniques
from shadowbench.plugin.spec import parse_spec
from shadowbench.scenes.library import load_scene

ROOT = Path(__file__).resolve().parents[1]
ENGINES = ROOT / "docs" / "how-to" / "ci-for-engines.yml"
FORMS = sorted((ROOT / ".github" / "ISSUE_TEMPLATE").glob("*.yml"))
COMMAND = re.compile(r"(?m)^(?:# +| +(?:- )?run: )(shadowbench [^#\n]+)")  # in a step, or in a comment by itself

RELEASE = re.compile(r"(?m)^## \[(\d\S*)\] - (\d{4}-\d\d-\d\d)$")  # of Keep a Changelog


def parse(line: str) -> None:
    """Raises UsageError for an invalid command line."""
    group = typer.main.get_command(app)
    with group.make_context("shadowbench", shlex.split(line)[1:]) as context:
        name, command, words = group.resolve_command(context, [*context._protected_args, *context.args])
        command.make_context(name, words, parent=context).close()


def test_the_engines_workflow_has_commands_that_shadowbench_takes() -> None:
    text = ENGINES.read_text(encoding="utf-8")
    (job,) = yaml.safe_load(text)["jobs"].values()
    lines = COMMAND.findall(text)
    assert [line for step in job["steps"] if (line := step.get("run", "")).startswith("shadowbench")] == lines[1:]
    assert [line.split()[1] for line in lines] == ["check", "export", "score", "check", "report"]
    for line in lines:
        parse(line)


def test_the_demo_s_next_commands_are_taken() -> None:
    lines = re.findall(r'(?m)^\t@echo "\$\(bin\)/(shadowbench [^#"]+)', (ROOT / "Makefile").read_text(encoding="utf-8"))
    assert [line.split()[1] for line in lines] == ["recommend", "needs", "run"]
    for line in lines:
        parse(line)
        _, _, scene, *words = line.split()
        load_scene(scene)
        for spec in words[1::2]:
            parse_spec(spec, techniques(()))


@pytest.mark.parametrize("file", FORMS, ids=lambda file: file.stem)
def test_issue_forms_have_required_fields(file: Path) -> None:
    form = yaml.safe_load(file.read_text(encoding="utf-8"))
    assert form["name"] and form["description"]
    assert all(field["attributes"]["label"] for field in form["body"] if field["type"] != "markdown")
    assert any(field.get("validations", {}).get("required") for field in form["body"])


def test_the_citation_is_of_this_version() -> None:
    citation = yaml.safe_load((ROOT / "CITATION.cff").read_text(encoding="utf-8"))
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    assert citation["version"] == __version__ and citation["license"] == project["license"]
    assert [one["name"].lower() for one in citation["authors"]] == [one["name"].lower() for one in project["authors"]]


def test_the_citation_has_the_date_of_the_release_and_none_before_it() -> None:
    citation = yaml.safe_load((ROOT / "CITATION.cff").read_text(encoding="utf-8"))
    releases = dict(RELEASE.findall((ROOT / "CHANGELOG.md").read_text(encoding="utf-8")))
    assert str(citation.get("date-released")) == releases.get(__version__, "None")
    assert releases or not citation.keys() & {"doi", "identifiers"}  # nothing to identify
