"""An engine's worst defect as a text for its issue tracker, with a picture and a folder that makes it again."""

from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np

from shadowbench.errors import counted
from shadowbench.files import replace_file
from shadowbench.measure.pictures import write_picture
from shadowbench.measure.rows import Record
from shadowbench.plugin.engine import Engine
from shadowbench.plugin.spec import parse_spec
from shadowbench.reports.annotated import annotated
from shadowbench.reports.engine_defects import DEFECTS, PLACE, TITLE
from shadowbench.reports.gallery import read_view
from shadowbench.reports.markdown import escaped, table
from shadowbench.reports.strips import read_truth
from shadowbench.reports.words import optional
from shadowbench.results.engine_settings import ERROR, EngineResults, Setting, names_of
from shadowbench.results.folder import view_name
from shadowbench.scenes.library import builtin_about, builtin_light, builtin_names
from shadowbench.scores.metrics import METRICS
from shadowbench.studies.repro import write_repro

LEAST, TIMES = 0.1, 3.0
RULE = (
    "An engine has a text for its issue tracker if a setting that it ships with or documents has, in a scene that its "
    f"documentation does not rule out, a {TITLE} of at least {LEAST}, and another of its settings, or another engine "
    "at the same map size whose box is given or its own as well, at most a third of that; of several such cells it has "
    f"the one of the largest {TITLE}."
)
_OWN = ("preset=shipped", "preset=documented")  # the engine's, not found by shadowbench
_SCRIPTS = {"web": "draw.js", "python": "draw.py"}
_SEEN = {
    "acne": ("surfaces shadow themselves", "{} of the lit surfaces, away from shadows, are dark (acne)."),
    "leak": ("light leaks into shadows", "{} of the shadows' interior is lit."),
    "contact": (
        "shadows are cut off from what casts them",
        "{} of the shadow near its caster is lit (peter-panning).",
    ),
}
_MISSING = 0.99  # of the shadows' interior: then there is no shadow
_LEAST_SEEN = 0.05
_NEAR = 1.1


class Defect(NamedTuple):
    """A setting of an engine in a scene, its row there, and the settings that are best there: its own, and others'."""

    one: EngineResults
    setting: Setting
    scene: str
    row: Record
    cure: Setting | None
    peer: Setting | None


def defect_of(one: EngineResults, found: Sequence[EngineResults]) -> Defect | None:
    """The worst defect of an engine among others, by RULE; None if it has none.

    cure: None if no other setting of the engine is better there; peer: at the same map size; None without one.
    """
    every: list[Defect] = []
    for setting in one.settings:
        named = names_of(one.engine).get(setting.spec, [""])[0]
        for scene in setting.rows if any(own in named for own in _OWN) else ():
            error = setting.value(scene, ERROR)
            ruled_out = any(f"preset={name}," in named and scene in of for name, of in one.engine.ruled_out.items())
            if error is None or error < LEAST or ruled_out:
                continue
            row = next(row for row in setting.rows[scene] if row["status"] == "ok")
            cure = _best_in(one, scene, setting.sides)
            peers = [
                other
                for each in found
                for other in each.settings
                if each is not one and each.about.get("box") == one.about["box"] and _comparable(other, scene, row)
            ]
            peer = min(peers, key=lambda other: other.value(scene, ERROR) or 0.0, default=None)
            better = [best for best in (cure, peer) if best and (best.value(scene, ERROR) or 0.0) * TIMES <= error]
            if better:
                every.append(Defect(one, setting, scene, row, None if cure is setting else cure, peer))
    return max(every, key=lambda defect: defect.setting.value(defect.scene, ERROR) or 0.0, default=None)


def _best_in(one: EngineResults, scene: str, sides: str) -> Setting:
    """An engine's best setting in a scene; one with these sides, if it is as good but for a tenth."""
    best = one.best_in(scene)
    same = [each for each in one.settings if each.sides == sides and each.value(scene, ERROR) is not None]
    near = min(same, key=lambda each: each.value(scene, ERROR) or 0.0)
    return near if (near.value(scene, ERROR) or 0.0) <= _NEAR * (best.value(scene, ERROR) or 0.0) else best


