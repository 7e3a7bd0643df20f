"""Campaigns and training sets on Dask.

A task is a range of cases, and a case depends on the recipe and its number only: the results are the same bits for any
number of workers, in any order, on any machine with the same package.
"""

from __future__ import annotations

import json
import os
import tempfile
from collections.abc import Callable, Iterable
from functools import lru_cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

from . import _onecycle

try:
    import onecycle_lab as _lab
except ImportError as error:
    raise _onecycle.OnecycleError("campaigns need the package onecycle-lab: pip install ./research/py") from error

if TYPE_CHECKING:
    import pandas

    Client = Any
    Progress = Callable[[int, int], object] | None
    StrPath = str | os.PathLike[str]

#: Tasks sent ahead for each thread of the cluster: enough to keep it busy.
AHEAD = 4
#: Attempts beyond the first for a task that fails on its worker, as for want of memory. Lost workers are Dask's own affair.
RETRIES = 2


@lru_cache(maxsize=8)
def _campaign(text: str, options: tuple[str, ...]) -> Any:
    # The workers need not see the file system of the client.
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder, "campaign.toml")
        path.write_text(text, encoding="utf-8")
        return _lab.Campaign(str(path), list(options))


def shard_cases(text: str, options: tuple[str, ...], first: int, end: int) -> list[str]:
    """Outcomes of the cases from `first` to before `end`, each as JSON. Runs on a worker."""
    cases: list[str] = _campaign(text, options).cases(first, end)
    return cases


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


def _write(path: Path, first: int, lines: list[str]) -> None:
    import pyarrow
    import pyarrow.parquet

    rows = [_cells(json.loads(line)) for line in lines]
    names = sorted({name for row in rows for name in row})
    columns = {"n": pyarrow.array(range(first, first + len(lines)), pyarrow.uint64())}
    columns |= {name: pyarrow.array([row.get(name) for row in rows]) for name in names}
    # What a resumed run goes on from: the digits of all numbers, and what has no column.
    columns["case"] = pyarrow.array(lines, pyarrow.string())
    part = path.with_suffix(".tmp")
    pyarrow.parquet.write_table(pyarrow.table(columns), part)
    os.replace(part, path)


def _read(path: Path) -> list[str]:
    import pyarrow.parquet

    lines: list[str] = pyarrow.parquet.read_table(path, columns=["case"]).column("case").to_pylist()
    return lines


def _folder(out: StrPath, settings: dict[str, Any]) -> Path:
    folder = Path(out)
    folder.mkdir(parents=True, exist_ok=True)
    stated = json.dumps(settings)
    path = folder / "settings.json"
    if not path.exists():
        part = path.with_suffix(".tmp")
        part.write_text(stated, encoding="utf-8")
        os.replace(part, path)
    elif path.read_text(encoding="utf-8") != stated:
        raise _onecycle.OnecycleError(
            f"{folder} holds the results of another recipe, option, shard or version: name another folder"
        )
    return folder


def _spread(client: Client, keys: Iterable[int], submit: Callable[[Client, int], Any], keep: Callable[[int, Any], None]) -> None:
    """Computes `submit(client, key)` for every key, a few ahead of what the cluster can do, and calls `keep(key, result)`
    as results arrive, in any order."""
    import distributed

    own: Any = None if client is not None else distributed.Client()  # type: ignore[no-untyped-call]
    client = client or own
    left = iter(keys)
    running: dict[str, int] = {}

    def following() -> list[Any]:
        key = next(left, None)
        if key is None:
            return []
        future = submit(client, key)
        running[future.key] = key
        return [future]

    try:
        ahead = AHEAD * max(1, sum(client.nthreads().values()))
        futures: Any = distributed.as_completed(  # type: ignore[no-untyped-call]
            [future for _ in range(ahead) for future in following()]
        )
        for future in futures:
            keep(running.pop(future.key), future.result())
            for more in following():
                futures.add(more)
    finally:
        if own:
            own.close()


class Outcomes:
    """Outcomes of all cases of a campaign.

    `len(outcomes)` is the number of cases; `print(outcomes)` shows the table of `onecycle-lab campaign FILE`.
    """

    def __init__(self, text: str, options: tuple[str, ...], lines: list[str]) -> None:
        self._text, self._options, self._lines = text, options, lines

    def __len__(self) -> int:
        return len(self._lines)

    @property
    def cases(self) -> list[Any]:
        """The outcome of every case."""
        return [json.loads(line) for line in self._lines]

    def to_json(self) -> str:
        """The text that `onecycle-lab campaign FILE --json` prints."""
        return str(_campaign(self._text, (*self._options, "--json")).text(self._lines))

    def to_pandas(self) -> pandas.DataFrame:
        """One row for each case."""
        import pandas

        return pandas.DataFrame([_cells(case) for case in self.cases]).rename_axis("n")

    def __str__(self) -> str:
        return str(_campaign(self._text, self._options).text(self._lines))


def run(
    recipe: StrPath, client: Client = None, out: StrPath | None = None, shard: int = 64, progress: Progress = None,
    options: tuple[str, ...] = (),
) -> Outcomes:
    if shard < 1:
        raise _onecycle.OnecycleError(f"a shard of {shard} cases is empty: use 1 or more")
    # Names the file in its errors.
    count = len(_lab.Campaign(os.fspath(recipe), list(options)))
    text = Path(recipe).read_text(encoding="utf-8")
    settings = {"version": _onecycle.__version__, "shard": shard, "options": list(options), "recipe": text}
    folder = None if out is None else _folder(out, settings)
    done: dict[int, list[str]] = {}

    def path(first: int) -> Path:
        assert folder is not None
        return folder / f"part-{first:09}.parquet"

    def submit(client: Client, first: int) -> Any:
        end = min(first + shard, count)
        return client.submit(shard_cases, text, options, first, end, retries=RETRIES, pure=False)

    def keep(first: int, lines: list[str]) -> None:
        if folder:
            _write(path(first), first, lines)
        done[first] = lines
        if progress:
            progress(min(len(done) * shard, count), count)

    if folder:
        done = {first: _read(path(first)) for first in range(0, count, shard) if path(first).exists()}
    missing = [first for first in range(0, count, shard) if first not in done]
    if missing:
        _spread(client, missing, submit, keep)
    return Outcomes(text, options, [line for first in sorted(done) for line in done[first]])


def dataset_file(manifest: str, number: int) -> Any:
    """Bytes and number of examples of a file of a dataset. Runs on a worker."""
    return _lab.dataset_file(manifest, number)


def fill(
    recipe: StrPath | None, examples: int, into: StrPath, client: Client = None, progress: Progress = None, restart: bool = False
) -> Path:
    words = [f"--examples={examples}", f"--into={os.fspath(into)}"] + ["--restart"] * bool(restart)
    folder = _lab.Dataset(None if recipe is None else os.fspath(recipe), words)
    manifest = folder.manifest()
    missing = folder.missing()
    kept = 0

    def submit(client: Client, number: int) -> Any:
        return client.submit(dataset_file, manifest, number, retries=RETRIES, pure=False)

    def keep(number: int, made: Any) -> None:
        nonlocal kept
        folder.keep(number, *made)
        kept += 1
        if progress:
            progress(kept, len(missing))

    if missing:
        _spread(client, missing, submit, keep)
    return Path(into)
