"""The page of other engines, in Markdown: how they were measured, tables over all scenes, each one's worst defect."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from statistics import median

from shadowbench.errors import InputError, counted
from shadowbench.files import replace_file
from shadowbench.plugin.spec import has_size
from shadowbench.reports.defect_text import RULE as TEXT_RULE
from shadowbench.reports.defect_text import defect_of, write_defect
from shadowbench.reports.engine_defects import DEFECTS, RULE, TITLE, worst_defect
from shadowbench.reports.markdown import escaped, table
from shadowbench.reports.words import optional, run_facts
from shadowbench.results.engine_settings import (
    ERROR,
    EngineResults,
    Setting,
    engine_results,
    errors_by_version,
    label_of,
    names_of,
)
from shadowbench.results.folder import Run

_HEADING = "# Shadows of other engines"

_HOW = """\
Each engine draws in a program of its own, a page in headless Chromium or a Python of its own. Its own loader reads the
same glTF: flat shading, white materials of roughness 1, one light without size. Each scene is drawn with shadows and
without, at two exposures that differ by a factor of 16. The mask is the ratio of the two pictures in linear light, at
the brighter exposure where that is not cut off. Ambient light, tone mapping, dithering, anti-aliasing and background
are off. Masks are scored like those of shadowbench's techniques, against the same ray-traced truth.

- **Refused pictures.** A cell fails, and is a gap below, if a picture has another size or values that are not finite;
  if it is black where surfaces face the light, or under a sun not shaded by N·L, as pictures of another frame, upside
  down or of another encoding are; if it differs when drawn again; or if shadows make more than 0.2% of the pixels
  lighter. Before that, each engine has to draw a probe of known places and brightness.
- **Sides.** With `sides=closed` the materials of closed meshes are single-sided and all others double-sided; with
  `sides=double` all are double-sided. Some engines choose by it what casts: three.js has single-sided materials cast by
  their back faces.
- **Box and phase.** An engine whose box is *given* is told what its map is to cover, the box around all casters and
  receivers; one whose box is its *own* chooses. Where the phase is *box*, the given box is moved by a part of a texel
  from phase to phase; where it is *none*, there is a single phase.