def _comparable(other: Setting, scene: str, row: Record) -> bool:
    rows = other.rows.get(scene, ())
    sized = any(each["view_size"] == row["view_size"] for each in rows)
    return sized and other.map_size == row["map_size"] and other.value(scene, ERROR) is not None


def write_defect(defect: Defect, stem: Path) -> None:
    """Write the text `stem`.md, its picture `stem`.png if the masks are kept, and the folder `stem` that repeats it.

    Raises InputError for a row that cannot be made again, and if nothing can be written.
    """
    one, scene = defect.one, defect.scene
    _, made = write_repro(defect.row["key"], one.run.folder, stem)
    error = defect.setting.value(scene, ERROR)
    about = f" ({builtin_about(scene)})" if scene in builtin_names() else ""
    again, compare = made.commands
    blocks = [
        f"# {_title(one.engine)} {one.about['version']}: {what_is_seen(defect.setting, scene)[0]} {_when(defect)}",
        f"In the scene {scene}{about}, the shadow differs from a ray-traced one: {TITLE} is {optional(error)}. "
        + " ".join(what_is_seen(defect.setting, scene)[1:]),
        *_picture(defect, stem),
        *_numbers(defect),
        "## Settings",
        *_settings(defect),
        "## What cures it",
        _cure(defect),
        "## How this was drawn",
        _setup(defect),
        "## To draw it again",
        f"With shadowbench and `shadowbench engines install {one.engine.name}`, in the attached folder `{stem.name}`:",
        f"```sh\n{again}\n{compare}\n```",
        f"The first command draws the scene by `shadowbench/engines/{one.engine.name}/{_SCRIPTS[one.engine.host]}`, "
        "which has every call to the engine, and scores it; the second says whether the scores are those above.",
    ]
    with replace_file(stem.with_suffix(".md")) as temporary:
        temporary.write_text("\n\n".join(blocks) + "\n", encoding="utf-8")


def what_is_seen(setting: Setting, scene: str) -> list[str]:
    """A few words on what is wrong with a setting's shadow in a scene, then sentences, the largest share first."""
    values = {name: setting.value(scene, name) or 0.0 for name in _SEEN}
    if values["leak"] >= _MISSING:
        return ["no shadow", f"There is no shadow: {values['leak']:.0%} of its interior is lit."]
    order = sorted((name for name in _SEEN if values[name] >= _LEAST_SEEN), key=lambda name: -values[name])
    told = [_SEEN[name][1].format(f"{values[name]:.0%}") for name in order]
    edge = setting.value(scene, "edge_px") or 0.0
    return [_SEEN[order[0]][0] if order else "displaced edges", *told, f"Edges are {edge:.1f} px off on average."]


def _when(defect: Defect) -> str:
    """With which settings a defect is seen, and under which light."""
    preset = next(own for own in _OWN if own in defect.setting.label).removeprefix("preset=")
    doubled = " and all materials double-sided" if defect.setting.sides == "double" else ""
    light = f" under a {builtin_light(defect.scene)} light" if defect.scene in builtin_names() else ""
    return f"with the settings as {preset}{doubled}{light}"


def _title(engine: type[Engine]) -> str:
    return (engine.__doc__ or engine.name).strip().partition(":")[0]


def _picture(defect: Defect, stem: Path) -> list[str]:
    """The truth beside the setting and its cure; nothing if a mask is not kept."""
    row, folder = defect.row, defect.one.run.folder
    truth = read_truth(folder / "truth" / f"{view_name(row)}.png", row["view_size"])
    cured = cured_row(defect)
    rows = [(defect.setting, row), *([(defect.cure, cured)] if defect.cure and cured else [])]
    files = {setting.label: folder / "masks" / f"{of['key']}.png" for setting, of in rows}
    if truth is None or not all(file.exists() for file in files.values()):
        return []
    masks = {label.replace("`", ""): read_view(file, row["view_size"]) for label, file in files.items()}
    wrong = np.abs(next(iter(masks.values())) - truth.visibility)
    shown = f"{defect.scene}, {row['view']}, {row['light']}"
    write_picture(stem.with_suffix(".png"), annotated(shown, truth, masks, False, wrong))
    names = "; ".join(["ray-traced truth", *(f"`{label}`" for label in masks)])
    return [f"![{names.replace('`', '')}]({stem.name}.png)", f"*From left to right: {names}.*"]


