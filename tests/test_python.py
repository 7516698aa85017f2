"""The Python API: the examples of its pages, and the promises of its functions."""

import re
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

import shadowbench as sb

ROOT = Path(__file__).resolve().parents[1]
PAGES = [ROOT / "docs" / name for name in ("how-to/python.md", "reference/api.md")]
CODE = re.findall(r"```python\n(.*?)```", "".join(page.read_text(encoding="utf-8") for page in PAGES), re.DOTALL)


@pytest.fixture(autouse=True, scope="module")
def end() -> None:
    yield
    sb.close()


@pytest.mark.slow
def test_the_pages_run_as_a_script_without_a_guard(tmp_path: Path) -> None:
    (tmp_path / "page.py").write_text("\n".join(CODE), encoding="utf-8")
    done = subprocess.run(
        [sys.executable, "page.py"], cwd=tmp_path, capture_output=True, text=True, timeout=240, check=False
    )
    assert (done.returncode, done.stderr) == (0, "")
    assert re.search(r"<Truth of post, .* in penumbra", done.stdout)
    wrong = [float(value) for value in re.findall(r"'rmse': ([\d.e-]+)", done.stdout)]
    assert 0 < 5 * wrong[1] < wrong[0], "points of the light against its centre alone"
    assert "'iou': 0.9" in done.stdout and "did you mean 'shadow-map'" in done.stdout


def test_a_table_has_the_columns_and_scores_of_a_run_folder(tmp_path: Path) -> None:
    given = {"map_size": np.array([16, 32]), "view_size": np.int64(32), "rounds": np.int64(1), "phases": np.int64(1)}
    table = sb.run(
        pd.Series(["stairs", "cube-on-plane"]),
        np.array(["shadow-map"]),
        folder=tmp_path / "run",
        each_phase=True,
        **given,
    )
    kept = pd.read_csv(tmp_path / "run" / "table.csv")
    assert table["map_size"].tolist() == [16, 32, 16, 32]
    assert [name for name in kept.columns if name != "command"] == [name for name in table if name != "command"]
    assert table["iou"].tolist() == kept["iou"].tolist()


def test_phases_are_summarised_unless_asked_for(tmp_path: Path) -> None:
    given = {"map_size": [16, 32], "view_size": 32, "rounds": 0, "phases": 3, "folder": tmp_path / "run"}
    cells = sb.run("stairs", ["shadow-map", "unshadowed"], each_phase=True, **given)
    table = sb.run("stairs", ["shadow-map", "unshadowed"], **given)
    assert len(cells) == 7 and table["phases"].tolist() == [3, 3, 1] and "phase" not in table
    assert [name for name in cells if name != "phase"] == [name for name in table if name != "phases"]
    for _, line in table.iterrows():
        own = cells[cells["full_spec"] == line["full_spec"]]
        assert len(own) == line["phases"]
        assert line["iou"] == own["iou"].median() and line["status"] == "ok"


def test_results_draw_their_charts_also_when_selected(tmp_path: Path) -> None:
    table = sb.run(["stairs", "cube-on-plane"], "shadow-map", map_size=[16, 32], view_size=32, rounds=1, phases=1)
    figure = table[table["iou"] > 0][["scene", "iou"]].front("cube-on-plane")
    assert "cube-on-plane" in repr(figure) and figure._repr_png_().startswith(b"\x89PNG")
    table.sizes().save(tmp_path / "sizes.svg")
    assert (tmp_path / "sizes.svg").read_text().startswith("<svg")
    for wrong, said in (
        (lambda: table.front("stair"), "did you mean 'stairs'"),
        (lambda: pd.concat([table, table]).front(), "one call of run"),
    ):
        with pytest.raises(sb.InputError, match=re.escape(said)):
            wrong()


def test_a_mask_of_bytes_scores_as_one_of_numbers() -> None:
    truth = sb.truth("cube-on-plane", view_size=64)
    assert sb.score((truth.visibility * 255).astype(np.uint8), truth)["iou"] == 1.0


def test_numbers_of_needs_are_a_frame() -> None:
    needs = sb.needs("stairs", view_size=64)
    frame = needs.frame.set_index("need")
    assert frame.loc["texels.size", "value"] == needs.texels.size