- **What this does not say.** Engines are not timed: times through different hosts would not be comparable. Pixels that
  are too dark without shadows are not scored. All sections but that of versions are of one version of each engine.
  Settings are those that an engine ships with, those that its documentation shows, and others where named; what else an
  engine can do is not measured. Medians over different numbers of scenes are over different scenes."""
_ONE_VERSION = """\
Each setting has one version here. To compare versions, lock another one, `shadowbench engines install` it, measure it
into the same folder or another, and give all folders to `shadowbench engines page`."""
_FACTS = (
    *("command", "commit", "finished", "rows", "renderer", "processor", "memory", "system", "OpenGL", "phases"),
    "versions",
)


def write_engines_page(runs: Sequence[Run], gaps: Mapping[str, str], target: Path) -> list[EngineResults]:
    """Write the page of runs with engines' rows, and into a folder of its name its pictures and texts of defects.

    gaps: why an engine has no rows, by name. Returns what it shows of each other engine. Raises InputError for a
    picture that cannot be read or a file that cannot be written.
    """
    found = list(engine_results(runs).values())
    missing = {name: reason for name, reason in gaps.items() if name not in {one.engine.name for one in found}}
    how = "\n".join([_HOW, *(f"- {line}" for line in _machine_notes(found))])
    blocks = [_HEADING, "## How this is measured, and what it does not say", how, *_engines(found)]
    if found:
        blocks += ["## Settings", "Medians over scenes; best first.", *table(*summary(found))]
    blocks += [f"## {TITLE} by scene", *_by_scene(found, missing)]
    blocks += ["## Defects and cures", RULE, TEXT_RULE] if found else []
    for one in found:
        blocks += [f"### {one.engine.name}", *_engine(one), *worst_defect(one, target), *_text(one, found, target)]
    history = errors_by_version(runs)
    blocks += ["## Versions", *_versions(history)] if history else [_ONE_VERSION] if found else []
    for run in runs:
        facts = [(name, value) for name, value in run_facts(run) if name in _FACTS]
        lines = [f"- {name}: {f'`{value}`' if name == 'command' else escaped(value)}" for name, value in facts]
        blocks += [f"## Run {escaped(run.label)}", "\n".join(lines)]
    with replace_file(target) as temporary:
        temporary.write_text("\n\n".join(blocks) + "\n", encoding="utf-8")
    return found


def is_engines_page(file: Path) -> bool:
    """Whether a file is a page that `write_engines_page` wrote."""
    with file.open("rb") as opened:
        return opened.read(len(_HEADING)) == _HEADING.encode()


def summary(found: Sequence[EngineResults]) -> tuple[list[str], list[list[str]]]:
    """Headings, and a row for each setting with a score, best first: medians over scenes."""
    scored = [(one, setting) for one in found for setting in one.settings if setting.values(ERROR)]
    rows = []
    for one, setting in sorted(scored, key=lambda pair: (pair[1].median(ERROR) or 0.0, pair[1].label)):
        version, box = one.about.get("version", "–"), one.about.get("box", "–")
        error = f"{optional(setting.median(ERROR))} ({len(setting.values(ERROR))})"
        values = [optional(setting.median(name)) for name in DEFECTS.values()]
        rows.append([setting.label, version, box, error, *values])
    return ["setting", "version", "box", f"{TITLE} (scenes)", *DEFECTS], rows


def _machine_notes(found: Sequence[EngineResults]) -> list[str]:
    """What is true of these rows alone: renderers, sub-pixel bits, sizes, and what is left out."""
    told = {one.about["renderer"] for one in found if one.about}
    notes = ["**Renderer.** All drew on Mesa's software renderer, llvmpipe."] if told else []
    if others := sorted(name for name in told if "llvmpipe" not in name):
        notes = [f"**Renderer.** Not all drew on Mesa's software renderer, llvmpipe: {', '.join(others)}."]
    devices = [one.run.about.get("device", {}) for one in found]
    if bits := {device["subpixel_bits"] for device in devices if "subpixel_bits" in device}:
        shown = " or ".join(map(str, sorted(bits)))
        notes.append(
            f"**Sub-pixel bits.** The machine's OpenGL rasterises with {shown} sub-pixel bits; pixels that the truth "
            "cannot decide within 1/256 px are not scored."
        )
    views = {str(row["view_size"]) for one in found for row in one.rows}
    sized = [one for one in found if has_size(one.engine)]
    maps = {str(row["map_size"]) for one in sized for row in one.rows if row["map_size"]}
    if views:
        notes.append(f"**Sizes.** Views have {' or '.join(sorted(views))} pixels a side.")
    if maps:
        sizes = " or ".join(sorted(maps, key=int))
        notes[-1] += f" Maps whose size can be chosen have {sizes} texels a side; what engines ship with is below."
    notes += [
        f"**Left out** of {one.engine.name}: {counted(one.left_out, 'cell')} of another version or view size."
        for one in found
        if one.left_out
    ]
    return notes


def _engines(found: Sequence[EngineResults]) -> list[str]:
    rows = []
    for one in found:
        told = [one.about.get(name, "–") for name in ("version", "renderer", "box", "phase")]
        shipped = one.engine.map_size(one.engine.Params())
        rows.append([one.engine.name, *told, str(shipped or "–")])
    return table(["engine", "version", "renderer", "box", "phase", "map as shipped"], rows)


def _by_scene(found: Sequence[EngineResults], missing: Mapping[str, str]) -> list[str]:
    """The table of errors by scene, and the reasons of its gaps, each once."""
    scenes = list(dict.fromkeys(scene for one in found for setting in one.settings for scene in setting.rows))
    reasons: dict[str, int] = {}

    def cell(setting: Setting, scene: str) -> str:
        statuses = [row["status"] for row in setting.rows.get(scene, ())] or ["not measured"]
        value = setting.value(scene, ERROR)
        if value is None and set(statuses) == {"ok"}:
            statuses = ["undefined: neither the truth nor the mask has a shadow"]
        marks = [str(reasons.setdefault(one, len(reasons) + 1)) for one in dict.fromkeys(statuses) if one != "ok"]
        return " ".join([optional(value), *(f"({mark})" for mark in marks)])

    rows = [[setting.label, *(cell(setting, scene) for scene in scenes)] for one in found for setting in one.settings]
    for name, reason in missing.items():
        mark = reasons.setdefault(reason, len(reasons) + 1)
        rows.append([f"`{name}`", *(f"– ({mark})" for _ in scenes or [""])])
    lines = "\n".join(f"- ({mark}) {escaped(reason)}" for reason, mark in reasons.items())
    return [*table(["setting", *(scenes or [TITLE])], rows), *([lines] if lines else [])]


def _engine(one: EngineResults) -> list[str]:
    """What an engine is, and where its settings are from."""
    engine, about = one.engine, one.about
    told = f"Version {about['version']}, on {about['renderer']}." if about else "Nothing was drawn."
    lines = [f"{(engine.__doc__ or '').strip().splitlines()[0]} {escaped(told)}"]
    sources = []
    for preset, items in engine.presets.items():
        source = engine.sources.get(preset)
        sources.append(f"- {preset}: {f'`{items}`' if items else 'the defaults'}" + (f"; {source}" if source else ""))
    same = [names for names in names_of(engine).values() if len(names) > 1]
    sources += [f"- {' and '.join(f'`{name}`' for name in names)} are the same setting" for names in same]
    return [*lines, *(["\n".join(sources)] if sources else [])]


def _text(one: EngineResults, found: Sequence[EngineResults], target: Path) -> list[str]:
    """A link to the text for an engine's issue tracker, which is written beside the page; nothing without a defect."""
    defect = defect_of(one, found)
    if defect is None:
        return []
    stem = target.with_suffix("") / f"{one.engine.name}-defect"
    try:
        write_defect(defect, stem)
    except InputError as error:  # a row that cannot be made again, such as one of an earlier command
        return [f"No text for its issue tracker: {escaped(str(error))}."]
    place = f"{target.stem}/{stem.name}"
    return [f"[A text for its issue tracker]({place}.md), with [a folder]({place}/README.md) that draws it again."]


def _versions(history: Mapping[tuple[str, str, int | None], Mapping[str, Sequence[float]]]) -> list[str]:
    rows = [
        [label_of(engine, spec, size), version, optional(median(errors)), str(len(errors))]
        for (engine, spec, size), versions in history.items()
        for version, errors in versions.items()
    ]
    about = "Medians over the cells that all versions of a setting drew; a setting is the same spec in each."
    return [about, *table(["setting", "version", TITLE, "cells"], rows)]
