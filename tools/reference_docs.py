"""Generates the lists of docs/reference/: commands, metrics, scenes, axes and columns; --check reports stale ones.

What stands above a list is written by hand, on its page.
"""

import io
import os
import sys
from collections.abc import Sequence
from contextlib import redirect_stdout
from pathlib import Path

import typer
from pages import checks, completed, write

from shadowbench.commands import app
from shadowbench.measure.columns import FIXED
from shadowbench.studies.catalogue import catalogue

REFERENCE = Path(__file__).resolve().parent.parent / "docs" / "reference"
GROUPS = ("Scene:", "Measurement:", "Machines:", "Output:")


def commands() -> str:
    """Each command's --help, as a terminal of 80 columns shows it, without sections of options that stand above."""
    os.environ["COLUMNS"] = "80"
    shown: dict[str, str] = {}
    lines = _help(shown)
    for name in typer.main.get_command(app).commands:
        lines += [f"## {name}", "", *_help(shown, name)]
    return completed(REFERENCE / "commands.md", "```", lines)


def _help(shown: dict[str, str], *command: str) -> list[str]:
    """The help of a command as a block; shown: receives its sections, and has those of the commands before."""
    words, text = [*command, "--help"], io.StringIO()
    with redirect_stdout(text):
        app(words, prog_name="shadowbench", standalone_mode=False)
    sections = []
    for section in text.getvalue().strip("\n").split("\n\n"):
        heading = section.partition("\n")[0]
        before = shown.setdefault(section, command[0]) if command and heading in GROUPS else ""
        sections.append(section if before in ("", *command) else f"{heading}\n  as of {before}")
    return ["```console", f"$ shadowbench {' '.join(words)}", "\n\n".join(sections), "```", ""]


def metrics() -> str:
    """The table of metrics."""
    rows = [
        (f"`{row['name']}`", row["better"], row["for"], row["tolerance"], row["help"])
        for row in catalogue(what="metrics")["metrics"]
    ]
    return _listed("metrics", ("metric", "better", "for", "tolerance", "what it is"), rows)


def scenes() -> str:
    """The table of built-in scenes."""
    rows = [
        (f"[{row['name']}](../../scenes/{row['name']}.toml)", row["light"], row["about"])
        for row in catalogue(what="scenes")["scenes"]
    ]
    return _listed("scenes", ("scene", "light", "what it tests"), rows)


def columns() -> str:
    """The table of columns."""
    return _listed("columns", ("column", "meaning"), [(f"`{name}`", text) for name, text in FIXED.items()])


def axes() -> str:
    """The table of stress axes."""
    heads = ("axis", "what varies", "unit", "values", "default", "lights")
    rows = [
        (f"`{row['name']}`", row["about"], row["unit"], " ".join(row["values"]), row["home"], ", ".join(row["lights"]))
        for row in catalogue(what="axes")["axes"]
    ]
    return _listed("axes", heads, rows)


def _listed(name: str, heads: Sequence[str], rows: Sequence[Sequence[object]]) -> str:
    """A page with these rows in its table."""
    table = [heads, ["---"] * len(heads), *rows]
    lines = ["| " + " | ".join(str(cell).replace("|", "\\|") for cell in row) + " |" for row in table]
    return completed(REFERENCE / f"{name}.md", "| ", lines)


def main() -> int:
    """Write the pages, or with --check compare them; 1 if one is stale."""
    pages = {REFERENCE / f"{page.__name__}.md": page() for page in (commands, metrics, scenes, axes, columns)}
    return write(pages, checks(__doc__))


if __name__ == "__main__":
    sys.exit(main())
