"""`engines measure`: each preset once, resumed, and what is not installed is told."""

from collections.abc import Callable
from pathlib import Path

import pytest

from shadowbench.plugin import registry
from shadowbench.plugin.engine import Engine
from shadowbench.results import engine_settings
from tests.conftest import Answer
from tests.engines.conftest import SIZE

Command = Callable[..., Answer]


@pytest.fixture
def known(engine: type[Engine], monkeypatch: pytest.MonkeyPatch) -> type[Engine]:
    """The fake engine, the only one there is."""
    monkeypatch.setattr(engine, "presets", {"shipped": "", "documented": ""})
    for module in (registry, engine_settings):
        monkeypatch.setattr(module, "engines", lambda: {"fake": engine})
    return engine


def test_measuring_goes_on_and_measures_equal_settings_once(
    known: type[Engine], tmp_path: Path, shadowbench: Command, records: Callable[..., list[dict]]
) -> None:
    folder = tmp_path / "measured"
    arguments = ("engines", "measure", "-o", folder, "--view-size", str(SIZE), "--scenes", "cube-on-plane", "-q")
    answer = shadowbench(*arguments)
    assert (answer.code, answer.err) == (0, "")
    assert answer.out.endswith(f"{folder}/engines.md: 2 settings of 1 engine\n")
    rows = records(folder, "score")
    assert [(row["spec"], row["status"]) for row in rows] == [("fake", "ok"), ("fake:sides=double", "ok")]
    page = (folder / "engines.md").read_text(encoding="utf-8")
    assert "`fake:preset=shipped,sides=closed` and `fake:preset=documented,sides=closed` are the same setting" in page
    assert "Version 1.0, on a test." in page and "Not all drew on Mesa's software renderer" in page
    (known.folder() / "fault").write_text("dies")
    assert shadowbench(*arguments).code == 0
    assert len(records(folder)) == 2


def test_a_refused_picture_is_a_gap_and_an_exit_code(known: type[Engine], tmp_path: Path, shadowbench: Command) -> None:
    (known.folder() / "fault").write_text("lighter")
    folder = tmp_path / "measured"
    answer = shadowbench(
        "engines", "measure", "fake", "-o", folder, "--view-size", str(SIZE), "--scenes", "cube-on-plane", "-q"
    )
    assert answer.code == 3 and "lighter with shadows than without" in answer.err
    page = (folder / "engines.md").read_text(encoding="utf-8")
    assert "| `fake:preset=shipped,sides=double` | – (1) |" in page and "Nothing was drawn." in page
    assert page.count("lighter with shadows than without") == 1


def test_an_engine_that_is_not_installed_is_told_and_a_gap(
    tmp_path: Path, shadowbench: Command, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("SHADOWBENCH_ENGINES", str(tmp_path / "empty"))
    monkeypatch.setattr("shadowbench.engines.environment.needed_programs", lambda engine: {})
    folder = tmp_path / "measured"
    for _ in range(2):  # the page is not in the way
        answer = shadowbench("engines", "measure", "three", "-o", folder)
        assert (answer.code, answer.err) == (1, "three: not installed: shadowbench engines install three\n")
    page = (folder / "engines.md").read_text(encoding="utf-8")
    assert "| `three` | – (" in page and ") not installed: shadowbench engines install three" in page


def test_a_page_of_the_user_s_own_is_kept(known: type[Engine], tmp_path: Path, shadowbench: Command) -> None:
    page = tmp_path / "engines.md"
    page.write_text("notes")
    answer = shadowbench("engines", "measure", "-o", tmp_path)
    assert answer.code == 2 and "found other files" in answer.err
    assert page.read_text() == "notes"


def test_the_doctor_has_a_shadow_drawn(
    known: type[Engine], shadowbench: Command, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("shadowbench.commands.engines._SIZE", SIZE)
    answer = shadowbench("engines", "doctor", "fake")
    assert (answer.code, answer.out) == (0, "fake: draws; 1.0, a test; shadows: directional 100%\n")
    (known.folder() / "fault").write_text("no shadows")
    answer = shadowbench("engines", "doctor", "fake")
    assert answer.code == 1
    assert "fake: drew 0% of the shadow of cube-on-plane, under a directional light: do the light" in answer.out


def test_a_lock_file_with_an_address_is_not_installed(known: type[Engine], shadowbench: Command) -> None:
    lock = known.folder() / "requirements.txt"
    lock.write_text("--find-links elsewhere\n")
    answer = shadowbench("engines", "install", "fake")
    told = f"{lock}: found --find-links elsewhere; allowed: NAME==VERSION with --hash=sha256:…, of each package"
    assert (answer.code, told in answer.err) == (2, True)


@pytest.mark.parametrize(
    ("arguments", "told"),
    [
        (["list", "--phases", "2"], "engines list: found --phases; allowed for: measure"),
        (["doctor", "-o", "x"], "engines doctor: found -o; allowed for: measure and page"),
        (["measure"], "engines measure: found no -o"),
        (["measure", "--json", "-o", "x"], "engines measure: found --json; allowed for: list"),
        (["measure", "-o", "x", "--scenes", "fence"], "--scenes: fence has soft shadows"),
        (["measure", "thre", "-o", "x"], "did you mean 'three'?"),
        (["page"], "engines page: found no folder"),
        (["page", "x"], "x: no such folder"),
    ],
)
def test_what_an_action_does_not_take_is_one_line(
    arguments: list[str], told: str, shadowbench: Command, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    answer = shadowbench("engines", *arguments)
    assert answer.code == 2 and answer.out == "" and answer.err.count("\n") == 1
    assert answer.err.startswith("shadowbench: ") and told in answer.err
    assert not any(tmp_path.iterdir())
