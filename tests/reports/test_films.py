"""Sequences on the page: every frame of a film at its place, the slice where a mask crawls, and scores in words."""

from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from shadowbench.measure.pictures import Pictures, read_film
from shadowbench.reports.films import changing_place
from shadowbench.reports.report import write_report
from shadowbench.results.frame import read_folders
from shadowbench.results.summary import summaries
from tests.reports.conftest import SIDE, Cell, data_of, image_of, run_file, write_folder

LEVELS = (0, 30, 60, 60, 60, 110, 200, 200)  # of frames, some of which equal their neighbours
POP = {"flicker": 0.0123, "pop": 9.0, "swim": None, "lag": 2.0}


def film_of(levels: tuple[int, ...]) -> NDArray[np.uint8]:
    return np.stack([np.full((SIDE, 3 * SIDE, 3), level, np.uint8) for level in levels])


def moving_row(spec: str) -> dict[str, Any]:
    (row,) = Cell(spec, 512, 0.1, None).records()
    curves = {name: [None, *(0.01 * frame for frame in range(1, len(LEVELS)))] for name in ("flicker", "pop")}
    curves |= {"iou": [0.9] * len(LEVELS), "rmse": [0.1] * len(LEVELS)}
    moving = {"sequence": "pan", "frames": len(LEVELS), "by_frame": curves, "pop_frame": 5}
    return row | moving | {"metrics": row["metrics"] | POP}


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A run of a sequence with two cells, the second's film backwards."""
    rows = [moving_row(spec) for spec in ("shadow-map", "cascades")]
    folder = write_folder(tmp_path_factory.mktemp("moving") / "run", rows, run_file(True, "A"), pictures=True)
    for row, levels in zip(rows, (LEVELS, LEVELS[::-1]), strict=True):
        Pictures(folder).write_film(row["key"], list(film_of(levels)))
    return folder


@pytest.mark.parametrize("levels", [LEVELS, LEVELS[::-1], (7, 7, 7), (7, 8)])
def test_a_film_is_read_as_the_frames_that_were_written_though_equal_neighbours_are_stored_once(
    tmp_path: Path, levels: tuple[int, ...]
) -> None:
    Pictures(tmp_path).write_film("a", list(film_of(levels)))
    np.testing.assert_array_equal(read_film(tmp_path / "masks/a.frames.png", len(levels)), film_of(levels))


def test_the_slice_is_where_an_edge_crawls_and_not_where_it_is_displaced_or_moves_as_in_the_truth() -> None:
    truth = np.full((8, 16, 400), 255, np.uint8)
    for frame, image in enumerate(truth):
        image[:, : 50 + 10 * frame] = 0
        image[11, 300:] = 0
    drawn = np.roll(truth, 20, axis=2)
    drawn[::2, 11, 298:301] = 255 - drawn[::2, 11, 298:301]
    row, columns = changing_place(np.concatenate([truth, drawn, truth], axis=2)[..., np.newaxis])
    assert row == 11 and abs((columns.start + columns.stop) / 2 - 299) < 3


def test_a_page_has_all_frames_in_order_and_says_the_scores_of_the_row(
    folder: Path, page_of: Callable[..., str]
) -> None:
    (panel,) = data_of(page_of(folder))["data"].values()
    ((view, shown),) = panel["sequences"].items()
    assert view == "camera, sun, pan" and [*panel["gallery"]["views"]] == [view]
    for film, levels in zip(shown["films"], (LEVELS, LEVELS[::-1]), strict=True):
        assert film["scores"] == "8 frames: flicker 0.0123 px, pop 9.00 px in frame 5, lag 2.00 frames"
        np.testing.assert_array_equal([np.asarray(image_of(uri))[0, 0, 0] for uri in film["frames"]], levels)
    assert [{point["frame"] for point in chart["data"]["values"]} for chart in shown["charts"]] == [
        {*range(8)}, {*range(1, 8)}, {*range(1, 8)}
    ]  # fmt: skip


@pytest.mark.slow
@pytest.mark.timeout(300)
def test_slider_keys_and_player_show_the_frame_they_name(browser: Any, folder: Path, tmp_path: Path) -> None:
    from tests.reports.browsing import visiting  # playwright, of slow tests alone

    runs, _ = read_folders([folder])
    write_report([(run, summaries(run)) for run in runs], [], tmp_path / "report.html", "html")
    with visiting(browser, tmp_path / "report.html") as page:
        slider, images = page.locator("#films .frame"), page.locator(".film > div:first-child img")

        def shown() -> Iterator[int]:
            for at in range(2):
                yield images.nth(at).evaluate(
                    """async (image) => {
                        await image.decode();
                        const context = document.createElement("canvas").getContext("2d");
                        context.drawImage(image, 0, 0);
                        return context.getImageData(40, 9, 1, 1).data[0];
                    }"""
                )

        slider.focus()
        for frame in range(len(LEVELS)):
            assert page.locator("#films output").inner_text() == str(frame) == slider.input_value()
            assert [*shown()] == [LEVELS[frame], LEVELS[-1 - frame]]
            signals = page.evaluate("[...films.querySelectorAll('.chart')].map((chart) => chart.view.signal('frame'))")
            assert signals == [frame] * 3
            page.keyboard.press("ArrowRight")
        page.keyboard.press("Space")
        page.wait_for_function("frameInput.value === '2'")  # past the last, from the first on
        page.locator("#films .play").click()
        stopped = int(slider.input_value())
        page.wait_for_timeout(400)
        assert int(slider.input_value()) == stopped and [*shown()] == [LEVELS[stopped], LEVELS[-1 - stopped]]
