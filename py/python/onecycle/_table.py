"""The outcomes of a campaign as one table: a folder of Parquet files."""

from __future__ import annotations

import json
import os
from pathlib import Path
from typing import TYPE_CHECKING, Any

from . import _onecycle

if TYPE_CHECKING:
    import pyarrow

    #: Outcome and truth of a case, each as JSON.
    Row = list[str]

#: What the files of a folder say that they were made of.
SETTINGS = b"onecycle"
#: Columns with outcome and truth as JSON.
KEPT = ("case", "truth")


def _cells(case: Any) -> dict[str, Any]:
    """The numbers, truth values and names of an outcome by their paths: `{"fit": {"misfit": 0.1}}` is `fit.misfit`."""
    cells: dict[str, Any] = {}

    def walk(path: str, value: Any) -> None:
        if isinstance(value, dict):
            for key, inner in value.items():
                walk(f"{path}.{key}" if path else key, inner)
        elif isinstance(value, list):
            for index, inner in enumerate(value):
                walk(f"{path}[{index}]", inner)
        elif value is not None:
            cells[path or "value"] = float(value) if type(value) is int else value

    walk("", case)
    return cells


def cells_of(row: Row) -> dict[str, Any]:
    """The cells of an outcome, and after them those of its truth."""
    case, truth = map(json.loads, row)
    return _cells(case) | {f"truth.{name}": value for name, value in _cells(truth).items()}


def _united(one: pyarrow.Schema, other: pyarrow.Schema) -> pyarrow.Schema:
    """The columns of both, in a fixed order. Where one has only nulls it takes the kind of the other; of two kinds text is made."""
    import pyarrow

    kinds = {field.name: field.type for field in one}
    for field in other:
        kind = kinds.setdefault(field.name, field.type)
        if pyarrow.types.is_null(kind):
            kinds[field.name] = field.type
        elif kind != field.type and not pyarrow.types.is_null(field.type):
            kinds[field.name] = pyarrow.string()
    names = ["n", *sorted(kinds.keys() - {"n", *KEPT}), *KEPT]
    return pyarrow.schema([(name, kinds[name]) for name in names])


class Folder:
    """The files of a campaign, which are one table at any time: where a file brings a column, those before it get it too."""

    def __init__(self, out: str | os.PathLike[str], settings: str) -> None:
        import pyarrow
        import pyarrow.parquet

        self.path, self.settings, self.schema = Path(out), settings, pyarrow.schema([])
        self.path.mkdir(parents=True, exist_ok=True)
        #: File and number of cases by the first case.
        self.parts: dict[int, tuple[Path, int]] = {}
        for path in sorted(self.path.glob("part-*.parquet")):
            of = pyarrow.parquet.read_metadata(path)
            if (of.metadata or {}).get(SETTINGS) != settings.encode():
                raise _onecycle.OnecycleError(
                    f"{self.path} holds the results of another recipe, option, measure or version: name another folder"
                )
            self.parts[int(path.stem.removeprefix("part-"))] = path, of.num_rows
            self.schema = _united(self.schema, of.schema.to_arrow_schema())
        self._widen()

    def _widen(self) -> None:
        """Gives the columns of the table to files that lack one."""
        import pyarrow.parquet

        for path, _ in self.parts.values():
            if pyarrow.parquet.read_schema(path).remove_metadata() != self.schema:
                kept = path.stat()
                self._store(path, pyarrow.parquet.read_table(path))
                # The time at which it was computed.
                os.utime(path, ns=(kept.st_atime_ns, kept.st_mtime_ns))

    def _store(self, path: Path, table: pyarrow.Table) -> None:
        import pyarrow
        import pyarrow.parquet

        columns = [
            table.column(of.name).cast(of.type) if of.name in table.column_names else pyarrow.nulls(len(table), of.type)
            for of in self.schema
        ]
        part = path.with_suffix(".tmp")
        pyarrow.parquet.write_table(pyarrow.table(columns, self.schema.with_metadata({SETTINGS: self.settings})), part)
        os.replace(part, path)

    def add(self, first: int, rows: list[Row]) -> None:
        import pyarrow

        cells = [cells_of(row) for row in rows]
        columns = {"n": pyarrow.array(range(first, first + len(rows)), pyarrow.uint64())}
        for name in {name for row in cells for name in row}:
            values = [row.get(name) for row in cells]
            is_mixed = len({type(value) for value in values if value is not None}) > 1
            columns[name] = pyarrow.array([None if value is None else str(value) for value in values] if is_mixed else values)
        # What a resumed run goes on from: the digits of all numbers, and what has no column.
        columns["case"] = pyarrow.array([case for case, _ in rows], pyarrow.string())
        columns["truth"] = pyarrow.array([truth for _, truth in rows], pyarrow.string())
        table = pyarrow.table(columns)
        before, self.schema = self.schema, _united(self.schema, table.schema)
        if self.schema != before:
            self._widen()
        path = self.path / f"part-{first:09}.parquet"
        self._store(path, table)
        self.parts[first] = path, len(rows)


def read(path: Path) -> list[Row]:
    import pyarrow.parquet

    table = pyarrow.parquet.read_table(path, columns=list(KEPT))
    return [list(row) for row in zip(*(table.column(name).to_pylist() for name in KEPT))]
