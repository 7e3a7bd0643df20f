"""Campaigns and training sets on Dask.

A task is a range of cases, and a case depends on the recipe and its number only: the results are the same bits for any
number of workers, in any order, on any machine with the same package.
"""

from __future__ import annotations

import hashlib
import inspect
import json
import os
import platform
import tempfile
import time
from collections.abc import Callable, Iterator
from functools import lru_cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

from . import _onecycle
from ._recording import Recording

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
    Own = Callable[[Recording, dict[str, Any]], Any] | None
    #: Outcome and truth of a case, each as JSON.
    Row = list[str]

#: What the files of a folder say that they were made of.
SETTINGS = b"onecycle"
#: Columns with outcome and truth as JSON.
KEPT = ("case", "truth")
#: Tasks sent ahead for each thread of the cluster: enough to keep it busy.
AHEAD = 4
#: Time that a task of many cases should take (s): the scheduler's part of it, some 3 ms, is small; and the least, at the end.
TASK_S, LEAST_S = 3.0, 0.3
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


def _plain(value: Any) -> Any:
    """A scalar or an array of NumPy for JSON."""
    return value.tolist() if hasattr(value, "tolist") else str(value)


def _measured(campaign: Any, n: int, own: Callable[[Recording, dict[str, Any]], Any]) -> Row:
    (t, u, y), truth = campaign.recording(n)
    outcome = own(Recording(t, u, y, name=f"case {n}"), json.loads(truth))
    return [json.dumps({"outcome": outcome}, default=_plain), truth]


def shard_cases(
    of_client: tuple[str, str, str], text: str, options: tuple[str, ...], first: int, end: int, own: Own = None
) -> tuple[float, list[Row]]:
    """The cases from `first` to before `end`, and the time that they took (s). Runs on a worker."""
    check(of_client)
    campaign = _campaign(text, options)
    begin = time.perf_counter()
    rows = campaign.cases(first, end) if own is None else [_measured(campaign, n, own) for n in range(first, end)]
    return time.perf_counter() - begin, rows


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


def _of_row(row: Row) -> dict[str, Any]:
    """The cells of an outcome, and after them those of its truth."""
    case, truth = map(json.loads, row)
    return _cells(case) | {f"truth.{name}": value for name, value in _cells(truth).items()}


def _write(path: Path, settings: str, first: int, rows: list[Row]) -> None:
    import pyarrow
    import pyarrow.parquet

    cells = [_of_row(row) for row in rows]
    names = sorted({name for row in cells for name in row})
    columns = {"n": pyarrow.array(range(first, first + len(rows)), pyarrow.uint64())}
    columns |= {name: pyarrow.array([row.get(name) for row in cells]) for name in names}
    # What a resumed run goes on from: the digits of all numbers, and what has no column.
    columns["case"] = pyarrow.array([case for case, _ in rows], pyarrow.string())
    columns["truth"] = pyarrow.array([truth for _, truth in rows], pyarrow.string())
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
    names = ["n", *sorted(types.keys() - {"n", *KEPT}), *KEPT]
    for path, schema in schemas.items():
        if schema.names != names:
            table = pyarrow.parquet.read_table(path)
            absent = {name: pyarrow.nulls(len(table), types[name]) for name in names if name not in schema.names}
            whole = pyarrow.table({name: absent[name] if name in absent else table.column(name) for name in names})
            kept = path.stat()
            # The time at which it was computed.
            _store(path, whole.replace_schema_metadata(schema.metadata), (kept.st_atime_ns, kept.st_mtime_ns))


def _read(path: Path) -> list[Row]:
    import pyarrow.parquet

    table = pyarrow.parquet.read_table(path, columns=list(KEPT))
    return [list(row) for row in zip(*(table.column(name).to_pylist() for name in KEPT))]


def _folder(out: StrPath, settings: str) -> Path:
    import pyarrow.parquet

    folder = Path(out)
    folder.mkdir(parents=True, exist_ok=True)
    for path in sorted(folder.glob("part-*.parquet"))[:1]:
        stated = (pyarrow.parquet.read_schema(path).metadata or {}).get(SETTINGS)
        if stated != settings.encode():
            raise _onecycle.OnecycleError(
                f"{folder} holds the results of another recipe, option, measure or version: name another folder"
            )
    return folder


def _gaps(done: dict[int, int], count: int) -> Iterator[tuple[int, int]]:
    """The cases that are missing: the first, and the one after the last. `done` has the numbers of cases from each first one on."""
    at = 0
    for first in sorted(done):
        if at < min(first, count):
            yield at, min(first, count)
        at = max(at, first + done[first])
    if at < count:
        yield at, count


def _spread(
    client: Client, tasks: Callable[[int], Any], submit: Callable[[Client, Any], Any], keep: Callable[[Any, Any], None]
) -> None:
    """Computes `submit(client, task)` for every task, with a few more waiting than the cluster has threads, and calls `keep(task, result)`
    as results arrive, in any order. `tasks(threads)` returns the next task, cut for that number of threads; None if there is nothing to
    hand out until another result has arrived."""
    import distributed
    from distributed.comm.core import CommClosedError

    own: Any = None if client is not None else distributed.Client()  # type: ignore[no-untyped-call]
    client = client or own
    running: dict[str, Any] = {}

    def following() -> list[Any]:
        """Tasks for the workers that there are now, which come and go."""
        made: list[Any] = []
        threads = max(1, sum(client.nthreads().values()))
        while len(running) < AHEAD * threads and (task := tasks(threads)) is not None:
            made.append(submit(client, task))
            running[made[-1].key] = task
        return made

    try:
        futures: Any = distributed.as_completed(following())  # type: ignore[no-untyped-call]
        for future in futures:
            keep(running.pop(future.key), future.result())
            for more in following():
                futures.add(more)
    except (distributed.CancelledError, CommClosedError, ConnectionError, TimeoutError) as error:
        raise _onecycle.OnecycleError(
            "the scheduler is lost: start it again with its workers; the same command goes on with what is finished"
        ) from error
    finally:
        if own:
            own.close()


