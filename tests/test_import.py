"""Start-up: heavy packages are imported only where needed."""

import subprocess
import sys

OF_THE_COMMAND_LINE = {"typer", "click", "shellingham", "annotated_doc", "typing_extensions"}


def imported_by(code: str, *arguments: str, after: str = "pass") -> set[str]:
    """Third-party packages imported by some code after other code."""
    told = (
        f"import sys; {after}; before = set(sys.modules)\n"
        f"try:\n    {code}\nexcept SystemExit: pass\n"
        "found = {name.partition('.')[0] for name in set(sys.modules) - before}\n"
        "print(*found - sys.stdlib_module_names, file=sys.stderr)"
    )
    done = subprocess.run([sys.executable, "-c", told, *arguments], check=True, capture_output=True, text=True)
    return set(done.stderr.split())


def test_importing_the_package_imports_no_other() -> None:
    assert imported_by("import shadowbench") == {"shadowbench"}


def test_help_imports_only_the_command_line_parser() -> None:
    found = imported_by("from shadowbench.commands import main; main()", "--help")
    assert {"shadowbench", "typer"} <= found <= {"shadowbench"} | OF_THE_COMMAND_LINE


def test_the_pytest_plugin_imports_nothing_beside_pytest() -> None:
    assert imported_by("import shadowbench.pytest_plugin", after="import pytest") == {"shadowbench"}


def test_a_worker_is_started_and_a_study_read_without_slow_packages() -> None:
    """Together they take more than a second, before the first cell is drawn."""
    assert not {"pandas", "numba", "trimesh", "networkx", "scipy"} & imported_by(
        "import shadowbench.measure.session, shadowbench.studies.run, shadowbench.plugin.registry"
    )
    assert "trimesh" not in imported_by("import shadowbench.engines.engine_drawer"), "only engines draw what it writes"
    told = imported_by("import shadowbench.measure.worker")
    assert "numpy" in told and not {"pydantic", "moderngl"} & told
