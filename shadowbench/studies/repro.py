"""Everything that makes one row of a run folder again: a study of its cell, the row as baseline, and how to cite it."""

import hashlib
import json
import os
import shutil
from collections.abc import Mapping
from pathlib import Path
from typing import Any, NamedTuple

from shadowbench.errors import InputError
from shadowbench.files import check_folder, make_folder, replace_file
from shadowbench.measure.rows import Record
from shadowbench.results.folder import Run, read_runs
from shadowbench.scenes.library import builtin_names
from shadowbench.scores.metrics import METRICS, is_soft, ranking
from shadowbench.studies.study import SceneFields

_SHORT = 8  # digits of a key that name it
STUDY = "study.toml"


class Repro(NamedTuple):
    """What was written: the row, and the commands that make it again and compare, to be given in the folder."""

    row: Record
    commands: tuple[str, str]


def write_repro(start: str, source: Path, target: Path | None) -> tuple[Path, Repro]:
    """Write the folder of a row of a run folder: `study.toml`, `rows.jsonl`, `mask.png`, `cite.bib`, `README.md`.

    start: the row's key, or its beginning; target: by default `repro-KEY` with the key's beginning. Raises InputError
    for a start that no row or several rows have, rows of other renderers, and scenes that are not found.
    """
    (run,) = read_runs([source])
    row = _row(run, start)
    folder = target or Path(f"repro-{row['key'][:_SHORT]}")
    check_folder(folder, STUDY)
    scene = _scene(run, row)
    make_folder(folder)
    made = Repro(row, ("shadowbench run -s study.toml -o again", "shadowbench check again --baseline ."))
    mask = source / "masks" / f"{row['key']}.png"
    if mask.exists():
        shutil.copyfile(mask, folder / "mask.png")
    texts = {
        "rows.jsonl": json.dumps(row, ensure_ascii=False) + "\n",
        "cite.bib": bibtex(run, row),
        "README.md": _readme(run, made, scene),
        STUDY: _study(run, row, scene, folder),
    }
    for name, text in texts.items():
        with replace_file(folder / name) as temporary:
            temporary.write_text(text, encoding="utf-8")
    return folder, made


def _row(run: Run, start: str) -> Record:
    found = [row for row in run.rows if row["key"].startswith(start)]
    if len(found) != 1 or not start:
        some = f"{len(found)} rows begin so" if found else "no row has this key"
        raise InputError(f"{run.folder}: {start!r:.40}: {some}; allowed: the key of a row, as in table.csv")
    (row,) = found
    if "content" in row:
        raise InputError(
            f"{run.folder}: {row['key']} is of {row['renderer']}, whose mask was given; allowed: other rows"
        )
    if row["key"] in run.earlier or "study" not in run.about:
        lost = f"{row['key']} is of an earlier command, whose options run.json no longer has"
        raise InputError(f"{run.folder}: {lost}; allowed: rows of the last command")
    return row


def _scene(run: Run, row: Record) -> str | Path:
    """Name of a built-in scene, or the file of another."""
    named = [
        one for one in run.about["study"].get("scenes", ()) if one == row["scene"] or Path(one).stem == row["scene"]
    ]
    if row["scene"] in named and row["scene"] in builtin_names():
        return str(row["scene"])
    for one in named:
        if (file := Path(one)).is_file():
            return file
    missing = f"{row['key']}: no file {named[0]}" if named else f"{row['key']}: the scene {row['scene']!r} has no file"
    raise InputError(f"{run.folder}: {missing}; allowed: built-in scenes, and files where the command found them")


def _study(run: Run, row: Record, scene: str | Path, folder: Path) -> str:
    facts: Mapping[str, Any] = run.about["study"]
    if isinstance(scene, Path):
        scene = os.path.relpath(scene, folder)
    fields = {
        "scenes": [scene],
        "views": [row["view"]],
        "lights": [row["light"]],
        "view_size": row["view_size"],
        "phases": row["phase"] + 1,
        "coordinates": row["coordinates"],
        "rounds": facts.get("rounds", 0),
        **({"step": row["step"]} if row.get("step") else {}),
        **{name: facts[name] for name in SceneFields.model_fields if name in facts},
    }
    lines = [f"{name} = {json.dumps(value)}" for name, value in fields.items()]
    return "\n".join([*lines, "", "[[technique]]", f"spec = {json.dumps(row['full_spec'])}", ""])


def _score_text(row: Record) -> str:
    if row["status"] != "ok":
        return str(row["status"])
    metric = ranking(is_soft(row["metrics"]))
    value = row["metrics"].get(metric.name)
    return f"{METRICS[metric.name].label} {'undefined' if value is None else f'{value:.6g}'}"


def _title(row: Record) -> str:
    at = f" at {row['map_size']}" if row["map_size"] else ""
    return f"{row['spec']}{at} in {row['scene']}, {row['view']}, {row['light']}, {row['view_size']}² pixels"


def bibtex(run: Run, row: Record) -> str:
    """A BibTeX entry of a row: what was measured, the result, version, renderer, date, and the row's key."""
    about = run.about
    version = about.get("versions", {}).get("shadowbench", "unknown")
    title = _title(row).replace("²", "$^2$").replace("_", r"\_")
    engine = row.get("engine")  # what drew it instead
    drawn_by = f"with {row['technique']} {engine['version']} " if engine else ""
    renderer = str((engine or row)["renderer"]).replace("_", r"\_")
    return "\n".join(
        [
            f"@misc{{shadowbench-{row['key'][:_SHORT]},",
            "  author = {{The shadowbench authors}},",
            f"  title = {{{{{title}: {_score_text(row)}}}}},",
            f"  year = {{{about.get('finished', 'unknown')[:4]}}},",
            f"  note = {{Row {row['key']} of shadowbench {version}, measured {drawn_by}on {renderer}}},",
            "}",
            "",
        ]
    )


def _readme(run: Run, made: Repro, scene: str | Path) -> str:
    row, about = made.row, run.about
    facts = {
        "row": f"`{row['key']}`",
        "result": _score_text(row),
        "spec": f"`{row['full_spec']}`",
        "phase": f"{row['phase']} of the map's grid",
        "mask": f"SHA-256 `{row['mask_sha256']}`, of its visibility" if "mask_sha256" in row else None,
        "measured by": f"`{row['command']}`" if "command" in row else None,
        "finished": about.get("finished"),
        "renderer": row["renderer"],
        "machine": ", ".join(f"{name} {value}" for name, value in about.get("machine", {}).items()) or None,
        "versions": ", ".join(f"{name} {version}" for name, version in about.get("versions", {}).items()) or None,
    }
    lines = [f"- {name}: {value}" for name, value in facts.items() if value is not None]
    if isinstance(scene, Path):
        digest = hashlib.sha256(scene.read_bytes()).hexdigest()
        lines.append(f"- scene: the file `{scene.name}`, which is not copied here, SHA-256 `{digest}`")
    again, compare = made.commands
    return f"""# {_title(row)}

{chr(10).join(lines)}

In this folder, with the same version installed:

```sh
{again}
{compare}
```

The second command fails if a metric differs by more than its tolerance. On the same renderer the mask is the same to
the bit, and the row has the same key unless a metric was changed or added since; on another renderer scores differ in
the last digits, and work by up to 2%.
"""
