"""Shader texts composed of includes, slots and defines."""

from pathlib import Path

from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from shadowbench.gl.program import VERSION, compose


def write(folder: Path, **files: str) -> None:
    folder.mkdir(exist_ok=True)
    for name, text in files.items():
        (folder / f"{name}.glsl").write_text(text, encoding="utf-8")


def test_version_comes_first_then_the_defines_that_are_used_then_text(tmp_path) -> None:
    code = "int a[SIZE], b = REVERSED;"
    text = compose(f"{code}\n", [tmp_path], {"SIZE": "1024", "REVERSED": "0", "CULL": "1"})
    assert text.splitlines() == [VERSION, "#define SIZE 1024", "#define REVERSED 0", code]


def test_a_slot_in_a_path_takes_a_name(tmp_path) -> None:
    """Also one that an include renames."""
    write(tmp_path, wide="wide", narrow="narrow", bias='#include "<bias_of>.glsl"\nbias_max')
    slots = {"bias_of": "wide", "bias_a_of": "narrow"}
    text = '#include "bias.glsl"\n#include "bias.glsl" with bias = bias_a\n'
    assert compose(text, [tmp_path], slots=slots).split("\n")[1:] == ["wide", "bias_max", "narrow", "bias_a_max", ""]


def test_a_file_may_be_included_with_renamed_identifiers(tmp_path) -> None:
    """Functions of that name, and names that begin with it and an underscore, also in what the file includes."""
    write(
        tmp_path,
        bias="#include <bias>\nfloat bias(P p) { return p.bias; }  // with unbiased_x",
        sum='#include "bias.glsl" with bias = bias_a\n#include "bias.glsl" with bias = bias_b\nfloat bias(P p);',
        slope="#define BIAS_HAS_DEPTH\nuniform float bias_max;",
    )
    slots = {"bias": "sum.glsl", "bias_a": "slope.glsl", "bias_b": "slope.glsl"}
    assert compose("#include <bias>\n", [tmp_path], slots=slots).split("\n")[1:] == [
        "#define BIAS_A_HAS_DEPTH",
        "uniform float bias_a_max;",
        "float bias_a(P p) { return p.bias; }  // with unbiased_x",
        "#define BIAS_B_HAS_DEPTH",
        "uniform float bias_b_max;",
        "float bias_b(P p) { return p.bias; }  // with unbiased_x",
        "float bias(P p);",
        "",
    ]


def test_the_first_folder_takes_precedence(tmp_path) -> None:
    own, shared = tmp_path / "own", tmp_path / "shared"
    write(own, a="own")
    write(shared, a="shared", b="shared b")
    text = compose('#include "a.glsl"\n#include "b.glsl"\n', [own, shared]).splitlines()
    assert text[1:] == ["own", "shared b"]


@settings(max_examples=30, suppress_health_check=[HealthCheck.function_scoped_fixture], deadline=None)
@given(st.lists(st.sets(st.integers(0, 7)), min_size=8, max_size=8), st.lists(st.integers(0, 7), min_size=1))
def test_every_reachable_include_is_inserted_once(tmp_path, web, start) -> None:
    for name, wanted in enumerate(web):
        includes = "".join(f'#include "{other}.glsl"\n' for other in sorted(wanted))
        (tmp_path / f"{name}.glsl").write_text(f"{includes}int file{name};", encoding="utf-8")
    reachable, ahead = set(), set(start)
    while ahead:
        reachable |= ahead
        ahead = set().union(*(web[name] for name in ahead)) - reachable
    text = compose("".join(f'#include "{name}.glsl"\n' for name in start) + "\n", [tmp_path])
    assert sorted(line for line in text.splitlines() if line.startswith("int")) == [
        f"int file{name};" for name in sorted(reachable)
    ]
    assert "#include" not in text