def cured_row(defect: Defect) -> Record | None:
    """The row of the cure in the view of the defect."""
    rows = defect.cure.rows[defect.scene] if defect.cure else ()
    place = [defect.row[part] for part in PLACE]
    return next((row for row in rows if row["status"] == "ok" and [row[part] for part in PLACE] == place), None)


def _numbers(defect: Defect) -> list[str]:
    """The setting beside the best of the engine and the best of others."""
    settings = {"this setting": defect.setting, "the engine's best here": defect.cure, "best of others": defect.peer}
    rows = [
        [what, one.label, *(optional(one.value(defect.scene, name)) for name in (ERROR, *DEFECTS.values()))]
        for what, one in settings.items()
        if one is not None
    ]
    names = [f"- {TITLE}: IoU is the intersection over union of the shadows, drawn and ray-traced; 0 is exact"]
    names += [f"- {title}: {METRICS[name].help[:1].lower()}{METRICS[name].help[1:]}" for title, name in DEFECTS.items()]
    size = defect.row["map_size"]
    box = {"given": "told what to cover", "own": "choosing itself what it covers"}[defect.one.about["box"]]
    same = f"Others are other engines with a map of {size} texels, each {box}, as this one." if size else ""
    return [*table(["", "setting", TITLE, *DEFECTS], rows, ["setting"]), "\n".join(names), *filter(None, [same])]


def _settings(defect: Defect) -> list[str]:
    """The parameters of the setting and of the cure, with the engine's names."""
    engine = defect.one.engine
    settings = [setting for setting in (defect.setting, defect.cure) if setting]
    specs = [parse_spec(setting.rows[defect.scene][0]["full_spec"], {engine.name: engine}) for setting in settings]
    rows = [
        [f"`{name}`", info.description or "", *(f"`{getattr(spec.params, name)}`" for spec in specs)]
        for name, info in engine.Params.model_fields.items()
    ]
    sources = [
        f"- {setting.label}: {engine.sources[preset]}"
        for setting in settings
        for preset in engine.presets
        if f"preset={preset}" in setting.label and preset in engine.sources
    ]
    headings = ["parameter", "what it is", "here", "the engine's best"][: 2 + len(specs)]
    return [*table(headings, rows, headings), *(["\n".join(sources)] if sources else [])]


def _cure(defect: Defect) -> str:
    before, cure = optional(defect.setting.value(defect.scene, ERROR)), defect.cure
    if cure is None:
        measured = counted(len(defect.one.settings), "setting")
        return f"Nothing that was measured: of {measured} of the engine none is better here; others were not tried."
    after = cure.value(defect.scene, ERROR) or 0.0
    error = defect.setting.value(defect.scene, ERROR) or 0.0
    how = "With" if after * TIMES <= error else "In part: with"
    return f"{how} {cure.label} the {TITLE} is {optional(after)} instead of {before}: the parameters above that differ."


def _setup(defect: Defect) -> str:
    row, engine = defect.row, defect.one.engine
    doc = " ".join((engine.__doc__ or "").split())
    lines = [
        f"{doc}",
        f"version {row['engine']['version']}, on {row['engine']['renderer']}",
        f"{row['view_size']} × {row['view_size']} pixels, camera `{row['view']}`, light `{row['light']}`; "
        f"`{row['full_spec']}`",
        "the engine's own loader reads the scene as glTF: flat normals, white materials of roughness 1, one light "
        "without size; no ambient light, tone mapping, dithering or anti-aliasing",
        "the mask is the ratio of a picture with shadows to one without, in linear light",
        f"row `{row['key']}` of shadowbench, IoU {row['metrics'][ERROR]:.5f}",
    ]
    if "llvmpipe" in row["engine"]["renderer"] or "llvmpipe" in row["renderer"]:
        lines.append("this is a software renderer; on a GPU single pixels differ, and this was not measured on one")
    return "\n".join(f"- {escaped(line)}" for line in lines)