def small_truth(size: int = 16) -> sb.Truth:
    return sb.truth("stairs", view_size=size)


WRONG = {
    "visibility: found shape (8, 8)": lambda: sb.score(np.ones((8, 8)), small_truth()),
    "visibility: ": lambda: sb.score(np.full((16, 16), np.nan), small_truth()),
    "visibility: found uint8 up to 1": lambda: sb.score(np.ones((16, 16), np.uint8), small_truth()),
    "truth: found None": lambda: sb.score(np.ones((16, 16)), None),
    "did you mean 'stairs'?": lambda: sb.load("stairz"),
    "max_rmse: found 2; allowed: 0 to 1": lambda: sb.recommend("stairs", max_rmse=2),
    "min_iou: found '0.9' (str)": lambda: sb.recommend("stairs", min_iou="0.9"),
    "unknown technique 'shadowmap'": lambda: sb.recommend("stairs", techniques="shadowmap"),
    "view_size: found '64x' (str)": lambda: small_truth("64x"),
    "pixel_samples: found 1.5": lambda: sb.truth("stairs", pixel_samples=1.5),
    "rounds: found -1": lambda: sb.run("stairs", "unshadowed", rounds=-1),
    "technique: found ['shadow-map'] (list)": lambda: sb.render("stairs", ["shadow-map"]),
    "scenes: found 3": lambda: sb.run(np.array(["stairs", 3], dtype=object), "unshadowed"),
    "stairs": lambda: sb.run([sb.load("stairs"), "stairs"], "unshadowed"),  # one name twice
}


def test_an_error_is_an_exception_of_one_line_that_names_parameters() -> None:
    for said, call in WRONG.items():
        with pytest.raises(sb.InputError, match=re.escape(said)) as caught:
            call()
        assert "--" not in str(caught.value) and "\n" not in str(caught.value)


def lit(spec: str) -> float:
    return float(sb.render("cube-on-plane", spec, view_size=64).visibility.mean())


def test_the_types_that_users_annotate_with_are_those_of_results_and_print_in_short() -> None:
    scene = sb.load("cube-on-plane")
    results = {
        sb.Scene: scene,
        sb.Truth: sb.truth(scene, view_size=16),
        sb.Rendering: sb.render(scene, "unshadowed", view_size=16),
        sb.Needs: sb.needs(scene, view_size=16),
        sb.Recommendation: sb.recommend(scene, min_iou=0.5, view_size=16),
    }
    assert all(type(result) is kind and kind.__name__ in sb.__all__ for kind, result in results.items())
    assert not any("array(" in repr(result) for result in results.values())


def test_threads_take_turns() -> None:
    wanted = {spec: lit(spec) for spec in ("unshadowed", "shadow-volume")}
    with ThreadPoolExecutor(4) as pool:
        found = list(pool.map(lit, list(wanted) * 6))
    assert found == list(wanted.values()) * 6 and len(set(found)) == 2


INTERRUPTED = """
import os, signal
import shadowbench as sb

first = sb.render("cube-on-plane", "shadow-volume", view_size=64).visibility
for delay in (0.005, 0.05, 0.2):
    signal.setitimer(signal.ITIMER_REAL, delay)
    signal.signal(signal.SIGALRM, lambda *_: os.kill(os.getpid(), signal.SIGINT))
    try:
        sb.render("cube-on-plane", "shadow-map:size=8192,filter=pcf", view_size=64)
    except KeyboardInterrupt:
        pass
    assert (sb.render("cube-on-plane", "shadow-volume", view_size=64).visibility == first).all()
"""


@pytest.mark.slow
def test_an_answer_after_ctrl_c_is_that_of_its_own_call() -> None:
    command = [sys.executable, "-c", INTERRUPTED]
    done = subprocess.run(command, capture_output=True, text=True, timeout=200, check=False)
    assert done.returncode == 0, done.stderr


def test_names_of_functions_stay_when_the_rooms_behind_them_are_imported() -> None:
    """Importing a submodule sets it as an attribute of the package."""
    for name in ("truth", "needs", "stress", "run", "render", "score", "load", "recommend", "close"):
        assert callable(getattr(sb, name)), name
    with pytest.raises(AttributeError, match="has no attribute 'shadow'"):
        _ = sb.shadow
