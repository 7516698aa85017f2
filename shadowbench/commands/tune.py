"""`tune`: a technique's parameters searched on some scenes, compared with its default and presets on others."""

from collections.abc import Mapping, Sequence
from contextlib import closing
from dataclasses import asdict, dataclass, fields, replace
from pathlib import Path
from typing import Any

from rich.markup import escape
from rich.table import Table

from shadowbench.advice.tune import tune
from shadowbench.advice.tune_beside import Entry, Tuning
from shadowbench.advice.tune_cells import Cells
from shadowbench.advice.tune_space import Space, searched
from shadowbench.advice.tune_split import split_of
from shadowbench.commands.console import (
    ConsoleReporter,
    check_folder,
    err,
    number,
    out,
    print_json,
    print_table,
    techniques_with,
)
from shadowbench.commands.run import map_sizes
from shadowbench.errors import InputError
from shadowbench.measure.machine import write_run_file
from shadowbench.measure.measurer import Measurer
from shadowbench.measure.row_store import RowStore
from shadowbench.measure.worker import Worker
from shadowbench.reports.folder import write_cells
from shadowbench.reports.words import counted
from shadowbench.scenes.library import builtin_names
from shadowbench.studies.run import check_sizes
from shadowbench.studies.study import Study, scenes_of
from shadowbench.studies.tables import Interval
from shadowbench.techniques.base import Technique
from shadowbench.techniques.spec import Spec, parse_spec, spec_of


@dataclass(frozen=True)
class TuneOptions:
    """What the command line says; None leaves the choice to us."""

    spec: str
    scenes: str | None
    held_out: str | None
    params: str | None
    against: tuple[str, ...]
    trials: int
    map_size: str
    view_size: int
    phases: int
    plugins: tuple[Path, ...]
    assets: Path | None
    up: str | None


def tune_command(options: TuneOptions, folder: Path, *, as_json: bool, quiet: bool) -> int:
    """Search, write `table.csv` and `run.json`, print what was found; 3 when a cell failed, else 0."""
    known = techniques_with(options.plugins)
    sizes = map_sizes(options.map_size)
    home = _at(parse_spec(options.spec, known), sizes)
    names = searched(home, options.params)
    others = _others(home, options, sizes, known)
    study = Study(
        scenes=_listed(options.scenes) or tuple(builtin_names()),
        specs=(home,),
        reference=home,
        map_sizes=sizes,
        view_size=options.view_size,
        rounds=0,
        phases=options.phases,
        assets=options.assets,
        up=options.up,
    )
    check_folder(folder)
    with ConsoleReporter(quiet) as reporter, Worker(options.plugins) as worker:
        info = worker.info
        check_sizes(study, info)
        if not info.pipeline_statistics:
            raise InputError(f"{info.renderer} counts no invocations, so there is no cost to tune for")
        with closing(RowStore(folder)) as store:
            cells = Cells(study, Measurer(worker, store, study.conditions(), reporter))
            blocks = cells.taking_part(home)
            split = split_of([scene.name for scene in scenes_of(blocks)], _listed(options.held_out))
            space = Space(home, names, cells.refused_rows(home, names, blocks))
            found = tune(space, cells, blocks, split, options.trials, others)
    results = list(cells.results.values())
    write_run_file(folder / "run.json", info, [], study.facts, [one.score for one in results])
    write_cells(folder, results, {})
    if as_json:
        print_json(_plain(found))
    else:
        _print(found)
        if not quiet:
            out.print(f"{folder / 'table.csv'}: {counted(len(results), 'cell')}", soft_wrap=True)
    failed = [one.status for one in results if one.status.startswith("failed")]
    if failed:
        line = f"shadowbench: {len(failed)} of {len(results)} cells failed; the first: {failed[0]}"
        err.print(line, markup=False, soft_wrap=True)
    return 3 if failed else 0


def _listed(text: str | None) -> tuple[str, ...]:
    return tuple(part.strip() for part in text.split(",") if part.strip()) if text else ()


def _at(spec: Spec, sizes: Sequence[int]) -> Spec:
    """A spec that takes the sizes, also where it names one: the comparison is at the same."""
    sized = spec.with_(size=sizes[0]) if spec.has_size else spec
    return replace(sized, named=sized.named - {"size"})


def _others(
    home: Spec, options: TuneOptions, sizes: Sequence[int], known: Mapping[str, type[Technique]]
) -> dict[str, Spec]:
    """What the tuned is set beside, by name: the technique's presets, and what --against names."""
    presets = {
        f"preset={name}": spec_of(home.technique, (("preset", name),), f"preset {name}")
        for name in home.technique.presets
    }
    return {name: _at(spec, sizes) for name, spec in presets.items()} | {
        text: _at(parse_spec(text, known), sizes) for text in options.against
    }


def _print(found: Tuning) -> None:
    held_out = found.split.held_out
    _print_table(f"best at each cost, from the cheapest; held out: {', '.join(held_out)}", found.front)
    out.print()
    intervals = ", with 95% intervals over them" if len(held_out) > 1 else ""
    title = f"beside the default and others on {counted(len(held_out), 'scene')} held out{intervals}"
    _print_table(title, (found.tuned, *found.others))
    out.print("error: √((1 − IoU) · (1 − SSIM)), geometric mean over scenes; × tuned: median over scenes")
    out.print(_verdict(found), markup=False, soft_wrap=True)


def _print_table(title: str, entries: Sequence[Entry]) -> None:
    table = Table(title=title, title_justify="left", box=None, pad_edge=False)
    table.add_column("")
    table.add_column("spec")
    for heading in ("cost", "tuning", "held out", "1 − IoU × tuned", "1 − SSIM × tuned", "acne", "leak", "contact"):
        table.add_column(heading, justify="right", no_wrap=True)
    for entry in entries:
        table.add_row(*_line(entry))
    print_table(table)


def _line(entry: Entry) -> list[str]:
    return [
        escape(entry.name),
        escape(entry.spec.sizeless_text),
        f"{entry.cost:.2f}",
        number(entry.tuning),
        entry.held_out.text(number),
        *("–" if one is None else one.text(_factor) for one in (entry.iou_ratio, entry.ssim_ratio)),
        *("–" if value is None else number(value) for value in (entry.acne, entry.leak, entry.contact)),
    ]


def _verdict(found: Tuning) -> str:
    """Whether the scenes held out speak for another default."""
    default = found.others[0]
    if found.tuned.spec == default.spec:
        return "the default stands: nothing at its cost was surely better on the scenes that were tuned on"
    iou, ssim = default.iou_ratio, default.ssim_ratio
    worse = iou is not None and ssim is not None and (iou.low or 0) > 1 and ssim.median > 1
    tuned = found.tuned.spec.sizeless_text
    if worse:
        return f"suggested default: {tuned}"
    return f"the default stands: on the scenes held out it is not surely behind {tuned}"


def _factor(value: float) -> str:
    return f"{value:.3g}"


def _plain(found: Tuning) -> dict[str, Any]:
    def entry(one: Entry) -> dict[str, Any]:
        values = {item.name: getattr(one, item.name) for item in fields(one)}
        return {key: asdict(value) if isinstance(value, Interval) else value for key, value in values.items()} | {
            "spec": one.spec.sizeless_text
        }

    return asdict(found.split) | {
        "front": [entry(one) for one in found.front],
        "tuned": entry(found.tuned),
        "others": [entry(one) for one in found.others],
        "verdict": _verdict(found),
    }
