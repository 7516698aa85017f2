"""Bias sweeps: the multiplied biases, and the curve of acne and contact."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import pandas as pd
import pytest

from shadowbench.errors import InputError
from shadowbench.maps.biases import Bias
from shadowbench.plugin.registry import techniques
from shadowbench.results.frame import add_factor_columns, read_bias_sweeps
from shadowbench.studies.study import Study, read_study

KNOWN = techniques()
BIASES = [bias for bias in Bias.table.values() if bias.__module__ == Bias.__module__]


def study(folder: Path, lines: str) -> Study:
    file = folder / "study.toml"
    file.write_text(f'scenes = ["cube-on-plane"]\nrounds = 0\n[[technique]]\n{lines}\n', encoding="utf-8")
    return read_study(file, KNOWN)


def test_every_bias_is_multiplied_or_says_that_it_cannot_be(tmp_path: Path) -> None:
    for bias in BIASES:
        lines = f"spec = 'shadow-map:bias={bias.name}'\nbias_sweep = [2]"
        if not bias.swept:
            with pytest.raises(InputError, match=f"no bias here that can be multiplied, found bias={bias.name}"):
                study(tmp_path, lines)
            continue
        (spec,) = study(tmp_path, lines).specs
        swept = spec.params.bias  # type: ignore[attr-defined]
        for name in bias.model_fields:
            assert getattr(swept, name) == getattr(bias(), name) * (2 if name in bias.swept else 1)
    (spec,) = study(tmp_path, "spec = 'shadow-map:bias=polygon-offset(2,4)+constant(0.01)'\nbias_sweep = [2]").specs
    assert "bias=polygon-offset(factor=4.0,units=8.0)+constant(units=0.02)" in spec.text


def test_true_means_a_quarter_to_four_times_with_the_spec_itself_among_them(tmp_path: Path) -> None:
    made = study(tmp_path, "spec = 'shadow-map'\nbias_sweep = true")
    assert [spec.text for spec in made.specs] == [
        "shadow-map:bias=texel(scale=0.25)",
        "shadow-map:bias=texel(scale=0.5)",
        "shadow-map",
        "shadow-map:bias=texel(scale=2.0)",
        "shadow-map:bias=texel(scale=4.0)",
    ]
    assert [factor for _, factor, _ in made.sweeps] == [0.25, 0.5, 1, 2, 4]
    assert [spec for _, _, spec in made.sweeps] == list(made.specs)
    without = study(tmp_path, "spec = 'shadow-map'\nbias_sweep = false")
    assert ([spec.text for spec in without.specs], without.sweeps) == (["shadow-map"], ())


def test_a_factor_beyond_the_limits_of_the_bias_is_dropped_with_a_note(tmp_path: Path) -> None:
    made = study(tmp_path, "spec = 'shadow-map:bias=constant(units=0.5)'\nbias_sweep = [4, 1]")
    assert [spec.text for spec in made.specs] == ["shadow-map:bias=constant(units=0.5)"]
    assert [factor for _, factor, _ in made.sweeps] == [1]
    (note,) = made.notes
    assert "dropped" in note and "bias_sweep 4" in note


def test_a_run_keeps_the_factors_and_acne_falls_as_contact_rises(
    shadowbench: Callable[..., Any], tmp_path: Path
) -> None:
    study(tmp_path, "spec = 'shadow-map'\nsize = 128\nbias_sweep = true")
    answer = shadowbench("run", "-s", tmp_path / "study.toml", "--view-size", "64", "-o", tmp_path / "run", "-q")
    assert answer.code == 0, answer.err
    cells = pd.read_csv(tmp_path / "run" / "table.csv").sort_values("bias_factor")
    assert set(cells["bias_of"]) == {"shadow-map"} and [*cells["bias_factor"]] == [0.25, 0.5, 1, 2, 4]
    acne, contact = [*cells["acne"]], [*cells["contact"]]
    assert acne[0] >= acne[-1] and contact[0] <= contact[-1]


def test_a_spec_in_two_sweeps_is_in_its_own(tmp_path: Path) -> None:
    made = study(
        tmp_path,
        "spec = 'shadow-map'\nsize = [256, 512]\nbias = ['constant(units=0.25)', 'constant(units=0.5)']\n"
        "bias_sweep = [0.5, 1, 2]",
    )

    def bias(units: float) -> str:
        return f"shadow-map:bias=constant(units={units})"

    table = add_factor_columns(pd.DataFrame({"spec": [spec.sizeless_text for spec in made.specs]}), made.bias_sweeps)
    steps = [(0.125, 0.25, 0.5), (0.25, 0.25, 1), (0.5, 0.5, 1), (1.0, 0.5, 2)]
    own = [(bias(units), bias(home), factor) for units, home, factor in steps]
    assert sorted(set(zip(table["spec"], table["bias_of"], table["bias_factor"], strict=True))) == own
    table.to_csv(tmp_path / "table.csv", index=False)
    assert read_bias_sweeps(tmp_path / "table.csv") == made.bias_sweeps


def test_a_bias_of_nothing_has_one_point(tmp_path: Path) -> None:
    made = study(tmp_path, "spec = 'shadow-map:bias=constant(units=0)'\nbias_sweep = [0.5, 1, 2]")
    assert [*made.bias_sweeps.values()] == [("shadow-map:bias=constant(units=0.0)", 1)]
