"""The data of a site: all cells as CSV and Parquet, and a Frictionless Data Package that describes each column."""

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import duckdb  # writes Parquet without pyarrow, in whose presence pandas has other dtypes
import pandas as pd

from shadowbench.measure.columns import described
from shadowbench.reports.report import all_cells
from shadowbench.results.folder import Run
from shadowbench.versions import VERSION

_TYPES = {"boolean": "BOOLEAN", "integer": "BIGINT", "number": "DOUBLE", "string": "VARCHAR"}


def write_data(runs: Sequence[Run], folder: Path) -> None:
    """Write `rows.csv`, `rows.parquet` and `datapackage.json` on the cells of all runs into a folder."""
    frame = all_cells(runs, [])
    types = {str(name): _type(frame[name]) for name in frame}
    frame.to_csv(folder / "rows.csv", index=False)
    columns = {name: _TYPES[kind] for name, kind in types.items()}
    rows = duckdb.read_csv(str(folder / "rows.csv"), header=True, dtype=columns)
    rows.write_parquet(str(folder / "rows.parquet"), compression="zstd")
    text = json.dumps(_package(types), indent=1, ensure_ascii=False)
    (folder / "datapackage.json").write_text(f"{text}\n", encoding="utf-8")


def _type(column: pd.Series) -> str:
    """A column's type in a table schema."""
    values = column.dropna()
    if len(values) and values.map(lambda value: isinstance(value, bool)).all():
        return "boolean"
    if pd.api.types.is_integer_dtype(column):
        return "integer"
    return "number" if len(values) and pd.api.types.is_numeric_dtype(column) else "string"


def _package(types: Mapping[str, str]) -> dict[str, Any]:
    texts = described(types)
    fields = [{"name": name, "type": kind, "description": texts[name]} for name, kind in types.items()]
    formats = {"csv": "text/csv", "parquet": "application/vnd.apache.parquet"}
    resources = [
        {"name": f"rows-{form}", "path": f"rows.{form}", "mediatype": kind, "schema": {"fields": fields}}
        for form, kind in formats.items()
    ]
    return {"name": "shadowbench", "version": VERSION, "licenses": [{"name": "MIT"}], "resources": resources}
