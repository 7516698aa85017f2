"""Workflows and the citation are valid YAML, and name, as the demo does, commands that exist."""

import os
import re
import shlex
import shutil
import subprocess
import sys
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


ENGINE = f"""#!{sys.executable}
# Draws what is right, or, once it is broken, casts no shadow in the lower half.
import sys, pathlib, numpy as np
from PIL import Image
scene, shots = pathlib.Path(sys.argv[2]), pathlib.Path(sys.argv[4])
truth = np.asarray(Image.open(scene.with_name("truth.png"))) >> 8 > 127
if pathlib.Path("broken").exists():
    truth[len(truth) // 2 :] = True
shots.mkdir(exist_ok=True)
for name, visible in (("lit", truth >= 0), ("shadowed", truth)):
    Image.fromarray(np.where(visible, 200, 0).astype(np.uint8)).convert("RGB").save(shots / f"{{name}}.png")
"""


@pytest.mark.slow
def test_the_engines_workflow_fails_with_pictures_once_the_engine_is_broken(tmp_path: Path) -> None:
    text = ENGINES.read_text(encoding="utf-8")
    (job,) = yaml.safe_load(text)["jobs"].values()
    steps = [step["run"] for step in job["steps"] if "run" in step and "if" not in step][1:]  # without pip
    (tmp_path / "engine").write_text(ENGINE)
    (tmp_path / "engine").chmod(0o755)
    summary = tmp_path / "summary.md"
    environment = {**os.environ, "PYTHONPATH": str(ROOT), "GITHUB_STEP_SUMMARY": str(summary)}

    def run(*lines: str) -> subprocess.CompletedProcess[str]:
        shutil.rmtree(tmp_path / "shadows", ignore_errors=True)
        line = " && ".join(lines).replace("shadowbench ", f"{sys.executable} -m shadowbench ")
        return subprocess.run(["bash", "-c", line], cwd=tmp_path, env=environment, capture_output=True, text=True)

    assert (done := run(*steps[:-1], COMMAND.findall(text)[0])).returncode == 0, done.stderr
    assert (done := run(*steps)).returncode == 0, done.stdout + done.stderr
    (tmp_path / "broken").touch()
    done = run(*steps)
    assert done.returncode == 1, done.stdout + done.stderr
    assert "::error title=my-engine in stairs camera light::" in done.stdout
    assert (
        "## Shadows are as good as they were" in summary.read_text() and "## Shadows got worse" in summary.read_text()
    )
    assert [file.name for file in (tmp_path / "shadows" / "check").glob("*.png")] == ["1.stairs.my-engine.png"]


def test_the_demo_s_next_commands_are_taken() -> None:
    lines = re.findall(r'(?m)^\t@echo "\$\(bin\)/(shadowbench [^#"]+)', (ROOT / "Makefile").read_text(encoding="utf-8"))
    assert [line.split()[1] for line in lines] == ["recommend", "needs", "run", "run"]
    parse(lines.pop())  # of a study, without a scene
    for line in lines:
        parse(line)
        _, _, scene, *words = line.split()
        load_scene(scene)
        for spec in words[1::2]:
            parse_spec(spec, techniques(()))


def test_the_citation_is_of_this_version_and_has_a_date_once_it_is_released() -> None:
    citation = yaml.safe_load((ROOT / "CITATION.cff").read_text(encoding="utf-8"))
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    assert citation["version"] == __version__ and citation["license"] == project["license"]
    assert [one["name"].lower() for one in citation["authors"]] == [one["name"].lower() for one in project["authors"]]
    releases = dict(RELEASE.findall((ROOT / "CHANGELOG.md").read_text(encoding="utf-8")))
    assert str(citation.get("date-released")) == releases.get(__version__, "None")
    assert releases or not citation.keys() & {"doi", "identifiers"}  # nothing to identify