class Outcomes:
    """Outcomes of all cases of a campaign.

    `len(outcomes)` is the number of cases; `print(outcomes)` shows the table of `onecycle-lab campaign FILE`, or of an own measure
    means and quantiles.
    """

    def __init__(
        self, text: str, options: tuple[str, ...], count: int, parts: dict[int, Path | list[Row]], is_own: bool
    ) -> None:
        self._text, self._options, self._count, self._parts, self._is_own = text, options, count, parts, is_own

    @property
    def _rows(self) -> list[Row]:
        rows: list[Row] = []
        for first in sorted(self._parts):
            part = self._parts[first]
            # Those that a part before it has too are left out.
            rows += (_read(part) if isinstance(part, Path) else part)[len(rows) - first :]
        return rows[: self._count]

    def __len__(self) -> int:
        return self._count

    @property
    def cases(self) -> list[Any]:
        """The outcome of every case."""
        made = [json.loads(case) for case, _ in self._rows]
        return [case["outcome"] for case in made] if self._is_own else made

    @property
    def truths(self) -> list[dict[str, Any]]:
        """What every case was made of: structure and parameters of the process, and disturbances."""
        return [json.loads(truth) for _, truth in self._rows]

    def to_json(self) -> str:
        """The text that `onecycle-lab campaign FILE --json` prints."""
        if self._is_own:
            return json.dumps({"cases": self.cases}, indent=2) + "\n"
        lines = [case for case, _ in self._rows]
        return str(_campaign(self._text, (*self._options, "--json")).text(lines))

    def to_pandas(self) -> pandas.DataFrame:
        """One row for each case: its outcome, and its truth in columns that begin with `truth.`."""
        import pandas

        return pandas.DataFrame([_of_row(row) for row in self._rows]).rename_axis("n")

    def __str__(self) -> str:
        if self._is_own:
            return f"{self.to_pandas().describe().T.to_string()}\n"
        return str(_campaign(self._text, self._options).text([case for case, _ in self._rows]))


def _source(own: Own) -> str | None:
    """What tells one measure from another: its source, or its name where that cannot be had."""
    if own is None:
        return None
    try:
        return inspect.getsource(own)
    except (OSError, TypeError):
        return f"{own.__module__}.{getattr(own, '__qualname__', type(own).__name__)}"


def run(
    recipe: StrPath, client: Client = None, out: StrPath | None = None, shard: int | None = None, progress: Progress = None,
    options: tuple[str, ...] = (), own: Own = None,
) -> Outcomes:
    if shard is not None and shard < 1:
        raise _onecycle.OnecycleError(f"a shard of {shard} cases is empty: use 1 or more")
    # Names the file in its errors.
    campaign = _lab.Campaign(os.fspath(recipe), list(options))
    count = len(campaign)
    text = Path(recipe).read_text(encoding="utf-8")
    # Not the number of cases: a finished campaign can be extended.
    decides = {"version": _onecycle.__version__, "settings": json.loads(campaign.settings()), "measure": _source(own)}
    settings = json.dumps(decides)
    folder = None if out is None else _folder(out, settings)
    parts: dict[int, Path | list[Row]] = {}
    done: dict[int, int] = {}
    if folder:
        import pyarrow.parquet

        for path in folder.glob("part-*.parquet"):
            first = int(path.stem.removeprefix("part-"))
            parts[first], done[first] = path, pyarrow.parquet.read_metadata(path).num_rows
    gaps = list(_gaps(done, count))
    missing = sum(end - first for first, end in gaps)
    left, began, timed, took_s = missing, 0, 0, 0.0
    of_client = build()

    def cases_of_task(threads: int) -> int:
        if shard:
            return shard
        if not timed:
            return 1
        a_second = timed / max(took_s, 1e-6)
        # Smaller ones at the end, so that all workers end at the same time.
        return max(1, int(min(TASK_S * a_second, max(LEAST_S * a_second, left / (2 * threads)))))

    def task(threads: int) -> tuple[int, int] | None:
        nonlocal left, began
        # One case for each thread shows how long a case takes.
        if not gaps or (not shard and not timed and began >= threads):
            return None
        first, last = gaps.pop(0)
        end = min(first + cases_of_task(threads), last)
        if end < last:
            gaps.insert(0, (end, last))
        left -= end - first
        began += 1
        return first, end

    def submit(client: Client, task: tuple[int, int]) -> Any:
        return client.submit(shard_cases, of_client, text, options, *task, own, retries=RETRIES, pure=False)

    def keep(task: tuple[int, int], result: tuple[float, list[Row]]) -> None:
        nonlocal timed, took_s
        first, (seconds, rows) = task[0], result
        if folder:
            # Of a campaign with a folder, no outcome stays in memory.
            path = folder / f"part-{first:09}.parquet"
            _write(path, settings, first, rows)
            parts[first] = path
        else:
            parts[first] = rows
        timed, took_s = timed + len(rows), took_s + seconds
        if progress:
            progress(count - missing + timed, count)

    if missing:
        _spread(client, task, submit, keep)
    if folder:
        _unify([part for part in parts.values() if isinstance(part, Path)])
    return Outcomes(text, options, count, parts, own is not None)


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
    left = iter(missing)
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
        _spread(client, lambda threads: next(left, None), submit, keep)
    return Path(into)
