"""Campaigns and training sets on Dask.

A task is a range of cases, and a case depends on the recipe and its number only: the results are the same bits for any
number of workers, in any order, on any machine with the same package.
"""

from __future__ import annotations

import hashlib
import json
import os
import platform
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
    import pyarrow

    Client = Any
    Progress = Callable[[int, int], object] | None
    StrPath = str | os.PathLike[str]

#: What the files of a folder say that they were made of.
SETTINGS = b"onecycle"
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


@lru_cache(maxsize=1)
def build() -> tuple[str, str, str]:
    """The version of the package, the kind of machine, and the hash of the compiled code."""
    code = hashlib.sha256(Path(_lab._lab.__file__).read_bytes()).hexdigest()
    return _onecycle.__version__, f"{platform.system()} {platform.machine()}", code


def check(of_client: tuple[str, str, str]) -> None:
    """Refuses a worker of another version; on machines of one kind, one with other code."""
    (version, machine, code), own = of_client, build()
    if own[0] != version or (own[1] == machine and own[2] != code):
        raise _onecycle.OnecycleError(
            f"the worker on {platform.node()} has another build of onecycle ({own[0]}, {own[2][:8]}) than the client ({version}, "
            f"{code[:8]}): install the same packages on both"
        )


def shard_cases(of_client: tuple[str, str, str], text: str, options: tuple[str, ...], first: int, end: int) -> list[str]:
    """Outcomes of the cases from `first` to before `end`, each as JSON. Runs on a worker."""
    check(of_client)
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


def _write(path: Path, settings: str, first: int, lines: list[str]) -> None:
    import pyarrow
    import pyarrow.parquet

    rows = [_cells(json.loads(line)) for line in lines]
    names = sorted({name for row in rows for name in row})
    columns = {"n": pyarrow.array(range(first, first + len(lines)), pyarrow.uint64())}
    columns |= {name: pyarrow.array([row.get(name) for row in rows]) for name in names}
    # What a resumed run goes on from: the digits of all numbers, and what has no column.
    columns["case"] = pyarrow.array(lines, pyarrow.string())
    _store(path, pyarrow.table(columns).replace_schema_metadata({SETTINGS: settings}))


def _store(path: Path, table: pyarrow.Table, times_ns: tuple[int, int] | None = None) -> None:
    import pyarrow.parquet

    part = path.with_suffix(".tmp")
    pyarrow.parquet.write_table(table, part)
    if times_ns:
        os.utime(part, ns=times_ns)
    os.replace(part, path)


def _unify(paths: list[Path]) -> None:
    """Gives all files the columns of all: a folder of them is one table. What a file lacks is null."""
    import pyarrow
    import pyarrow.parquet

    schemas = {path: pyarrow.parquet.read_schema(path) for path in paths}
    types = {field.name: field.type for schema in schemas.values() for field in schema}
    names = ["n", *sorted(types.keys() - {"n", "case"}), "case"]
    for path, schema in schemas.items():
        if schema.names != names:
            table = pyarrow.parquet.read_table(path)
            absent = {name: pyarrow.nulls(len(table), types[name]) for name in names if name not in schema.names}
            whole = pyarrow.table({name: absent[name] if name in absent else table.column(name) for name in names})
            kept = path.stat()
            # The time at which it was computed.
            _store(path, whole.replace_schema_metadata(schema.metadata), (kept.st_atime_ns, kept.st_mtime_ns))


def _read(path: Path) -> list[str]:
    import pyarrow.parquet

    lines: list[str] = pyarrow.parquet.read_table(path, columns=["case"]).column("case").to_pylist()
    return lines


def _folder(out: StrPath, settings: str) -> Path:
    import pyarrow.parquet

    folder = Path(out)
    folder.mkdir(parents=True, exist_ok=True)
    for path in sorted(folder.glob("part-*.parquet"))[:1]:
        stated = (pyarrow.parquet.read_schema(path).metadata or {}).get(SETTINGS)
        if stated != settings.encode():
            raise _onecycle.OnecycleError(
                f"{folder} holds the results of another recipe, option, shard or version: name another folder"
            )
    return folder


def _spread(client: Client, keys: Iterable[int], submit: Callable[[Client, int], Any], keep: Callable[[int, Any], None]) -> None:
    """Computes `submit(client, key)` for every key, a few ahead of what the cluster can do, and calls `keep(key, result)`
    as results arrive, in any order."""
    import distributed
    from distributed.comm.core import CommClosedError

    own: Any = None if client is not None else distributed.Client()  # type: ignore[no-untyped-call]
    client = client or own
    left = iter(keys)
    running: dict[str, int] = {}

    def following() -> list[Any]:
        """Tasks for the workers that there are now, which come and go."""
        made: list[Any] = []
        ahead = AHEAD * max(1, sum(client.nthreads().values()))
        while len(running) < ahead and (key := next(left, None)) is not None:
            made.append(submit(client, key))
            running[made[-1].key] = key
        return made

    try:
        futures: Any = distributed.as_completed(following())  # type: ignore[no-untyped-call]
        for future in futures:
            keep(running.pop(future.key), future.result())
            for more in following():
                futures.add(more)
    except (distributed.CancelledError, CommClosedError, ConnectionError, TimeoutError) as error:
        raise _onecycle.OnecycleError(
            "the scheduler is lost: start it again with its workers; the same command goes on with the finished shards"
        ) from error
    finally:
        if own:
            own.close()


class Outcomes:
    """Outcomes of all cases of a campaign.

    `len(outcomes)` is the number of cases; `print(outcomes)` shows the table of `onecycle-lab campaign FILE`.
    """

    def __init__(self, text: str, options: tuple[str, ...], parts: list[Path | list[str]]) -> None:
        self._text, self._options, self._parts = text, options, parts

    @property
    def _lines(self) -> list[str]:
        return [line for part in self._parts for line in (_read(part) if isinstance(part, Path) else part)]

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
    settings = json.dumps({"version": _onecycle.__version__, "shard": shard, "options": list(options), "recipe": text})
    folder = None if out is None else _folder(out, settings)
    done: dict[int, Path | list[str]] = {}
    own = build()

    def path(first: int) -> Path:
        assert folder is not None
        return folder / f"part-{first:09}.parquet"

    def submit(client: Client, first: int) -> Any:
        end = min(first + shard, count)
        return client.submit(shard_cases, own, text, options, first, end, retries=RETRIES, pure=False)

    def keep(first: int, lines: list[str]) -> None:
        if folder:
            _write(path(first), settings, first, lines)
        # Of a campaign with a folder, no outcome stays in memory.
        done[first] = path(first) if folder else lines
        if progress:
            progress(min(len(done) * shard, count), count)

    if folder:
        done = {first: path(first) for first in range(0, count, shard) if path(first).exists()}
    missing = [first for first in range(0, count, shard) if first not in done]
    if missing:
        _spread(client, missing, submit, keep)
    if folder:
        _unify([path(first) for first in sorted(done)])
    return Outcomes(text, options, [done[first] for first in sorted(done)])


def dataset_file(of_client: tuple[str, str, str], manifest: str, number: int) -> Any:
    """Bytes and number of examples of a file of a dataset. Runs on a worker."""
    check(of_client)
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
        return client.submit(dataset_file, build(), manifest, number, retries=RETRIES, pure=False)

    def keep(number: int, made: Any) -> None:
        nonlocal kept
        folder.keep(number, *made)
        kept += 1
        if progress:
            progress(kept, len(missing))

    if missing:
        _spread(client, missing, submit, keep)
    return Path(into)
